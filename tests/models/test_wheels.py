"""Forward speed of wheels: where nothing slips it is exact, and slip is found and left out."""

from dataclasses import replace

import numpy as np
import pytest

from models.logs.log import RecordingError
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.recordings.rolled import rolled
from models.recordings.wheels import Wheels, _identified_scale
from models.vehicle import sedan
from tests.models.wheel_speeds import CORNERS, anti_lock, gentle_slip, shown, spin

CAR = sedan()
KNOWN = Wheels().completed(CAR)
FRONT, REAR, ALL = (0, 1), (2, 3), (0, 1, 2, 3)


def speed(t):
    """Faster and slower by 4 m/s, then hard on the brakes from 30 s on."""
    calm = 18.0 + 4.0 * np.sin(2.0 * np.pi * t / 20.0)
    return np.where(t > 30.0, np.maximum(18.0 - 7.0 * (t - 30.0), 10.0), calm)


@pytest.fixture(scope="module")
def run():
    steer = RandomSteer(
        amplitude=np.radians(3.0), frequency=0.4, seed=3, onset=1.0, rate_limit=1.0, duration=39.99
    )
    chassis = replace(CAR.require_chassis(), brake_front_share=1.0)  # the rear wheels roll freely
    return Plant(replace(CAR, chassis=chassis)).simulate(steer, speed=speed)


def slipping(run, columns, slip):
    """Gentle slip of all wheels and an event of some."""
    slips = gentle_slip(run)
    slips[:, columns] += np.column_stack([slip] * len(columns))
    return slips


def told(run, speeds, wheels=KNOWN):
    return rolled(speeds, run.r, run.delta_f, run.delta_r, wheels, 0.01)


def rms(away):
    return float(np.sqrt(np.mean(away**2)))


def against_mean(run, slips, wheels=KNOWN):
    """Errors of v_x, gated and by the mean of all wheels [m/s], and what was gated."""
    speeds = shown(run, slips, np.random.default_rng(0))
    result = told(run, speeds, wheels)
    mean = np.mean([*speeds.values()], axis=0)
    return rms(result.v_x - run.v_x), rms(mean - run.v_x), result


def test_a_rear_wheel_without_slip_tells_the_speed_of_the_center_of_gravity_exactly(run):
    speeds = shown(run, np.zeros((run.t.size, 4)))
    for name in CORNERS[2:]:
        only = told(run, {name: speeds[name]})
        np.testing.assert_allclose(only.v_x, run.v_x, atol=1e-9)
        assert only.gated == only.untrusted == 0
    # Without the track an axle tells it by its mean.
    rear = told(run, {name: speeds[name] for name in CORNERS[2:]}, Wheels()).v_x
    np.testing.assert_allclose(rear, run.v_x, atol=1e-9)
    with pytest.raises(RecordingError, match=r"wheel_rl is alone .* \[wheels\] track"):
        told(run, {"wheel_rl": speeds["wheel_rl"]}, Wheels())


@pytest.mark.parametrize("driven", ["", "front", "all"])
@pytest.mark.parametrize(
    ("columns", "event"),
    [
        (FRONT, lambda t: spin(t, 8.0, 3.0, 0.3)),
        (FRONT, lambda t: spin(t, 18.0, 2.5, 0.15, rise=1.2)),
        ((1,), lambda t: spin(t, 8.0, 4.0, 0.5)),
        (REAR, lambda t: spin(t, 8.0, 1.5, -1.0)),
        (ALL, lambda t: spin(t, 8.0, 1.0, 0.3)),
        (ALL, lambda t: anti_lock(t, 30.0, 1.5)),
    ],
    ids=["axle spins", "axle spins up slowly", "wheel spins", "handbrake", "all spin", "anti-lock"],
)
def test_slip_costs_a_fraction_of_what_it_costs_the_mean(run, driven, columns, event):
    slips = slipping(run, columns, event(run.t))
    ours, mean, result = against_mean(run, slips, replace(KNOWN, driven=driven))
    assert ours < 0.3 * mean
    assert ours < 0.2
    assert result.gated > 50


def test_wheels_that_all_agree_are_all_trusted_but_driven_ones_stand_back(run):
    ours, mean, result = against_mean(run, gentle_slip(run))
    assert ours < 1.05 * mean
    assert result.gated < 0.01 * run.t.size and result.untrusted == 0
    free, _, _ = against_mean(run, gentle_slip(run), replace(KNOWN, driven="front"))
    assert free < 0.9 * ours  # the sedan drives by its front wheels, and brakes by them more


def stop_and_go(rng):
    """Speed of a car that stands, launches, holds and brakes at random [m/s], (n,)."""
    wanted = np.repeat(rng.choice([0.0, 1.0], 60) * rng.uniform(-10.0, 9.0, 60), 100)
    v, a, found = rng.choice([0.0, 20.0]), 0.0, []
    for one in wanted:
        a += 0.125 * (one - a)
        v = min(max(v + 0.01 * a, 0.0), 45.0)
        found.append(v)
    return np.array(found)


@pytest.mark.parametrize("size", [1.0, 0.1], ids=["car", "model car"])
def test_without_slip_wheels_are_trusted_whatever_the_car_does(size):
    """From standstill too, where sensors of wheels show nothing below a threshold."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        v = size * stop_and_go(rng)
        still, shows = np.zeros(v.size), v > 0.6 * size
        speeds = {name: shows * (v + 0.02 * size * rng.standard_normal(v.size)) for name in CORNERS}
        result = rolled(speeds, still, still, still, Wheels(track=(1.5,)), 0.01)
        assert np.abs(result.v_x - v).max() < 0.7 * size + 0.1
        assert result.untrusted < 0.01 * v.size


def test_no_sample_looks_at_a_later_one(run):
    speeds = shown(run, slipping(run, ALL, anti_lock(run.t, 30.0, 1.5)), np.random.default_rng(2))
    whole = told(run, speeds).v_x
    n = 3075
    cut = {name: one[:n] for name, one in speeds.items()}
    begun = rolled(cut, run.r[:n], run.delta_f[:n], run.delta_r[:n], KNOWN, 0.01).v_x
    np.testing.assert_array_equal(begun, whole[:n])


def test_a_long_log_is_worked_through_in_blocks_that_leave_no_trace(run, monkeypatch):
    import models.recordings.rolled as module

    speeds = shown(run, slipping(run, FRONT, spin(run.t, 8.0, 3.0, 0.3)), np.random.default_rng(2))
    whole = told(run, speeds)
    pieces = lambda n: (slice(k, min(k + 7, n)) for k in range(0, n, 7))  # noqa: E731
    monkeypatch.setattr(module, "blocks", pieces)
    again = told(run, speeds)
    np.testing.assert_array_equal(again.v_x, whole.v_x)
    assert again[1:] == whole[1:]


def test_each_wheel_has_its_radius():
    assert Wheels().radius_of("wheel_fl") is None
    assert Wheels(radius=(0.3,)).radius_of("wheel_rr") == 0.3
    axles = Wheels(radius=(0.3, 0.4))
    assert [axles.radius_of(name) for name in (*CORNERS, "wheel")] == [0.3, 0.3, 0.4, 0.4, 0.4]
    corners = Wheels(radius=(0.30, 0.31, 0.32, 0.34))
    assert [corners.radius_of(name) for name in CORNERS] == [0.30, 0.31, 0.32, 0.34]
    assert corners.radius_of("wheel") == pytest.approx(0.33)


# The radius by a second speed.


def test_straight_driving_tells_the_radius_and_slip_does_not(run):
    slips = slipping(run, REAR, spin(run.t, 8.0, 3.0, 0.3))
    speeds = shown(run, slips, np.random.default_rng(0), noise=0.03)
    gnss = run.v_x + 0.05 * np.random.default_rng(1).standard_normal(run.t.size)
    value, seconds = _identified_scale(run.t, gnss, run.r, speeds["wheel_rl"] / 0.317)
    assert value == pytest.approx(0.317, rel=2e-3)
    assert 2.0 < seconds < 30.0
