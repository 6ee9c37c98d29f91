"""The default identifier: axle force curves of slip, learnt by recursive least squares."""

from identifier.axle.design import AxleIdentifier
from identifier.axle.model import AxleModel

__all__ = ["AxleIdentifier", "AxleModel"]
