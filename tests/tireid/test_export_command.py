"""`tireid export`: what it writes and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from codegen import find_compiler
from codegen import processor as figures
from identifier.methods import make_method
from identifier.run import identify
from identifier.verdict import calibrated
from models.recordings import read_recording
from models.vehicle import sedan
from tests.rivals import rival
from tests.shipped import Shipped
from tests.tireid.conftest import json_of, refusal, typed
from tireid import exporting
from tireid.commands import export as export_command
from tireid.run import Run

CAR = sedan()


pytestmark = pytest.mark.usefixtures("unmeasured")


def test_a_package_is_complete(tmp_path):
    out = tmp_path / "package"
    assert typed("export", "--out", out, "--paper", "--name", "car") == 0
    for path in (
        "include/car.h",
        "src/car.c",
        "src/car_equations.c",
        "examples/main.c",
        "tests/test_car.c",
        "CMakeLists.txt",
        "README.md",
        "car.json",
    ):
        assert (out / path).stat().st_size > 300, path


def test_learnt_weights_are_shipped(tmp_path, logs):
    if find_compiler() is None:
        pytest.skip("needs a C compiler")
    recording = read_recording(logs / "slalom.csv")
    model = identify(recording, CAR, make_method("integral", CAR)).freeze(7.0)
    model.save(tmp_path / "weights.json")
    out = tmp_path / "package"
    assert typed("export", "--out", out, "--weights", tmp_path / "weights.json") == 0
    weights = Shipped.from_folder(out).weights
    np.testing.assert_array_equal(weights["W"], model.weights.W)


def test_single_precision_is_the_default_of_the_build(tmp_path):
    assert typed("export", "--out", tmp_path / "a", "--single") == 0
    config = tmp_path / "a" / "include" / "tireid_config.h"
    assert "#define TIREID_SINGLE 1" in config.read_text()
    assert json_of(tmp_path / "a" / "tireid.json")["precision"] == "float"


@pytest.mark.heavy
def test_a_y_is_an_input_where_it_is_asked_for(tmp_path, capsys):
    for words, inputs in (([], "v_x, v_y, r, delta_f, delta_r"), (["--with-a-y"], "delta_r, a_y")):
        assert typed("export", "--out", tmp_path / f"a{len(words)}", *words) == 0
        printed = [line for line in capsys.readouterr().err.splitlines() if "reads" in line]
        assert f" {inputs}; " in printed[0]


@pytest.mark.heavy
def test_what_was_learnt_without_a_lateral_velocity_goes_on_without_it(
    tmp_path, logs, capsys, monkeypatch
):
    """From a log to C and FMU: the C begins with what was learnt, and tells what Python tells."""
    monkeypatch.setattr("identifier.export.fmu.MINGW", "no-such-compiler")  # for speed
    if find_compiler() is None:
        pytest.skip("needs a C compiler")
    drive = replace(read_recording(logs / "slalom.csv"), v_y=None)
    if drive.a_y is None:
        force = drive.axle_force.sum(axis=1)
        drive = replace(drive, a_y=force / CAR.mass)
    method = make_method("inertial", CAR)
    model = identify(drive, CAR, method).freeze()
    model.save(tmp_path / "weights.json")
    CAR.to_toml(tmp_path / "car.toml")
    out, weights = tmp_path / "package", str(tmp_path / "weights.json")
    words = ["--weights", weights, "--fmu"]
    assert typed("export", "--out", out, *words) == 0
    printed = capsys.readouterr().err
    assert "reads v_x, r, delta_f, delta_r, a_y; v_y is an output; one step each 10 ms" in printed
    assert "tireid_fmi2.fmu, tireid_fmi3.fmu" in printed
    package = Shipped.from_folder(out)
    np.testing.assert_array_equal(package.weights["W"], model.W)
    run, expected = package.run(drive), identify(drive, CAR, method, start=model)
    assert (run.status == 0).all()
    np.testing.assert_allclose(run.axle_force, expected.axle_force, atol=1e-6)
    np.testing.assert_allclose(run.outputs["v_y"], expected.outputs["v_y"], atol=1e-9)
    assert np.ptp(run.outputs["v_y"]) > 0.05
    text = (out / "README.md").read_text()
    assert "| `v_y_sd` | m/s |" in text and "without v_y" in text
    for version in (2, 3):
        assert (out / f"tireid_fmi{version}.fmu").stat().st_size > 10_000
    assert typed("export", "--out", tmp_path / "b", "--weights", weights, "--method", "axle") == 0
    assert "v_y is an output" not in capsys.readouterr().err


def test_the_frozen_network_lies_beside_the_c(tmp_path):
    pytest.importorskip("onnx", reason="needs the package onnx")
    assert typed("export", "--out", tmp_path / "a", "--paper", "--onnx") == 0
    assert (tmp_path / "a" / "tireid.onnx").stat().st_size > 500


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--name", "No"], "name must be lower-case"),
        (["--method", "linear"], "formula without state"),
        (["--paper", "--method", "axle"], "give only one of --method, --paper"),
        (["--weights", "missing.json"], "missing.json"),
        rival(["--method", "linear_kf", "--onnx"], "--onnx"),
        (["--method", "integral", "--with-a-y"], "has no use for a_y"),
        (["--caution", "0.5"], "--caution goes with --mpc"),
        (["--band", "--paper"], "cannot tell how sure it is: it has no band"),
    ],
)
def test_bad_words_are_one_line_and_leave_nothing(words, complaint, tmp_path, capsys):
    out = tmp_path / "package"
    assert complaint in refusal(capsys, ["export", "--out", out, *words])
    assert not out.exists()


def test_missing_tools_are_said_in_the_readme(monkeypatch, tmp_path):
    monkeypatch.setattr(figures, "missing_tools", lambda: ("arm-none-eabi-gcc",))
    assert typed("export", "--out", tmp_path / "a", "--paper") == 0
    assert "Not measured: arm-none-eabi-gcc" in (tmp_path / "a" / "README.md").read_text()


def test_beside_a_tracker_the_identifier_lies_in_a_folder_of_its_own(monkeypatch, tmp_path):
    def seen(folder, package, single, caution):
        assert caution == 0.0
        return [str(path.relative_to(folder)) for path in sorted(folder.iterdir())]

    said = []
    monkeypatch.setattr(exporting, "write_tracker", seen)
    monkeypatch.setattr(export_command, "say", said.append)
    out = tmp_path / "package"
    assert typed("export", "--out", out, "--paper", "--mpc") == 0
    assert said[0] == "identifier", "and nothing else, when the tracker is to be written"
    assert (out / "identifier" / "include" / "tireid.h").is_file()
    assert not (out / "include").exists()


def test_the_band_is_exported_as_it_was_calibrated(tmp_path, logs, capsys):
    run = identify(read_recording(logs / "slalom.csv"), CAR, make_method("axle", CAR))
    calibrated(run).save(tmp_path / "weights.json")
    words = ["export", "--band", "--weights", tmp_path / "weights.json"]
    assert typed(*words, "--out", tmp_path / "printed") == 0
    manifest = json_of(tmp_path / "printed" / "tireid.json")
    assert manifest["band"] == calibrated(run).calibration.to_dict()
    assert "half_band" in (tmp_path / "printed" / "include" / "tireid_config.h").read_text()
    assert exporting.UNCALIBRATED not in capsys.readouterr().err
    again = exporting.export(Run(history=run), tmp_path / "run", band=True)
    assert again.package.specialized.band == manifest["band"]


def test_a_band_that_nobody_calibrated_is_said(tmp_path, capsys):
    assert typed("export", "--band", "--out", tmp_path / "fresh") == 0
    assert exporting.UNCALIBRATED in capsys.readouterr().err
