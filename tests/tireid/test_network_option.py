"""`--network FILE.onnx`: a tire network of one's own in identify and compare."""

import json

import numpy as np
import pytest

from identifier.export.onnx import export_onnx
from identifier.methods import make_method
from identifier.own_network import FrozenMethod, OnnxModel, UnusableNetworkError, read_network
from identifier.paper.network import Network, NetworkModel, Weights
from identifier.run import identify
from identifier.tire_model import load_model
from models.recordings import read_recording
from models.vehicle import sedan
from tests.tireid.conftest import refusal
from tireid.cli import main

onnx = pytest.importorskip("onnx", reason="needs the package onnx")
CAR = sedan()


def tire_file(path, *, iso=False, swapped=False, forces=2, peak=4e4):
    """[alpha_f, alpha_r] -> F = 40 kN tanh(5 alpha) of each axle, or as other people order it."""
    sign = -1.0 if iso else 1.0
    first, second = 5.0 * sign * np.eye(2), peak * np.eye(2)[:, :forces]
    if swapped:
        first = first[::-1]
    kind = onnx.TensorProto.DOUBLE
    graph = onnx.helper.make_graph(
        [
            onnx.helper.make_node("MatMul", ["slip", "A"], ["z"]),
            onnx.helper.make_node("Tanh", ["z"], ["a"]),
            onnx.helper.make_node("MatMul", ["a", "B"], ["force"]),
        ],
        "tire",
        [onnx.helper.make_tensor_value_info("slip", kind, ["batch", 2])],
        [onnx.helper.make_tensor_value_info("force", kind, ["batch", forces])],
        [onnx.numpy_helper.from_array(first, "A"), onnx.numpy_helper.from_array(second, "B")],
    )
    opset = [onnx.helper.make_opsetid("", 13)]
    onnx.save(onnx.helper.make_model(graph, opset_imports=opset, ir_version=7), path)
    return path


@pytest.fixture
def words(logs, tmp_path):
    words = ["identify", str(logs / "slalom.csv"), "--vehicle", str(logs / "car.toml")]
    words += ["--replay", str(logs / "quick.csv"), "--accept"]  # a network that was drawn
    return [*words, "--out", str(tmp_path / "out")]


def test_its_errors_are_those_of_onnxruntime(words, logs, tmp_path, capsys, undrawn):
    runtime = pytest.importorskip("onnxruntime", reason="needs the package onnxruntime")
    path = tire_file(tmp_path / "tire.onnx")
    assert main([*words, "--network", str(path)]) == 0
    assert "axle, learning online" in capsys.readouterr().out
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert not summary["verdict"]["valid"]
    session = runtime.InferenceSession(path)
    for name in ("slalom", "quick"):
        log = read_recording(logs / f"{name}.csv")
        slip = np.column_stack(
            [
                log.delta_f - (log.v_y + CAR.l_f * log.r) / log.v_x,
                log.delta_r - (log.v_y - CAR.l_r * log.r) / log.v_x,
            ]
        )
        force = session.run(None, {"slip": slip})[0]
        front, rear = np.sqrt(np.mean((force - log.axle_force) ** 2, axis=0))
        found = summary["rmse_N"]["frozen"]["network"][name]
        assert found == pytest.approx({"front": front, "rear": rear}, rel=1e-9)
    assert summary["network"] == {
        "file": "tire.onnx",
        "inputs": ["alpha_f", "alpha_r"],
        "slip_sign": 1,
    }


@pytest.mark.usefixtures("undrawn")
def test_what_a_learnt_model_leaves_is_left_too(words, logs, tmp_path):
    assert main([*words, "--network", str(tire_file(tmp_path / "tire.onnx"))]) == 0
    out, quick = tmp_path / "out", read_recording(logs / "quick.csv")
    for name in ("slip", "slip_quick", "replay_slalom", "replay_quick", "inputs"):
        assert (out / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    stored = load_model(out / "weights.json").predict(quick)
    curves = np.genfromtxt(out / "forces_quick.csv", delimiter=",", names=True)
    np.testing.assert_allclose(curves["Fyf_network_N"], stored[:, 0], rtol=1e-6, atol=1e-2)
    assert "Fyr_online_N" in curves.dtype.names


def test_a_log_without_forces_is_judged_against_what_is_learnt(
    words, logs, tmp_path, capsys, undrawn
):
    lines = [line.split(",") for line in (logs / "slalom.csv").read_text().splitlines()]
    keep = [i for i, name in enumerate(lines[0]) if not name.startswith("Fy")]
    blind = tmp_path / "blind.csv"
    blind.write_text("\n".join(",".join(row[i] for i in keep) for row in lines))
    words[1] = str(blind)
    assert main([*words, "--network", str(tire_file(tmp_path / "tire.onnx"))]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if " blind " in line)
    assert "against online, no truth" in row
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["rmse_N"]["frozen"]["network"]["blind"] is None


@pytest.mark.heavy
def test_other_signs_and_orders_are_told_by_options(words, tmp_path, undrawn):
    results = {}
    for name, shape, options in (
        ("plain", {}, []),
        ("iso", {"iso": True}, ["--network-iso"]),
        ("swapped", {"swapped": True}, ["--network-inputs", "alpha_r", "alpha_f"]),
    ):
        path = tire_file(tmp_path / f"{name}.onnx", **shape)
        assert main([*words, "--force", "--network", str(path), *options]) == 0
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        results[name] = summary["rmse_N"]["frozen"]
    assert results["plain"] == results["iso"]
    assert results["plain"] == results["swapped"]


def test_compare_sets_it_beside_the_methods(logs, tmp_path, capsys, laid_out):
    path = tire_file(tmp_path / "tire.onnx")
    words = ["compare", str(logs / "slalom.csv"), str(logs / "quick.csv")]
    words += ["--vehicle", str(logs / "car.toml"), "--method", "linear", "--network", str(path)]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    assert "tire.onnx" in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "compare.json").read_text())["methods"]["tire.onnx"]
    for name in ("slalom", "quick"):  # it learns nothing: online and frozen are the same
        assert found["frozen_N"]["slalom"][name] == found["online_N"][name]


def test_a_model_of_ours_comes_back_as_a_network(logs, tmp_path, rng):
    network = Network(inputs=("v_y", "r", "delta_f"))
    weights = Weights(W=rng.uniform(0.5, 1.0, (2, 10)), V=0.2 * rng.standard_normal((10, 3)))
    model = NetworkModel(
        vehicle=CAR, network=network, weights=weights, force_unit=1e3, min_speed=1.0
    )
    export_onnx(model, tmp_path / "ours.onnx")
    back = OnnxModel.from_onnx(tmp_path / "ours.onnx", CAR, min_speed=1.0)
    recording = read_recording(logs / "quick.csv")
    method = FrozenMethod(model=back)
    history = identify(recording, CAR, method)
    expected = model.predict(recording)
    assert np.abs(history.axle_force - expected).max() < 1e-9 * np.abs(expected).max()
    assert history.freeze(5.0) is back
    assert history.diverged_at is None


def test_a_network_cannot_be_learnt_on_from_a_model():
    method = make_method("linear", CAR)
    with pytest.raises(ValueError, match="dt must be positive"):
        FrozenMethod(model=method, dt=0.0)
    with pytest.raises(ValueError, match="learns no tire"):
        FrozenMethod(model=method).setup(CAR, start=object())


@pytest.mark.sweep("not a network*", "content[24]*")
@pytest.mark.parametrize(
    ("content", "options", "complaint"),
    [
        (None, [], "absent.onnx"),
        (b"not a network", [], "CasADi cannot read it"),
        ({"forces": 1}, [], "the outputs must be the two forces"),
        ({"iso": True}, [], "must rise with slip"),
        ({}, ["--network-inputs", "alpha_f"], "inputs must be 2 different signals"),
        ({}, ["--freeze", "4"], "--freeze is for identified models"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_leaves_nothing(
    words, tmp_path, capsys, content, options, complaint
):
    path = tmp_path / "absent.onnx"
    if isinstance(content, bytes):
        path = tmp_path / "tire.onnx"
        path.write_bytes(content)
    elif content is not None:
        path = tire_file(tmp_path / "tire.onnx", **content)
    assert complaint in refusal(capsys, [*words, "--network", path, *options])
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["identify", "compare"])
def test_its_options_do_not_stand_alone(command, logs, tmp_path, capsys):
    words = [command, str(logs / "slalom.csv"), "--vehicle", str(logs / "car.toml")]
    assert main([*words, "--out", str(tmp_path / "out"), "--network-iso"]) == 2
    assert "go with --network FILE.onnx" in capsys.readouterr().err


@pytest.mark.parametrize("shape", [[], [1, 1, 2], ["batch", 1, 2], [3, 2], [1, 0]])
def test_a_row_of_signals_is_a_tire_and_another_tensor_is_refused(tmp_path, shape):
    for row in ([2], ["batch", 2], [1, 2]):
        step = read_network(shaped_file(tmp_path / "t.onnx", row).read_bytes())
        assert step.n_out() == 1 and step.numel_out(0) == 2
    content = shaped_file(tmp_path / "t.onnx", shape).read_bytes()
    with pytest.raises(UnusableNetworkError, match="must be"):
        read_network(content)


def shaped_file(path, shape):
    """A tire whose input and output have a shape."""
    kind = onnx.TensorProto.DOUBLE
    node = onnx.helper.make_node("Tanh", ["slip"], ["force"])
    ports = [onnx.helper.make_tensor_value_info(name, kind, shape) for name in ("slip", "force")]
    graph = onnx.helper.make_graph([node], "tire", ports[:1], ports[1:])
    opset = [onnx.helper.make_opsetid("", 13)]
    onnx.save(onnx.helper.make_model(graph, opset_imports=opset, ir_version=7), path)
    return path


def test_a_network_in_kilonewtons_is_refused_before_anything_is_learnt(words, tmp_path, capsys):
    path = tire_file(tmp_path / "tire.onnx", peak=40.0)
    assert main([*words, "--network", str(path)]) == 2
    said = capsys.readouterr().err
    assert f"{path}: the front axle does not push: it has " in said
    assert "check the units of force" in said
    assert not (tmp_path / "out").exists()
