"""Tires behind one call: `forces(alpha, kappa, gamma, F_z, mu)`."""

from models.tires.forces import Tire, TireForces
from models.tires.magic_formula import MagicFormula
from models.tires.magic_formula_coefficients import Coefficients
from models.tires.simple import DugoffTire, FialaTire, LinearTire
from models.tires.tir import TirError, TirFile, ValidRange, read_tir

__all__ = [
    "Coefficients", "DugoffTire", "FialaTire", "LinearTire", "MagicFormula", "TirError", "TirFile",
    "Tire", "TireForces", "ValidRange", "read_tir",
]  # fmt: skip
