"""Frozen models as ONNX, run by onnxruntime."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from identifier.export.onnx import MissingOnnxError, NoOnnxError, onnx_bytes
from identifier.methods import make_method
from identifier.paper.network import SIGNALS, Network
from identifier.run import identify
from tests.identifier.conftest import network_model

onnx = pytest.importorskip("onnx", reason="needs the package onnx")
runtime = pytest.importorskip("onnxruntime", reason="needs the package onnxruntime")

STRUCTURES = [
    Network(),
    Network(inputs=("alpha_f", "alpha_r", "v_x"), hidden=3),
    Network(inputs=tuple(reversed(SIGNALS)), hidden=7),
]


def stopping(drive, rng):
    """A drive with samples below, at and above the minimum speed, and backward."""
    v_x = drive.v_x + rng.standard_normal(drive.t.size)
    v_x[:6] = [0.0, 0.5, 0.999999, 1.0, 1.000001, -3.0]
    return replace(drive, v_x=v_x, delta_r=0.02 * rng.standard_normal(drive.t.size))


def run(content, drive, number=np.float64):
    """Forces (n, 2) of an ONNX file that reads the five signals."""
    session = runtime.InferenceSession(content)
    names = ("v_x", "v_y", "r", "delta_f", "delta_r")
    columns = {name: getattr(drive, name)[:, None].astype(number) for name in names}
    return np.hstack(session.run(["F_yf", "F_yr"], columns))


@pytest.mark.parametrize("network", STRUCTURES)
@pytest.mark.parametrize(("single", "tolerance"), [(False, 1e-9), (True, 1e-6)])
def test_onnxruntime_gives_the_forces_of_the_network(car, drive, rng, network, single, tolerance):
    recording = stopping(drive(400), rng)
    model = network_model(car, network, rng)
    expected = model.predict(recording)
    number = np.float32 if single else np.float64
    forces = run(onnx_bytes(model, single=single), recording, number)
    assert forces.dtype == number
    assert (forces[[0, 1, 2, 5]] == 0.0).all()
    assert np.abs(forces - expected).max() < tolerance * np.abs(expected).max()


def test_every_port_tells_its_unit(car, rng):
    graph = onnx.load_from_string(onnx_bytes(network_model(car, Network(), rng))).graph
    units = {port.name: port.doc_string.rsplit(" ", 1)[1] for port in (*graph.input, *graph.output)}
    assert units == {
        "v_x": "[m/s]", "v_y": "[m/s]", "r": "[rad/s]", "delta_f": "[rad]", "delta_r": "[rad]",
        "F_yf": "[N]", "F_yr": "[N]",
    }  # fmt: skip


@pytest.mark.parametrize(("single", "tolerance"), [(False, 1e-9), (True, 1e-6)])
def test_the_static_curve_of_the_axle_model(car, drive, single, tolerance):
    recording = drive(1000)
    method = make_method("axle", car)
    model = identify(recording, car, method).freeze(recording.t[-1])
    alpha = np.linspace(-0.5, 0.5, 101)
    expected = model.force(alpha)
    session = runtime.InferenceSession(onnx_bytes(model, single=single))
    column = alpha[:, None].astype(np.float32 if single else np.float64)
    forces = np.hstack(session.run(["F_yf", "F_yr"], {"alpha_f": column, "alpha_r": column}))
    assert np.abs(expected).max() > 1000
    assert np.abs(forces - expected).max() < tolerance * np.abs(expected).max()


def test_a_model_that_is_no_network_is_refused(car, drive):
    recording = drive(100)
    model = identify(recording, car, make_method("lagged_ekf", car)).freeze(recording.t[-1])
    with pytest.raises(NoOnnxError, match="CurveModel has no ONNX form"):
        onnx_bytes(model)


def test_without_the_package_it_says_what_to_install(car, rng, monkeypatch):
    model = network_model(car, Network(), rng)
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(MissingOnnxError, match="needs the package onnx: pip install onnx "):
        onnx_bytes(model)
