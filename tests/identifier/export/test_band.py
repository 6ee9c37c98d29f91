"""The band in C and FMU: that of the model, narrower as it learns; zero where forces read zero."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.export.compiled import samples_of
from identifier.export.fmu import fmu_text
from identifier.export.onnx import NoOnnxError, onnx_bytes
from identifier.export.package import build_package
from identifier.export.specialize import specialize
from identifier.methods import make_method
from identifier.run import identify
from models.vehicle import sedan
from tests.identifier.export.conftest import CALIBRATION, banded
from tests.shipped import Shipped

CAR = sedan()
AXLE = make_method("axle", CAR)


@pytest.fixture(scope="module", name="model")
def a_model(slalom):
    """What twenty seconds of the slalom teach, its band as somebody calibrated it."""
    run = identify(slalom.between(0.0, 20.0), CAR, AXLE)
    return replace(run.freeze(), calibration=CALIBRATION)


@pytest.fixture(scope="module")
def package(model):
    return build_package(AXLE, CAR, model, with_band=True)


def test_noise_widens_it_as_that_of_a_drive_with_such_sensors(package, model, slalom):
    drive, rng = slalom.between(20.0, 45.0), np.random.default_rng(3)
    sideways = CALIBRATION.noise[1] * rng.standard_normal(len(drive))
    noisy = replace(drive, v_y=drive.v_y + sideways)
    compiled = Shipped.of(package)
    compiled.set_adaptation(False)
    told = compiled.run(noisy).outputs["half_band"][100:, 1]
    np.testing.assert_allclose(told, model.band.over(noisy)[100:, 1], rtol=0.01)
    assert (told > 1.002 * model.band.over(drive)[100:, 1]).mean() > 0.5


def test_with_a_band_the_forces_are_the_same_and_it_narrows_while_the_step_learns(packages, slalom):
    rows = samples_of(slalom)[:800]
    told = Shipped.of(banded(CAR), single=False).run_samples(rows)
    plain = Shipped.of(packages["axle"], single=False).run_samples(rows).axle_force
    np.testing.assert_allclose(told.axle_force, plain, rtol=1e-9, atol=1e-6)
    small = np.abs(told.axle_force[:, 0]) < 500.0
    half, number = told.outputs["half_band"][:, 0], np.arange(800)
    assert 0.0 < half[small & (number > 600)].mean() < 0.7 * half[small & (number < 100)].mean()


def test_where_forces_read_zero_there_is_no_band(package, slalom):
    rows = samples_of(slalom)[:300]
    rows[200:, 0] = 0.3
    told = Shipped.of(package).run_samples(rows).outputs["half_band"]
    assert (told[50:200] > 0.0).all()
    assert (told[280:] == 0.0).all()


def test_an_fmu_has_a_band_where_its_step_tells_one():
    for told in (False, True):
        text = fmu_text(specialize(AXLE, CAR, with_band=told), 3)["modelDescription.xml"]
        assert all((f'name="F_y{end}_half_band"' in text) == told for end in "fr")


@pytest.mark.parametrize("single", [False, True])
def test_onnx_tells_the_band_of_the_model(single, model):
    pytest.importorskip("onnx", reason="needs the package onnx")
    runtime = pytest.importorskip("onnxruntime", reason="needs the package onnxruntime")
    session = runtime.InferenceSession(onnx_bytes(model, single=single, with_band=True))
    alpha = np.linspace(-0.4, 0.4, 81)
    column = alpha[:, None].astype(np.float32 if single else np.float64)
    told = session.run(None, {"alpha_f": column, "alpha_r": column})
    expected = np.column_stack([model.force(alpha), model.band.half(alpha)])
    np.testing.assert_allclose(np.hstack(told), expected, rtol=2e-4 if single else 1e-9, atol=0.1)
    assert len(runtime.InferenceSession(onnx_bytes(model)).get_outputs()) == 2
    paper = make_method("integral", CAR)
    network = paper.frozen(CAR, paper.setup(CAR).carry)
    with pytest.raises(NoOnnxError, match="cannot tell how sure it is"):
        onnx_bytes(network, with_band=True)
