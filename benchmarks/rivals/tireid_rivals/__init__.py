"""Estimators that tireid is compared with, as another distribution adds them.

Each entry point of the group `tireid.methods` names a function here: of a car and a seed, which
none of them uses, to a method whose numbers follow from the car.
"""

from models.vehicle import Vehicle
from tireid_rivals.curve_ekf import CurveEkf
from tireid_rivals.slip_filter import SlipFilter

NAMES = ("linear_kf", "joint_ekf")  # that estimate v_y


def magic_formula_ekf(vehicle: Vehicle, seed: int = 0) -> CurveEkf:
    """Return the filter of a Magic Formula an axle, the lag and the offsets of the sensors."""
    del seed
    return CurveEkf.for_vehicle(vehicle)


def textbook_ekf(vehicle: Vehicle, seed: int = 0) -> CurveEkf:
    """Return the same without lag and offsets, as textbooks have it."""
    del seed
    return CurveEkf.for_vehicle(vehicle, textbook=True)


def linear_kf(vehicle: Vehicle, seed: int = 0) -> SlipFilter:
    """Return the linear filter of v_y and r on the stiffnesses of the vehicle file."""
    del seed
    return SlipFilter.for_vehicle(vehicle, learns=False)


def joint_ekf(vehicle: Vehicle, seed: int = 0) -> SlipFilter:
    """Return the naive joint filter of v_y, r and a tire of Dugoff per axle."""
    del seed
    return SlipFilter.for_vehicle(vehicle, learns=True)
