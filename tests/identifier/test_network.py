"""The network: what it may read, and weights that follow from a seed."""

import casadi as ca
import numpy as np
import pytest

from identifier.paper.network import SIGNALS, Network, network_signals


def test_every_signal_can_be_read(car):
    """Slip angles among them, in the paper's sign; each divided by its scale."""
    p = car.bicycle
    network = Network(hidden=3, inputs=tuple(SIGNALS))
    x, u, v_x = np.array([0.4, 0.2]), np.array([0.05, -0.01]), 15.0
    x_bar = network.normalized_input(network_signals(p, v_x, ca.DM(x), ca.DM(u)))
    alpha = u - np.array([x[0] + p.l_f * x[1], x[0] - p.l_r * x[1]]) / v_x
    raw = np.concatenate([x, u, [v_x], alpha])
    np.testing.assert_allclose(np.array(x_bar)[:, 0], raw / list(SIGNALS.values()), rtol=1e-14)


def test_initial_weights_follow_from_the_generator():
    network = Network(hidden=7)
    one = network.initial_weights(np.random.default_rng(3))
    same = network.initial_weights(np.random.default_rng(3))
    other = network.initial_weights(np.random.default_rng(4))
    np.testing.assert_array_equal(one.V, same.V)
    assert np.abs(one.V - other.V).max() > 0.1
    assert one.W.shape == (2, 7)
    assert one.V.shape == (7, 4)


@pytest.mark.parametrize(
    "wrong",
    [
        {"hidden": 0}, {"inputs": ("v_y", "speed")}, {"inputs": ("v_y", "v_y")}, {"inputs": ()},
        {"scale": (1.0, 2.0)}, {"scale": (1.0, 2.0, 0.0, 1.0)},
    ],
)  # fmt: skip
def test_impossible_structures_are_refused(wrong):
    with pytest.raises(ValueError, match="must"):
        Network(**wrong)


def test_a_list_of_scales_makes_the_same_network_as_a_tuple():
    one = Network(inputs=["v_y", "r"], scale=[2.0, 3.0])
    two = Network(inputs=("v_y", "r"), scale=(2.0, 3.0))
    assert one == two and hash(one) == hash(two)
