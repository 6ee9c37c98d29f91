"""What a tracker is told of the tires, as curves."""

from collections.abc import Sequence
from contextlib import suppress

import casadi as ca
import numpy as np

from identifier.method import FrozenModel
from mpc.tires import Car, CurveFitError, TireModel, tire_model
from mpc.tires.structure import Point
from tireid.drive_runs import FROZEN, LEARNING, LINEAR, ORACLE, Run
from tireid.drive_setup import Setup
from tireid.figures.drive_look import AT_THE_END
from tireid.figures.tire_curve import TireCurve

LARGEST = 0.35  # slip up to which curves are drawn [rad]
POINTS = 281


def steady_curve(label: str, model: TireModel, v_x: float) -> TireCurve:
    """Return the steady axle forces of a tire over slip, by sliding sideways without yawing.

    Parameters
    ----------
    label : what legends call it.
    model : the tire.
    v_x : speed [m/s], which a network may look at.
    """
    a = ca.SX.sym("alpha")
    car = Car(*(float(value) for value in model.car))
    at = Point(-v_x * ca.tan(a), ca.SX(0.0), ca.SX(0.0), ca.SX(v_x), car, ca.SX(model.weights))
    force = model.structure.force((a, a), at)
    evaluate = ca.Function("curve", [a], [ca.vertcat(*force)])
    alpha = np.linspace(-LARGEST, LARGEST, POINTS)
    return TireCurve(label=label, alpha=alpha, force=np.array(evaluate(alpha[None])).T)


def known_curves(runs: Sequence[Run], setup: Setup, learnt: FrozenModel | None) -> list[TireCurve]:
    """Return what the trackers were told, and the linear and the true tire beside it.

    Parameters
    ----------
    runs : the drives.
    setup : path, car and road.
    learnt : the frozen tires, if there are any.
    """
    models = {LINEAR: tire_model(setup.vehicle)}
    if learnt is not None:
        models[FROZEN] = tire_model(learnt, setup.vehicle)
    for run in runs:
        if run.label != LEARNING:
            models[run.label] = run.model
        if run.label != ORACLE and run.final is not run.model:
            models[run.label + AT_THE_END] = run.final
    with suppress(CurveFitError):  # a true tire that no curve can follow is not drawn
        models[ORACLE] = setup.oracle()
        if setup.drops:
            models[ORACLE + AT_THE_END] = setup.oracle(setup.drops[-1][1])
    v_x = float(setup.speeds().mean())
    return [steady_curve(label, model, v_x) for label, model in models.items()]
