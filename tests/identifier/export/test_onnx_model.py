"""A user's own tire network as a frozen model."""

import json
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.export.onnx import onnx_bytes
from identifier.frozen import FrozenModelError
from identifier.own_network import OnnxModel, UnusableNetworkError, read_network
from identifier.paper.network import Network, NetworkModel, Weights
from identifier.tire_model import load_model
from models.bicycle import slip_angles

onnx = pytest.importorskip("onnx", reason="needs the package onnx")
runtime = pytest.importorskip("onnxruntime", reason="needs the package onnxruntime")


def network_file(
    weights, *, activation="Tanh", batch="batch", number=np.float32, inputs=None, outputs=None
):
    """A dense network as other tools write it; weights: [(in, out), ...]."""
    kind = onnx.helper.np_dtype_to_tensor_dtype(np.dtype(number))
    inputs = inputs or [("input", weights[0].shape[0])]
    outputs = outputs or [("output", weights[-1].shape[1])]
    shape = [] if batch is None else [batch]
    nodes, value = [], inputs[0][0]
    if len(inputs) > 1:
        value = "joined"
        nodes.append(onnx.helper.make_node("Concat", [n for n, _ in inputs], [value], axis=-1))
    for i, _ in enumerate(weights):
        last = i == len(weights) - 1
        product = outputs[0][0] if last and len(outputs) == 1 else f"z{i}"
        nodes.append(onnx.helper.make_node("MatMul", [value, f"W{i}"], [product]))
        value = product if last else f"a{i}"
        if not last:
            nodes.append(onnx.helper.make_node(activation, [product], [value]))
    if len(outputs) > 1:
        nodes.append(onnx.helper.make_node("Split", [value], [n for n, _ in outputs], axis=-1))
    graph = onnx.helper.make_graph(
        nodes,
        "tire",
        [onnx.helper.make_tensor_value_info(n, kind, [*shape, size]) for n, size in inputs],
        [onnx.helper.make_tensor_value_info(n, kind, [*shape, size]) for n, size in outputs],
        [onnx.numpy_helper.from_array(W.astype(number), f"W{i}") for i, W in enumerate(weights)],
    )
    opset = [onnx.helper.make_opsetid("", 13)]
    return onnx.helper.make_model(graph, opset_imports=opset, ir_version=7).SerializeToString()


def tire(rng, sign=1.0):
    """Weights of [α_f, α_r] -> [F_yf, F_yr] of five units an axle, rising with slip."""
    scale = rng.uniform(3, 20, (2, 5))
    first = np.vstack([np.append(scale[0], np.zeros(5)), np.append(np.zeros(5), scale[1])])
    second = np.zeros((10, 2))
    second[:5, 0], second[5:, 1] = rng.uniform(500, 1500, (2, 5))
    return [sign * first, second]


def slip(drive, car):
    rows = zip(drive.v_x, drive.x, drive.u, strict=True)
    return np.array(
        [np.array(ca.DM(slip_angles(car.l_f, car.l_r, v, x, u))).ravel() for v, x, u in rows]
    )


@pytest.mark.sweep("batch-Tanh", "batch-Elu", "None-Tanh", "1-Elu")
@pytest.mark.parametrize("activation", ["Tanh", "Sigmoid", "Elu", "Softsign", "Atan"])
@pytest.mark.parametrize("batch", ["batch", 1, None])
def test_its_forces_are_those_of_onnxruntime(car, drive, rng, activation, batch):
    recording = drive(200)
    content = network_file(tire(rng), activation=activation, batch=batch)
    forces = OnnxModel(vehicle=car, content=content).predict(recording)
    session = runtime.InferenceSession(content)
    alpha = slip(recording, car).astype(np.float32)
    rows = alpha if batch is None else alpha[:, None]
    expected = np.vstack([session.run(None, {"input": row})[0].reshape(1, 2) for row in rows])
    assert np.abs(expected).max() > 1000
    assert np.abs(forces - expected).max() < 1e-6 * np.abs(expected).max()


def test_a_network_of_the_five_signals_comes_back_from_onnx(car, drive, rng):
    recording = drive(300)
    recording = replace(recording, v_x=np.where(recording.t < 0.5, 0.3, recording.v_x))
    network = Network(inputs=("alpha_f", "alpha_r", "v_y", "r"))
    V = 0.2 * rng.standard_normal((10, 4))
    W = 0.2 * rng.standard_normal((2, 10))
    model = NetworkModel(
        vehicle=car, network=network, weights=Weights(W=W, V=V), force_unit=1e3, min_speed=1.0
    )
    back = OnnxModel(vehicle=car, content=onnx_bytes(model), min_speed=1.0)
    expected = model.predict(recording)
    assert (back.predict(recording)[recording.t < 0.5] == 0.0).all()
    assert np.abs(back.predict(recording) - expected).max() < 1e-9 * np.abs(expected).max()


def test_its_derivative_is_that_of_the_file(car, rng):
    content = network_file(tire(rng), number=np.float64)
    function = read_network(content)
    point, step = np.array([0.05, -0.03]), 1e-6
    session = runtime.InferenceSession(content)
    differences = np.column_stack(
        [
            (
                session.run(None, {"input": (point + h)[None]})[0]
                - session.run(None, {"input": (point - h)[None]})[0]
            )[0]
            / (2 * step)
            for h in step * np.eye(2)
        ]
    )
    slope = np.array(
        function.factory("slope", function.name_in(), ["jac:axle_force:alpha_f"])(*point)
    )
    assert np.abs(slope.ravel() - differences[:, 0]).max() < 1e-6 * np.abs(differences).max()


def test_a_network_in_the_sign_of_iso_8855_is_turned_round(car, drive, rng):
    state = rng.bit_generator.state
    paper = network_file(tire(rng))
    rng.bit_generator.state = state
    iso = network_file(tire(rng, sign=-1.0))
    recording = drive(100)
    with pytest.raises(UnusableNetworkError, match="must rise with slip"):
        OnnxModel(vehicle=car, content=iso)
    turned = OnnxModel(vehicle=car, content=iso, slip_sign=-1).predict(recording)
    assert np.array_equal(turned, OnnxModel(vehicle=car, content=paper).predict(recording))


@pytest.mark.parametrize("inputs", [None, ("alpha_r", "alpha_f")])
def test_it_is_stored_and_read_again(car, drive, rng, tmp_path, inputs):
    recording = drive(50)
    content = network_file(tire(rng, -1.0))
    model = OnnxModel(vehicle=car, content=content, min_speed=2.0, slip_sign=-1, inputs=inputs)
    model.save(tmp_path / "weights.json")
    again = load_model(tmp_path / "weights.json")
    assert again == model
    assert np.array_equal(again.predict(recording), model.predict(recording))
    (tmp_path / "tire.onnx").write_bytes(model.content)
    numbers = {"min_speed": 2.0, "slip_sign": -1, "inputs": inputs}
    assert OnnxModel.from_onnx(tmp_path / "tire.onnx", car, **numbers) == model


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"onnx_base64": "!"}, "weights.json: "),
        ({"onnx_base64": ""}, "weights.json: the file holds no ONNX graph"),
        ({"slip_sign": 2}, "weights.json: slip_sign must be 1 or -1, it is 2"),
        ({"min_speed_m_s": 0.0}, "weights.json: min_speed must be positive"),
    ],
)
def test_a_spoiled_file_is_refused(car, rng, tmp_path, change, message):
    data = OnnxModel(vehicle=car, content=network_file(tire(rng))).to_dict()
    path = tmp_path / "weights.json"
    path.write_text(json.dumps(data | change))
    with pytest.raises(FrozenModelError, match=message):
        load_model(path)
    del data["inputs"]
    path.write_text(json.dumps(data))
    with pytest.raises(FrozenModelError, match="inputs is missing"):
        load_model(path)


def unusable(rng):
    first, second = tire(rng)
    three = rng.standard_normal((3, 2))
    return {
        "no ONNX graph": b"",
        "Failed to parse ONNX model": b"not a network",
        "Unsupported operation 'Softmax'": network_file([first, second], activation="Softmax"),
        "reads 3 columns: declare with inputs": network_file([three]),
        "the outputs must be the two forces": network_file([first, rng.standard_normal((10, 3))]),
        r"must be \(columns,\) or \(batch, columns\)": network_file([first, second], batch=32),
        "FLOAT or DOUBLE, holds": network_file([first, second], number=np.float16),
        "must rise with slip": network_file([first, -second]),
    }


@pytest.mark.parametrize("reason", list(unusable(np.random.default_rng(0))))
def test_what_cannot_be_used_is_told_in_one_line(car, rng, tmp_path, reason):
    path = tmp_path / "tire.onnx"
    path.write_bytes(unusable(rng)[reason])
    with pytest.raises(UnusableNetworkError, match=reason) as caught:
        OnnxModel.from_onnx(path, car)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("inputs", [("alpha_f",), ("alpha_f", "alpha_f"), ("alpha_f", "beta")])
def test_inputs_must_be_signals_one_a_column(car, rng, inputs):
    with pytest.raises(UnusableNetworkError, match="inputs must be 2 different signals"):
        OnnxModel(vehicle=car, content=network_file(tire(rng)), inputs=inputs)
