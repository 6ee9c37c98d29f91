"""B, C and D of a Magic Formula per axle, learnt by an extended Kalman filter."""

from identifier.baselines.curve_ekf import CurveEkf
from models.vehicle import Vehicle


def magic_formula_ekf(vehicle: Vehicle, *, dt: float = 0.01) -> CurveEkf:
    """Return the method for a car.

    Parameters
    ----------
    vehicle : the car; its stiffness B C D is the prior.
    dt : sampling interval [s].
    """
    return CurveEkf.for_vehicle(vehicle, curve="magic_formula", dt=dt)
