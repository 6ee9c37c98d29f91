"""`tireid init`: read as it is, and with its comment signs taken away a car to simulate."""

import io
import re
from dataclasses import fields
from pathlib import Path

import pytest

from models.vehicle import Chassis, Vehicle, sedan
from tests.tireid.conftest import typed

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_what_it_writes_is_read_with_stated_estimates(tmp_path, capsys):
    path = tmp_path / "car.toml"
    assert typed("init", path) == 0
    car, model = Vehicle.from_toml(path), sedan()
    assert (car.mass, car.l_f, car.l_r) == (model.mass, model.l_f, model.l_r)
    assert car.yaw_inertia == pytest.approx(car.mass * car.l_f * car.l_r, rel=1e-12)
    front, rear = car.axle_loads
    assert car.cornering_stiffness_front == pytest.approx(14.0 * front, rel=1e-12)
    assert car.cornering_stiffness_rear == pytest.approx(14.0 * rear, rel=1e-12)
    assert car.chassis is None
    assert typed("check", "--vehicle", path) == 0
    said = capsys.readouterr()
    estimates = "estimated, as the vehicle file leaves it out: yaw_inertia = 2674 kg m²"
    assert (said.out + said.err).count(estimates) == 1


def test_with_the_comment_signs_taken_away_it_is_a_car_that_can_be_simulated(tmp_path):
    path = tmp_path / "car.toml"
    assert typed("init", path) == 0
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub(r"(?m)^# (?=\w+ = |\[chassis\])", "", text), encoding="utf-8")
    car = Vehicle.from_toml(path)
    assert (car.estimated, car.estimates) == ((), "")
    assert car.bicycle == sedan().bicycle
    for one in fields(Chassis):
        if one.name not in ("tire", "estimated"):
            ours, theirs = (getattr(c.require_chassis(), one.name) for c in (car, sedan()))
            assert ours == theirs, one.name
    assert car.require_chassis().tire == tmp_path / "my_tire.tir"


@pytest.mark.parametrize(
    ("options", "answer", "sd"),
    [
        (["--center-of-gravity", "weighed"], "", 0.01),
        (["--center-of-gravity", "data-sheet"], "weighed", 0.04),
        ([], "d\n", 0.04),
        ([], "\n", None),
    ],
)
def test_where_the_center_of_gravity_comes_from_is_asked(
    tmp_path, monkeypatch, capsys, options, answer, sd
):
    terminal = io.StringIO(answer)
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr("sys.stdin", terminal)
    path = tmp_path / "car.toml"
    assert typed("init", path, *options) == 0
    assert Vehicle.from_toml(path).center_of_gravity_sd == sd
    assert ("weighed or data-sheet" in capsys.readouterr().err) == (not options)


def test_nothing_is_replaced_unasked(tmp_path, capsys):
    path = tmp_path / "car.toml"
    path.write_text("precious", encoding="utf-8")
    assert typed("init", path) == 2
    assert "exists: choose another, or add --force" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == "precious"
    assert typed("init", path, "--force") == 0
    assert path.read_text(encoding="utf-8") != "precious"
    assert typed("init", tmp_path / "car.txt") == 2
    assert typed("init", tmp_path / "none" / "car.toml") == 2
    assert (
        capsys.readouterr().err.strip().endswith(f"{tmp_path / 'none'}: no such file or directory")
    )
    assert sorted(one.name for one in tmp_path.iterdir()) == ["car.toml"]


def test_the_documented_table_is_the_one_that_is_read():
    page = (DOCS / "driving.md").read_text(encoding="utf-8")
    section = page.partition("## The car that is driven")[2].partition("\n## ")[0]
    documented = re.findall(r"`(\w+)`", "\n".join(re.findall(r"(?m)^\| (`.*?) \|", section)))
    assert documented == [one.name for one in fields(Chassis) if one.name != "estimated"]
