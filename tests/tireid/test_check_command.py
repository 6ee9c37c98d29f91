"""`tireid check`: a table with advice, JSON, exit codes, the design that was judged."""

import json
import re
from dataclasses import replace

import pytest

from identifier.axle import AxleIdentifier
from identifier.certificate import Certificate, Property
from identifier.driving import Driving
from identifier.paper.design import PaperIdentifier, design_text, read_design
from models.vehicle import sedan
from tests.tireid.conftest import json_of, refusal, typed
from tireid.commands.certificate_table import (
    advised,
    certificate_text,
    number,
    unit_text,
)


def checked(capsys, *words):
    """Exit code and what was printed."""
    capsys.readouterr()
    code = typed("check", *words)
    return code, capsys.readouterr()


@pytest.fixture
def unstable(tmp_path):
    design = PaperIdentifier.for_vehicle(sedan())
    gains = replace(design.gains, eta_W=30.0 * design.gains.eta_W)
    path = tmp_path / "unstable.toml"
    path.write_text(design_text(replace(design, gains=gains)))
    return path


def test_the_gains_of_the_paper_s_law_pass_for_any_size_of_car(capsys, tmp_path):
    assert checked(capsys, "--paper")[0] == 0
    model = tmp_path / "model.toml"
    model.write_text(
        "mass = 1.58\nyaw_inertia = 0.00481\nl_f = 0.0805\nl_r = 0.093\n"
        "cornering_stiffness_front = 40.0\ncornering_stiffness_rear = 40.0\n"
    )
    code, said = checked(capsys, "--paper", "--vehicle", model)
    assert code == 0
    assert "verdict: pass" in said.out
    assert "[N s]" in said.out


def test_gains_beyond_the_limit_fail_with_advice(capsys, unstable):
    code, said = checked(capsys, "--design", unstable)
    assert code == 1
    assert "verdict: fail" in said.out
    assert "fail: loop gain, sampled: multiply eta_W and eta_V by" in said.out


def test_json_has_the_documented_keys_and_only_finite_numbers(capsys, unstable):
    code, said = checked(capsys, "--design", unstable, "--json")
    data = json.loads(said.out)
    assert code == 1
    assert data["verdict"] == "fail"
    for entry in data["properties"].values():
        assert {"value", "limit", "margin", "status"} <= set(entry)
        assert entry["status"] in ("pass", "warn", "fail")
    gain = data["properties"]["gain_sampled"]
    assert gain["margin"] == pytest.approx(gain["limit"] / gain["value"])
    assert gain["margin"] < 1.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--design", "nowhere.toml"], "nowhere.toml"),
        (["--bandwidth", "-1"], "--bandwidth must be positive"),
        (["--slip", "12"], "--slip must be in rad"),
        (["--vehicle", "nowhere.toml"], "nowhere.toml"),
        (["--bandwidth", "0.5"], "which axle has not: add --paper, --method integral"),
        (["--paper", "--method", "axle"], "give only one of --method, --paper"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(capsys, monkeypatch, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    assert said in refusal(capsys, ["check", *words])
    assert list(tmp_path.iterdir()) == []


def test_the_folder_has_figures_certificate_and_design(capsys, tmp_path):
    folder = tmp_path / "judged"
    code, said = checked(capsys, "--paper", "--out", folder)
    assert code == 0
    assert read_design(folder / "design.toml") == PaperIdentifier.for_vehicle(sedan())
    for name in ("locus.png", "bounds.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    assert (folder / "certificate.txt").read_text(encoding="utf-8") == said.out
    numbers = json_of(folder / "certificate.json")
    assert (numbers["method"], numbers["verdict"]) == ("integral", "pass")
    assert checked(capsys, "--paper", "--out", folder)[0] == 2  # nothing is replaced unasked


def test_numbers_and_units_read_well():
    assert [number(v) for v in (None, float("inf"), 12.3456, 1e-9)] == [
        "-",
        "inf",
        "12.35",
        "1e-09",
    ]
    assert unit_text("U s", 1000.0) == "kN s"
    assert unit_text("U s", 1.0) == "N s"


def test_without_options_it_says_what_is_certified_of_what_identify_uses(capsys, tmp_path):
    """Boxes and properties are those of the identifier itself."""
    code, said = checked(capsys, "--out", tmp_path / "judged")
    assert code == 0
    assert said.out.startswith("sedan: axle, the default in a car\n")
    assert said.out.splitlines()[-1] == "verdict: pass"
    held = AxleIdentifier.for_vehicle(sedan()).certify(sedan()).limits
    least, most = held["grip_static_axle_loads"]
    assert re.search(rf"grip_static_axle_loads +{number(least)} to {number(most)}\n", said.out)
    assert set(held) <= set(said.out.split())
    numbers = json_of(tmp_path / "judged" / "certificate.json")
    assert numbers["limits"] == held
    code, said = checked(capsys, "--json")
    assert (code, json.loads(said.out)) == (0, numbers)
    linear = checked(capsys, "--method", "linear")[1].out
    assert "no limits are enforced by construction" in linear
    assert "verdict: not certified; no margin and no bound of its error is proven" in linear


def test_friction_and_speed_of_the_default_are_those_that_are_told(capsys):
    times = []
    for friction in ("1.0", "1.5"):
        code, said = checked(capsys, "--friction", friction, "--json")
        numbers = json.loads(said.out)
        assert code == 0 and numbers["conditions"]["friction"] == float(friction)
        times.append(numbers["properties"]["drop_time"]["value"])
    assert times[0] != times[1]
    assert checked(capsys, "--slip", "0.1")[0] == 2


def test_advice_is_given_for_what_does_not_pass_and_says_what_to_do():
    def entry(name, status, advice):
        return Property(
            name=name, title=name, value=1.0, limit=2.0, margin=2.0, status=status, unit="-",
            advice=advice,
        )  # fmt: skip

    certificate = Certificate(
        properties=(
            entry("good", "pass", ""),
            entry("fine", "pass", "could be better"),
            entry("weak", "warn", "turn it down"),
            entry("mute", "warn", ""),
            entry("bad", "fail", "turn it off"),
        )
    )
    assert [line.name for line in advised(certificate)] == ["weak", "bad"]
    told = certificate_text(certificate, 1.0)
    assert "warn: weak: turn it down" in told and "fail: bad: turn it off" in told
    assert "could be better" not in told
    assert told.endswith("verdict: fail")


def test_the_same_file_gives_the_same_verdict_and_options_are_said(tmp_path, capsys):
    words = ["--bandwidth", "0.5", "--slip", "0.09", "--noise-r", "0.02"]
    assert typed("check", "--paper", "--out", tmp_path / "judged", *words, "--json") == 0
    path = tmp_path / "judged" / "design.toml"
    there = json.loads(capsys.readouterr().out)
    assert read_design(path).driving == Driving(**there["conditions"])
    typed("check", "--design", path, "--json")
    assert json.loads(capsys.readouterr().out) == there
    typed("check", "--design", path)
    assert "conditions: as stored in the design\n" in capsys.readouterr().out
    typed("check", "--design", path, "--slip", "0.2")
    assert "as stored in the design, but for --slip" in capsys.readouterr().out
