"""`tireid check`: a table with advice, JSON, exit codes, a design from a bandwidth."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.certificate import Certificate, Property
from identifier.driving import Driving, natural_driving
from identifier.methods import certify
from identifier.paper.design import (
    PaperIdentifier,
    design_for,
    design_text,
    read_design,
    with_keeping,
)
from identifier.stability.gain_design import DEFAULT_KEEPING, KEEPINGS
from models.vehicle import sedan
from tireid.cli import main
from tireid.commands.certificate_table import (
    advised,
    certificate_text,
    number,
    unit_text,
)


def checked(capsys, *words):
    """Exit code and what was printed."""
    capsys.readouterr()
    code = main(["check", *(str(word) for word in words)])
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


def test_gains_beyond_the_limit_fail_with_advice_and_a_proposal_that_passes(capsys, unstable):
    code, said = checked(capsys, "--design", unstable)
    assert code == 1
    assert "verdict: fail" in said.out
    assert "fail: loop gain, sampled: multiply eta_W and eta_V by" in said.out
    assert "proposal (pass)" in said.out


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


def test_a_design_is_found_written_and_keeps_the_wanted_margin(capsys, tmp_path):
    path = tmp_path / "design.toml"
    words = ("--tune", path, "--bandwidth", "0.5", "--phase-margin", "50")
    code, said = checked(capsys, *words)
    assert code == 0
    assert f"wrote {path}" in said.err
    design = read_design(path)
    phase = certify(design, sedan())["phase_margin"].value
    assert phase == pytest.approx(50.0, abs=0.5)
    assert checked(capsys, *words)[0] == 2  # nothing is overwritten unasked
    assert checked(capsys, *words, "--force")[0] == 0
    assert checked(capsys, "--design", path, "--bandwidth", "0.5")[0] == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--design", "nowhere.toml"], "nowhere.toml"),
        (["--tune", "d.toml", "--bandwidth", "9"], "sample every"),
        (["--bandwidth", "-1"], "--bandwidth must be positive"),
        (["--slip", "12"], "--slip must be in rad"),
        (["--phase-margin", "30"], "go with --tune"),
        (["--tune", "d.toml", "--phase-margin", "120"], "phase margin must be in"),
        (["--vehicle", "nowhere.toml"], "nowhere.toml"),
        (["--bandwidth", "0.5"], "which axle has not: add --paper, --method integral"),
        (["--tune", "d.toml", "--method", "linear"], "linear has none"),
        (["--tune", "d.toml", "--design", "d.toml"], "give no --design FILE"),
        (["--paper", "--method", "axle"], "give only one of --method, --paper"),
        (["--log", "drive.csv"], "must be a log.toml"),
        (["--columns", "r=yaw"], "--columns is for a drive: give one by --along LOG"),
        (["--dbc", "car.dbc"], "--dbc is for a drive"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(capsys, monkeypatch, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    code, out = checked(capsys, *words)
    errors = [line for line in out.err.splitlines() if "error:" in line]
    assert code == 2
    assert len(errors) == 1
    assert said in errors[0]
    assert list(tmp_path.iterdir()) == []


def test_figures_and_a_recorded_run(capsys, logs, tmp_path):
    folder = tmp_path / "judged"
    code, said = checked(capsys, "--paper", "--along", logs / "slalom.csv", "--out", folder)
    assert code == 0
    margin = float(re.search(r"gain margin there ([\d.]+)", said.out).group(1))
    worst = certify(PaperIdentifier.for_vehicle(sedan()), sedan())["gain_sampled"].margin
    assert margin > worst  # no recorded regressor is worse than the worst
    for name in ("locus.png", "bounds.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    assert (folder / "certificate.txt").read_text(encoding="utf-8") == said.out
    numbers = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
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
    numbers = json.loads((tmp_path / "judged" / "certificate.json").read_text(encoding="utf-8"))
    assert numbers["limits"] == held
    code, said = checked(capsys, "--json")
    assert (code, json.loads(said.out)) == (0, numbers)
    linear = checked(capsys, "--method", "linear")[1].out
    assert "no limits are enforced by construction" in linear
    assert "verdict: not certified; no margin and no bound of its error is proven" in linear


def test_the_default_is_judged_along_a_log_on_the_slip_that_it_learns_there(capsys, tmp_path):
    log = tmp_path / "log.csv"
    assert main(["sample", str(log)]) == 0
    code, said = checked(capsys, "--along", log, "--json")
    found = json.loads(said.out)["properties"]
    assert code == 0 and json.loads(said.out)["verdict"] == "pass"
    for axle in ("front", "rear"):
        error = found[f"along/{axle}/force_error"]
        parts = [found[f"along/{axle}/{name}"]["value"] for name in ("declared", "begin", "moved")]
        assert error["value"] == pytest.approx(sum(parts)) and error["value"] < 0.1
        assert found[f"along/{axle}/opposes"]["value"] > 1.0
    assert found["along/jump"]["value"] <= found["jump"]["value"]


def test_a_drive_whose_curve_pushes_the_wrong_way_fails_the_certificate(
    capsys, tmp_path, monkeypatch
):
    """Exit code 1, as documented: the learnt weights are made to fall."""
    log = tmp_path / "log.csv"
    assert main(["sample", str(log)]) == 0
    honest = AxleIdentifier.frozen

    def spoilt(self, vehicle, state):
        model = honest(self, vehicle, state)
        return replace(model, W=model.W * [1.0, -1.0, -1.0, 1.0])

    monkeypatch.setattr(AxleIdentifier, "frozen", spoilt)
    code, said = checked(capsys, "--along", log)
    assert code == 1 and "does not push against its slip" in said.out
    assert said.out.splitlines()[-1] == "verdict: fail"


def test_friction_and_speed_of_the_default_are_those_that_are_told(capsys):
    times = []
    for friction in ("1.0", "1.5"):
        code, said = checked(capsys, "--friction", friction, "--json")
        numbers = json.loads(said.out)
        assert code == 0 and numbers["conditions"]["friction"] == float(friction)
        times.append(numbers["properties"]["drop_time"]["value"])
    assert times[0] != times[1]
    assert checked(capsys, "--slip", "0.1")[0] == 2
    assert checked(capsys, "--method", "linear", "--along", "no.csv")[0] == 2


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


@pytest.mark.heavy
@pytest.mark.parametrize("keeping", KEEPINGS)
def test_weights_of_a_found_design_are_kept_as_asked(capsys, tmp_path, keeping):
    path = tmp_path / "design.toml"
    code, said = checked(capsys, "--tune", path, "--keep", keeping)
    gains = read_design(path).gains
    radii = {"dead_zone": gains.W_free * gains.V_free, "projection": gains.W_max * gains.V_max}
    found = [name for name, radius in radii.items() if 0.0 < radius < np.inf]
    assert (code, found) == (0, [keeping] * (keeping != "leakage"))
    assert (gains.rho_W > 0.0) == (keeping != "projection")
    assert ("W_free" in said.out, "W_max" in said.out) == tuple(name in found for name in radii)
    assert checked(capsys, "--design", path)[0] == 0
    assert checked(capsys, "--keep", keeping)[0] == 2


def test_the_default_of_keep_is_not_the_leakage_that_forgets(capsys, tmp_path):
    path = tmp_path / "design.toml"
    assert checked(capsys, "--tune", path)[0] == 0
    assert DEFAULT_KEEPING != "leakage"
    design = design_for(sedan(), natural_driving(sedan()))
    kept = with_keeping(design, design.operation(sedan()), DEFAULT_KEEPING)
    assert read_design(path) == kept


def test_the_same_file_gives_the_same_verdict_and_options_are_said(tmp_path, capsys):
    path = tmp_path / "design.toml"
    words = ["--bandwidth", "0.5", "--slip", "0.09", "--noise-r", "0.02"]
    assert main(["check", "--tune", str(path), *words, "--json"]) == 0
    there = json.loads(capsys.readouterr().out)
    assert read_design(path).driving == Driving(**there["conditions"])
    main(["check", "--design", str(path), "--json"])
    assert json.loads(capsys.readouterr().out) == there
    main(["check", "--design", str(path)])
    assert "conditions: as stored in the design\n" in capsys.readouterr().out
    main(["check", "--design", str(path), "--slip", "0.2"])
    assert "as stored in the design, but for --slip" in capsys.readouterr().out
