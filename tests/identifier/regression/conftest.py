"""The filtered regression written out in numpy, by differences of samples: another road."""

import numpy as np
import pytest

from identifier.paper.network import Network
from identifier.regression import RegressionIdentifier


def known_rate(recording, car, unit):
    """ξ, b = A_ξ ξ + B_ξ u and the linear tire's force (n, 2), from Newton and Euler by hand."""
    p, (v_y, r) = car.bicycle, recording.x.T
    K_inv = np.linalg.inv(np.array([[1 / p.m, 1 / p.m], [p.l_f / p.I_z, -p.l_r / p.I_z]]))
    speed = recording.v_x
    alpha = recording.u - np.column_stack([v_y + p.l_f * r, v_y - p.l_r * r]) / speed[:, None]
    linear = alpha * [p.C_f, p.C_r]
    turning = np.column_stack([-speed * r, np.zeros_like(r)]) @ K_inv.T
    return recording.x @ K_inv.T / unit, (linear + turning) / unit, linear


def hidden(recording, design, V):
    """σ (n, n_h) of a network that reads x and u."""
    return np.tanh(np.column_stack([recording.x, recording.u]) / design.network.scale @ V.T)


def pairs_by_hand(recording, design, car):
    """s (n, n_h) and y (n, 2) [U], from the recursions with (ξ⁺ - ξ)/T."""
    V = design.network.initial_weights(np.random.default_rng(design.seed)).V
    xi, b, _ = known_rate(recording, car, design.force_unit)
    sigma, e = hidden(recording, design, V), np.exp(-design.filter_rate * design.dt)
    s, y = np.zeros_like(sigma), np.zeros_like(xi)
    for k in range(len(s) - 1):
        rate = (xi[k + 1] - xi[k]) / design.dt - (b[k] + b[k + 1]) / 2
        s[k + 1] = e * s[k] + (1 - e) * (sigma[k] + sigma[k + 1]) / 2
        y[k + 1] = e * y[k] + (1 - e) * rate
    return s, y


@pytest.fixture(name="pairs")
def the_pairs():
    """The function `pairs_by_hand(recording, design, car)`."""
    return pairs_by_hand


@pytest.fixture(name="design")
def a_design(car):
    """The function `design(law, **numbers)`: six hidden units, nothing rests, nothing projects."""

    def make(law="rls", **numbers):
        chosen = {
            "filter_rate": 4.0,
            "forgetting": 0.3,
            "learning_rate": 30.0,
            "ridge": 1e-3,
            "quiet": 0.0,
            "W_max": np.inf,
            "memory": 5,
            "network": Network(hidden=6),
        }
        return RegressionIdentifier(law=law, **{**chosen, **numbers})

    return make
