"""The FMU of a method that tells v_y: a_y goes in, v_y, its deviation and a flag come out."""

import numpy as np
import pytest

from identifier.export import fmu as binaries
from identifier.export.compiled import samples_of
from identifier.export.fmu import export_fmu
from identifier.export.package import run_in_virtual_machine
from identifier.export.specialize import specialize
from identifier.methods import make_method
from models.vehicle import sedan
from tests.identifier.export.test_fmu import Master
from tests.kept import Kept
from tests.rivals import needs_rivals

fmpy = pytest.importorskip("fmpy", reason="needs the package fmpy")
if not binaries.targets():
    pytest.skip("needs a C compiler on Linux x86-64", allow_module_level=True)

CAR = sedan()
TOLD = ("v_y_estimate", "v_y_sd", "side_slip_observable")
REFERENCES = (1, 2, 3, 4, 5, 13)  # of v_x, v_y, r, delta_f, delta_r, a_y


@pytest.fixture(scope="module")
def step():
    return specialize(make_method("inertial", CAR), CAR)


@pytest.fixture(scope="module")
def paths(step, tmp_path_factory):
    """By version; Linux only, for speed."""
    folder = tmp_path_factory.mktemp("fmu")

    def make(version):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(binaries, "MINGW", "no-such-compiler")
            export_fmu(step, folder / f"{version}.fmu", version)
        return folder / f"{version}.fmu"

    return Kept(make)


@pytest.mark.parametrize("version", [2, 3])
def test_what_is_told_is_to_the_last_bit_what_the_step_tells(
    paths, version, step, slalom, tmp_path
):
    """With holes in a_y, a v_y that comes and goes, and samples that are refused."""
    rows = samples_of(slalom, [port.name for port in step.inputs])[:600]
    rows[:300, 1], rows[400:450, 1], rows[450:, 1] = np.nan, 1e9, np.nan
    rows[200:260, 5], rows[350:360, 2], rows[500:560, 0] = np.nan, np.nan, np.inf
    expected, _ = run_in_virtual_machine(step, rows)
    slave = Master(paths[version], tmp_path).fmu
    read = slave.getReal if version == 2 else slave.getFloat64
    put = slave.setReal if version == 2 else slave.setFloat64
    told = np.empty_like(expected)
    for k, row in enumerate(rows):
        put(REFERENCES, row)
        slave.doStep(0.01 * k, 0.01)
        told[k] = [*read([6, 7, 14, 15]), *slave.getBoolean([16])]
    assert read([13]) == [rows[-1, 5]]
    slave.reset()
    assert np.isnan(read([2, 13])).all()
    slave.freeInstance()
    np.testing.assert_array_equal(told, expected)
    assert np.ptp(told[:, 2]) > 0.1


@needs_rivals
def test_an_fmu_tells_as_much_of_side_slip_as_its_step(tmp_path, monkeypatch):
    """Not every method knows whether anything can be seen."""
    monkeypatch.setattr(binaries, "MINGW", "no-such-compiler")
    step = specialize(make_method("linear_kf", CAR), CAR)
    export_fmu(step, tmp_path / "one.fmu")
    about = fmpy.read_model_description(str(tmp_path / "one.fmu"))
    told = [v.name for v in about.modelVariables if v.name in TOLD]
    assert told == list(TOLD[: len(step.side_slip)]) and 0 < len(told) < 3
