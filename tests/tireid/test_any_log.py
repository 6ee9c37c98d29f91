"""Logs as loggers write them go to a verdict by `tireid channels` and `tireid identify` alone."""

import numpy as np
import pytest

import tireid as ti
from tests.models.logs.drive_in_every_format import IN_BAG, write_bag
from tests.tireid.conftest import json_of, typed

CAR = ti.sedan()

pytestmark = pytest.mark.usefixtures("unmade")  # words and numbers are asked, not pictures


@pytest.fixture(scope="module")
def log():
    return ti.sample_recording(CAR)


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    path = tmp_path_factory.mktemp("car") / "car.toml"
    CAR.to_toml(path)
    return str(path)


def learnt(words, out):
    """The stiffnesses of a run whose verdict is valid."""
    assert typed(*words, "--out", out) == 0
    model = json_of(out / "weights.json")
    return np.array(model["cornering_stiffness_N_rad"])


@pytest.fixture(scope="module")
def in_si(log):
    return ti.identify(log, CAR).freeze().stiffness


def test_mdf_with_three_rates_a_gap_and_a_hand_wheel(log, car, in_si, tmp_path, capsys):
    asammdf = pytest.importorskip("asammdf", reason="needs asammdf")
    driven = (log.t < 20.0) | (log.t > 22.5)

    def group(file, every, **channels):
        rows = driven & (np.arange(len(log)) % every == 0)
        signals = [
            asammdf.Signal(values[rows], log.t[rows], name=name, unit=unit)
            for name, (values, unit) in channels.items()
        ]
        file.append(signals, common_timebase=True)

    with asammdf.MDF(version="4.10") as file:
        group(file, 10, VehV_v=(3.6 * log.v_x, "km/h"))
        group(
            file,
            2,
            Correvit_vQuer=(3.6 * log.v_y, "km/h"),
            IMU_LatAcc=(log.a_y / 9.80665, "g"),
        )
        group(
            file,
            1,
            IMU_YawRate=(np.degrees(log.r), "deg/s"),
            LWS_Angle=(14.6 * np.degrees(log.delta_f), "deg"),
        )
        file.save(tmp_path / "log.mf4", overwrite=True)
    path, told = str(tmp_path / "log.mf4"), str(tmp_path / "log.toml")
    assert typed("channels", path) == 1
    said = capsys.readouterr().out
    assert '--columns "delta_f=LWS_Angle [deg] /RATIO"' in said
    word = "delta_f=LWS_Angle [deg] /14.6"
    assert typed("channels", path, "--columns", word, "--write", told) == 0
    capsys.readouterr()
    found = learnt(["identify", path, "--vehicle", car, "--log", told], tmp_path / "out")
    assert "gaps cut the log into 2 segments" in capsys.readouterr().err
    np.testing.assert_allclose(found, in_si, rtol=0.08)  # within three sigma


def test_a_bag_of_two_yaw_rates_asks_which_and_goes_on_when_told(log, car, in_si, tmp_path, capsys):
    pytest.importorskip("rosbags", reason="needs rosbags")
    columns = {name: getattr(log, name) for name in ("v_x", "v_y", "r", "delta_f", "a_y")}
    path = str(write_bag(tmp_path / "bag", log.t, columns))
    words = ["identify", path, "--vehicle", car]
    assert typed(*words) == 2
    said = capsys.readouterr().err
    assert "'/odom/twist.twist.angular.z' or '/imu/angular_velocity.z' for r, equally" in said
    told = ["--columns", f"r={IN_BAG['r']}", f"delta_f={IN_BAG['delta_f']} [rad]"]
    found = learnt([*words, *told], tmp_path / "out")
    np.testing.assert_allclose(found, in_si, rtol=1e-3)
