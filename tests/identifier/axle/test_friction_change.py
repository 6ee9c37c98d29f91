"""Another road by its rules; and what a broken sensor taught is gone once it is good."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

from benchmarks.random_cars import good_sensors
from identifier.axle import AxleIdentifier
from identifier.axle.learning import RoadChange, RoadState, believed, evidence
from identifier.run import identify
from models.faults import SensorFault
from models.vehicle import sedan
from tests.identifier.conftest import steered

DT, RATE = 0.01, 30.0  # s, loads/s
NOISE = good_sensors(sedan())
STARTS, LASTS, AGAIN = 14.0, 2.0, 3.0  # s


def collected(e, *, g=(0.3, 0.2), seconds=2.0, rule=None):
    """Evidence of errors e [loads] that last, with a variance of 0.03 squared."""
    numbers = (rule or RoadChange()).at(DT, RATE)
    state, V = RoadState(0.0, 0.0, 0.0, 0.0), 0.03**2
    for _ in range(round(seconds / DT)):
        state = RoadState(*followed(numbers, state, 0.0, g, e, V))
    return state


def followed(numbers, state, change, g=(0.0, 0.0), e=(0.0, 0.0), V=1.0):
    """The evidence after a sample that tells errors e."""
    one = ca.DM.ones(2)
    found = evidence(numbers, state, change, g=ca.DM(g), e=ca.DM(e), V=V * one, holds=one, learns=1)
    return np.array(found).ravel()


def change_of(state, rule=None):
    change, variance = believed((rule or RoadChange()).at(DT, RATE), state)
    return float(change), float(variance)


def test_what_is_believed_is_the_estimate_of_least_squares_with_a_prior():
    rule, m, g = RoadChange(time=1e6), -0.2, np.array([0.3, 0.2])
    state = collected(m * g, g=g, seconds=2.0, rule=rule)
    n = 2.0 / rule.correlation_time  # independent samples in two seconds
    precision = n * (g @ g) / 0.03**2 + rule.spread**-2
    change, variance = change_of(state, rule)
    assert change == pytest.approx(m * n * (g @ g) / 0.03**2 / precision, rel=1e-3)
    assert variance == pytest.approx(1.0 / precision, rel=1e-3)


def test_a_change_is_believed_where_it_explains_both_axles_and_not_where_one_contradicts():
    assert change_of(collected([-0.12, -0.08]))[0] == -RoadChange().step  # cut
    assert change_of(collected([-0.12, 0.08])) == (0.0, 0.0)
    assert change_of(collected([-0.01, -0.01])) == (0.0, 0.0)
    assert change_of(collected([-0.12, 0.0], g=(0.3, 0.0)))[0] < 0.0  # that one tells nothing


def test_evidence_is_that_of_about_a_second_and_gone_once_it_is_believed():
    assert collected([-0.1, -0.1], seconds=9.0).A < 1.6 * collected([-0.1, -0.1], seconds=1.0).A
    numbers, state = RoadChange().at(DT, RATE), collected([-0.1, -0.1])
    np.testing.assert_allclose(followed(numbers, state, -0.2), [0.0, 0.0, 0.0, -0.2])


def test_a_step_that_the_limit_of_a_sample_cuts_goes_on_with_the_errors_that_are_left():
    numbers, state = RoadChange().at(0.002, RATE), collected([-0.1, -0.08])
    change = float(believed(numbers, state)[0])
    assert change == pytest.approx(-0.06)  # 30 loads/s over 2 ms
    A, b, E, ln_friction = followed(numbers, state, change)
    w = state.A / (0.3**2 + 0.2**2)  # the errors that remain, summed up by hand
    left = np.array([-0.1, -0.08]) - change * np.array([0.3, 0.2])
    expected = w * np.array([0.3**2 + 0.2**2, left @ [0.3, 0.2], left @ left])
    np.testing.assert_allclose([A, b, E], numbers.keep * expected, rtol=1e-9)
    assert ln_friction == change


@cache
def drive():
    """A noisy random drive of the sedan."""
    run = steered(3, 25.0, onset=0.5)
    return run.recording(NOISE, np.random.default_rng(8))


@cache
def without_fault():
    return identify(drive(), sedan(), AxleIdentifier.for_vehicle(sedan())).axle_force


def broken(channel, kind, size=0.0):
    clean = drive()
    fault = SensorFault(channel=channel, kind=kind, start=STARTS, duration=LASTS, size=size)
    good, wrong = getattr(clean, channel), fault.active(clean.t)
    shown = fault.measured(clean.t, good, good[np.argmax(wrong)], 0.0)
    return replace(clean, **{channel: np.where(wrong, shown, good)})


def off_afterwards(recording, design):
    """Difference of the forces told to those without the fault, over their rms; ln of friction."""
    history = identify(recording, sedan(), design)
    later = recording.t >= STARTS + LASTS + AGAIN
    off = np.sqrt(np.mean((history.axle_force - without_fault())[later] ** 2, axis=0))
    size = np.sqrt(np.mean(without_fault() ** 2, axis=0))
    return (off / size).max(), history.state["change"].reshape(recording.t.size + 1, 4)[:, 3]


HARMFUL = [
    ("r", "stuck"),
    ("r", "zero"),
    ("r", "flipped"),
    ("r", "scaled", 1.6),
    ("v_y", "stuck"),
    ("v_y", "biased", 1.0),
    ("delta_f", "stuck"),
]


@pytest.mark.parametrize("fault", HARMFUL, ids=str)
def test_what_a_broken_sensor_taught_is_gone_three_seconds_after_it_is_good(fault):
    off, friction = off_afterwards(broken(*fault), AxleIdentifier.for_vehicle(sedan()))
    assert off < 0.05
    assert not friction.any(), "a fault was taken for another road"


def test_a_biased_steering_may_look_like_less_grip_and_no_more_than_that():
    off, friction = off_afterwards(
        broken("delta_f", "biased", 0.04), AxleIdentifier.for_vehicle(sedan())
    )
    assert off < 0.25 and friction.min() >= -RoadChange().step


@pytest.mark.parametrize(
    "change",
    [
        {"fast": 1e9},  # sudden errors are not doubted
        {"explains": 0.01},  # what explains nothing is taken for a road
    ],
    ids=str,
)
def test_a_rule_that_is_broken_is_caught(change):
    design = AxleIdentifier.for_vehicle(sedan())
    design = replace(design, change=replace(design.change, **change))
    assert max(off_afterwards(broken(*fault), design)[0] for fault in HARMFUL) > 0.05


def test_no_road_is_another_where_nothing_fails():
    assert not off_afterwards(drive(), AxleIdentifier.for_vehicle(sedan()))[1].any()


@pytest.mark.parametrize("channel", ["v_x", "v_y", "r", "delta_f", "delta_r"])
@pytest.mark.parametrize("at", [0, 700])
def test_samples_that_are_no_number_are_as_impossible_ones(channel, at):
    """Bit for bit, wherever they come, in every carried number; and none of them is kept."""
    car, clean, carried = sedan(), drive(), []
    setup = AxleIdentifier.for_vehicle(car).setup(car)
    names = ("v_x", "v_y", "r", "delta_f", "delta_r")
    for wrong in (np.nan, 1e6):
        seen = {name: getattr(clean, name).copy() for name in names}
        seen[channel][at : at + 50] = wrong
        over = {
            "x": np.column_stack([seen["v_y"], seen["r"]]),
            "u": np.column_stack([seen["delta_f"], seen["delta_r"]]),
            "v_x": seen["v_x"],
            "a_y": np.full(len(clean), np.nan),
        }
        carried.append(setup.scan(len(clean), {**setup.carry, **over, **setup.constants}))
    for name, values in carried[0].items():
        assert np.isfinite(values).all(), name
        np.testing.assert_array_equal(values, carried[1][name], err_msg=name)
    off = np.sqrt(np.mean((carried[0]["axle_force"] - without_fault())[1000:] ** 2, axis=0))
    assert (off < 0.02 * np.sqrt(np.mean(without_fault() ** 2, axis=0))).all()
