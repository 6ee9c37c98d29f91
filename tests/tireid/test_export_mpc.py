"""`tireid export --mpc`: what it writes and what it refuses."""

import shutil

import numpy as np
import pytest

from codegen import find_compiler
from identifier.export.compiled import CompiledPackage
from identifier.methods import make_method
from identifier.run import identify
from models.recordings import read_recording
from models.vehicle import sedan
from mpc.export import processor as figures
from mpc.tires import prediction_tire
from tests.rivals import rival
from tests.tireid.conftest import json_of, refusal, typed
from tests.tireid.test_hostile_names import built

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")
CAR = sedan()


@pytest.fixture(autouse=True)
def quick(monkeypatch, unmeasured):
    monkeypatch.setattr(figures, "missing_tools", lambda: ("arm-none-eabi-gcc",))


def test_both_packages_and_what_joins_them_are_complete(tmp_path, capsys):
    out = tmp_path / "package"
    assert typed("export", "--out", out, "--mpc", "--name", "car") == 0
    for path in (
        "README.md",
        "CMakeLists.txt",
        "include/car_handover.h",
        "src/car_handover.c",
        "examples/closed_loop.c",
        "examples/simulated_car.c",
        "examples/lane_changes.c",
        "identifier/include/car.h",
        "identifier/car.json",
        "mpc/include/car_mpc.h",
        "mpc/src/car_mpc_qp.c",
        "mpc/tests/test_car_mpc.c",
        "mpc/README.md",
        "mpc/car_mpc.json",
    ):
        assert (out / path).stat().st_size > 300, path
    assert "car_mpc takes" in capsys.readouterr().err
    assert "Arm was not measured" in (out / "mpc" / "README.md").read_text()
    assert CompiledPackage.from_folder(out / "identifier").name == "car"


@pytest.mark.heavy
def test_a_car_named_as_the_example_builds_and_drives(tmp_path):
    if shutil.which("cmake") is None:
        pytest.skip("needs cmake")
    out = tmp_path / "package"
    assert typed("export", "--out", out, "--mpc", "--paper", "--name", "car", "--single") == 0
    built(out)
    assert "#define CAR_MPC_SINGLE 1" in (out / "mpc" / "include" / "car_mpc_config.h").read_text()
    assert json_of(out / "mpc" / "car_mpc.json")["precision"] == "float"


@pytest.mark.heavy
def test_the_tracker_begins_with_learnt_weights_and_another_car(tmp_path, logs):
    model = identify(read_recording(logs / "slalom.csv"), CAR, make_method("axle", CAR)).freeze(7.0)
    model.save(tmp_path / "weights.json")
    out = tmp_path / "package"
    assert typed("export", "--out", out, "--mpc", "--weights", tmp_path / "weights.json") == 0
    manifest = json_of(out / "mpc" / "tireid_mpc.json")
    np.testing.assert_array_equal(manifest["params"]["weights"], prediction_tire(model).weights)
    assert manifest["params"]["car"] == list(CAR.bicycle[:4])


@pytest.mark.sweep("lagged_ekf")
@pytest.mark.parametrize("law", [rival("linear_kf"), "lagged_ekf"])
def test_a_method_without_a_tire_for_c_is_refused_in_one_line(law, tmp_path, capsys):
    out = tmp_path / "package"
    assert "hand" in refusal(capsys, ["export", "--out", out, "--mpc", "--method", law])
    assert not out.exists()


def test_without_a_compiler_nothing_is_left_behind(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("mpc.realtime.instance.load_library", lambda *_, **__: None)
    out = tmp_path / "package"
    assert "--mpc: no C compiler" in refusal(capsys, ["export", "--out", out, "--mpc"])
    assert not out.exists()
