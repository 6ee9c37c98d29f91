"""The default identifier: axle force curves of slip, learnt by recursive least squares."""

from identifier.axle.design import AxleDesign
from identifier.axle.model import AxleModel

__all__ = ["AxleDesign", "AxleModel"]
