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
from tests.refused import line_about

SPELLED = {  # spellings apart by semicolons
    (SPEED, 1000 / 3600): "km/h;kph;KPH;[kmh];kilometers per hour;km|h",
    (SPEED, 1.0): "m s-1;m*s^-1;meter/second;Meters/Second;",
    (SPEED, 0.44704): "mph;miles/hour",
    (SPEED, 0.514444): "knots;kn;Knots",
    (ANGLE, np.pi / 180): "°;Degrees;deg.",
    (RATE, np.pi / 180): "deg|s;deg/sec;°/s;degrees per second;deg/second;degree/sec.",
    (RATE, 1.0): "rad s^-1;1/s;rps",
    (ACCELERATION, 9.80665): "g;G;g's;Gs;gees",
    (ACCELERATION, 9.80665e-3): "milli-g",
    (ACCELERATION, 1.0): "m|s2;m/s²;m/s^2;m/s**2;ms-2;meters per second squared;m/(s^2)",
    (FORCE, 1000.0): "kN;KN",
    (FORCE, 4.44822): "lbf",
    (FORCE, 1.0): "-",
    (TIME, 1e-3): "ms;msec;milliseconds",
    (TIME, 1e-6): "µs",
    (TIME, 1.0): "[sec]",
    (TIME, 3600.0): "Hours",
}


@pytest.mark.parametrize(
    ("unit", "quantity", "one"),
    [(unit, *meant) for meant, some in SPELLED.items() for unit in some.split(";")],
)
def test_a_spelling_is_understood(unit, quantity, one):
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
def test_a_unit_of_something_else_is_refused(unit, quantity, rule):
    where = "a.csv: vy (channel 'Vel')"
    assert rule in line_about(where, RecordingError, lambda _: to_si(unit, quantity, where))


def test_every_si_unit_is_one_of_its_quantity_and_of_no_other():
    for quantity, unit in SI.items():
        assert to_si(unit, quantity, "") == 1.0
        assert quantities(unit) == (quantity,)


def test_spellings_that_are_written_in_the_table_are_found_as_they_stand():
    for quantity, factors in FACTORS.items():
        for unit, factor in factors.items():
            assert to_si(unit, quantity, "") == factor


def test_a_sign_of_no_unit_tells_none():
    assert not any(map(is_given, ("", " ", "-", "[]", "none", "1")))
    assert all(map(is_given, ("m/s", "%", "1/s")))


def test_a_number_that_no_car_reaches_in_si_is_in_another_unit():
    assert unit_of_range(RATE, 6.0) == unit_of_range(ANGLE, 0.7) == unit_of_range(SPEED, 110) == ""
    assert unit_of_range(RATE, 7.0) == "deg/s" and unit_of_range(SPEED, 130.0) == "km/h"
    assert unit_of_range(ANGLE, 5.0) == "deg" and unit_of_range(HAND_WHEEL, 5.0) == ""
    assert unit_of_range(HAND_WHEEL, 20.0) == "deg"
    assert unit_of_range(ACCELERATION, 1.1) == "g" and unit_of_range(ACCELERATION, 9.0) == ""
    assert unit_of_range(FORCE, 1e6) == ""
