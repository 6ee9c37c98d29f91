"""Stability of the identifier: margins of the learning loop, proven bounds."""

from identifier.certificate import Certificate, Property
from identifier.paper.laws import DrivingError
from identifier.stability.certificate import certify
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL
from identifier.stability.operation import Operation

__all__ = [
    "INSTANTANEOUS", "INTEGRAL", "Certificate", "DrivingError", "Operation", "Property", "certify",
]  # fmt: skip
