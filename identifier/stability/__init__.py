"""Stability of the identifier: margins of the learning loop, proven bounds, gains by design."""

from identifier.certificate import Certificate, Property
from identifier.paper.laws import DrivingError
from identifier.stability.certificate import certify
from identifier.stability.gain_design import DesignError, design_gains
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL
from identifier.stability.operation import Operation

__all__ = [
    "INSTANTANEOUS", "INTEGRAL", "Certificate", "DesignError", "DrivingError",
    "Operation", "Property", "certify", "design_gains",
]  # fmt: skip
