"""A user's network in the prediction: its tensors are run-time weights."""

import casadi as ca
import numpy as np
import pytest

from identifier.own_network import OnnxModel
from mpc.prediction import build_stage
from mpc.tires import prediction_tire
from mpc.tires.tire import ALL

onnx = pytest.importorskip("onnx", reason="needs the package onnx")


def network_file(rng, *, hidden=6, activation="Tanh", scale=0.1, unit=1000.0):
    """[α_f, α_r] over a scale, a biased hidden layer, forces times a unit (of kN in N)."""
    make, tensor = onnx.helper.make_node, onnx.numpy_helper.from_array
    first, second = np.zeros((2, hidden)), np.zeros((hidden, 2))
    half = hidden // 2
    first[0, :half], first[1, half:] = rng.uniform(0.5, 2.0, (2, half))
    second[:half, 0], second[half:, 1] = rng.uniform(0.5, 1.5, (2, half))
    numbers = {
        "s": np.array([scale, scale]),
        "W": first,
        "b": np.concatenate([rng.normal(0.0, 0.1, hidden - 1), [0.0]]),
        "U": second * (1000.0 / unit),  # so that U times k is newtons, whatever k is
        "k": np.array(unit),
    }
    nodes = [
        make("Div", ["x", "s"], ["x_bar"]),
        make("Gemm", ["x_bar", "W", "b"], ["z"]),
        make(activation, ["z"], ["h"]),
        make("MatMul", ["h", "U"], ["f"]),
        make("Mul", ["f", "k"], ["y"]),
    ]
    kind = onnx.TensorProto.DOUBLE
    ports = [onnx.helper.make_tensor_value_info(name, kind, ["n", 2]) for name in ("x", "y")]
    graph = onnx.helper.make_graph(
        nodes, "tire", ports[:1], ports[1:], [tensor(v, name) for name, v in numbers.items()]
    )
    opset = [onnx.helper.make_opsetid("", 13)]
    return onnx.helper.make_model(graph, opset_imports=opset, ir_version=7).SerializeToString()


def own_forces(model, recording):
    rows = zip(recording.x, recording.u, recording.v_x, strict=True)
    return np.array(
        [np.array(model.step(x, u, v, model.vehicle.bicycle)).ravel() for x, u, v in rows]
    )


@pytest.mark.parametrize("activation", ["Tanh", "Sigmoid", "Relu"])
def test_forces_are_those_of_the_network(car, motions, forces, at, rng, activation):
    model = OnnxModel(vehicle=car, content=network_file(rng, activation=activation))
    predicted, _ = forces(prediction_tire(model), *at(motions))
    expected = own_forces(model, motions)
    np.testing.assert_allclose(predicted, expected, rtol=1e-9, atol=1e-6)


def test_a_network_in_the_sign_of_iso_is_turned_about(car, motions, forces, at, rng):
    content = network_file(rng, scale=-0.1)
    model = OnnxModel(vehicle=car, content=content, slip_sign=-1)
    predicted, _ = forces(prediction_tire(model), *at(motions))
    np.testing.assert_allclose(predicted, own_forces(model, motions), rtol=1e-9, atol=1e-6)


def test_a_retrained_network_is_other_weights_only(car, rng):
    one, other = (
        prediction_tire(OnnxModel(vehicle=car, content=network_file(rng, scale=scale)))
        for scale in (0.1, 0.07)
    )
    assert one.structure == other.structure
    assert build_stage(one.structure) is build_stage(other.structure)
    assert one.weights.size == one.structure.n_weights
    assert np.flatnonzero(one.weights != other.weights).size >= 2 + 6 + 5 + 6
    larger = prediction_tire(OnnxModel(vehicle=car, content=network_file(rng, hidden=8)))
    assert larger.structure != one.structure
    assert len(repr(one.structure)) < 200


def test_its_stage_has_the_derivatives_of_the_network(car, rng):
    model = OnnxModel(vehicle=car, content=network_file(rng))
    tire = prediction_tire(model)
    x, u, dt = np.array([0.2, 0.05, 0.5, 0.2, 0.05]), 0.1, 1e-4
    result = build_stage(tire.structure)(
        x, u, 0.01, 20.0, dt, tire.car, tire.weights, *ALL, np.ones(7)
    )
    state, steer = ca.MX.sym("state", 2), ca.MX.sym("steer", 2)
    force = model.step(state, steer, 20.0, car.bicycle)
    slope = ca.Function("slope", [state, steer], [ca.jacobian(force, state)])(x[2:4], [x[4], 0.0])
    K = np.array([[1 / car.mass] * 2, [car.l_f / car.yaw_inertia, -car.l_r / car.yaw_inertia]])
    expected = K @ np.array(slope) - np.array([[0.0, 20.0], [0.0, 0.0]])
    np.testing.assert_allclose(
        (np.array(result[1])[2:4, 2:4] - np.eye(2)) / dt, expected, rtol=0.01
    )


@pytest.mark.parametrize(("unit", "learnt"), [(0.5, 0), (2.0, 0), (1 / 3, 1), (1000.0, 1)])
def test_halves_and_small_whole_numbers_are_of_the_formula_others_are_weights(
    car, rng, unit, learnt
):
    tire = prediction_tire(OnnxModel(vehicle=car, content=network_file(rng, unit=unit)))
    assert np.count_nonzero(tire.weights == unit) == learnt
