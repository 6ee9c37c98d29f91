"""Where the friction of the road changes inside drives: segments with a grip of their own.

At the estimate without segments the loss of each residual is computed for a grid of frictions m
(the curve is m φ(x/m)); the piecewise constant friction of least loss, with a price for each
change, is found by dynamic programming (Viterbi). The segments are then estimated with all
parameters, and kept where that gains more than the price.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.estimate.drive import Drive
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import Priors
from identifier.estimate.solve import NU, Problem, estimate
from models.vehicle import Vehicle

PRICE = 12.0  # [nats] of a change of friction
_BIN = 10  # residuals, half a second, on one road
LEAST_CHANGE = 0.1  # |ln m|, below which segments are one road
# |ln m| and gain [nats], from which a log is on another road than tires that it adds to: of 324
# logs of 36 random cars on the same road 4 gained more than 12, of 140 fresh ones none gained 18;
# at 0.6 of the friction 10 of 12 slaloms and 9 of 12 gentle laps did
_ANOTHER, _PRICE_OF_ROAD = 0.25, 18.0
_MOST_SCALE = 1.5  # S [-] of residuals, in search of segments
_MOST_MEMORY = 4.0  # T [s] of residuals, in search of segments
_ROUNDS = 2  # of finding segments anew at the better estimate

GRID = np.linspace(-1.35, 0.6, 14)  # ln m: 0.26 to 1.8
# Between are polynomials over Chebyshev's nodes: e is smooth, within 0.01 b on a sedan's drive.
_ASKED = 0.5 * (GRID[0] + GRID[-1] + np.ptp(GRID) * np.cos(np.pi * (np.arange(6) + 0.5) / 6))
_SHARES = np.vander(GRID, 6) @ np.linalg.inv(np.vander(_ASKED, 6))


class Roads(NamedTuple):
    """Which road each sample of each drive is on, and the estimate with them.
    labels : by drive, (n,); 0 is the road of the curves.   ln_m : of roads 1 to K (K,).   sd : of
    these.
    """

    labels: tuple[NDArray[np.intp], ...]
    ln_m: Array
    sd: Array


def with_roads(
    drives: Sequence[Drive], vehicle: Vehicle, priors: Priors, plain: Posterior
) -> tuple[Posterior, Roads | None]:
    """Return the estimate with a friction of each segment where that is worth its price.
    plain : the estimate without segments.
    """
    best, roads = plain, None
    for _ in range(_ROUNDS):
        labels = _segments(drives, vehicle, priors, best)
        count = 1 + max(int(one.max()) for one in labels)
        if count == 1:
            break
        found = estimate(drives, vehicle, priors, best.p, labels=labels)
        ln_m = found.roads
        changes = sum(int(np.count_nonzero(np.diff(one))) for one in labels) + len(drives) - 1
        one_road = Problem(drives, vehicle, priors)
        before = one_road.cost(one_road.misses(plain.p), plain.p, found.memory)
        gained = before - found.cost - PRICE * max(changes, 1)
        if gained <= 0.0 or np.abs(ln_m).max() < LEAST_CHANGE:
            break
        best, roads = found, Roads(labels, ln_m, found.road_sd)
    return best, roads


def road_of(
    drives: Sequence[Drive], vehicle: Vehicle, beliefs: Priors, plain: Posterior
) -> float | None:
    """Return the friction of drives over that of the tires of beliefs; None where it is the same.
    plain : the estimate on the same road.
    """
    labels = tuple(np.ones(len(one.signals), dtype=np.intp) for one in drives)
    found = estimate(drives, vehicle, beliefs, plain.p, labels=labels)
    same, ln_m = Problem(drives, vehicle, beliefs), float(found.roads[0])
    gained = same.cost(same.misses(plain.p), plain.p, found.memory) - found.cost
    return float(np.exp(ln_m)) if gained > _PRICE_OF_ROAD and abs(ln_m) >= _ANOTHER else None


def _segments(
    drives: Sequence[Drive],
    vehicle: Vehicle,
    priors: Priors,
    at: Posterior,
) -> tuple[NDArray[np.intp], ...]:
    """Return which road each sample is on, 0 the longest, by dynamic programming."""
    problem = Problem(drives, vehicle, priors).thinned()
    weight = problem.weight[:, None]
    # A fit between two roads misses much, for long: that must not hide them.
    S2, T = np.minimum(at.scale, _MOST_SCALE) ** 2, np.minimum(at.memory, _MOST_MEMORY)
    loss = np.empty((len(GRID), len(weight)))
    asked = np.array([problem.misses(at.p, float(ln_m)) for ln_m in _ASKED])
    for k, share in enumerate(_SHARES):
        e = np.tensordot(share, asked, 1)
        loss[k] = (weight / T * (NU + 1.0) / 2.0 * np.log1p(e**2 / (NU * S2))).sum(axis=1)
    count = loss.shape[1]
    bins = np.arange(0, count, _BIN)
    path = _cheapest(np.add.reduceat(loss, bins, axis=1), PRICE).repeat(_BIN)[:count]
    found, begin = [], 0
    for k, one in enumerate(drives):
        length = problem.lengths[k]
        mine = np.zeros(len(one.signals), dtype=np.intp)
        if length:
            steps = path[begin : begin + length]
            nearest = np.searchsorted(problem.times(k), one.t, side="right") - 1
            mine = steps[np.clip(nearest, 0, length - 1)]
        found.append(mine)
        begin += length
    return _ranked(found)


def _cheapest(loss: Array, price: float) -> NDArray[np.intp]:
    """Return the states of least loss when each change has a price, (m,).
    loss : of each state at each step (k, m) [nats].
    """
    states, steps = loss.shape
    total = loss[:, 0].copy()
    came = np.empty((steps, states), dtype=np.intp)
    here = np.arange(states)
    for step in range(1, steps):
        best = int(np.argmin(total))
        changes = total[best] + price < total
        came[step] = np.where(changes, best, here)
        total = np.where(changes, total[best] + price, total) + loss[:, step]
    path = np.empty(steps, dtype=np.intp)
    path[-1] = int(np.argmin(total))
    for step in range(steps - 1, 0, -1):
        path[step - 1] = came[step, path[step]]
    return path


def _ranked(found: list[NDArray[np.intp]]) -> tuple[NDArray[np.intp], ...]:
    """Return labels that count roads by the time on them, the longest 0; alike ones are one."""
    whole = np.concatenate(found)
    states, counts = np.unique(whole, return_counts=True)
    order: dict[int, int] = {}
    for state in states[np.argsort(-counts)]:
        alike = [known for known in order if abs(GRID[known] - GRID[state]) < LEAST_CHANGE]
        order[int(state)] = order[alike[0]] if alike else len(set(order.values()))
    table = np.zeros(len(GRID), dtype=np.intp)
    for state, label in order.items():
        table[state] = label
    return tuple(table[one] for one in found)
