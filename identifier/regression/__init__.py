"""Laws for the last layer from a filtered regression: gradient, Newton, RLS and a memory."""

from identifier.regression.design import RegressionIdentifier
from identifier.regression.laws import LAWS

__all__ = ["LAWS", "RegressionIdentifier"]
