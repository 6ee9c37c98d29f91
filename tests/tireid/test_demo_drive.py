"""The end of the demo: the car drives on what it learnt, and the report shows the film."""

from types import SimpleNamespace

import numpy as np
import pytest

from codegen import find_compiler
from models.vehicle import sedan
from mpc.tires.tire import curves_at
from tests.tireid.conftest import json_of
from tireid.commands import demo as demo_drive
from tireid.commands.demo import NOT_DRIVEN, drive_section, drive_story, drive_text
from tireid.driving import results as drive_results
from tireid.driving.results import Drives
from tireid.figures import film as frames
from tireid.report import Picture


@pytest.fixture
def quick(monkeypatch, undrawn):
    """Short films and empty pictures: both have tests of their own."""
    monkeypatch.setattr(frames, "MOST", 4)


@pytest.mark.heavy
def test_learnt_tires_steer_as_the_true_ones_and_learning_stays_on_the_road(story, tmp_path, quick):
    if find_compiler() is None:
        pytest.skip("needs a C compiler")
    driven = drive_story(story, tmp_path)
    rms = {
        folder: {
            label: scores["rms_e_y_m"]
            for label, scores in json_of(tmp_path / folder / "summary.json")["drives"].items()
        }
        for folder in ("drive", "drive_slippery")
    }
    assert rms["drive"]["frozen"] < 1.2 * rms["drive"]["oracle"]
    assert rms["drive"]["frozen"] < 0.3 * rms["drive"]["linear"]
    assert rms["drive_slippery"]["learning"] < 0.3 * rms["drive_slippery"]["linear"]
    leading = [one.drives.runs[0] for one in driven.values()]
    assert [run.label for run in leading] == ["frozen", "learning"]
    assert all(run.scores.completed for run in leading)
    printed = drive_text(driven)
    assert "ISO 3888-2 at" in printed and "friction 1, 0.5 from 110 m on" in printed
    section = drive_section(driven, tmp_path)
    films = [
        block
        for block in section.blocks
        if isinstance(block, Picture) and block.image[8:12] == b"WEBP"
    ]
    assert len(films) == 1
    assert all((tmp_path / folder / "drive.webp").is_file() for folder in driven)
    run = driven["drive_slippery"].drives.runs[0]
    known = [min(run.known, key=lambda one: abs(one.t - t)) for t in (8.0, 15.0)]
    before, after = (
        curves_at(run.model._replace(weights=one.steering), np.array([0.07]))[0, 0] for one in known
    )
    assert 0.0 < after < 0.75 * before, "the friction dropped to half at 8.7 s"
    assert all(run.known == () for one in driven.values() for run in one.drives.runs[1:])


def test_without_a_compiler_the_report_says_so(story, tmp_path, monkeypatch):
    monkeypatch.setattr(demo_drive, "find_compiler", lambda: None)
    driven = drive_story(story, tmp_path)
    assert driven == {} and list(tmp_path.iterdir()) == []
    assert drive_text(driven) == NOT_DRIVEN
    assert NOT_DRIVEN in str(drive_section(driven, tmp_path))


def test_with_a_compiler_the_learnt_car_drives_both_roads(tmp_path, monkeypatch):
    """The drives themselves are left out: which they are, on which tires, into which folder."""
    written = []
    monkeypatch.setattr(demo_drive, "find_compiler", lambda: "cc")
    monkeypatch.setattr(drive_results, "run_drive", lambda label, _, tires: (label, tires))
    monkeypatch.setattr(Drives, "write", lambda _, folder, film: written.append(folder.name))
    frozen = "frozen"
    told = SimpleNamespace(car=sedan(), axle=SimpleNamespace(model=frozen))
    driven = drive_story(told, tmp_path)
    assert written == list(driven) == ["drive", "drive_slippery"]
    assert [one.drives.runs for one in driven.values()] == [
        [(label, frozen) for label in ("frozen", "linear", "oracle")],
        [(label, frozen) for label in ("learning", "frozen", "linear")],
    ]
    assert [one.drives.conditions.setup.drops for one in driven.values()] == [(), ((110.0, 0.5),)]
