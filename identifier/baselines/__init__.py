"""What the default is compared with: known estimators."""

from identifier.baselines.curve_ekf import CurveEkf, magic_formula_ekf
from identifier.baselines.curves import CurveModel
from identifier.baselines.lagged_ekf import LaggedEkf
from identifier.baselines.linear import LinearBaseline

__all__ = ["CurveEkf", "CurveModel", "LaggedEkf", "LinearBaseline", "magic_formula_ekf"]
