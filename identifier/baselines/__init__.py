"""What the laws are compared with: known estimators, and the floor that no method gets below."""

from identifier.baselines.curve_ekf import CurveEkf
from identifier.baselines.curve_model import CurveModel
from identifier.baselines.dugoff_ekf import dugoff_ekf
from identifier.baselines.eso import ExtendedStateObserver
from identifier.baselines.floor import Structure, fit_floor, share_of_force
from identifier.baselines.floor_structures import structure_of
from identifier.baselines.force_ekf import ForceEkf
from identifier.baselines.linear import LinearBaseline
from identifier.baselines.magic_formula_ekf import magic_formula_ekf
from identifier.baselines.stiffness_rls import StiffnessRls

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
