"""Units as loggers spell them: what a number is in SI, and what is refused with which words."""

import numpy as np
import pytest

from models.logs.log import RecordingError
from models.logs.units import (
    ACCELERATION,
    ANGLE,
    FACTORS,
    FORCE,
    HAND_WHEEL,
    RATE,
    SI,
    SPEED,
    TIME,
    is_given,
    quantities,
    to_si,
    unit_of_range,
)


@pytest.mark.parametrize(
    ("unit", "quantity", "one"),
    [
        ("km/h", SPEED, 1000 / 3600),
        ("kph", SPEED, 1000 / 3600),
        ("KPH", SPEED, 1000 / 3600),
        ("[kmh]", SPEED, 1000 / 3600),
        ("kilometers per hour", SPEED, 1000 / 3600),
        ("m s-1", SPEED, 1.0),
        ("km|h", SPEED, 1000 / 3600),
        ("m|s2", ACCELERATION, 1.0),
        ("deg|s", RATE, np.pi / 180),
        ("m*s^-1", SPEED, 1.0),
        ("mph", SPEED, 0.44704),
        ("knots", SPEED, 0.514444),
        ("kn", SPEED, 0.514444),
        ("°", ANGLE, np.pi / 180),
        ("Degrees", ANGLE, np.pi / 180),
        ("deg/sec", RATE, np.pi / 180),
        ("°/s", RATE, np.pi / 180),
        ("degrees per second", RATE, np.pi / 180),
        ("rad s^-1", RATE, 1.0),
        ("1/s", RATE, 1.0),
        ("g", ACCELERATION, 9.80665),
        ("G", ACCELERATION, 9.80665),
        ("m/s²", ACCELERATION, 1.0),
        ("m/s^2", ACCELERATION, 1.0),
        ("m/s**2", ACCELERATION, 1.0),
        ("ms-2", ACCELERATION, 1.0),
        ("kN", FORCE, 1000.0),
        ("KN", FORCE, 1000.0),
        ("lbf", FORCE, 4.44822),
        ("ms", TIME, 1e-3),
        ("µs", TIME, 1e-6),
        ("[sec]", TIME, 1.0),
        ("msec", TIME, 1e-3),
        ("Hours", TIME, 3600.0),
        ("meter/second", SPEED, 1.0),
        ("Meters/Second", SPEED, 1.0),
        ("Knots", SPEED, 0.514444),
        ("miles/hour", SPEED, 0.44704),
        ("deg.", ANGLE, np.pi / 180),
        ("deg/second", RATE, np.pi / 180),
        ("degree/sec.", RATE, np.pi / 180),
        ("rps", RATE, 1.0),
        ("g's", ACCELERATION, 9.80665),
        ("Gs", ACCELERATION, 9.80665),
        ("gees", ACCELERATION, 9.80665),
        ("milli-g", ACCELERATION, 9.80665e-3),
        ("meters per second squared", ACCELERATION, 1.0),
        ("m/(s^2)", ACCELERATION, 1.0),
        ("milliseconds", TIME, 1e-3),
        ("", SPEED, 1.0),
        ("-", FORCE, 1.0),
    ],
)
def test_a_spelling_is_understood(unit: str, quantity: str, one: float) -> None:
    assert to_si(unit, quantity, "log: x") == pytest.approx(one, rel=1e-5)


@pytest.mark.parametrize(
    ("unit", "quantity", "rule"),
    [
        ("deg", SPEED, "must be in a unit of a speed (m/s, km/h, mph, knots), 'deg' is one of an"),
        ("deg", RATE, "'deg' is one of an angle; another channel?"),
        ("rpm", RATE, "'rpm' is one of a rate of turns"),
        ("ms", SPEED, "'ms' is one of a time"),
        ("Nm", FORCE, "'Nm' is one of a torque"),
        ("m", SPEED, "'m' is one of a length"),
        ("furlongs", SPEED, "'furlongs', which is not known; name one of a speed: m/s"),
    ],
)
def test_a_unit_of_something_else_is_refused(unit: str, quantity: str, rule: str) -> None:
    with pytest.raises(RecordingError) as caught:
        to_si(unit, quantity, "a.csv: vy (channel 'Vel')")
    message = str(caught.value)
    assert message.startswith("a.csv: vy (channel 'Vel')") and rule in message
    assert "\n" not in message


def test_every_si_unit_is_one_of_its_quantity_and_of_no_other() -> None:
    for quantity, unit in SI.items():
        assert to_si(unit, quantity, "") == 1.0
        assert quantities(unit) == (quantity,)


def test_spellings_that_are_written_in_the_table_are_found_as_they_stand() -> None:
    for quantity, factors in FACTORS.items():
        for unit, factor in factors.items():
            assert to_si(unit, quantity, "") == factor


def test_a_sign_of_no_unit_tells_none() -> None:
    assert not any(map(is_given, ("", " ", "-", "[]", "none", "1")))
    assert all(map(is_given, ("m/s", "%", "1/s")))


def test_a_number_that_no_car_reaches_in_si_is_in_another_unit() -> None:
    assert unit_of_range(RATE, 6.0) == unit_of_range(ANGLE, 0.7) == unit_of_range(SPEED, 110) == ""
    assert unit_of_range(RATE, 7.0) == "deg/s" and unit_of_range(SPEED, 130.0) == "km/h"
    assert unit_of_range(ANGLE, 5.0) == "deg" and unit_of_range(HAND_WHEEL, 5.0) == ""
    assert unit_of_range(HAND_WHEEL, 20.0) == "deg"
    assert unit_of_range(ACCELERATION, 1.1) == "g" and unit_of_range(ACCELERATION, 9.0) == ""
    assert unit_of_range(FORCE, 1e6) == ""
