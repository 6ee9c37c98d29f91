"""Which channel is the speed of which wheel, by its name and unit."""

import re
from pathlib import Path

import numpy as np
import pytest

from models.logs.door import open_log
from models.logs.names import _RULES, SURE, _name_confidence, propose
from models.logs.signals import QUANTITIES, WHEELS
from models.logs.spelling import unit_in_name
from tests.models.logs.test_names import WAVE, each_of, names_of, proposed

DOCS = Path(__file__).resolve().parents[3] / "docs"
CALLED = {  # names apart by commas
    "wheel_fl": """
wheel_fl, WheelSpeed_FL, Wheel Speed FL, WHL_SPD_FL, ESP_VL_Radgeschw, nWheelFL,
Vhcl.FL.rotv, Wheel Speed Front Left, v_Rad_VL, omega_fl, WheelSpeedFrontLeft,
/vehicle/wheel_speeds/lf.speed, Speed_FL, whlspdfl, rpm_fl
""",
    "wheel_fr": "WHEEL_SPEED_FR, ws_fr, Raddrehzahl vorne rechts, wheelVel_RF",
    "wheel_rl": "wheel_speed_rl, omega_rl, HL_Radgeschw, WheelRPM_RL",
    "wheel_rr": "ws_rr, vWheelRR, Wheel_Spd_RearRight, WSPEED RR",
    "wheel": "wheel, wheel_speed, encoder, wheel_encoder, WheelSpeed, wheel rpm",
}
NO_WHEEL = names_of("""
Engine RPM, Steering Wheel Speed, Wheel Slip FL, Brake Pressure FL, v_x, Tire Temp FL,
WheelSpeed_FL_valid, Wheel Angle FL, Suspension Travel FL, WheelBasedVehicleSpeed,
Ground Speed, yaw rate, encoder ticks
""")


@each_of(CALLED)
def test_a_name_of_a_logger_is_that_wheel_and_nothing_else(signal, name):
    found = {one: _name_confidence(one, name) for one in (*WHEELS, *_RULES)}
    assert found[signal] >= SURE
    assert not any(value for one, value in found.items() if one != signal)


@pytest.mark.parametrize("name", NO_WHEEL)
def test_a_name_of_something_else_is_no_wheel(name):
    assert not any(_name_confidence(one, name) for one in WHEELS)


@pytest.mark.parametrize("unit", ["rad/s", "rpm", "1/min", "Hz", "deg/s", "m/s", "km/h", "mph"])
def test_a_wheel_turns_or_has_a_speed(unit):
    found = proposed(("WheelSpeed_FL", unit, 30.0 + WAVE))
    assert found.is_sure("wheel_fl") and found.guesses["wheel_fl"].unit == unit


@pytest.mark.parametrize("unit", ["%", "bar", "", "deg", "m/s^2"])
def test_a_wheel_of_another_unit_or_none_is_not_sure(unit):
    assert not proposed(("WheelSpeed_FL", unit, 30.0 + WAVE)).is_sure("wheel_fl")


def documented(page, row):
    """What stands in code in a row of a table of the documents."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    return re.findall("`([^`]+)`", next(line for line in lines if line.startswith(row)))


@pytest.mark.parametrize("column", [*documented("first_steps.md", "| `wheel_fl`"), "vx", "vy"])
@pytest.mark.parametrize("form", documented("logs.md", "| units |"))
def test_every_documented_speed_is_read_with_its_unit_in_every_documented_form(column, form):
    name = form.replace("Speed", column).replace("SPEED", column.upper())
    found = proposed((name, unit_in_name(name), 30.0 + WAVE))
    signal = {"vx": "v_x", "vy": "v_y"}.get(column, column)
    assert found.is_sure(signal) and found.guesses[signal].unit == "km/h"
    assert not any(found.is_sure(other) for other in QUANTITIES if other != signal)


@pytest.mark.parametrize("unit", ["deg/s", "rpm", "1/min", "m/s"])
def test_a_documented_wheel_of_a_table_in_text_is_found(unit, tmp_path):
    for name in ("wheel_fl", "WHEEL_FL"):
        path = tmp_path / "log.csv"
        rows = (f"{k / 100},{30 + np.sin(k / 20)}" for k in range(200))
        path.write_text("\n".join([f"t [s],{name} [{unit}]", *rows]))
        log = open_log(path)
        assert propose(log, log.headings()).is_sure("wheel_fl")


def test_a_wheel_that_never_turns_or_is_there_twice_is_not_sure():
    assert not proposed(("ws_rr", "rpm", np.full(200, 3.0))).is_sure("wheel_rr")
    twice = proposed(("ws_rr", "rpm", 30.0 + WAVE), ("omega_rr", "rad/s", 3.0 + WAVE))
    assert not twice.is_sure("wheel_rr") and len(twice.rivals["wheel_rr"]) == 2
