"""Random cars, and the residual that the samples of a drive show."""

import numpy as np

from benchmarks.monte_carlo import Drives, residuals
from codegen.arrays import Array
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

FORCE_UNIT = 1000.0  # N


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
