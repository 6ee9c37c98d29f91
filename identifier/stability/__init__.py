"""Stability of the identifier: margins of the learning loop, proven bounds, gains by design."""

from identifier.stability.certificate import along_run, certify
from identifier.stability.gain_design import DesignError, GainDesign, design_gains
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL, Law, linear_law
from identifier.stability.operation import Operation
from identifier.stability.pi_lead import pi_lead
from identifier.stability.property import Certificate, Property

__all__ = [
    "INSTANTANEOUS",
    "INTEGRAL",
    "Certificate",
    "DesignError",
    "GainDesign",
    "Law",
    "Operation",
    "Property",
    "along_run",
    "certify",
    "design_gains",
    "linear_law",
    "pi_lead",
]
