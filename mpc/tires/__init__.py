"""Tires for the prediction: a compiled structure, and weights that are read at run time."""

from mpc.tires.door import tire_model
from mpc.tires.ladder_fit import CurveFitError
from mpc.tires.oracle import oracle_tire
from mpc.tires.structure import Car, PredictionTire, TireModel

__all__ = ["Car", "CurveFitError", "PredictionTire", "TireModel", "oracle_tire", "tire_model"]
