"""Is a set of gains safe to drive with? All properties of a design, with limits and advice.

Judged at the worst regressor (|s|² = n_h, no leakage), so that a pass holds on every road.
"""

import math

from codegen.arrays import Array
from identifier.certificate import Certificate, Property
from identifier.paper.laws import DrivingError, Gains, Law
from identifier.stability.checks import (
    bound_checks,
    drift_check,
    dynamics_checks,
    margin_checks,
    weight_check,
)
from identifier.stability.loop import Loop, direction_matrix
from identifier.stability.operation import Operation, proven_bounds, worst_loop


def certify(gains: Gains, law: Law, operation: Operation) -> Certificate:
    """Return every property of the design.
    gains : of (8) to (12).
    law : of `identifier.paper.laws.LAWS`; the PI-lead law takes its τ from the gains.
    """
    error, D = law.error(gains.lead), direction_matrix(law, gains.matrix)
    proven = proven_bounds(gains, error, operation, D)
    W, _, margins = judged_loop(gains, error, operation, D, proven.W)
    return Certificate(
        properties=(
            *dynamics_checks(gains, operation),
            *margins,
            weight_check(gains, operation, proven.W, W),
            drift_check(gains, error, operation, D),
            *bound_checks(gains, error, operation, D, proven),
        )
    )


def judged_loop(
    gains: Gains, law: DrivingError, operation: Operation, direction: Array, kept: float
) -> tuple[float, Loop, list[Property]]:
    """Return the |W_hat| that margins are judged at, the worst loop there, and its margins.

    It is the proven bound, or where the margins do not hold up to it `W_large`.
    gains : of (8) to (12).   direction : (2, 2) D [s].   kept : |W_hat| that is proven [U].
    """
    loop = worst_loop(gains, law, operation, direction, kept)
    margins = margin_checks(loop, operation)
    if kept <= operation.W_large or (
        math.isfinite(kept) and all(entry.status == "pass" for entry in margins)
    ):
        return kept, loop, margins
    loop = worst_loop(gains, law, operation, direction, operation.W_large)
    return operation.W_large, loop, margin_checks(loop, operation)
