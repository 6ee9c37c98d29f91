"""The learning loop along a recorded run: how large its gain was, how close to the limit."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS
from identifier.paper.network import network_signals
from identifier.run import History
from identifier.stability.loop import (
    INTEGRATORS,
    Loop,
    along_run,
    direction_matrix,
    regressor_gains,
    strongest,
)
from identifier.stability.margins import gain_margin
from models.bicycle import BicycleParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopAlongRun:
    """The sampled loop at the regressor of every moving sample.

    Parameters
    ----------
    t : time (n,) [s].
    gain : largest eigenvalue of the loop gain (n,).
    radius : spectral radius of the sampled loop without leakage (n,); above one it is unstable,
        one where nothing is learnt.
    margin : sampled gain margin there [-].
    """

    t: Array
    gain: Array
    radius: Array
    strongest: int
    margin: float


def loop_along(history: History, design: PaperIdentifier) -> LoopAlongRun:
    """Evaluate the loop at the regressors and weights of a run.

    The network's input is taken from the measured state, which the estimate follows closely.
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


def network_inputs(history: History, design: PaperIdentifier) -> Array:
    """Return x̄ at every sample, (n, n_in).

    Parameters
    ----------
    history : a run; samples below the minimum speed count as driven at it.
    """
    recording, network = history.recording, design.network
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    parameters = BicycleParameters(*history.vehicle.bicycle)
    signals = network_signals(parameters, v_x, x, u)
    evaluate = ca.Function("x_bar", [x, u, v_x], [network.normalized_input(signals)])
    speed = np.maximum(recording.v_x, design.min_speed)
    columns = evaluate.map(recording.t.size)(recording.x.T, recording.u.T, speed[None, :])
    return np.array(columns).T
