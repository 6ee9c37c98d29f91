"""`tireid compare` as a user meets it: its numbers by another road, its files, its refusals."""

import csv
import html
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from identifier.compare.course import INFINITE, Shares
from identifier.methods import METHODS, make_method
from models.recordings import read_recording
from models.vehicle import sedan
from tests.pages import outline
from tests.rivals import INSTALLED, needs_rivals
from tests.tireid.conftest import json_of, page_in, refusal, rewritten, typed
from tireid.commands.compare_results import _ERROR_COLUMNS
from tireid.figures.compare import short_names
from tireid.output import write_json

ROOT = Path(__file__).resolve().parents[2]
SIGNAL = ("linear_kf",) * INSTALLED  # which has nothing to freeze
METHODS_TRIED = ("integral", "linear", *SIGNAL, "fit")


@pytest.fixture(scope="module")
def words(logs):
    return ["compare", logs / "slalom.csv", logs / "quick.csv", "--vehicle",
            logs / "car.toml"]  # fmt: skip


@pytest.fixture(scope="module")
def result(words, tmp_path_factory):
    out = tmp_path_factory.mktemp("compare") / "out"
    words = [*words, "--method", *METHODS_TRIED]
    assert typed(*words, "--out", out) == 0
    return out


@pytest.fixture(scope="module")
def numbers(result):
    return json_of(result / "compare.json")


def linear_error(path, stiffness):
    """RMSE per axle of C α with the small-angle slip of (3) [N]."""
    recording, car = read_recording(path), sedan()
    v_y, r, force = recording.v_y, recording.r, recording.axle_force
    alpha = (
        recording.u
        - np.column_stack([v_y + car.l_f * r, v_y - car.l_r * r]) / (recording.v_x[:, None])
    )
    error = np.sqrt(np.mean((alpha * stiffness - force) ** 2, axis=0))
    return dict(zip(("front", "rear"), error, strict=True)), np.sqrt(np.mean(force**2, axis=0))


def test_the_linear_tire_has_the_error_of_stiffness_times_slip(numbers, logs):
    car = sedan()
    told = [car.cornering_stiffness_front, car.cornering_stiffness_rear]
    linear = numbers["methods"]["linear"]
    shares = []
    for name in ("slalom", "quick"):
        error, size = linear_error(logs / f"{name}.csv", told)
        assert linear["online_N"][name] == pytest.approx(error, rel=1e-6)
        for learnt in ("slalom", "quick"):
            assert linear["frozen_N"][learnt][name] == pytest.approx(error, rel=1e-6)
        shares.append(100 * np.linalg.norm(list(error.values())) / np.linalg.norm(size))
        rms = numbers["recordings"][name]["rms_force_N"]
        assert [rms["front"], rms["rear"]] == pytest.approx(size)
    assert linear["percent"] == pytest.approx(
        dict.fromkeys(("online", "in_sample", "other"), np.mean(shares))
    )


@needs_rivals
def test_a_signal_estimator_has_no_frozen_error(numbers, result):
    signal = numbers["methods"]["linear_kf"]
    assert signal["frozen_N"] is None
    assert signal["percent"]["other"] is None
    assert signal["percent"]["online"] > 0.0
    assert "a signal, no model" in (result / "tables.txt").read_text()


@needs_rivals
@pytest.mark.heavy
@pytest.mark.usefixtures("undrawn")
def test_the_table_says_which_baselines_know_lag_and_offsets(words, tmp_path, capsys):
    out, names = tmp_path / "out", ("linear", "textbook_ekf", "magic_formula_ekf")
    assert typed(*words, "--method", *names, "--out", out) == 0
    learnt = "magic_formula_ekf: lag of the tires and offsets of the sensors are identified"
    without = "textbook_ekf: the textbook's, without lag and offsets"
    for text in (
        capsys.readouterr().out,
        (out / "tables.txt").read_text(),
        page_in(out),
    ):
        assert learnt in text
        assert html.escape(without) in text or without in text
        assert "linear: " not in text, "it has neither, and says nothing"


@pytest.mark.usefixtures("undrawn")
def test_without_true_forces_methods_are_judged_by_the_motion(
    words, logs, numbers, tmp_path, out, capsys
):
    """The order is that of the true forces, and the shares are near theirs."""
    command, *_, vehicle, car = words
    blind = [
        rewritten(logs / f"{n}.csv", tmp_path / f"{n}.csv", axle_force=None)
        for n in ("slalom", "quick")
    ]
    line = [command, *blind, vehicle, car, "--method", *METHODS_TRIED, "--accept"]
    assert typed(*line, "--out", out) == 0
    data = json_of(out / "compare.json")
    assert (data["judged_by"], numbers["judged_by"]) == ("motion", "truth")
    shares = {name: data["methods"][name]["percent"]["online"] for name in METHODS_TRIED}
    true = {name: numbers["methods"][name]["percent"]["online"] for name in METHODS_TRIED}
    assert sorted(shares, key=shares.get) == sorted(true, key=true.get)
    assert shares["linear"] == pytest.approx(true["linear"], rel=0.2)
    said = capsys.readouterr()
    assert "no true forces; judged by the motion" in said.err
    assert "means over 0.3 s by the motion" in said.out


def test_a_method_that_needs_an_accelerometer_is_left_out_where_a_log_has_none(
    words, logs, tmp_path, capsys, undrawn
):
    out, quick = tmp_path / "out", rewritten(logs / "quick.csv", tmp_path / "blind.csv", a_y=None)
    words = [words[0], words[1], quick, *words[3:]]
    assert typed(*words, "--method", "inertial", "linear", "--out", out) == 0
    why = "inertial: left out, it learns from ay and blind has none"
    for text in ((out / "tables.txt").read_text(), page_in(out)):
        assert why in text
    told = capsys.readouterr()
    assert why in told.out and why in told.err
    numbers = json_of(out / "compare.json")
    assert list(numbers["methods"]) == ["linear"] and list(numbers["left_out"]) == ["inertial"]
    assert typed(*words, "--method", "inertial", "--out", tmp_path / "other") == 2
    assert "blind has none" in capsys.readouterr().err


def test_times_are_over_that_of_the_integral_law(numbers):
    methods = numbers["methods"]
    assert methods["integral"]["step_ratio"] == 1.0
    ratio = methods["linear"]["step_s"] / methods["integral"]["step_s"]
    assert methods["linear"]["step_ratio"] == pytest.approx(ratio)
    assert 0.0 < ratio < 1.0
    assert methods["fit"]["step_s"] is None and methods["fit"]["step_ratio"] is None


def test_the_tables_as_csv_hold_the_numbers_of_the_json(numbers, result):
    with (result / "compare.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == _ERROR_COLUMNS
    online, frozen = 2 * len(METHODS_TRIED), 4 * (len(METHODS_TRIED) - len(SIGNAL))
    assert len(rows) == online + frozen
    for row in rows:
        method = numbers["methods"][row["method"]]
        if row["kind"] == "frozen":
            error = method["frozen_N"][row["identified_on"]][row["replayed_on"]]
        else:
            assert row["identified_on"] == row["replayed_on"]
            error = method["online_N"][row["replayed_on"]]
        assert_shares(row, error, numbers["recordings"][row["replayed_on"]]["rms_force_N"])


def assert_shares(row, error, size):
    """Errors of a row in N, and in percent of the rms of what was replayed on."""
    assert float(row["front_N"]) == pytest.approx(error["front"])
    assert float(row["rear_N"]) == pytest.approx(error["rear"])
    for axle in ("front", "rear"):
        assert float(row[f"{axle}_percent"]) == pytest.approx(100.0 * error[axle] / size[axle])
    both = np.hypot(error["front"], error["rear"]) / np.hypot(size["front"], size["rear"])
    assert float(row["both_percent"]) == pytest.approx(100.0 * both)
    assert size["front"] != pytest.approx(size["rear"], rel=0.02)


def test_the_report_is_whole_and_says_the_numbers_of_the_summary(result):
    told = outline(page_in(result)).text
    numbers = json_of(result / "compare.json")
    best = min(
        (m["percent"]["other"], name)
        for name, m in numbers["methods"].items()
        if m["percent"]["other"] is not None
    )
    assert f"{best[0]:.1f} %" in told and best[1] in told
    assert "tireid compare" in told


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (["--method", "magic"], "method must be one of fit, axle, "),
        (["--vehicle", "nowhere.toml"], "nowhere.toml"),
        ([], "slalom is given twice"),
    ],
)
def test_wrong_words_are_one_clear_line_and_leave_nothing(words, logs, out, capsys, extra, said):
    command, *rest = words
    twice = [logs / "slalom.csv"] * (extra == [])
    assert said in refusal(capsys, [command, *twice, *rest, *extra, "--out", out])
    needed = "--vehicle FILE is needed with a LOG"
    assert needed in refusal(capsys, ["compare", logs / "slalom.csv", "--out", out])
    assert not out.exists()


def test_without_a_log_the_plant_drives(out, laid_out):
    words = ["compare", "--method", "linear"]
    assert typed(*words, "--out", out) == 0
    data = json_of(out / "compare.json")
    assert set(data["recordings"]) == {"slalom_20", "step_steer", "lane_change", "slalom_25"}
    assert not (out / "side_slip.png").exists(), "no method tells it"


@pytest.mark.heavy
@pytest.mark.usefixtures("undrawn")
def test_a_recording_that_teaches_nothing_right_makes_the_exit_code(
    logs, tmp_path, capsys, undrawn
):
    log = rewritten(logs / "slalom.csv", tmp_path / "mirrored.csv", v_y=lambda log: -log.v_y)
    words = ["compare", log, "--vehicle", logs / "car.toml"]
    words += ["--no-check", "--method", "linear"]
    assert typed(*words, "--out", tmp_path / "another") == 0
    assert "verdict" not in capsys.readouterr().out
    words.append("fit")
    assert typed(*words, "--out", tmp_path / "refused") == 3
    assert "0 of 1" in page_in(tmp_path / "refused")
    assert "default identified on mirrored: verdict: NOT VALID" in capsys.readouterr().out
    assert typed(*words, "--accept", "--out", tmp_path / "accepted") == 0
    found = json_of(tmp_path / "accepted" / "compare.json")["verdict"]
    assert found["mirrored"]["valid"] is False


def test_the_registry_has_every_name_that_is_promised():
    promised = "linear lagged_ekf integral instantaneous "
    promised += "instantaneous_scaled pi_lead fit axle inertial"
    assert set(METHODS) == set(promised.split())


def test_a_rival_that_is_not_installed_is_told_where_it_is(out, capsys, monkeypatch):
    monkeypatch.setattr("identifier.methods.installed", lambda group: {})
    told = "method joint_ekf is not installed: pip install ./benchmarks/rivals"
    words = ["--method", "joint_ekf", "--out", out]
    assert told in refusal(capsys, ["compare", *words])
    with pytest.raises(SystemExit):
        typed("identify", "log.csv", "--vehicle", "car.toml", *words)
    assert told in capsys.readouterr().err
    with pytest.raises(ValueError, match=told):
        make_method("joint_ekf", sedan())
    assert typed("compare", "log.csv", "--out", out) == 2
    left_out = "without magic_formula_ekf, textbook_ekf, linear_kf, joint_ekf, which are not inst"
    assert left_out in capsys.readouterr().err
    assert (ROOT / "benchmarks/rivals/pyproject.toml").is_file()


def test_runs_of_one_file_are_named_by_the_run_alone():
    assert short_names(["log:a", "log:b"]) == {"log:a": "a", "log:b": "b"}
    assert short_names(["log:a", "other:a"]) == {"log:a": "log:a", "other:a": "other:a"}


def test_what_diverged_is_null_in_the_file_and_not_infinite(tmp_path):
    shares = Shares(np.inf, 6.0, None)._asdict()
    write_json(tmp_path / "compare.json", {"percent": shares, "online_N": asdict(INFINITE)})
    assert json_of(tmp_path / "compare.json") == {
        "percent": {"online": None, "in_sample": 6.0, "other": None},
        "online_N": {"front": None, "rear": None},
    }
