"""Curves of tires over slip: of one, and of what was known at every moment of a drive."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from mpc.tires import Car, PredictionTire
from mpc.tires.tire import Point
from tireid.driving.known import Known
from tireid.figures.tires import TireCurve

_SLIP = np.linspace(-0.35, 0.35, 281)  # at which curves are drawn [rad]


def _steady_forces(model: PredictionTire, v_x: float) -> Callable[[Array], Array]:
    """Return what gives front and rear force over `_SLIP` [N], (k, 2), of weights (n_weights,).

    All tires of the model's structure are asked by it.   v_x : speed [m/s].
    """
    a, weights = ca.SX.sym("alpha"), ca.SX.sym("weights", model.weights.size)
    car = Car(*(float(value) for value in model.car))
    at = Point(-v_x * ca.tan(a), ca.SX(0.0), ca.SX(0.0), ca.SX(v_x), car, weights)
    force = ca.vertcat(*model.structure.force((a, a), at))
    function = ca.Function("curve", [a, weights], [force])
    return lambda values: np.array(function(_SLIP[None], values)).T


def steady_curve(label: str, model: PredictionTire, v_x: float) -> TireCurve:
    """Return the steady axle forces of a tire over slip, by sliding sideways without yawing.

    v_x : speed [m/s], which a network may look at.
    """
    force = _steady_forces(model, v_x)(model.weights)
    return TireCurve(label=label, alpha=_SLIP, force=force)


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
    force = _steady_forces(model, v_x)
    return KnownCurves(
        np.array([one.t for one in known]),
        _SLIP,
        np.array([force(one.steering) for one in known]),
        np.array([force(one.learnt) for one in known]),
        np.array([one.slip for one in known]),
    )
