"""What the laws are compared with: known estimators, and the floor that no method gets below."""

from identifier.baselines.curve_ekf import CurveEkf, dugoff_ekf, magic_formula_ekf
from identifier.baselines.curves import CurveModel
from identifier.baselines.eso import ExtendedStateObserver
from identifier.baselines.floor import Structure, fit_floor, share_of_force, structure_of
from identifier.baselines.horizon import HorizonEstimator
from identifier.baselines.kalman import ForceEkf
from identifier.baselines.lagged_ekf import LaggedEkf
from identifier.baselines.linear import LinearBaseline, StiffnessRls
from identifier.baselines.slip_filter import SlipFilter, joint_ekf, linear_kf
from identifier.baselines.washout import Washout

__all__ = [
    "CurveEkf",
    "CurveModel",
    "ExtendedStateObserver",
    "ForceEkf",
    "HorizonEstimator",
    "LaggedEkf",
    "LinearBaseline",
    "SlipFilter",
    "StiffnessRls",
    "Structure",
    "Washout",
    "dugoff_ekf",
    "fit_floor",
    "joint_ekf",
    "linear_kf",
    "magic_formula_ekf",
    "share_of_force",
    "structure_of",
]
