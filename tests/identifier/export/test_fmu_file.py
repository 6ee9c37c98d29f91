"""An FMU as a file: valid, reproducible, and told apart from others by its content."""

import logging
import zipfile

import numpy as np
import pytest

from identifier.export import fmu as package
from identifier.export.fmu import export_fmu, fmu_text
from identifier.export.package import build_package
from identifier.export.specialize import specialize
from identifier.paper.design import PaperIdentifier
from models.vehicle import sedan

fmpy = pytest.importorskip("fmpy", reason="needs the package fmpy")
validation = pytest.importorskip("fmpy.validation")
CAR = sedan()
PARTS = ("include", "src")
DESIGN = PaperIdentifier.for_vehicle(CAR)


@pytest.fixture(name="exported")
def sources_only(tmp_path, monkeypatch):
    """Paths of both FMUs by version, without binaries."""
    monkeypatch.setattr(package, "targets", lambda: ())
    paths = {version: tmp_path / f"{version}.fmu" for version in (2, 3)}
    for version, path in paths.items():
        export_fmu(specialize(DESIGN, CAR), path, version)
    return paths


@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_finds_nothing_to_complain_about(exported, version):
    assert validation.validate_fmu(str(exported[version])) == []


def test_its_component_is_the_c_package():
    shipped = build_package(DESIGN, CAR).files
    shared = {path: text for path, text in shipped.items() if path.split("/")[0] in PARTS}
    inside = fmu_text(specialize(DESIGN, CAR), 3)
    assert len(shared) == 6
    for path, text in shared.items():
        assert inside[f"sources/{path.split('/')[1]}"] == text


@pytest.mark.parametrize("version", [2, 3])
def test_units_are_told(exported, version):
    about = fmpy.read_model_description(str(exported[version]))
    units = {variable.name: variable.unit for variable in about.modelVariables}
    assert [units[name] for name in ("v_x", "r", "delta_f", "F_yr")] == ["m/s", "rad/s", "rad", "N"]


def test_without_a_compiler_it_holds_sources_only_and_says_so(exported, caplog, tmp_path):
    with caplog.at_level(logging.WARNING, "tireid.export"):
        export_fmu(specialize(DESIGN, CAR), tmp_path / "again.fmu")
    assert "no C compiler found" in caplog.text
    with zipfile.ZipFile(exported[2]) as archive:
        names = archive.namelist()
    assert not [name for name in names if name.startswith("binaries")]
    assert {"modelDescription.xml", "sources/tireid_equations.c", "sources/fmi.c"} <= set(names)


def test_a_start_that_is_not_finite_is_refused(tmp_path):
    specialized = specialize(DESIGN, CAR)
    carry = {port: np.full_like(value, np.nan) for port, value in specialized.carry.items()}
    with pytest.raises(ValueError, match="must be finite to be exported, it is nan"):
        export_fmu(specialized._replace(carry=carry), tmp_path / "nan.fmu")
