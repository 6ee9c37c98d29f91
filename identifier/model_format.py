"""The format of stored frozen models, and the error of a file that does not keep it."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from models.doors import Table
from models.rules import LARGEST_FORCE
from models.vehicle import Vehicle

Array = NDArray[np.float64]

FORMAT = "tireid frozen model 1"


class FrozenModelError(ValueError):
    """A file does not hold a frozen model; the message names the file and what is wrong."""


DEAD = 0.02  # of the stiffness told, below which an axle does not push
PROBE = 0.02  # rad, a slip at which every tire pushes back
WIDE = 0.3  # rad, beyond the slip of every tire's peak
PROBE_SPEED = 10.0  # m/s
LARGEST_MIN_SPEED = 50.0  # m/s: above it, a car would have forces on motorways only

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
    ValueError
        Where a key is missing or unknown, or a value has a wrong type or is impossible.
    """
    table = Table(data, "", FrozenModelError, "vehicle.")
    return Vehicle(**table.record(Vehicle, skip=("chassis",)))


class SteadyTires(Protocol):
    """What has steady axle forces at slip angles."""

    def force_at(self, alpha: Array) -> Array:
        """Return the steady axle forces at slip angles, (k, 2) [N].

        Parameters
        ----------
        alpha : slip angles in the paper's sign [rad], (k,).
        """


def require_alive(refusal: type[ValueError], tires: SteadyTires) -> None:
    """Refuse tires that no road has: forces that are not finite or too large, or a dead axle.

    Parameters
    ----------
    refusal : class of the error to raise.
    tires : both axles.

    Raises
    ------
    ValueError
        Of that class, with the forces.
    """
    force = np.asarray(tires.force_at(np.array([-WIDE, -PROBE, PROBE, WIDE])))
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


def require_min_speed(speed: float) -> None:
    """Refuse a lowest speed [m/s] that is not positive, or that no car drives at.

    Parameters
    ----------
    speed : below which forces read zero.

    Raises
    ------
    ValueError
        Where it is not above zero, or above `LARGEST_MIN_SPEED`.
    """
    if not 0.0 < speed <= LARGEST_MIN_SPEED:
        raise ValueError(
            f"min_speed must be positive and at most {LARGEST_MIN_SPEED:g} m/s, it is {speed:g}"
        )
