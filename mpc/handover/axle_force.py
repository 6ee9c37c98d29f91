"""The axle forces that prediction tires tell from measured motion, sample by sample."""

from collections.abc import Hashable
from functools import cache
from typing import Any, cast

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from mpc.handover.window import COLUMNS
from mpc.tires import TireModel
from mpc.tires.structure import Car, Point

Array = NDArray[np.float64]

SHORTEST_LAG = 1e-3  # m


def axle_forces(tire: TireModel, weights: Array, samples: Array, dt: float) -> Array:
    """Return the axle forces (k, n, 2) [N] of k tires, frame of the body; a lag begins settled.

    Parameters
    ----------
    tire : structure and car; its weights are not read.
    weights : of k tires (k, n_weights).
    samples : rows of `window.COLUMNS`, (n, 4).
    dt : sampling interval [s].
    """
    k = len(weights)
    run = axle_scan(cast(Hashable, tire.structure), k)(
        len(samples),
        {
            "lagged": np.zeros((2, k)),
            "begun": np.zeros(1),
            "sample": samples,
            "dt": np.array(dt),
            "car": tire.car,
            "w": weights.T,
        },
    )
    return run["axle_force"].reshape(len(samples), k, 2).swapaxes(0, 1)


@cache
def axle_scan(structure: Any, k: int) -> Scan:
    """Return the compiled loop: slip, its lag held exactly over a sample, force of k tires.

    Parameters
    ----------
    structure : of the tires.
    k : number of tires.
    """
    lagged, begun = ca.SX.sym("lagged", 2, k), ca.SX.sym("begun")
    sample, dt = ca.SX.sym("sample", len(COLUMNS)), ca.SX.sym("dt")
    car, w = ca.SX.sym("car", 4), ca.SX.sym("w", structure.n_weights, k)
    slips, forces = [], []
    for i in range(k):
        v_x, v_y, r, delta = ca.vertsplit(sample)
        at = Point(v_y, r, delta, v_x, Car(*ca.vertsplit(car)), w[:, i])
        slip: Any = ca.vertcat(*structure.slip(at))
        if structure.lagged:
            sigma = ca.vertcat(*structure.lag_length((lagged[0, i], lagged[1, i]), at))
            share = 1 - ca.exp(-v_x * dt / ca.fmax(sigma, SHORTEST_LAG))
            slip = ca.if_else(begun > 0, lagged[:, i] + share * (slip - lagged[:, i]), slip)
        slips.append(slip)
        forces.append(ca.vertcat(*structure.force((slip[0], slip[1]), at)))
    step = ca.Function(
        f"axle_forces_{k}",
        [lagged, begun, sample, dt, car, w],
        [ca.densify(value) for value in (ca.horzcat(*slips), ca.SX(1), ca.vertcat(*forces))],
        ["lagged", "begun", "sample", "dt", "car", "w"],
        ["lagged_next", "begun_next", "axle_force"],
        {"cse": True},
    )
    return Scan(step, carry=("lagged", "begun"), over=("sample",))
