"""The forward model: what a car with these tires does in a drive, and by how much it is missed."""

from identifier.motion.model import Columns, motion_scan
from identifier.motion.parameters import INDEX, NAMES, Parameter

__all__ = ["INDEX", "NAMES", "Columns", "Parameter", "motion_scan"]
