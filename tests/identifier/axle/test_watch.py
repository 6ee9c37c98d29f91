"""Doubt by its rules, on numbers; and what a broken sensor taught is gone once it is good."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.axle.watch import BEGIN, Watch, WatchState, watched
from identifier.run import identify
from models.faults import SensorFault
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.sensors import Sensor, Sensors
from models.vehicle import sedan

DT = 0.01
NOISE = Sensors(
    v_x=Sensor(noise=0.03), v_y=Sensor(noise=0.03), r=Sensor(noise=0.003), delta=Sensor(noise=5e-4)
)
STARTS, LASTS, AGAIN = 14.0, 2.0, 3.0  # s


@cache
def judge():
    """`watched` as a function of numbers."""
    ports = [ca.SX.sym(name, size) for name, size in (("s", 7), ("q", 2), ("k", 2), ("on", 2))]
    numbers = Watch().at(DT)
    state, q, kept, (learns, moving) = ports[0], ports[1], ports[2], ca.vertsplit(ports[3])
    found = watched(
        numbers,
        WatchState(*ca.vertsplit(state)),
        q,
        kept,
        dt=DT,
        learns=learns,
        moving=moving,
    )
    return ca.Function("judge", ports, list(found))


KNOWN = BEGIN._replace(known=Watch().known)  # so that there may be an alarm


def judged(samples, state=KNOWN, axle=0):
    """Rests, returns and follow of samples (q and q of the kept ones at an axle, learns, moving).

    The other axle is as it should be.
    """
    told = []
    for q, kept, learns, moving in samples:
        *what, state = judge()(
            list(state), [q, 1.0][:: 1 - 2 * axle], [kept, 1.0][:: 1 - 2 * axle], [learns, moving]
        )
        state = np.array(state).ravel()
        told.append([float(one) for one in what])
    return np.array(told), WatchState(*state)


GOOD, BAD = (1.0, 1.0, 1, 1), (20.0, 20.0, 1, 1)


@pytest.mark.parametrize("axle", [0, 1])
def test_doubt_begins_soon_after_errors_are_large_at_an_axle_and_one_outlier_is_none(axle):
    told, _ = judged([GOOD] * 50 + [(1e9, 1.0, 1, 1)] + [GOOD] * 50, axle=axle)
    assert not told[:, :2].any()
    told, state = judged([GOOD] * 50 + [BAD] * 10, axle=axle)
    assert told[-1, 0] == 1.0 and not told[:50, 0].any()
    assert 0.0 < state.alarm <= 0.1
    np.testing.assert_array_equal(told[told[:, 0] > 0, 2], 0.0)  # kept weights stay


@pytest.mark.parametrize("axle", [0, 1])
def test_kept_weights_that_explain_forces_again_are_gone_back_to(axle):
    told, state = judged([BAD] * 200 + [(20.0, 1.0, 1, 1)] * 100, axle=axle)
    (back,) = np.flatnonzero(told[:, 1])
    calm_after = 0.2 * np.log((20.0 - 1.0) / (Watch().calm - 1.0))  # of a mean from 20 to 1
    assert (back - 200) * DT == pytest.approx(calm_after + Watch().again, abs=3 * DT)
    assert state.alarm == 0.0 and state.known == 0.5 * Watch().known
    told, state = judged([BAD] * 200 + [(20.0, 1.0, 1, 0)] * 200)
    assert not told[:, 1].any(), "without forces every weight explains what is measured"


def test_another_road_is_believed_after_a_while_and_nothing_is_waited_for_for_ever():
    explained, unexplained = [(1.0, 20.0, 1, 1)], [BAD]
    for samples, wait in ((explained, Watch().give_up), (unexplained, 2 * Watch().give_up)):
        told, _ = judged([BAD] * 10 + samples * 1400)
        begin, end = np.argmax(told[:, 0] > 0), np.argmax(told[:, 2] == 1.0)
        assert told[end, 2] == 1.0 and not told[:, 1].any()
        assert (end - begin) * DT == pytest.approx(wait, abs=2 * DT)


def test_there_is_no_alarm_before_forces_were_explained_for_a_while():
    """Weights that never explained a force cannot know better than the sensors."""
    need = round(Watch().known / DT)
    for before, alarms in ((need - 20, False), (need + 20, True)):
        told, state = judged([GOOD] * before + [BAD] * 50, BEGIN)
        assert bool(told[:, 0].any()) == alarms
        assert state.known == pytest.approx(min(before + 5, need) * DT, abs=0.1)
    assert not judged([(1.0, 1.0, 1, 0)] * 2 * need + [BAD] * 50, BEGIN)[0][:, 0].any()


def test_what_was_known_is_halved_by_going_back_and_gone_by_going_on():
    _, state = judged([BAD] * 100 + [(1.0, 1.0, 1, 1)] * 100)
    assert state.known < 0.9 * Watch().known
    told, state = judged([BAD] * 10 + [(1.0, 20.0, 1, 1)] * round(Watch().give_up / DT + 1))
    assert told[:, 2].max() == 1.0 and state.known < 0.2


def test_without_forces_that_tell_them_apart_the_kept_weights_are_believed_in_the_end():
    quiet = [(1.0, 1.0, 1, 0)] * 1400
    told, _ = judged([BAD] * 10 + quiet)
    (back,), begin = np.flatnonzero(told[:, 1]), np.argmax(told[:, 0] > 0)
    assert (back - begin) * DT == pytest.approx(2 * Watch().give_up, abs=2 * DT)
    assert not (told[:, 2] == 1.0).any()


def test_nothing_changes_where_learning_does_not_run():
    for begun in (BEGIN, WatchState(3, 0.2, 9, 8, 1, 1.5, 3), WatchState(7, 0, 3, 3, 5, 5, 1)):
        _, state = judged([(20.0, 0.1, 0, 1), (0.1, 20.0, 0, 1)] * 50, begun)
        np.testing.assert_array_equal(state, begun)


@cache
def drive():
    """A noisy random drive of the sedan; its signals by name."""
    steer = RandomSteer(
        amplitude=0.08, frequency=0.5, seed=3, onset=0.5, rate_limit=1.0, duration=25.0
    )
    run = Plant(sedan()).simulate(steer, speed=20.0)
    return run.recording(NOISE, np.random.default_rng(8))


@cache
def without_fault():
    return identify(drive(), sedan(), AxleIdentifier.for_vehicle(sedan())).axle_force


def broken(channel, kind, size=0.0):
    clean = drive()
    fault = SensorFault(channel=channel, kind=kind, start=STARTS, duration=LASTS, size=size)
    good, wrong = getattr(clean, channel), fault.active(clean.t)
    shown = fault.shown(clean.t, good, good[np.argmax(wrong)], 0.0)
    return replace(clean, **{channel: np.where(wrong, shown, good)})


def off_afterwards(recording, design):
    """Difference of the forces told to those without the fault, over their rms; and doubt."""
    history = identify(recording, sedan(), design)
    later = recording.t >= STARTS + LASTS + AGAIN
    off = np.sqrt(np.mean((history.axle_force - without_fault())[later] ** 2, axis=0))
    size = np.sqrt(np.mean(without_fault() ** 2, axis=0))
    doubts = history.state["watch"].reshape(recording.t.size + 1, 7)[:, 0] > 0.0
    return (off / size).max(), recording.t[np.flatnonzero(doubts[1:])]


HARMFUL = [
    ("r", "stuck"),
    ("r", "zero"),
    ("r", "flipped"),
    ("r", "scaled", 1.6),
    ("v_y", "stuck"),
    ("v_y", "biased", 1.0),
    ("delta_f", "stuck"),
    ("delta_f", "biased", 0.04),
]


@pytest.mark.parametrize("fault", HARMFUL, ids=str)
def test_what_a_broken_sensor_taught_is_gone_three_seconds_after_it_is_good(fault):
    design, recording = AxleIdentifier.for_vehicle(sedan()), broken(*fault)
    off, doubted = off_afterwards(recording, design)
    assert off < 0.05
    assert STARTS < doubted[0] < STARTS + 0.55
    assert doubted[-1] < STARTS + LASTS + AGAIN


@pytest.mark.parametrize(
    "watch",
    [
        {"noticed": 1e9},  # is never noticed
        {"again": 1e9},  # the kept weights are never gone back to
        {"give_up": 0.1},  # the fault is believed
    ],
    ids=str,
)
def test_a_broken_watch_is_caught(watch):
    design = AxleIdentifier.for_vehicle(sedan())
    design = replace(design, watch=replace(design.watch, **watch))
    assert max(off_afterwards(broken(*fault), design)[0] for fault in HARMFUL) > 0.05


def test_nothing_is_in_doubt_where_nothing_fails():
    _, doubted = off_afterwards(drive(), AxleIdentifier.for_vehicle(sedan()))
    assert doubted.size == 0


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


def test_numbers_of_the_watch_are_positive():
    with pytest.raises(ValueError, match="noticed must be positive and finite, it is 0"):
        Watch(noticed=0.0)
