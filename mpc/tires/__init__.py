"""Tires for the prediction: a compiled structure, and weights that are read at run time."""

from mpc.tires.door import tire_model
from mpc.tires.ladder import CurveFitError, oracle_tire
from mpc.tires.tire import Car, PredictionTire, TireModel

__all__ = ["Car", "CurveFitError", "PredictionTire", "TireModel", "oracle_tire", "tire_model"]
