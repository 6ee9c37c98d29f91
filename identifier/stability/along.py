"""The learning loop along a recorded run: how large its gain was, how close to the limit."""

from typing import NamedTuple

import casadi as ca
import numpy as np

from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS
from identifier.paper.network import network_signals
from identifier.run import History
from identifier.stability.loop import (
    INTEGRATORS,
    Loop,
    direction_matrix,
    regressor_gains,
    strongest,
)
from identifier.stability.margins import gain_margin
from models.bicycle import BicycleParameters


class _Strongest(NamedTuple):
    """The moving sample of a run with the largest loop gain: its time [s], λ_max(G) and the sampled
    gain margin there [-].
    """

    t: float
    gain: float
    margin: float


def strongest_along(history: History, design: PaperIdentifier) -> _Strongest:
    """Evaluate the loop at the regressors and weights of a run.

    The network's input is taken from the measured state, which the estimate follows closely.
    """
    recording, network = history.recording, design.network
    moving = recording.v_x >= design.min_speed
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    signals = network_signals(BicycleParameters(*history.vehicle.bicycle), v_x, x, u)
    evaluate = ca.Function("x_bar", [x, u, v_x], [network.normalized_input(signals)])
    sampled = recording.x[moving].T, recording.u[moving].T, recording.v_x[moving][None, :]
    x_bar = np.array(evaluate.map(int(moving.sum()))(*sampled)).T
    W, V = history.state["W"][:-1][moving], history.state["V"][:-1][moving]
    s, gains = np.tanh(np.einsum("nij,nj->ni", V, x_bar)), design.gains
    G = regressor_gains(eta_W=gains.eta_W, eta_V=gains.eta_V, s=s, x_bar=x_bar, W=W)
    at, largest = strongest(G)
    law = LAWS[design.law]
    loop = Loop(
        A_d=gains.matrix,
        forgetting=gains.forgetting,
        law=law.error(gains.lead),
        G=G[at],
        direction=direction_matrix(law, gains.matrix),
    )
    margin = gain_margin(loop, INTEGRATORS[design.integrator], design.dt).factor
    return _Strongest(float(recording.t[moving][at]), largest, margin)
