"""Tires for the prediction: a compiled structure, and weights that are read at run time."""

from mpc.tires.factory import prediction_tire
from mpc.tires.ladder import CurveFitError, oracle_tire
from mpc.tires.tire import Car, PredictionTire, TireStructure

__all__ = [
    "Car", "CurveFitError", "PredictionTire", "TireStructure", "oracle_tire", "prediction_tire",
]  # fmt: skip
