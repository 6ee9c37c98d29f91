"""Is a set of gains safe to drive with? All properties of a design, with limits and advice.

Judged at the worst regressor (|s|² = n_h, no leakage), so that a pass holds on every road; the
same loop at the regressors of a recorded run is `along_run`.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from identifier.gains import Gains
from identifier.laws import DrivingError
from identifier.stability.bound_checks import bound_checks
from identifier.stability.loop import (
    INTEGRATORS,
    Law,
    Loop,
    direction_matrix,
    linear_law,
    spectral_radius,
)
from identifier.stability.loop_checks import (
    drift_check,
    dynamics_checks,
    margin_checks,
    weight_check,
)
from identifier.stability.lyapunov import Matrix
from identifier.stability.operation import Operation, proven_bounds, worst_loop
from identifier.stability.property import Certificate, Property


def certify(gains: Gains, driving_error: DrivingError, operation: Operation) -> Certificate:
    """Return every property of the design.

    Parameters
    ----------
    gains : of (8) to (12).
    driving_error : of `identifier.laws`; the PI-lead law takes its τ from the gains.
    operation : where it runs.
    """
    law, D = linear_law(driving_error, gains.lead), direction_matrix(driving_error, gains.matrix)
    proven = proven_bounds(gains, law, operation, D)
    W, _, margins = judged_loop(gains, law, operation, D, proven.W)
    return Certificate(
        properties=(
            *dynamics_checks(gains, operation),
            *margins,
            weight_check(gains, operation, proven.W, W),
            drift_check(gains, law, operation, D),
            *bound_checks(gains, law, operation, D, proven),
        )
    )


def judged_loop(
    gains: Gains, law: Law, operation: Operation, direction: Matrix, kept: float
) -> tuple[float, Loop, list[Property]]:
    """Return the |W_hat| that margins are judged at, the worst loop there, and its margins.

    It is the proven bound, or where the margins do not hold up to it `W_large`.

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    direction : (2, 2) D [s].
    kept : |W_hat| that is proven [U].
    """
    loop = worst_loop(gains, law, operation, direction, kept)
    margins = margin_checks(loop, operation)
    if kept <= operation.W_large or (
        math.isfinite(kept) and all(entry.status == "pass" for entry in margins)
    ):
        return kept, loop, margins
    loop = worst_loop(gains, law, operation, direction, operation.W_large)
    return operation.W_large, loop, margin_checks(loop, operation)


def along_run(loop: Loop, gains_along: npt.ArrayLike, integrator: str, dt: float) -> Matrix:
    """Spectral radius of the sampled loop at each sample of a run, (n,).

    Parameters
    ----------
    loop : A_d, law and input of the design; its own G is not used.
    gains_along : (n, 2, 2) G along the run, from `regressor_gains`.
    integrator : "euler", "rk4" or "exact".
    dt : sampling interval [s].
    """
    G = np.asarray(gains_along, dtype=np.float64)
    unit = replace(loop, G=np.eye(2)).matrix()
    stack = np.repeat(unit[None], G.shape[0], axis=0)
    stack[:, 4:, :4] = G @ unit[4:, :4]
    return spectral_radius(stack, INTEGRATORS[integrator], dt)
