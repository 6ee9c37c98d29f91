"""Random cars on random smooth drives: a bicycle on saturating tires, simulated in compiled code.

The residual f that the identifier sees is known exactly: (ξ_{k+1} - ξ_k)/dt - A_ξ ξ_k - B_ξ u_k.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.stability.random_drives import (
    Drives,
    residuals,
    saturating_bicycle,
    smooth_steering,
)
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

Array = NDArray[np.float64]
FORCE_UNIT = 1000.0  # N


class Drive(NamedTuple):
    """A car, its drive, and the residual (n - 1, 2) [kN] that its samples show."""

    vehicle: Vehicle
    recording: Recording
    residual: Array


def random_vehicle(rng: np.random.Generator) -> Vehicle:
    """Return a car between a small one and a van, never so oversteering that it spins at once.

    Parameters
    ----------
    rng : source of randomness.
    """
    mass, wheelbase = rng.uniform(900.0, 2500.0), rng.uniform(2.3, 3.2)
    front = rng.uniform(0.42, 0.54)  # share of the wheelbase before the center of gravity
    l_f, l_r = front * wheelbase, (1.0 - front) * wheelbase
    stiffness = mass * GRAVITY / wheelbase * rng.uniform(12.0, 20.0)  # N/rad over the axle's load
    return Vehicle(
        mass=mass,
        yaw_inertia=mass * l_f * l_r * rng.uniform(0.9, 1.1),
        l_f=l_f,
        l_r=l_r,
        cornering_stiffness_front=stiffness * l_r,
        cornering_stiffness_rear=stiffness * l_f * rng.uniform(1.05, 1.3),
    )


LARGEST_SLIP = 0.4  # v_y/v_x beyond which a car has spun and the drive is thrown away


def random_drive(rng: np.random.Generator, *, duration: float = 15.0, dt: float = 0.01) -> Drive:
    """Return a random car on a random drive, often at the limit of its tires, that does not spin.

    Parameters
    ----------
    rng : source of randomness.
    duration : [s].
    dt : sampling interval [s].
    """
    while True:
        drive = _drive(rng, duration, dt)
        recording = drive.recording
        if np.all(np.abs(recording.v_y) < LARGEST_SLIP * recording.v_x):
            return drive


def _drive(rng: np.random.Generator, duration: float, dt: float) -> Drive:
    vehicle = random_vehicle(rng)
    t: Array = np.arange(round(duration / dt), dtype=np.float64) * dt
    speed = rng.uniform(12.0, 32.0)
    friction = rng.uniform(0.3, 1.0)
    lateral = friction * GRAVITY * rng.uniform(0.6, 1.3)  # asked of the linear car, m/s²
    peak = vehicle.wheelbase * lateral / speed**2 + lateral / GRAVITY * rng.uniform(0.0, 0.05)
    u = smooth_steering(rng, t, highest=rng.uniform(0.3, 1.2), peak=peak)
    v_x = speed * (1.0 + 0.05 * np.sin(2 * np.pi * 0.1 * t * rng.uniform(0.5, 1.0)))
    ahead = np.vstack([u[1:], u[-1:]])
    record = _plant()(
        t.size,
        {
            "x": np.zeros(2),
            "u": u,
            "u_ahead": ahead,
            "v_x": v_x,
            "vehicle": np.array(vehicle.bicycle),
            "road": np.array([friction, dt]),
        },
    )
    recording = Recording(
        name="random drive",
        t=t,
        v_x=v_x,
        v_y=record["x"][:, 0],
        r=record["x"][:, 1],
        delta_f=u[:, 0],
        delta_r=u[:, 1],
    )
    return Drive(vehicle, recording, sampled_residual(vehicle, recording))


def sampled_residual(vehicle: Vehicle, recording: Recording) -> Array:
    """Return (ξ_{k+1} - ξ_k)/dt - A_ξ ξ_k - B_ξ u_k, (n - 1, 2) [kN], with ξ at the speed's K.

    Parameters
    ----------
    vehicle : the car.
    recording : its drive.
    """
    drive = Drives(recording.v_x[None], recording.x[None], recording.u[None])
    residual: Array = residuals(vehicle, drive, recording.dt)[0] / FORCE_UNIT
    return residual


@cache
def _plant() -> Scan:
    return Scan(saturating_bicycle(), carry=("x",), over=("u", "u_ahead", "v_x"))
