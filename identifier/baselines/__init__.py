"""What the default is compared with: the vehicle's linear tire, and a short Kalman filter."""

from identifier.baselines.curves import CurveModel
from identifier.baselines.lagged_ekf import LaggedEkf
from identifier.baselines.linear import LinearBaseline, LinearModel

__all__ = ["CurveModel", "LaggedEkf", "LinearBaseline", "LinearModel"]
