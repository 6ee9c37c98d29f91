"""Logs that hold wheel speeds in place of a forward speed, or beside it."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from models.logs.log import RecordingError
from models.logs.signals import Signal
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.recordings import LogMap, Repair, read_recording
from models.recordings.reader import read_repaired
from models.recordings.rolled import rolled
from models.recordings.wheels import Wheels
from models.vehicle import sedan
from tests.models.wheel_speeds import CORNERS, gentle_slip, shown, spin
from tests.refused import line_about

CAR = sedan()
RADIUS = 0.316
TRACK = Wheels(radius=(RADIUS,), track=(CAR.chassis.track_front, CAR.chassis.track_rear))
BY_WHEELS = LogMap(wheels=TRACK)
UNITS = {"rad/s": 1.0, "rpm": 60.0 / (2.0 * np.pi), "Hz": 0.5 / np.pi, "deg/s": 180.0 / np.pi}


@pytest.fixture(scope="module")
def run():
    steer = RandomSteer(
        amplitude=np.radians(2.5), frequency=0.4, seed=5, onset=3.0, rate_limit=1.0, duration=19.99
    )
    return Plant(CAR).simulate(steer, speed=lambda t: 18.0 + np.sin(0.3 * t))


@pytest.fixture(scope="module")
def wheels(run):
    slips = gentle_slip(run)
    slips[:, :2] += spin(run.t, 8.0, 2.0, 0.3)[:, None]
    return shown(run, slips, np.random.default_rng(0))


def columns(run, wheels, scale=1.0, **more):
    """A log without v_x and v_y, of wheels of a unit, and more columns."""
    rest = {"t": run.t, "r": run.r, "delta_f": run.delta_f, "ay": run.a_y}
    return {**rest, **{name: scale * one for name, one in wheels.items()}, **more}


def write(path, data):
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(data)
        table.writerows(np.column_stack([*data.values()]).tolist())
    return path


def test_turns_and_speeds_give_the_same_recording_whatever_their_unit(run, wheels, tmp_path):
    still = np.zeros(run.t.size)
    want = rolled(wheels, run.r, run.delta_f, still, TRACK, 0.01).v_x
    as_speed = {f"WheelSpeed_{name[-2:].upper()} [km/h]": 3.6 * one for name, one in wheels.items()}
    found = [columns(run, as_speed)]
    for unit, one in UNITS.items():
        turns = {f"ws_{name[-2:]} [{unit}]": one * w / RADIUS for name, w in wheels.items()}
        found.append(columns(run, turns))
    found.append(columns(run, wheels, 1.0 / RADIUS))  # our names, no unit: the radius says turns
    for data in found:
        got = read_recording(write(tmp_path / "log.csv", data), log_map=BY_WHEELS)
        np.testing.assert_allclose(got.v_x, want, rtol=1e-9)
    np.testing.assert_allclose(want, run.v_x, atol=0.5)


def test_wheels_are_told_by_words_and_by_a_map_that_is_written_and_read(run, wheels, tmp_path):
    data = {"t": run.t, "yaw": run.r, "steer": run.delta_f, "lat": run.a_y}
    data |= {f"corner{k}": one / RADIUS for k, one in enumerate(wheels.values())}
    path = write(tmp_path / "log.csv", data)
    told = {"r": "yaw [rad/s]", "delta_f": "steer [rad]", "ay": "lat [m/s^2]"}
    told |= {name: f"corner{k} [rad/s]" for k, name in enumerate(CORNERS)}
    read = read_recording(path, columns=told, log_map=BY_WHEELS)
    signals = {
        name: Signal(channel=(f"corner{k}",), unit="rad/s") for k, name in enumerate(CORNERS)
    }
    signals |= {
        "r": Signal(channel=("yaw",), unit="rad/s"),
        "delta_f": Signal(channel=("steer",), unit="rad"),
        "a_y": Signal(channel=("lat",), unit="m/s^2"),
    }
    made = LogMap(signals=signals, wheels=replace(TRACK, driven="front", acceleration=10.0))
    made.to_toml(tmp_path / "log.toml")
    text = (tmp_path / "log.toml").read_text()
    assert "[wheels]" in text and f"radius = {RADIUS}" in text and 'driven = "front"' in text
    again = read_recording(path, log_map=tmp_path / "log.toml")
    assert np.abs(again.v_x - read.v_x).max() < 0.5
    assert not np.array_equal(again.v_x, read.v_x)  # the driven wheels stand back


def test_wheels_that_nobody_told_leave_a_log_with_a_speed_as_it_is(run, wheels):
    data = columns(run, wheels, vx=run.v_x)
    data["wheel_fl"] = np.where(run.t > 5.0, np.nan, data["wheel_fl"])
    plain = {name: one for name, one in data.items() if "wheel" not in name}
    ours, theirs = read_recording(data), read_recording(plain)
    assert ours.notes == theirs.notes
    np.testing.assert_array_equal(ours.v_x, theirs.v_x)


def test_a_log_without_the_second_speed_is_read_by_the_same_map(run, wheels, tmp_path):
    names = {name: Signal(channel=(name,), unit="rad/s") for name in CORNERS}
    told = LogMap(signals={"v_x": Signal(channel=("gnss",)), **names}, wheels=TRACK)
    turns = columns(run, wheels, 1.0 / RADIUS)
    later = read_recording(turns, log_map=told)
    np.testing.assert_allclose(later.v_x, run.v_x, atol=0.5)
    assert any(
        "there is no column 'gnss': vx is computed from the wheels" in one for one in later.notes
    )
    first = read_recording({**turns, "gnss": run.v_x}, log_map=told)
    np.testing.assert_array_equal(first.v_x, run.v_x)


def test_the_car_tells_track_and_wheelbase(run, wheels, tmp_path):
    one = {"wheel_rl": wheels["wheel_rl"]}
    path = write(tmp_path / "log.csv", columns(run, one))
    with pytest.raises(RecordingError, match=r"wheel_rl is alone on its axle"):
        read_recording(path)
    recording, _ = read_repaired(path, CAR)
    np.testing.assert_allclose(recording.v_x, run.v_x, atol=0.3)


def test_axes_and_signs_that_a_map_turns_are_turned_before_wheels_are_brought_over(run, wheels):
    rear = {name: wheels[name] for name in CORNERS[2:]}
    turned = columns(run, rear)
    for name in ("r", "delta_f", "ay"):
        turned[name] = -turned[name]
    known = replace(TRACK, radius=())
    right = read_recording(columns(run, rear), log_map=LogMap(wheels=known))
    left = read_recording(turned, log_map=LogMap(wheels=known, axes="SAE"))
    np.testing.assert_allclose(left.v_x, right.v_x, rtol=1e-12)
    wrong = {**columns(run, rear), "r": -run.r}
    repair = Repair(factor={"r": -1.0})
    mended = read_recording(wrong, log_map=LogMap(wheels=known, repair=repair), check=False)
    np.testing.assert_allclose(mended.v_x, right.v_x, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "told", "rule"),
    [
        ({}, {"wheel_fl": "wheel_fl [rpm]"}, "is in rpm, a rate of turns: give the radius"),
        ({}, {"wheel_fl": "wheel_fl [bar]"}, "must be in a unit of a speed"),
        ({"wheel_fl": np.nan}, {}, "wheel_fl must be finite, 1 of 2000 values"),
        ({"wheel_fl": 1e6}, {}, "wheel_fl must be of a car"),
    ],
)
def test_what_wheels_cannot_be_is_refused_in_one_line(run, wheels, change, told, rule):
    data = columns(run, wheels)
    for name, value in change.items():
        data[name] = np.where(np.arange(run.t.size) == 7, value, data[name])
    read = lambda _: read_recording(data, columns=told)  # noqa: E731
    assert rule in line_about("", RecordingError, read)
