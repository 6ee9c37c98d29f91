"""Is a set of gains safe to drive with? All properties of a design, with limits and advice.

Judged at the worst regressor (|s|² = n_h, no leakage), so that a pass holds on every road; the
same loop at the regressors of a recorded run is `along_run`.
"""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from identifier.certificate import Certificate, Property
from identifier.paper.laws import LAWS, DrivingError, Gains, Law
from identifier.paper.network import network_signals
from identifier.run import History
from identifier.stability.checks import (
    bound_checks,
    drift_check,
    dynamics_checks,
    margin_checks,
    weight_check,
)
from identifier.stability.loop import (
    INTEGRATORS,
    Loop,
    direction_matrix,
    regressor_gains,
    spectral_radius,
    strongest,
)
from identifier.stability.margins import gain_margin
from identifier.stability.operation import Operation, proven_bounds, worst_loop
from models.bicycle import BicycleParameters

if TYPE_CHECKING:
    from identifier.paper.design import PaperIdentifier  # which asks for this


def certify(gains: Gains, law: Law, operation: Operation) -> Certificate:
    """Return every property of the design.

    Parameters
    ----------
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

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
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


def along_run(loop: Loop, gains_along: ArrayLike, integrator: str, dt: float) -> Array:
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


# The learning loop along a recorded run: how large its gain was, how close to the limit.


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopAlongRun:
    """The sampled loop at the regressor of every moving sample.

    Parameters
    ----------
    t : time (n,) [s].
    gain : largest eigenvalue of the loop gain (n,).
    radius : spectral radius of the sampled loop without leakage (n,); above one it is unstable,
        one where nothing is learnt.
    strongest : index of the sample with the largest gain.
    margin : sampled gain margin there [-].
    """

    t: Array
    gain: Array
    radius: Array
    strongest: int
    margin: float


def loop_along(history: History, design: "PaperIdentifier") -> LoopAlongRun:
    """Evaluate the loop at the regressors and weights of a run.

    The network's input is taken from the measured state, which the estimate follows closely.

    Parameters
    ----------
    history : a run that did not diverge.
    design : the design that ran.
    """
    recording = history.recording
    moving = recording.v_x >= design.min_speed
    x_bar = network_inputs(history, design)[moving]
    W, V = history.state["W"][:-1][moving], history.state["V"][:-1][moving]
    s = np.tanh(np.einsum("nij,nj->ni", V, x_bar))
    gains = regressor_gains(
        eta_W=design.gains.eta_W, eta_V=design.gains.eta_V, s=s, x_bar=x_bar, W=W
    )
    worst, _ = strongest(gains)
    loop = Loop(
        A_d=design.gains.matrix,
        forgetting=design.gains.forgetting,
        law=LAWS[design.law].error(design.gains.lead),
        G=gains[worst],
        direction=direction_matrix(LAWS[design.law], design.gains.matrix),
    )
    return LoopAlongRun(
        t=recording.t[moving],
        gain=np.asarray(np.linalg.eigvalsh(gains)[:, -1], dtype=np.float64),
        radius=along_run(loop, gains, design.integrator, design.dt),
        strongest=worst,
        margin=gain_margin(loop, INTEGRATORS[design.integrator], design.dt).factor,
    )


def network_inputs(history: History, design: "PaperIdentifier") -> Array:
    """Return x̄ at every sample, (n, n_in).

    Parameters
    ----------
    history : a run; samples below the minimum speed count as driven at it.
    design : the design that ran.
    """
    recording, network = history.recording, design.network
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    parameters = BicycleParameters(*history.vehicle.bicycle)
    signals = network_signals(parameters, v_x, x, u)
    evaluate = ca.Function("x_bar", [x, u, v_x], [network.normalized_input(signals)])
    speed = np.maximum(recording.v_x, design.min_speed)
    columns = evaluate.map(recording.t.size)(recording.x.T, recording.u.T, speed[None, :])
    return np.array(columns).T
