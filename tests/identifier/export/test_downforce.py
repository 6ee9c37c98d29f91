"""The step of a car with downforce in C: the bits of CasADi."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.export.compiled import samples_of
from identifier.export.onnx import onnx_bytes
from identifier.export.package import build_package
from identifier.methods import make_method
from identifier.run import identify
from models.vehicle import sedan
from tests.identifier.export.test_bit_for_bit import assert_the_bits_of_casadi

RACER = replace(sedan(), downforce_area_front=1.5, downforce_area_rear=-0.4)
AXLE = make_method("axle", RACER)


@pytest.fixture(scope="module")
def package():
    return build_package(AXLE, RACER, with_a_y=True, with_band=True)


@pytest.fixture(scope="module")
def rows(slalom, package):
    """The slalom at a speed that swings, with gaps."""
    rows = samples_of(slalom, [port.name for port in package.specialized.inputs])
    rows[:, 0] *= 1.0 + 0.8 * np.sin(np.linspace(0.0, 20.0, len(rows))) ** 2
    rows[:5, 0], rows[1000:1020, 4], rows[2000:2200, 2] = np.inf, np.nan, 1e308
    return rows


def test_c_computes_the_bits_of_casadi(package, rows):
    assert_the_bits_of_casadi(package, rows)


def test_onnx_has_the_curves_of_the_static_loads_and_says_so(slalom):
    pytest.importorskip("onnx", reason="needs the package onnx")
    runtime = pytest.importorskip("onnxruntime", reason="needs the package onnxruntime")
    model = identify(slalom.between(0.0, 20.0), RACER, AXLE).freeze()
    content = onnx_bytes(model)
    session = runtime.InferenceSession(content)
    alpha = np.linspace(-0.2, 0.2, 11)
    told = session.run(None, {"alpha_f": alpha[:, None], "alpha_r": alpha[:, None]})
    np.testing.assert_allclose(np.hstack(told), model.force(alpha), rtol=1e-9, atol=1e-6)
    assert b"static loads" in content
    front, rear = (float(session.get_modelmeta().custom_metadata_map[f"downforce_{axle}_s2_m2"])
                   for axle in ("front", "rear"))  # fmt: skip
    assert (front, rear) == RACER.downforce
    assert b"downforce" not in onnx_bytes(replace(model, vehicle=sedan()))
