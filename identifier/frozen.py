"""The format of stored frozen models, and the refusal of tires that no road has."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.rules import LARGEST_FORCE
from models.schema import Table
from models.vehicle import AREAS, BICYCLE, LENGTHWISE, Vehicle

FORMAT = "tireid frozen model 1"


class FrozenModelError(TireidError, ValueError):
    """A file does not hold a frozen model; the message names the file and what is wrong."""


DEAD = 0.02  # of the stated stiffness, below which an axle does not push
PROBE = 0.02  # rad, a slip at which every tire pushes back
WIDE = 0.3  # rad, beyond the slip of every tire's peak
_LARGEST_MIN_SPEED = 50.0  # m/s: above it, a car would have forces on motorways only

VEHICLE_KEYS = ("name", *BICYCLE)


def vehicle_numbers(vehicle: Vehicle) -> dict[str, Any]:
    """Return the name and the six numbers of the bicycle by the words of a vehicle file, SI.

    Where the car has downforce its areas follow, and what it tells of `LENGTHWISE` and of the doubt
    of its center of gravity; where some numbers are estimated, `estimated` lists which.
    """
    numbers = {key: getattr(vehicle, key) for key in VEHICLE_KEYS}
    if vehicle.has_downforce:
        numbers |= {key: getattr(vehicle, key) for key in AREAS}
    declared = (*LENGTHWISE, "center_of_gravity_sd")
    given = {key: value for key in declared if (value := getattr(vehicle, key)) is not None}
    return numbers | given | ({"estimated": list(vehicle.estimated)} if vehicle.estimated else {})


def vehicle_from(data: Mapping[str, Any]) -> Vehicle:
    table = Table(data, "", FrozenModelError, "vehicle.")
    for key in BICYCLE:
        table.value(key)  # `Vehicle` would estimate it
    return Vehicle(**table.record(Vehicle, skip=("chassis",)))


def require_alive(
    refusal: type[ValueError], steady: Callable[[Array], Array], vehicle: Vehicle
) -> None:
    """Refuse tires that no road has: forces that are not finite or too large, or a dead axle.
    steady : axle forces at slip angles (k,) [rad], (k, 2) [N].   vehicle : states its stiffnesses.
    """
    force = np.asarray(steady(np.array([-WIDE, -PROBE, PROBE, WIDE])))
    if not (np.abs(force) <= LARGEST_FORCE).all():
        raise refusal(
            f"axle forces must be finite and below {LARGEST_FORCE:g} N, at {WIDE} rad of slip and "
            f"less they reach {np.abs(force).max():g} N"
        )
    if not (force[2] > force[1]).all():
        raise refusal(
            f"axle forces must rise with slip, at {-PROBE} and {PROBE} rad they are "
            f"{force[1].tolist()} and {force[2].tolist()} N: check units, the order of inputs, "
            "and the sign of slip (slip_sign)"
        )
    slope = (force[2] - force[1]) / (2.0 * PROBE)
    for axle, here, said in zip(("front", "rear"), slope, vehicle.bicycle[4:], strict=True):
        if not here >= DEAD * said:
            play = "the steering for play, and " if axle == "front" else ""
            raise refusal(
                f"the {axle} axle does not push: to {PROBE} rad it has {here:.4g} N/rad, its "
                f"vehicle {said:.4g}; "
                f"check {play}the units of force and slip"
            )


def require_min_speed(speed: float) -> None:
    """Refuse a lowest speed [m/s] that is not positive, or that no car drives at.
    speed : below which forces read zero.
    """
    if not 0.0 < speed <= _LARGEST_MIN_SPEED:
        raise ValueError(
            f"min_speed must be positive and at most {_LARGEST_MIN_SPEED:g} m/s, it is {speed:g}"
        )
