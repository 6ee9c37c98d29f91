"""`tireid emit` and `ti.emit`: what they write, all or nothing, and what they refuse."""

import numpy as np
import pytest

import tireid as ti
from identifier.methods import make_method
from models.tires import MagicFormula
from tests.identifier.export.test_emitted import SMALL
from tests.tireid.conftest import refusal, typed


@pytest.fixture(scope="module")
def stored(tmp_path_factory, logs):
    """Models as they are stored: of a drive, and of the paper's network, which knows no doubt."""
    folder, car = tmp_path_factory.mktemp("emit"), ti.sedan()
    tire = ti.identify(ti.read_recording(logs / "slalom.csv"), car).tire
    tire.save(folder / "tire.json")
    method = make_method("integral", car)
    method.frozen(car, method.setup(car).carry).save(folder / "network.json")
    return folder


def refused(capsys, *words):
    return refusal(capsys, ["emit", *words])


def test_several_outputs_are_written_at_once(stored, tmp_path, capsys):
    tire = ti.TireModel.load(stored / "tire.json")
    words = ["--tir", "car.tir", "--ggv", "ggv.csv", "--steady", "steady.csv"]
    words += ["--out", "understeer.csv"]
    words = [word if word.startswith("--") else str(tmp_path / word) for word in words]
    assert typed("emit", stored / "tire.json", "--understeer", *words) == 0
    printed = capsys.readouterr()
    names = {"car_front.tir", "car_rear.tir", "ggv.csv", "steady.csv", "understeer.csv"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert all(f"wrote {tmp_path / name}" in printed.err for name in names)
    rows = np.loadtxt(tmp_path / "understeer.csv", delimiter=",", skiprows=1)
    head, first = (line.split() for line in printed.out.splitlines()[:2])
    assert head == ["v_x_m_s", "a_y_m_s2", "gradient_deg_per_g", "sd_deg_per_g"]
    assert [float(one) for one in first] == pytest.approx(rows[0])
    for axle, load in zip(("front", "rear"), tire.vehicle.axle_loads, strict=True):
        one = MagicFormula.from_tir(tmp_path / f"car_{axle}.tir")
        pair = 2.0 * float(one.forces(0.02, 0.0, 0.0, 0.5 * load).F_y)
        assert pair == pytest.approx(tire.force(0.02, axle), rel=0.03)
    again = ["emit", stored / "tire.json", "--tir", tmp_path / "car.tir", "--force"]
    before = (tmp_path / "car_rear.tir").read_bytes()
    assert typed(*again) == 0
    assert (tmp_path / "car_rear.tir").read_bytes() == before
    tire.save(tmp_path / "judged.json", valid=False)
    ti.emit(tmp_path / "judged.json", tir=tmp_path / "car.tir", overwrite=True)
    judged = (tmp_path / "car_rear.tir").read_text(encoding="utf-8")
    assert "$ Verdict: not judged on its" in before.decode() and "$ Verdict: NOT valid" in judged
    numbers = [one for one in tire.estimates() if one.axle == "rear"]
    assert all(one.title in judged for one in numbers)
    open_ = [
        line for line in judged.splitlines() if line.endswith("not identified (default value)")
    ]
    assert len(open_) == sum(not one.identified for one in numbers)


def test_without_a_flag_one_line_names_them_all(stored, capsys):
    line = refused(capsys, stored / "tire.json")
    assert all(flag in line for flag in ("--tir FILE", "--slipx DIR", "--ggv FILE", "--understeer"))
    assert "--out goes with --understeer" in refused(capsys, stored / "tire.json", "--out", "a.csv")


def test_what_cannot_be_written_or_known_leaves_nothing(stored, tmp_path, capsys):
    model, tir, ggv = stored / "network.json", tmp_path / "a.tir", tmp_path / "ggv.csv"
    line = refused(capsys, model, "--tir", tir, "--ggv", ggv)
    assert "NetworkModel cannot tell how sure it is" in line
    assert "cannot be a file" in refused(capsys, model, "--tir", tir, "--ggv", tmp_path, "--force")
    line = refused(capsys, stored / "tire.json", "--tir", tir, "--slipx", tmp_path / "car")
    assert "slipx describes cars of 1:10" in line
    line = refused(capsys, stored / "tire.json", "--ggv", ggv, "--understeer", "--out", ggv)
    assert "two outputs have one name" in line
    assert "tir must name a file" in refused(capsys, stored / "tire.json", "--tir", "")
    line = refused(capsys, stored / "tire.json", "--ggv", tmp_path / "none" / "ggv.csv")
    assert f"{tmp_path / 'none' / 'ggv.csv'} cannot be a file" in line
    assert list(tmp_path.iterdir()) == []
    ggv.write_text("mine", encoding="utf-8")
    assert "ggv.csv exists" in refused(capsys, stored / "tire.json", "--tir", tir, "--ggv", ggv)
    assert ggv.read_text(encoding="utf-8") == "mine" and not (tmp_path / "a_front.tir").exists()


def test_a_disk_that_fills_up_leaves_nothing(stored, tmp_path, monkeypatch):
    def full(path, text):
        if path.name == "ggv.csv":
            raise OSError(28, "No space left on device", str(path))
        path.write_text(text, encoding="utf-8")

    monkeypatch.setattr("tireid.emitting.write_atomically", full)
    tire = ti.TireModel.load(stored / "tire.json")
    with pytest.raises(OSError, match="No space left"):
        ti.emit(tire, tir=tmp_path / "car.tir", ggv=tmp_path / "ggv.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_small_car_becomes_a_folder_of_slipx(stored, tmp_path):
    tire = ti.TireModel.load(stored / "tire.json").mounted_on(SMALL)
    emitted = ti.emit(tire, slipx=tmp_path / "car", understeer=True)
    assert emitted.files == (tmp_path / "car",) and emitted.understeer is not None
    assert len(list((tmp_path / "car" / "tyres").iterdir())) == 2
    with pytest.raises(ti.errors.OutputError, match="is not empty"):
        ti.emit(tire, slipx=tmp_path / "car")
    ti.emit(tire, slipx=tmp_path / "car", overwrite=True)
