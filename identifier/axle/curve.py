"""The hidden units of an axle: a ladder of odd functions tanh(x/α_j) of one slip angle.

φ(x) = Σ_j w_j tanh(x/α_j), in static axle loads.   α_j: slip scales [rad], each a power of two of
the next: tanh(y) = 1 - 2/(1 + E) with E = exp(2y), and doubling y squares E, so that one tanh
gives all units, with the same bits on every machine.   φ saturates at Σ w_j.
"""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.elementary import tanh
from identifier.axle.car import larger, smaller
from identifier.setup import NOT_NEGATIVE, Port

LADDER = (0.016, 0.064, 0.128, 0.256)  # rad: from where a tire bends to where it slides


class Curve(NamedTuple):
    """Static force curve at one slip, per axle (2,).
    units : tanh(x/α_j) (2, n).   force : φ [-].   slope : dφ/dx [1/rad].
    carcass_slope : C = slope [1/rad], but at least 2 % of that at zero, for the lag.
    bend : dC/dx [1/rad²], zero where C is held up.
    """

    units: Any
    force: Any
    slope: Any
    carcass_slope: Any
    bend: Any

    def under(self, load: Any) -> "Curve":
        """Return the curve of axles under another load than the static one.
        load : over the static one, λ (2,) [-].
        """
        units = self.units * ca.repmat(load, 1, self.units.shape[1])
        return Curve(units, *(load * one for one in self[1:]))


def doublings(ladder: tuple[float, ...]) -> tuple[int, ...]:
    """Return by how many doublings of its argument each unit follows from the next wider one.
    ladder : slip scales [rad], rising.

    Raises
    ------
    ValueError
        Where scales do not rise by powers of two.
    """
    if not ladder or not all(0.0 < scale < math.inf for scale in ladder):
        raise ValueError(f"ladder must hold positive slip scales, it is {ladder}")
    steps = []
    for narrow, wide in pairwise(ladder):
        power = math.log2(wide / narrow)
        if not (power > 0.5 and abs(power - round(power)) < 1e-9):
            raise ValueError(f"ladder must rise by powers of two, it is {ladder}")
        steps.append(round(power))
    return tuple(steps)


def hidden_units(x: Any, scales: Any, steps: tuple[int, ...]) -> Any:
    """Return tanh(x/α_j) (2, n).
    x : slip angles [rad], (2,).   scales : 1/α_j [1/rad], (1, n).   steps : from `doublings`.
    """
    T = tanh(scales[0, len(steps)] * x)
    E = (1 + T) / (1 - T)  # exp(2 x/α) of the widest unit, the same bits on every machine
    columns = [E]
    for count in reversed(steps):
        for _ in range(count):
            E = E * E
        columns.append(E)
    return 1 - 2 / (1 + ca.horzcat(*reversed(columns)))


def curve(x: Any, W: Any, scales: Any, steps: tuple[int, ...]) -> Curve:
    """Return the static force curve at a slip.
    x : slip angles [rad], (2,).   W : weights [static axle loads], (2, n).
    scales : 1/α_j [1/rad], (1, n).   steps : from `doublings`.
    """
    return of_units(hidden_units(x, scales, steps), W, scales)


def of_units(T: Any, W: Any, scales: Any) -> Curve:
    """Return the static force curve where its units are known.
    T : from `hidden_units`, (2, n).   W : weights [static axle loads], (2, n).
    scales : 1/α_j of the units [1/rad], (1, n).
    """
    inverse = ca.repmat(scales, 2, 1)
    slopes = W * (1 - T * T) * inverse
    slope, bend = ca.sum2(slopes), -2 * ca.sum2(T * slopes * inverse)
    least = 0.02 * larger(ca.sum2(W * inverse), 0.1)
    floored = slope < least
    return Curve(
        units=T,
        force=ca.sum2(W * T),
        slope=slope,
        carcass_slope=larger(slope, least),
        bend=ca.if_else(floored, 0, bend),
    )


def unit_matrix(alpha: Array, ladder: tuple[float, ...]) -> Array:
    """Return tanh(α/α_j) (k, n) in numpy.
    alpha : slip angles [rad], (k,).   ladder : slip scales [rad], (n,).
    """
    return np.tanh(np.asarray(alpha)[:, None] / np.array(ladder))


def unit_slopes(alpha: Array | float, ladder: tuple[float, ...]) -> Array:
    """Return the derivatives of tanh(α/α_j) over α in numpy, (..., n) [1/rad].
    alpha : slip angles [rad], (...).   ladder : slip scales [rad], (n,).
    """
    scales = np.array(ladder)
    at = np.minimum(np.asarray(alpha)[..., None] / scales, 300.0)  # whose cosh² is a number
    return 1.0 / (scales * np.cosh(at) ** 2)


# Where the model has been: how long it learnt, by range of slip.
#
# Slip counts with the larger of its two sizes, without lag and sway and with them: the first is
# what a reader of the recording sees, the second is what made the force.

EDGES = (0.0, 0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)  # rad
EXCITATION = Port(
    "excitation",
    "rad; s",
    "largest slip, then time of learning above each edge, per axle",
    learnt=True,
    rule=NOT_NEGATIVE,
)


def excited(state: Any, size: Any, *, dt: Any, samples: Any, learns: Any) -> Any:
    """Return the next state (2, 1 + edges): largest slip [rad], then time above `EDGES` [s].
    size : of slip [rad], (2,).   dt : sampling interval [s].
    samples : in which errors are correlated: one alone does not make a range known.
    learns : 1 where the axle learns, else 0, (2,).
    """
    largest = state[:, 0]
    largest += learns * smaller(1, 1 / samples) * larger(size - largest, 0)
    spent = dt * learns
    times = [state[:, 1 + k] + ca.if_else(size >= edge, spent, 0) for k, edge in enumerate(EDGES)]
    return ca.horzcat(largest, *times)
