"""A tire on a road of another friction, and the friction that explains the last moments best.

Similarity: φ(α) = μ φ₀(α/μ): the stiffness stays, force and the slip of the peak shrink. Ladders
and networks of slip keep their structure under it, so that only weights change. One number is
known after a third of a second, when a whole curve is not.
"""

import math
from typing import NamedTuple

import numpy as np

from mpc.handover.misfit import Array, Judge, Misfit
from mpc.tires import TireModel
from mpc.tires.ladder import N_AXLE, N_COMMON, LadderAxles
from mpc.tires.network import NetworkAxles

LEAST = 0.15  # of the friction that a tire was learnt on: ice, after a dry road
GRID = 13
DOUBT = 0.7  # standard deviation of ln μ where nothing is seen


class FrictionFit(NamedTuple):
    """Friction over that of the tire it began with [-], the tire, and how it explains the samples.

    `gain` is by how much the misfit, with what is known of roads, is better than without a change.
    """

    ratio: float
    tire: TireModel
    misfit: Misfit
    gain: float


def can_scale(tire: TireModel) -> bool:
    """Return whether a tire can be told for another friction.

    Parameters
    ----------
    tire : the tire.
    """
    if isinstance(tire.structure, NetworkAxles):
        return "v_x" not in tire.structure.inputs
    return isinstance(tire.structure, LadderAxles)


def at_friction(tire: TireModel, ratio: float) -> TireModel:
    """Return a tire where the friction is another.

    Parameters
    ----------
    tire : a ladder, or a network that does not read the speed.
    ratio : friction over the one that the tire has [-].

    Raises
    ------
    ValueError
        Where the tire's structure has no such weights, or the ratio is not positive.
    """
    if not 0.0 < ratio < math.inf:
        raise ValueError(f"ratio must be positive, it is {ratio}")
    structure, w = tire.structure, tire.weights.copy()
    if not can_scale(tire):
        raise ValueError(f"a {type(structure).__name__} cannot be told for another friction")
    if isinstance(structure, LadderAxles):
        n = structure.units
        w[N_COMMON : N_COMMON + n] /= ratio  # 1/α_j
        axles = w[N_COMMON + n :].reshape(2, -1)  # a view
        axles[:, N_AXLE:] *= ratio
    elif isinstance(structure, NetworkAxles):  # C α is its own similar
        end = 2 + 2 * structure.hidden
        w[2:end] *= ratio
        w[end:] /= ratio
    return tire._replace(weights=w)


def fit_friction(
    judge: Judge,
    tire: TireModel,
    samples: Array,
    *,
    known: float = 1.0,
    between: tuple[float, float] = (LEAST, 1.0),
    scale: float = 1.0,
) -> FrictionFit:
    """Return the friction that explains samples best, and what is known of roads beforehand.

    Parameters
    ----------
    judge : of misfits.
    tire : as `at_friction` takes it.
    samples : as `Judge.errors` takes them.
    known : friction over that of the tire that was taken so far [-].
    between : least and largest friction over that of the tire that is looked for [-].
    scale : of misfits: they are that many times as large as expected even of a good tire [-].

    Raises
    ------
    ValueError
        Where the tire cannot be told for another friction.
    """
    center, (least, most) = math.log(known), np.log(between)

    def costs(log_ratios: Array) -> tuple[Array, list[Misfit]]:
        weights = np.stack([at_friction(tire, math.exp(at)).weights for at in log_ratios])
        misfits = judge.misfits(tire, weights, samples)
        total = np.array([misfit.total for misfit in misfits])
        return total / scale + ((log_ratios - center) / DOUBT) ** 2, misfits

    grid = np.linspace(least, most, GRID)
    cost, _ = costs(grid)
    around = grid[int(np.argmin(cost))] + (grid[1] - grid[0]) * np.linspace(-1.0, 1.0, GRID)
    fine = np.append(np.clip(around, least, most)[:-1], center)  # what is known, too
    cost, misfits = costs(fine)
    best = int(np.argmin(cost))
    ratio = math.exp(fine[best])
    gain = float(cost[-1] - cost[best])
    return FrictionFit(ratio, at_friction(tire, ratio), misfits[best], gain)
