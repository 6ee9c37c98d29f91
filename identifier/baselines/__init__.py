"""What the default is compared with: known estimators."""

from identifier.baselines.curve_ekf import CurveEkf, magic_formula_ekf
from identifier.baselines.curves import CurveModel
from identifier.baselines.horizon import HorizonEstimator
from identifier.baselines.lagged_ekf import LaggedEkf
from identifier.baselines.linear import LinearBaseline
from identifier.baselines.slip_filter import SlipFilter, joint_ekf, linear_kf
from identifier.baselines.washout import Washout

__all__ = [
    "CurveEkf", "CurveModel", "HorizonEstimator", "LaggedEkf", "LinearBaseline", "SlipFilter",
    "Washout", "joint_ekf", "linear_kf", "magic_formula_ekf",
]  # fmt: skip
