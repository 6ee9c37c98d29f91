"""The paper's network in the prediction: the frozen model's own forces, weights as data."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.paper.network import Network
from mpc.tires import prediction_tire
from tests.identifier.conftest import network_model


@pytest.mark.parametrize(
    "network",
    [
        Network(),
        Network(hidden=3, inputs=("v_y", "r", "delta_f", "delta_r", "v_x"), scale=(1, 2, 3, 4, 5)),
        Network(hidden=7, inputs=("alpha_r", "alpha_f")),
    ],
)
def test_forces_are_those_of_the_frozen_model(network, car, motions, forces, at, rng):
    model = network_model(car, network, rng)
    predicted, _ = forces(prediction_tire(model), *at(motions))
    expected = model.predict(motions)
    np.testing.assert_allclose(predicted, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_scale_unit_and_stiffness_are_weights(car, rng):
    model = network_model(car, Network(), rng)
    others = (
        replace(model, force_unit=1.0),
        replace(model, network=replace(model.network, scale=(2.0, 1.0, 1.0, 1.0))),
        replace(model, vehicle=replace(car, cornering_stiffness_front=1.0e5)),
    )
    for other in others:
        assert prediction_tire(other).structure == prediction_tire(model).structure
        assert not np.array_equal(prediction_tire(other).weights, prediction_tire(model).weights)
