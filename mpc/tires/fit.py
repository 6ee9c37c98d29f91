"""A fit as a prediction tire: the curves of the forward model, their parameters as weights.

F = F_z λ φ(α') cos δ per axle, φ and its slope of `identifier.motion.model.carcass_curve`; lag
σ = s φ' + σ_0; λ = 1 + κ v_x² is the load of the axle over the static one.
"""

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.axle.slip import SHORTEST
from identifier.estimate.model import FittedModel
from identifier.motion.model import carcass_curve
from identifier.motion.parameters import curve_index, curve_names
from models.vehicle import load_ratio
from mpc.tires.chosen import CHOSEN
from mpc.tires.tire import Pair, Point, PredictionTire, TireStructure

_COMMON = ("steering_zero", "steering_gain", "v_y_bias", "v_y_angle")
_NUMBERS = len(curve_names("f")) + 1  # of a curve; the last is ln of the road's friction
_OF_AXLE = 3 + _NUMBERS


@dataclass(frozen=True, slots=True)
class FitAxles(TireStructure):
    """w = [δ_0, g, b, β, σ_0], then of each axle F_z [N], κ [s²/m²], s [m], numbers of its curve.

    δ_0 [rad], g: zero and relative error of the steering. b [m/s], β [rad]: bias of v_y and
    mounting angle of its sensor. The tracker reads the same sensors as the fit did.
    """

    saturates = True
    lagged = True
    n_weights = len(_COMMON) + 1 + 2 * _OF_AXLE

    def slip(self, at: Point) -> Pair:
        """Return the slip angles, errors of the sensors taken off [rad]."""
        _, _, bias, angle = ca.vertsplit(at.w[: len(_COMMON)])
        v_y = at.v_y - bias - angle * at.v_x
        return TireStructure.slip(self, at._replace(v_y=v_y, delta=_steered(at)))

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        front, rear = (
            axle[0] * load_ratio(axle[1], at.v_x) * carcass_curve(*axle[3:], x)[0]
            for axle, x in zip(_axles(at.w), slip, strict=True)
        )
        delta = _steered(at)
        cos_delta = 1 - delta**2 / 2 + delta**4 / 24  # as `FittedModel.force_expression` has it
        return front * cos_delta, rear

    def lag_length(self, slip: Pair, at: Point) -> Pair:
        """Return the relaxation lengths [m], which shorten with the slope of the curve."""
        front, rear = (
            axle[2] * load_ratio(axle[1], at.v_x) * carcass_curve(*axle[3:], x)[1]
            + at.w[len(_COMMON)]
            for axle, x in zip(_axles(at.w), slip, strict=True)
        )
        return front, rear

    def at_friction(self, weights: Array, ratio: float) -> Array:
        """Return `weights` (n_weights,) of another friction."""
        w = weights.copy()
        w[len(_COMMON) + _OF_AXLE :: _OF_AXLE] += math.log(ratio)
        return w

    def similar(self, at: Point, ratio: Any) -> Point:
        """Return `at`: nothing but slip makes the force."""
        del ratio
        return at


def _steered(at: Point) -> Any:
    """Return δ of the front wheels without the sensor's errors [rad]."""
    return (1 + at.w[1]) * at.delta + at.w[0]


def _axles(w: Any) -> list[list[Any]]:
    """Return F_z, κ, s and the numbers of the curve of each axle."""
    numbers = ca.vertsplit(w)[len(_COMMON) + 1 :]
    return [numbers[:_OF_AXLE], numbers[_OF_AXLE:]]


def fit_tire(model: FittedModel) -> PredictionTire:
    """Return the prediction tire of a fit, read by its sensors.
    model : frozen; load transfer, ellipse and the place of the sensor of v_y are left out: the
        tracker is told no a_x.
    """
    car = model.vehicle
    weights = np.concatenate(
        [
            [model[name] for name in _COMMON],
            [SHORTEST * car.wheelbase],
            *(
                [load, pressed, give, *model.p[curve_index(axle)]]
                for load, pressed, give, axle in zip(
                    car.axle_loads, car.downforce, model.give, "fr", strict=True
                )
            ),
        ]
    )
    doubt = model.band.half(CHOSEN.doubt_step * np.arange(CHOSEN.n_doubts, dtype=np.float64)).T
    return PredictionTire(FitAxles(), weights, car, doubt)
