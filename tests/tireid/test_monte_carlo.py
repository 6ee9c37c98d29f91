"""`tireid check --monte-carlo` as a user meets it."""

import json

import numpy as np
import pytest

from identifier.stability import Certificate
from identifier.stability.monte_carlo import Observed
from identifier.stability.property import statement
from tireid import check_command
from tireid.cli import main
from tireid.monte_carlo_table import bound_rows


def observed(xi_tilde):
    ones = np.ones(len(xi_tilde))
    return Observed(np.array(xi_tilde), ones, ones, ones, 3)


def test_no_drive_passes_a_proven_bound(capsys):
    assert main(["check", "--monte-carlo", "200", "--seed", "5"]) == 0
    told = capsys.readouterr()
    assert "200 random drives within what is judged, seed 5" in told.out
    assert "|xi - xi_hat|, by the leakage [kN s]" in told.out
    assert "200 of 200 random drives" in told.err


def test_the_numbers_are_in_the_json(capsys):
    assert main(["check", "--monte-carlo", "50", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["monte_carlo"]
    assert (found["drives"], found["seed"], found["diverged"]) == (50, 0, 0)
    bound = found["bounds"]["error_bound"]
    assert bound["passed"] == 0
    assert bound["over_seen"]["least"] == pytest.approx(bound["value"] / bound["largest"])


@pytest.mark.parametrize("json_too", [[], ["--json"]])
def test_a_bound_that_is_passed_fails_the_check(monkeypatch, capsys, json_too):
    planted = observed([0.5, 1e3, 0.5])
    monkeypatch.setattr(check_command, "monte_carlo", lambda *_, **__: planted)
    assert main(["check", "--monte-carlo", "3", *json_too]) == 1
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
    assert main(["check", "--monte-carlo", "2", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["monte_carlo"]
    assert found["diverged"] == 1
    assert found["bounds"]["error_bound"]["passed"] == 1
    assert found["largest_error"] is None


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--monte-carlo", "0"], "--monte-carlo must be at least 1"),
        (["--seed", "1"], "goes with --monte-carlo"),
        (["--monte-carlo", "5", "--seed", "-1"], "not negative"),
    ],
)
def test_bad_words_are_one_line(words, complaint, capsys):
    assert main(["check", *words]) == 2
    assert complaint in capsys.readouterr().err


def test_gains_of_which_nothing_is_proven_say_so(tmp_path, capsys):
    from dataclasses import replace

    from identifier.defaults import default_design
    from identifier.design_file import design_text
    from models.vehicle import sedan

    design = default_design(sedan())
    unproven = replace(design, gains=replace(design.gains, eta_W=6.0 * design.gains.eta_W))
    path = tmp_path / "design.toml"
    path.write_text(design_text(unproven))
    main(["check", str(path), "--monte-carlo", "20"])
    assert "nothing is proven of these gains" in capsys.readouterr().out
