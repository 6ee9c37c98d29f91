"""The end of the demo: the car drives on what it learnt, and the report shows the film."""

import json

import pytest

from codegen import find_compiler
from tireid import demo_drive, drive_results
from tireid.animation import frames
from tireid.demo_drive import NO_COMPILER, drive_section, drive_story, drive_text
from tireid.demo_story import run_story
from tireid.report import Picture


@pytest.fixture(scope="module")
def story():
    return run_story()


@pytest.fixture
def quick(monkeypatch):
    """Short films and empty pictures: both have tests of their own."""
    monkeypatch.setattr(frames, "MOST", 4)
    empty = b"\x89PNG\r\n\x1a\n"
    monkeypatch.setattr(drive_results, "save_figure", lambda _, path: path.write_bytes(empty))


def test_learnt_tires_steer_as_the_true_ones_and_learning_stays_on_the_road(story, tmp_path, quick):
    if find_compiler() is None:
        pytest.skip("needs a C compiler")
    driven = drive_story(story, tmp_path)
    rms = {
        folder: {
            label: scores["rms_e_y_m"]
            for label, scores in json.loads((tmp_path / folder / "summary.json").read_text())[
                "drives"
            ].items()
        }
        for folder in ("drive", "drive_slippery")
    }
    assert rms["drive"]["frozen"] < 1.2 * rms["drive"]["oracle"]
    assert rms["drive"]["frozen"] < 0.3 * rms["drive"]["linear"]
    assert rms["drive_slippery"]["learning"] < 0.3 * rms["drive_slippery"]["linear"]
    leading = [one.runs[0] for one in driven.values()]
    assert [run.label for run in leading] == ["frozen", "learning"]
    assert all(run.scores.completed for run in leading)
    printed = drive_text(driven)
    assert "ISO 3888-2 at" in printed and "friction 1, 0.5 from 110 m on" in printed
    section = drive_section(driven, tmp_path)
    films = [
        block
        for block in section.blocks
        if isinstance(block, Picture) and block.image.startswith(b"GIF89a")
    ]
    assert len(films) == 2


def test_without_a_compiler_the_report_says_so(story, tmp_path, monkeypatch):
    monkeypatch.setattr(demo_drive, "find_compiler", lambda: None)
    driven = drive_story(story, tmp_path)
    assert driven == {} and list(tmp_path.iterdir()) == []
    assert drive_text(driven) == NO_COMPILER
    assert NO_COMPILER in str(drive_section(driven, tmp_path))
