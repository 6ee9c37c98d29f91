"""What the laws are compared with: known estimators, and the floor that no method gets below."""

from identifier.baselines.curve_ekf import CurveEkf, dugoff_ekf, magic_formula_ekf
from identifier.baselines.curves import CurveModel
from identifier.baselines.eso import ExtendedStateObserver
from identifier.baselines.floor import Structure, fit_floor, share_of_force, structure_of
from identifier.baselines.kalman import ForceEkf
from identifier.baselines.linear import LinearBaseline, StiffnessRls

__all__ = [
    "CurveEkf",
    "CurveModel",
    "ExtendedStateObserver",
    "ForceEkf",
    "LinearBaseline",
    "StiffnessRls",
    "Structure",
    "dugoff_ekf",
    "fit_floor",
    "magic_formula_ekf",
    "share_of_force",
    "structure_of",
]
