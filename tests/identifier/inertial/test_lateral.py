"""A measured lateral velocity is one more measurement: from perfect to absent, one method."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.inertial import InertialIdentifier
from identifier.run import identify
from models.friction import Friction
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.sensors import Sensor, Sensors
from models.vehicle import GRAVITY, sedan
from tests.kept import Kept

CAR = sedan()
METHOD = replace(InertialIdentifier.for_vehicle(CAR), reads_v_y=True)
NOISE = Sensors(
    v_x=Sensor(noise=0.03), r=Sensor(noise=0.003), delta=Sensor(noise=5e-4), v_y=Sensor(noise=0.0)
)
LATE = 0.15
SEEDS = range(5)


def random_plant(seed):
    """A drive at random on tires of random grip, and what inertial sensors show of it."""
    rng = np.random.default_rng(seed)
    maneuver = RandomSteer(
        amplitude=np.radians(rng.uniform(2.5, 4.5)),
        frequency=rng.uniform(0.3, 0.7),
        seed=seed,
        onset=3.0,
        rate_limit=1.0,
        duration=29.99,
    )
    steepest, grip = np.radians(rng.uniform(0.0, 5.0)), rng.uniform(0.7, 1.1)
    run = Plant(CAR).simulate(
        maneuver,
        speed=rng.uniform(15.0, 22.0),
        bank=lambda t: steepest * np.sin(2 * np.pi * t / 20.0),
        friction=Friction(scale=grip),
    )
    exact = run.recording()
    felt = exact.a_y + GRAVITY * np.sin(run.roll) + rng.normal(0, 0.1)
    shown = NOISE.apply(exact, rng)
    a_y = felt + 0.15 * rng.normal(size=len(exact))
    return exact, replace(shown, a_y=a_y, v_y=np.zeros(len(exact)), axle_force=None)


def receiver(exact, seed):
    """v_y at 10 Hz, 150 ms late, noisy and off, which repeats its number for 4 s."""
    rng, n = np.random.default_rng(seed + 100), len(exact)
    k = np.arange(n) // 10 * 10
    v_y = exact.v_y[np.maximum(k - 15, 0)] + 0.05 * rng.normal(size=n)[k] + 0.03 * rng.normal()
    v_y[1200:1600] = v_y[1199]
    return v_y


def of_set(sensors, exact, shown, seed):
    if sensors == "perfect":
        return identify(replace(shown, v_y=exact.v_y), CAR, METHOD)
    if sensors == "receiver":
        late = replace(METHOD, v_y_delay=LATE)
        return identify(replace(shown, v_y=receiver(exact, seed)), CAR, late)
    return identify(shown, CAR, METHOD)


@pytest.fixture(scope="module")
def runs():
    """By set of sensors: errors of v_y and their standard deviations, drive by drive."""
    plants = Kept(SEEDS, random_plant)

    def driven(sensors):
        listed = []
        for seed, (exact, shown) in plants.items():
            history = of_set(sensors, exact, shown, seed)
            error = history.outputs["v_y"].ravel() - exact.v_y
            model = history.freeze()
            force = model.force_at(np.array([0.02, 0.05, 0.08]))
            listed.append((error[100:], history.outputs["v_y_sd"].ravel()[100:], force, model))
        return listed

    return Kept(("perfect", "receiver", "absent"), driven)


def rms(listed):
    return np.array([np.sqrt(np.mean(error**2)) for error, *_ in listed])


def test_the_better_the_sensor_the_smaller_the_error_of_side_slip(runs):
    perfect, late, absent = (np.mean(rms(runs[one])) for one in ("perfect", "receiver", "absent"))
    assert perfect < 0.5 * late
    assert late < 0.9 * absent


@pytest.mark.parametrize("sensors", ["perfect", "receiver", "absent"])
def test_the_deviation_is_honest(runs, sensors):
    within = [np.mean(np.abs(error) < 2 * sd) for error, sd, *_ in runs[sensors]]
    assert np.mean(within) > 0.93
    assert min(within) > 0.8
    sds = np.sqrt(np.mean([np.mean(sd**2) for _, sd, *_ in runs[sensors]]))
    assert sds < 4 * np.sqrt(np.mean(rms(runs[sensors]) ** 2))  # and not by knowing nothing


def shown_as(method, shown, v_y):
    """State and outputs of the step at the end, where v_y may be NaN, which no recording holds."""
    setup = method.setup(CAR)
    signals = setup.shown(shown).signals
    signals["x"] = np.column_stack([v_y, shown.r])
    record = setup.scan(len(shown), {**setup.begun(shown), **signals, **setup.constants})
    return {name: np.asarray(value) for name, value in record.items() if "heard_v_y" not in name}


@pytest.fixture(scope="module")
def drive():
    return random_plant(7)


def test_a_missing_lateral_velocity_changes_nothing_but_rounding(drive):
    exact, shown = drive
    blind = shown_as(replace(METHOD, reads_v_y=False), shown, exact.v_y)
    nothing = np.full(len(shown), np.nan)
    for method in (METHOD, replace(METHOD, v_y_delay=LATE)):
        told = shown_as(method, shown, nothing)
        for name, values in blind.items():
            np.testing.assert_allclose(told[name], values, rtol=1e-7, atol=1e-12, err_msg=name)
    assert blind["gate_all"][-1].ravel()[7] == 0  # and no sample was bad


def test_numbers_that_are_missing_or_repeat_are_no_measurement(drive):
    exact, shown = drive
    late = replace(METHOD, v_y_delay=LATE)
    repeats = receiver(exact, 7)
    holes = np.where(np.diff(repeats, prepend=np.nan) == 0, np.nan, repeats)
    assert np.isnan(holes).mean() > 0.8
    told = shown_as(late, shown, holes)
    for name, values in shown_as(late, shown, repeats).items():
        np.testing.assert_array_equal(told[name], values, err_msg=name)


def test_what_no_car_does_is_no_measurement(drive):
    exact, shown = drive
    broken = np.where(np.arange(len(exact)) % 3, exact.v_y, 1e6)
    holes = np.where(np.arange(len(exact)) % 3, exact.v_y, np.nan)
    told = shown_as(METHOD, shown, broken)
    for name, values in shown_as(METHOD, shown, holes).items():
        np.testing.assert_array_equal(told[name], values, err_msg=name)


def test_a_delay_that_is_not_told_costs(drive):
    exact, shown = drive
    late = replace(shown, v_y=exact.v_y[np.maximum(np.arange(len(exact)) - 15, 0)])
    errors = [
        rms([(identify(late, CAR, method).outputs["v_y"].ravel()[100:] - exact.v_y[100:],)])
        for method in (METHOD, replace(METHOD, v_y_delay=LATE))
    ]
    assert errors[1] < 0.6 * errors[0]


@pytest.mark.parametrize("wander", [0.0, 0.05])
def test_a_bias_of_the_sensor_is_found_and_not_believed(drive, wander):
    exact, shown = drive
    bias = 0.08 + wander * np.sin(2 * np.pi * exact.t / 60.0)
    history = identify(replace(shown, v_y=exact.v_y + bias), CAR, METHOD)
    error = (history.outputs["v_y"].ravel() - exact.v_y)[1000:]
    assert np.abs(error.mean()) < 0.4 * 0.08
    assert np.sqrt(np.mean(error**2)) < 0.6 * np.sqrt(np.mean(bias[1000:] ** 2))
    assert np.mean(np.abs(error) < 2 * history.outputs["v_y_sd"].ravel()[1000:]) > 0.9
    model = history.freeze()
    assert model.own[1, 2] == pytest.approx(bias[-1], abs=0.4 * 0.08)
    assert model.covariance[1, -1, -1] < model.prior_covariance[1, -1, -1]


def test_the_noise_is_learnt_from_the_signal(drive):
    exact, shown = drive
    rng = np.random.default_rng(0)
    for noise in (0.02, 0.2):
        noisy = replace(shown, v_y=exact.v_y + noise * rng.normal(size=len(exact)))
        variance = identify(noisy, CAR, METHOD).state["heard_v_y"][-1].ravel()[2]
        assert np.sqrt(variance) == pytest.approx(noise, rel=0.25)


def test_a_bias_learnt_by_one_run_is_known_to_the_next(drive):
    exact, shown = drive
    off = replace(shown, v_y=exact.v_y + 0.08)
    stored = identify(off, CAR, METHOD).freeze()
    again = identify(off, CAR, METHOD, start=stored)
    first = slice(0, 300)
    errors = [
        np.abs(one.outputs["v_y"].ravel() - exact.v_y)[first].mean()
        for one in (again, identify(off, CAR, METHOD))
    ]
    assert errors[0] < errors[1]


@pytest.mark.parametrize("delay", [-0.01, 0.3, np.nan])
def test_a_delay_that_no_receiver_has_is_refused(delay):
    with pytest.raises(ValueError, match="v_y_delay"):
        replace(METHOD, v_y_delay=delay)
