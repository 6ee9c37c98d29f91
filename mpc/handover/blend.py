"""Moving weights to new ones so gently that the plan does not jump."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mpc.tires import TireModel

HALVINGS = 6


class Step(NamedTuple):
    """A move of the weights.

    tire : to steer with now.   share : of the way that was left [-], 0 where nothing could move.
    jump : of the steering rate that comes from it [rad/s].   arrived : whether nothing is left.
    """

    tire: TireModel
    share: float
    jump: float
    arrived: bool


def blended(
    now: TireModel,
    target: TireModel,
    share: float,
    *,
    planned: Callable[[TireModel], float],
    most: float,
) -> Step:
    """Return the next weights on the way to a target, on which the plan does not jump.

    The share is halved until the tracker, asked what it would plan with the weights in the same
    situation, answers within the bound; where no share of the way is small enough, weights stay.

    Parameters
    ----------
    now : tire in use.
    target : tire to arrive at, of the same structure.
    share : of the way that is left, to go at most [-], in (0, 1].
    planned : first steering rate of the plan that a tire leads to, in one situation [rad/s].
    most : change of it that is allowed [rad/s].

    Raises
    ------
    ValueError
        Where the structures differ.
    """
    if now.structure != target.structure:
        raise ValueError(f"weights of {now.structure} cannot move to those of {target.structure}")
    way = target.weights - now.weights
    if not np.any(way):
        return Step(target, 1.0, 0.0, True)
    reference = planned(now)
    for _ in range(HALVINGS):
        whole = share >= 1.0
        tire = target if whole else now._replace(weights=now.weights + share * way)
        jump = abs(planned(tire) - reference)
        if jump <= most:
            return Step(tire, share, jump, whole)
        share *= 0.5
    return Step(now, 0.0, 0.0, False)
