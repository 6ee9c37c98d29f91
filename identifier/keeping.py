"""What keeps the weights of the paper's network over hours of driving, by name.

"leakage" is the paper's (11)-(12): it never rests, so that sensor noise, and every error that the
network cannot learn, takes the weights to zero in hours of calm driving. "dead_zone" lets only that
leak which lies beyond a ball; "projection" has no leakage, and keeps the weights in the same ball.

The ball of W has twice the smallest weights that hold the force which the linear tire is expected
to miss, every unit saturated: those of units that are half open. That of V has twice the norm that
random first weights are expected to have. Neither reads anything but the car and its driving.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from identifier.design import Design
from identifier.gains import Gains
from identifier.laws import DRIVING_ERRORS
from identifier.stability.loop import direction_matrix, linear_law
from identifier.stability.operation import Operation, proven_bounds


def leakage(gains: Gains, known: Operation) -> Gains:
    """Return the gains as they are: the paper's leakage alone.

    Parameters
    ----------
    gains : of `design_gains`.
    known : where the design runs.
    """
    del known
    return gains


def dead_zone(gains: Gains, known: Operation) -> Gains:
    """Return the gains with a leakage of what lies beyond the balls.

    Parameters
    ----------
    gains : of `design_gains`.
    known : where the design runs.
    """
    return replace(gains, W_free=known.W_large, V_free=known.V_start)


def projection(gains: Gains, known: Operation) -> Gains:
    """Return the gains with a projection on the balls, and no leakage.

    Parameters
    ----------
    gains : of `design_gains`.
    known : where the design runs.
    """
    return replace(gains, rho_W=0.0, rho_V=0.0, W_max=known.W_large, V_max=known.V_start)


KEEPINGS: Mapping[str, Callable[[Gains, Operation], Gains]] = {
    "leakage": leakage,
    "dead_zone": dead_zone,
    "projection": projection,
}
DEFAULT_KEEPING = "projection"  # of designs that are found; measured by benchmarks/forgetting.py


def with_keeping(design: Design, known: Operation, keeping: str) -> Design:
    """Return the design with its weights kept otherwise, η_V lowered where V would cost margin.

    Parameters
    ----------
    design : of the paper's leakage, as `design_for` finds it.
    known : where it runs, `identifier.defaults.natural_operation`.
    keeping : one of `KEEPINGS`.

    Raises
    ------
    ValueError
        Where the name is unknown, or the design has a dead zone or a projection already.
    """
    if keeping not in KEEPINGS:
        raise ValueError(f"keeping must be one of {list(KEEPINGS)}, not {keeping!r}")
    first = design.gains
    if first.W_free or first.V_free or np.isfinite([first.W_max, first.V_max]).any():
        raise ValueError("the weights of this design are kept by a dead zone or a projection")
    gains = KEEPINGS[keeping](first, known)
    if gains == first:
        return design
    driving_error = DRIVING_ERRORS[design.law]
    law, D = linear_law(driving_error, gains.lead), direction_matrix(driving_error, gains.matrix)
    W = proven_bounds(gains, law, known, D).W
    free_of_cost = gains.eta_W / (known.x_bar_max * W) ** 2  # rule 5 of `gain_design`
    return replace(design, gains=replace(gains, eta_V=min(gains.eta_V, free_of_cost)))
