"""Logs of an IMU, wheel speeds and steering alone, wheels that spin included: learnt end to end."""

import tomllib

import numpy as np
import pytest

import tireid as ti
from models.recordings import LogMap, read_recording
from models.recordings.wheels import Wheels
from tests.identifier.conftest import steered
from tests.models.test_wheel_logs import write
from tests.models.wheel_speeds import anti_lock, gentle_slip, shown, spin
from tests.tireid.conftest import json_of, learn_words, typed
from tests.tireid.test_without_v_y import missed

CAR = ti.sedan()
RADIUS = np.array([0.314, 0.315, 0.318, 0.317])
RPM = 30.0 / np.pi


def driven(seed, amplitude, speed):
    return steered(seed, 29.99, amplitude=np.radians(amplitude), onset=4.0, speed=speed)


@pytest.fixture(scope="module")
def run():
    return driven(3, 4.0, lambda t: 19.0 + 1.5 * np.sin(0.5 * t))


@pytest.fixture(scope="module")
def wheels(run):
    """The front wheels, which drive, spin three times; once all are braked at the limit."""
    t, slips = run.t, gentle_slip(run)
    spins = (7.0, 2.0, 0.3, 0.15), (13.0, 1.5, 0.2, 0.6), (22.0, 2.5, 0.4, 0.3)
    for begin, lasts, size, rise in spins:
        slips[:, :2] += spin(t, begin, lasts, size, rise)[:, None]
    for k in range(4):
        slips[:, k] += anti_lock(t, 18.0, 1.0, frequency=6.0 + 0.7 * k, phase=0.23 * k)
    return shown(run, slips, np.random.default_rng(0))


def imu(run):
    """What an IMU and the steering show, with noise and a bias."""
    rng, n = np.random.default_rng(1), run.t.size
    return {
        "t": run.t,
        "r": run.r + 0.002 * rng.normal(size=n),
        "delta_f": run.delta_f,
        "ay": run.a_y + 0.05 + 0.1 * rng.normal(size=n),
    }


def errors(run, recording):
    """Side slip [deg] that is missed, and frozen forces as a share, worst of both axles."""
    history = ti.identify(recording, CAR, check=False)
    exact = run.recording()
    away = np.degrees(history.recording.v_y / history.recording.v_x - run.v_y / run.v_x)[400:]
    return np.sqrt(np.mean(away**2)), missed(history.freeze(), exact).max()


def test_side_slip_and_forces_stay_right_while_driven_wheels_spin(run, wheels):
    signals = imu(run)
    known = LogMap(wheels=Wheels().completed(CAR))
    gated = read_recording({**signals, **wheels}, log_map=known)
    mean = np.mean([*wheels.values()], axis=0)
    ungated = read_recording({**signals, "vx": mean}, check=False)
    exact = read_recording({**signals, "vx": run.v_x})
    slip, force = errors(run, gated)
    slip_of_exact, force_of_exact = errors(run, exact)
    slip_of_mean, _ = errors(run, ungated)
    assert slip < 1.3 * slip_of_exact + 0.02
    assert force < 1.2 * force_of_exact + 0.01
    assert slip_of_mean > 1.5 * slip


def logger(run, wheels, **more):
    """The log as a logger writes it: turns of wheels per minute, degrees, g."""
    signals = imu(run)
    turns = {
        f"WheelSpeed_{name[-2:].upper()} [rpm]": RPM * one / radius
        for (name, one), radius in zip(wheels.items(), RADIUS, strict=True)
    }
    return {
        "Time [s]": signals["t"],
        "Yaw Rate [deg/s]": np.degrees(signals["r"]),
        "Road Wheel Angle [deg]": np.degrees(signals["delta_f"]),
        "Lateral Acc [g]": signals["ay"] / 9.80665,
        **turns,
        **more,
    }


@pytest.mark.usefixtures("unmade")
def test_a_log_with_a_second_speed_teaches_the_radius_for_one_without(
    run, wheels, tmp_path, out, capsys
):
    CAR.to_toml(tmp_path / "car.toml")
    alone = write(tmp_path / "alone.csv", logger(run, wheels))
    assert typed("channels", alone) == 1  # turns, and nobody knows of which radius
    said = capsys.readouterr().out
    assert "wheel_fl: speed of the front left wheel" in said
    assert "a rate of turns: give the radius of the wheels, in m, by [wheels] radius" in said
    assert "all that is needed is there" not in said
    first = driven(5, 2.0, lambda t: 18.0 + np.sin(0.3 * t))
    slips = shown(first, gentle_slip(first), np.random.default_rng(2))
    gnss = first.v_x + 0.05 * np.random.default_rng(3).normal(size=first.t.size)
    both = write(tmp_path / "both.csv", logger(first, slips, **{"Ground Speed [km/h]": 3.6 * gnss}))
    told = tmp_path / "log.toml"
    assert typed("channels", both, "--write", told) == 0
    assert "wheels roll by vx" in capsys.readouterr().out
    data = tomllib.loads(told.read_text())
    np.testing.assert_allclose(data["wheels"]["radius"], RADIUS, rtol=0.005)
    assert typed("channels", alone, "--log", told) == 0
    words = [*learn_words(tmp_path, alone), "--log", told]
    assert typed(*words, "--out", out, "--accept") == 0
    captured = capsys.readouterr()
    assert (
        "there is no column 'Ground Speed [km/h]': vx is computed from the wheels" in captured.err
    )
    assert "vx is computed from wheel_fl, wheel_fr, wheel_rl, wheel_rr" in captured.err
    assert "a log has no lateral velocity: fit learns" in captured.err
    assert json_of(out / "summary.json")
