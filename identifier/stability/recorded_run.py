"""The learning loop along a recorded run: how large its gain was, how close to the limit it came."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identifier.history import History
from identifier.laws import DRIVING_ERRORS
from identifier.network import network_signals
from identifier.stability.certificate import along_run
from identifier.stability.loop import Loop, linear_law
from identifier.stability.regressor_gain import regressor_gains
from models.bicycle import BicycleParameters

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopAlongRun:
    """The sampled loop at the regressor of every moving sample.

    Parameters
    ----------
    t : time (n,) [s].
    gain : largest eigenvalue of the loop gain (n,).
    radius : spectral radius of the sampled loop without leakage (n,); below one it is stable.
    """

    t: Array
    gain: Array
    radius: Array

    @property
    def worst(self) -> int:
        """Index of the sample with the largest spectral radius."""
        return int(np.argmax(self.radius))


def loop_along(history: History) -> LoopAlongRun:
    """Evaluate the loop at the regressors and weights of a run.

    The network's input is taken from the measured state, which the estimate follows closely.

    Parameters
    ----------
    history : a run that did not diverge.
    """
    design, recording = history.design, history.recording
    moving = recording.v_x >= design.min_speed
    x_bar = network_inputs(history)[moving]
    W, V = history.W[:-1][moving], history.V[:-1][moving]
    s = np.tanh(np.einsum("nij,nj->ni", V, x_bar))
    gains = regressor_gains(
        eta_W=design.gains.eta_W, eta_V=design.gains.eta_V, s=s, x_bar=x_bar, W=W
    )
    loop = Loop(
        A_d=design.gains.matrix,
        forgetting=design.gains.forgetting,
        law=linear_law(DRIVING_ERRORS[design.law], design.gains.lead),
        G=np.eye(2),
    )
    return LoopAlongRun(
        t=recording.t[moving],
        gain=np.linalg.eigvalsh(gains)[:, -1],
        radius=along_run(loop, gains, design.integrator, design.dt),
    )


def network_inputs(history: History) -> Array:
    """Return x̄ at every sample, (n, n_in).

    Parameters
    ----------
    history : a run; samples below the minimum speed count as driven at it.
    """
    recording, network = history.recording, history.design.network
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    parameters = BicycleParameters(*history.vehicle.bicycle)
    signals = network_signals(parameters, v_x, x, u)
    evaluate = ca.Function("x_bar", [x, u, v_x], [network.normalized_input(signals)])
    speed = np.maximum(recording.v_x, history.design.min_speed)
    columns = evaluate.map(recording.t.size)(recording.x.T, recording.u.T, speed[None, :])
    return np.array(columns).T
