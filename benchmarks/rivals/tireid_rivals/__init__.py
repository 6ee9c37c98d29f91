"""Estimators of lateral velocity that tireid is compared with, as another distribution adds them.

Each entry point of the group `tireid.methods` names a function here: of a car and a seed, which
none of them uses, to a method whose numbers follow from the car.
"""

from models.vehicle import Vehicle
from tireid_rivals.horizon import HorizonEstimator
from tireid_rivals.slip_filter import SlipFilter
from tireid_rivals.washout import Washout

NAMES = ("linear_kf", "joint_ekf", "washout", "mhe")


def linear_kf(vehicle: Vehicle, seed: int = 0) -> SlipFilter:
    """Return the linear filter of v_y and r on the stiffnesses of the vehicle file."""
    del seed
    return SlipFilter.for_vehicle(vehicle, tire="linear")


def joint_ekf(vehicle: Vehicle, seed: int = 0) -> SlipFilter:
    """Return the naive joint filter of v_y, r and a tire of Dugoff per axle."""
    del seed
    return SlipFilter.for_vehicle(vehicle, tire="dugoff")


def washout(vehicle: Vehicle, seed: int = 0) -> Washout:
    """Return the integration of a_y that is washed out."""
    del seed
    return Washout.for_vehicle(vehicle)


def mhe(vehicle: Vehicle, seed: int = 0) -> HorizonEstimator:
    """Return moving-horizon estimation on the tires of the joint filter."""
    del seed
    return HorizonEstimator.for_vehicle(vehicle)
