"""Tires behind one call: `forces(alpha, kappa, gamma, F_z, mu)`."""

from models.tires.dugoff import DugoffTire
from models.tires.fiala import FialaTire
from models.tires.forces import Tire, TireForces
from models.tires.linear import LinearTire
from models.tires.magic_formula import MagicFormula
from models.tires.magic_formula_coefficients import Coefficients
from models.tires.magic_formula_file import ValidRange
from models.tires.tir import TirError, TirFile, read_tir

__all__ = [
    "Coefficients",
    "DugoffTire",
    "FialaTire",
    "LinearTire",
    "MagicFormula",
    "TirError",
    "TirFile",
    "Tire",
    "TireForces",
    "ValidRange",
    "read_tir",
]
