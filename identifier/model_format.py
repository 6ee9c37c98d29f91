"""The format of stored frozen models, and the error of a file that does not keep it."""

from collections.abc import Mapping
from typing import Any

from models.vehicle import Vehicle

FORMAT = "tireid frozen model 1"


class FrozenModelError(ValueError):
    """A file does not hold a frozen model; the message names the file and what is wrong."""


VEHICLE_KEYS = (
    "name",
    "mass",
    "yaw_inertia",
    "l_f",
    "l_r",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
)


def vehicle_numbers(vehicle: Vehicle) -> dict[str, Any]:
    """Return the name and the six numbers of the bicycle by the words of a vehicle file, SI.

    Parameters
    ----------
    vehicle : the car.
    """
    return {key: getattr(vehicle, key) for key in VEHICLE_KEYS}


def vehicle_from(data: Mapping[str, Any]) -> Vehicle:
    """Return the car that `vehicle_numbers` describes.

    Parameters
    ----------
    data : as from `vehicle_numbers`.

    Raises
    ------
    KeyError
        Where a key is missing.
    ValueError
        Where a number is impossible.
    """
    return Vehicle(**{key: data[key] for key in VEHICLE_KEYS})
