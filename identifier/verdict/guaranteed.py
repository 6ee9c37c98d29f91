"""The guaranteed band: forces between which the true one lies, under a bound that is stated.

Of the motion alone, in means over moments of 0.3 s, weighted by a triangle g_k that is not negative
and sums up to one: y = Σ g_k (dξ/dt + v_x r/g)_k, where the derivative is moved to g, and
h = Σ g_k (T cos δ)_k. Where |F/F_z - φ_w cos δ| <= e (1 + β) + τ ρ at every instant, the same holds
of the means, whatever the force does: a mean of errors is no larger than the largest.

The bound that is estimated is `CHOSEN.reserve` times the least one with which any curve fits the
drive, and a little more: the quick part of errors, which means hide, has to find room in it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from codegen.errors import TireidError
from identifier.axle.guarantee import (
    ForceBound,
    HalfSpaces,
    PossibleWeights,
    Strips,
    least_bound,
    possible_weights,
)
from identifier.axle.learning import Regression
from identifier.axle.model import AxleModel
from identifier.run import History
from identifier.tire_model import AXLES, TireModel
from identifier.verdict.chosen import CHOSEN
from identifier.verdict.motion import Windows, brisk_from, impulse_signals
from identifier.verdict.parts import asked_run
from models.recordings import Recording

_OVER_ERROR = 0.25 * Regression().error  # static axle loads, added before the reserve
_OVER_LATENESS = Regression().lateness  # s, added before the reserve


class BoundViolatedError(TireidError, ValueError):
    """No tire's curve satisfies the given bound: the drive contradicts it."""


def strips_of(model: TireModel, recording: Recording, road: Array | None = None) -> Strips | None:
    """Return what a drive says of the weights of a model; None where too little is driven.

    None without a lateral velocity that was measured: slip would be what the model makes of it.
    None of a model whose forces are no curves of slip.
    model : frozen; its lag, sway and offsets make the slip.
    road : what a banked road pushes to the left at each sample [weights], (n,); None unknown.
    """
    if recording.logged_v_y is None or not isinstance(model, AxleModel):
        return None
    drives = recording.v_x >= brisk_from(model)
    windows = Windows.where(drives, recording, CHOSEN.window, CHOSEN.overlapping)
    if len(windows) < CHOSEN.fewest:
        return None
    units, doubt = model.signals_of(recording)
    g, slope = triangle(windows.n, recording.dt)
    impulse, sideways = impulse_signals(recording, model.vehicle, road)

    def mean(signal: Array, weights: Array) -> Array:
        flat = signal.reshape(len(signal), -1)
        columns = [np.correlate(column, weights, "valid")[windows.starts] for column in flat.T]
        return np.stack(columns, axis=1).reshape(-1, *signal.shape[1:])

    return Strips(
        y=mean(impulse, slope) + mean(sideways[:, None], g),
        h=mean(units, g),
        beyond=mean(doubt.beyond, g),
        rate=mean(doubt.rate, g),
        lost=mean(doubt.lost, g),
        v_x=mean(recording.v_x[:, None], g)[:, 0],
        t=recording.t[windows.starts],
    )


def triangle(n: int, dt: float) -> tuple[Array, Array]:
    """Return g (n + 1,), and the weights whose product with ξ is Σ g dξ/dt [1/s].
    dt : sampling interval [s].
    """
    step = np.minimum(np.arange(n) + 0.5, n - np.arange(n) - 0.5)  # of each step, in its middle
    step /= step.sum()
    around = np.pad(step, 1)
    return 0.5 * (around[1:] + around[:-1]), (around[:-1] - around[1:]) / dt


def guaranteed(
    history: History,
    bound: float | ForceBound | None = None,
    t: float | None = None,
    model: TireModel | None = None,
) -> TireModel:
    """Return the model frozen at a time with its guaranteed band; without where there is none.

    There is none where the method learns no curve of slip, no lateral velocity was measured, or too
    little is driven.
    bound : of the errors: their size [static axle loads] of both axles, or a `ForceBound`; None
        estimates it from the drive.
    t : time of the freeze in the recording's own clock [s]; None is the end.
    model : frozen at that time, which is to carry it, as of `calibrated`; None freezes one.
    """
    given = None if bound is None else ForceBound.of(bound)
    run = asked_run(history, t)
    carries, limits = run.model if model is None else model, history.design.limits
    if limits is None or not isinstance(carries, AxleModel):
        return carries
    box = limits.curves
    strips = strips_of(run.model, run.portion.recording, run.road)
    if strips is not None and run.until is not None:
        strips = strips.until(
            int(np.searchsorted(strips.t, run.until - CHOSEN.window, side="right"))
        )
    if strips is None or len(strips.t) < CHOSEN.fewest:
        return carries
    chosen = _estimated_bound(strips, box) if given is None else given
    corners = []
    for axle in range(2):
        found = possible_weights(strips, axle, chosen, box)
        if found is None:
            raise _violated(strips, axle, chosen, box)
        corners.append(found)
    possible = PossibleWeights(
        bound=chosen,
        given=given is not None,
        corners=(corners[0], corners[1]),
        speed=float(strips.v_x.mean()),
        fastest=fastest(strips),
    )
    return replace(carries, possible=possible)


def fastest(strips: Strips) -> tuple[float, float]:
    """Return the largest rate of the force that a drive shows, of both axles [static axle
    loads/s].
    """
    front, rear = np.maximum(strips.rate.max(axis=0), CHOSEN.slowest)
    return float(front), float(rear)


def _estimated_bound(strips: Strips, box: HalfSpaces) -> ForceBound:
    """Return the bound that a drive tells: the least that any curve keeps, with a reserve."""
    (e_f, tau_f), (e_r, tau_r) = (least_bound(strips, axle, box) for axle in range(2))
    return ForceBound(
        error=(CHOSEN.reserve * (e_f + _OVER_ERROR), CHOSEN.reserve * (e_r + _OVER_ERROR)),
        lateness=(
            CHOSEN.reserve * (tau_f + _OVER_LATENESS),
            CHOSEN.reserve * (tau_r + _OVER_LATENESS),
        ),
    )


def _violated(strips: Strips, axle: int, bound: ForceBound, box: HalfSpaces) -> BoundViolatedError:
    """Return what to raise: since when no curve keeps the bound, and the least that one does."""
    first, last = 0, len(strips.t)  # none contradict one another, some do
    while last - first > 1:
        middle = (first + last) // 2
        if possible_weights(strips.until(middle), axle, bound, box) is None:
            last = middle
        else:
            first = middle
    least, late = least_bound(strips, axle, box)
    return BoundViolatedError(
        f"the bound of {bound.error[axle]:g} static axle loads and {bound.lateness[axle]:g} s is "
        f"violated at the {AXLES[axle]} axle: no curve satisfies it from {strips.t[last - 1]:g} s "
        f"on; the least one that fits is {least:.3g} and {late:.3g} s"
    )


def contradictions(
    model: TireModel, recording: Recording, road: Array | None = None
) -> tuple[Array, NDArray[np.bool_]] | None:
    """Return which moments of a drive no possible curve explains: when they begin, and which axle.

    Times [s], (m,), and (m, 2). One is enough: other tires, another road, or a sensor that is
    wrong. None where the model has no guarantee, or too little is driven.
    """
    if model.guarantee is None:
        return None
    strips = strips_of(model, recording, road)
    if strips is None:
        return None
    return strips.t, model.guarantee.possible.contradicted(strips)
