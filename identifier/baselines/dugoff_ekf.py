"""Dugoff's tire, stiffness per axle and friction of the road by an extended Kalman filter."""

from identifier.baselines.curve_ekf import CurveEkf
from models.vehicle import Vehicle


def dugoff_ekf(vehicle: Vehicle, *, dt: float = 0.01) -> CurveEkf:
    """Return the method for a car.

    Parameters
    ----------
    vehicle : the car; its stiffness is the prior.
    dt : sampling interval [s].
    """
    return CurveEkf.for_vehicle(vehicle, curve="dugoff", dt=dt)
