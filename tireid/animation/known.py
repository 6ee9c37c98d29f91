"""Curves of tires over slip: of one, and of what was known at every moment of a drive."""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from mpc.tires import Car, PredictionTire
from mpc.tires.tire import Point
from tireid.driving.known import Known
from tireid.figures.tires import TireCurve

LARGEST = 0.35  # slip up to which curves are drawn [rad]
POINTS = 281


class Curves:
    """Steady axle forces over slip of all tires that have one structure, at one speed.

    v_x : speed [m/s], which a network may look at.
    """

    def __init__(self, model: PredictionTire, v_x: float) -> None:
        a, weights = ca.SX.sym("alpha"), ca.SX.sym("weights", model.weights.size)
        car = Car(*(float(value) for value in model.car))
        at = Point(-v_x * ca.tan(a), ca.SX(0.0), ca.SX(0.0), ca.SX(v_x), car, weights)
        force = model.structure.force((a, a), at)
        self._force = ca.Function("curve", [a, weights], [ca.vertcat(*force)])
        self.alpha = np.linspace(-LARGEST, LARGEST, POINTS)

    def force(self, weights: Array) -> Array:
        """Return the forces of front and rear axle over `alpha` [N], (k, 2).

        weights : of the tire, (n_weights,).
        """
        force: Array = np.array(self._force(self.alpha[None], weights)).T
        return force


def steady_curve(label: str, model: PredictionTire, v_x: float) -> TireCurve:
    """Return the steady axle forces of a tire over slip, by sliding sideways without yawing.

    v_x : speed [m/s], which a network may look at.
    """
    curves = Curves(model, v_x)
    return TireCurve(label=label, alpha=curves.alpha, force=curves.force(model.weights))


class KnownCurves(NamedTuple):
    """What a film shows of the tires of its first drive, moment by moment.

    t : (m,) [s].   alpha : slip [rad], (k,).   steering, learnt : forces of what is steered by and
    of what was learnt by then [N], (m, k, 2), NaN where there was none.   slip : up to which that
    is known [rad], (m, 2), NaN where it is not known.
    """

    t: Array
    alpha: Array
    steering: Array
    learnt: Array
    slip: Array


def known_over_time(
    known: Sequence[Known], model: PredictionTire, v_x: float
) -> KnownCurves | None:
    """Return the curves that were known over a drive; None where nothing learnt.

    v_x : speed at which curves are drawn [m/s].
    """
    if not known:
        return None
    curves = Curves(model, v_x)
    return KnownCurves(
        np.array([one.t for one in known]),
        curves.alpha,
        np.array([curves.force(one.steering) for one in known]),
        np.array([curves.force(one.learnt) for one in known]),
        np.array([one.slip for one in known]),
    )
