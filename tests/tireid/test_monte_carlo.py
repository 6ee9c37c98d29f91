"""`tireid check --monte-carlo` as a user meets it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identifier.certificate import statement
from identifier.driving import Driving, natural_driving
from identifier.methods import certify
from identifier.paper.design import PaperIdentifier, design_text, read_design
from identifier.stability import Certificate
from identifier.stability.monte_carlo import Beginning, Observed, monte_carlo
from models.vehicle import sedan
from tireid.cli import main
from tireid.commands import check as check_command
from tireid.commands.certificate_table import bound_rows


def observed(xi_tilde):
    ones = np.ones(len(xi_tilde))
    return Observed(np.array(xi_tilde), ones, ones, ones, 3)


def test_no_drive_passes_a_proven_bound(capsys):
    assert main(["check", "--paper", "--monte-carlo", "100", "--seed", "5"]) == 0
    told = capsys.readouterr()
    assert "100 random drives within what is judged, seed 5" in told.out
    assert "|xi - xi_hat|, by the leakage [kN s]" in told.out


def test_the_numbers_are_in_the_json(capsys):
    assert main(["check", "--paper", "--monte-carlo", "50", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["monte_carlo"]
    assert (found["drives"], found["seed"], found["diverged"]) == (50, 0, 0)
    bound = found["bounds"]["error_bound"]
    assert bound["passed"] == 0
    assert bound["over_seen"]["least"] == pytest.approx(bound["value"] / bound["largest"])


@pytest.mark.parametrize("json_too", [[], ["--json"]])
def test_a_bound_that_is_passed_fails_the_check(monkeypatch, capsys, json_too):
    planted = observed([0.5, 1e3, 0.5])
    monkeypatch.setattr(check_command, "monte_carlo", lambda *_, **__: planted)
    assert main(["check", "--paper", "--monte-carlo", "3", *json_too]) == 1
    told = capsys.readouterr().out
    if json_too:
        assert json.loads(told)["monte_carlo"]["bounds"]["error_bound"]["passed"] == 1
    else:
        row = next(line for line in told.splitlines() if line.startswith("|xi - xi_hat|"))
        assert row.split()[-4] == "1"


BOUNDED = {"error_bound": "xi_tilde", "projection_bound": "xi_tilde", "weight_bound": "W"}


@pytest.mark.parametrize("name", BOUNDED)
@pytest.mark.parametrize(("over", "passed"), [(0.999, 0), (1.001, 2), (1.9, 2), (np.inf, 2)])
def test_the_alarm_rings_right_at_the_bound(name, over, passed):
    """Two of three drives come to a share of the bound, each bound by its own signal."""
    values = dict.fromkeys(BOUNDED, 7.0)
    certificate = Certificate(
        properties=tuple(statement(key, "", value, "U s") for key, value in values.items())
    )
    drives = observed([0.5, 0.5, 0.5])
    seen = np.array([0.5, 7.0 * over, 7.0 * over])
    rows = bound_rows(certificate, drives._replace(**{BOUNDED[name]: seen}))
    (row,) = (row for row in rows if row.name == name)
    assert (row.bound, row.passed) == (7.0, passed)
    assert row.largest == 7.0 * over
    others = [row for row in rows if BOUNDED[row.name] != BOUNDED[name]]
    assert all(row.passed == 0 for row in others)


def test_a_run_that_diverged_counts_as_passed(monkeypatch, capsys):
    monkeypatch.setattr(check_command, "monte_carlo", lambda *_, **__: observed([0.5, np.nan]))
    assert main(["check", "--paper", "--monte-carlo", "2", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["monte_carlo"]
    assert found["diverged"] == 1
    assert found["bounds"]["error_bound"]["passed"] == 1
    assert found["largest_error"] is None


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--monte-carlo", "0"], "--monte-carlo must be at least 1"),
        (["--seed", "1"], "goes with --monte-carlo"),
        (["--paper", "--monte-carlo", "5", "--seed", "-1"], "not be negative"),
    ],
)
def test_bad_words_are_one_line(words, complaint, capsys):
    assert main(["check", *words]) == 2
    assert complaint in capsys.readouterr().err


def test_gains_of_which_nothing_is_proven_say_so(tmp_path, capsys):
    design = PaperIdentifier.for_vehicle(sedan())
    unproven = replace(design, gains=replace(design.gains, eta_W=6.0 * design.gains.eta_W))
    path = tmp_path / "design.toml"
    path.write_text(design_text(unproven))
    main(["check", "--design", str(path), "--monte-carlo", "20"])
    assert "nothing is proven of these gains" in capsys.readouterr().out


def test_a_drive_that_diverges_fails_the_check_where_nothing_is_proven(tmp_path, capsys):
    design = PaperIdentifier.for_vehicle(sedan())
    gains = replace(design.gains, eta_W=1e9, rho_W=0.0, rho_V=0.0)
    path = tmp_path / "design.toml"
    path.write_text(design_text(replace(design, gains=gains)))
    assert main(["check", "--design", str(path), "--monte-carlo", "20"]) == 1
    told = capsys.readouterr().out
    assert "nothing is proven" in told
    assert "diverged on 0" not in told


def test_divergence_alone_is_an_exit_code_of_one(monkeypatch, capsys):
    """No row is there to be passed: the projection's certificate, and drives that blew up."""
    monkeypatch.setattr(check_command, "bound_rows", lambda *_: [])
    monkeypatch.setattr(check_command, "monte_carlo", lambda *_, **__: observed([0.5, np.inf]))
    assert main(["check", "--paper", "--monte-carlo", "2"]) == 1
    monkeypatch.setattr(check_command, "monte_carlo", lambda *_, **__: observed([0.5, 0.5]))
    assert main(["check", "--paper", "--monte-carlo", "2"]) == 0
    capsys.readouterr()


def test_every_row_is_passed_by_a_law_that_breaks_what_it_bounds():
    """The certificate of a sound design, beside drives of one whose layers leak wrongly."""
    vehicle, design = sedan(), PaperIdentifier.for_vehicle(sedan())
    driving = natural_driving(vehicle)
    passed = {}
    for name, changed in {
        "error_bound": {"eta_W": 3e5, "rho_W": 0.0},
        "weight_bound": {"eta_W": 3e5, "rho_W": 0.0},
        "V_bound": {"rho_V": 3e3},
        "projection_bound": {"eta_W": 3e5, "rho_W": 0.0},
    }.items():
        kept = replace(design, gains=replace(design.gains, W_max=5.0, V_max=13.0))
        told = kept if name == "projection_bound" else design
        planted = replace(design, gains=replace(design.gains, **changed))
        beginning = Beginning(W=0.0, V=12.0)
        rng = np.random.default_rng(1)
        seen = monte_carlo(planted, vehicle, driving, 30, beginning=beginning, rng=rng)
        found = bound_rows(certify(told, vehicle), seen)
        passed[name] = {row.name: row.passed for row in found}[name]
    assert min(passed.values()) > 0, passed


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


@pytest.mark.parametrize("share", [0.5, 2.0, np.inf])
def test_drives_resume_with_the_smaller_of_proven_and_projected_weights(
    monkeypatch, tmp_path, share
):
    """A projection beyond what the leakage keeps, or none, lets no drive begin beyond the bound."""
    seen, design = [], PaperIdentifier.for_vehicle(sedan())
    bound = certify(design, sedan())["weight_bound"].value
    path = tmp_path / "design.toml"
    gains = replace(design.gains, W_max=share * bound)
    path.write_text(design_text(replace(design, gains=gains)))

    def resumed(*_, beginning, **__):
        seen.append(beginning.W)
        return observed([0.5])

    monkeypatch.setattr(check_command, "monte_carlo", resumed)
    main(["check", "--design", str(path), "--monte-carlo", "1"])
    assert seen == [pytest.approx(min(share, 1.0) * bound, rel=1e-3)]
