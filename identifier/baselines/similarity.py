"""Scales of a car by Froude similarity, and ranges around numbers that follow from them.

Lengths scale with the wheelbase L, times with sqrt(L/g), speeds with sqrt(g L): one rule serves a
passenger car (2.7 m, 0.52 s, 5.1 m/s) and a 1:10 model (0.17 m, 0.13 s, 1.3 m/s).
"""

import math
from typing import NamedTuple

from identifier.tuning import Range
from models.vehicle import GRAVITY, Vehicle


class Scales(NamedTuple):
    """Natural units of a car: length [m], time [s], speed [m/s]."""

    length: float
    time: float
    speed: float


def scales(vehicle: Vehicle) -> Scales:
    """Return the natural units of a car.

    Parameters
    ----------
    vehicle : its wheelbase is the length.
    """
    L = vehicle.wheelbase
    return Scales(length=L, time=math.sqrt(L / GRAVITY), speed=math.sqrt(GRAVITY * L))


def lowest_speed(vehicle: Vehicle) -> float:
    """Return the speed below which slip angles mean little, 0.2 sqrt(g L) [m/s].

    Parameters
    ----------
    vehicle : 1 m/s for a sedan.
    """
    return 0.2 * scales(vehicle).speed


def around(value: float, factor: float) -> Range:
    """Return the range from a number divided by a factor to the number times it.

    Parameters
    ----------
    value : the number, positive.
    factor : above one.
    """
    return Range(value / factor, value * factor, log=True)


def require_positive(**numbers: float) -> None:
    """Check numbers.

    Parameters
    ----------
    numbers : by name.

    Raises
    ------
    ValueError
        Where one is not positive and finite.
    """
    for name, value in numbers.items():
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, it is {value}")
