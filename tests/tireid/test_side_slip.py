"""Side slip that methods tell: its error by another road, in tables, files, reports and figures."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identifier.compare.course import Course, SideSlip, cross_replay, side_slip
from identifier.methods import make_method
from identifier.run import identify
from models.recordings import read_recording
from models.vehicle import sedan
from tests.pages import faults_of, outline
from tests.rivals import INSTALLED, needs_rivals, rival
from tireid.cli import main
from tireid.figures.side_slip import side_slip_figure

CAR = sedan()
TOLD = (*("linear_kf", "joint_ekf", "washout") * INSTALLED, "inertial")


@pytest.fixture(scope="module")
def slalom(logs):
    return read_recording(logs / "slalom.csv")


@pytest.fixture(scope="module")
def result(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("side_slip") / "out"
    words = ["compare", f"{logs / 'slalom.csv'}", f"{logs / 'quick.csv'}", "--vehicle"]
    words += [f"{logs / 'car.toml'}", "--method", "linear", *TOLD]
    assert main([*words, "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def methods(result):
    return json.loads((result / "compare.json").read_text())["methods"]


def by_hand(name, recording):
    """RMSE of side slip [deg] and share within two sigma [%], from the outputs of a run."""
    blind = replace(recording, v_y=None)
    outputs = identify(blind, CAR, make_method(name, CAR)).outputs
    v_y = outputs["v_y"].ravel()
    slip = (v_y - recording.v_y) / recording.v_x  # small angles
    away = np.abs(v_y - recording.v_y)
    sd = outputs["v_y_sd"].ravel() if "v_y_sd" in outputs else None
    return np.degrees(np.sqrt((slip**2).mean())), None if sd is None else (away <= 2 * sd).mean()


@pytest.mark.heavy
def test_errors_of_side_slip_are_those_of_the_outputs(methods, logs):
    for name in TOLD:
        for log in ("slalom", "quick"):
            rms, within = by_hand(name, read_recording(logs / f"{log}.csv"))
            told = methods[name]["side_slip"][log]
            assert told["rms_deg"] == pytest.approx(rms, rel=0.01)
            share = told["within_two_sigma_percent"]
            assert share is None if within is None else share == pytest.approx(100 * within)
    assert methods["linear"]["side_slip"] == {}


@pytest.mark.heavy
def test_the_table_has_a_column_of_side_slip_and_a_dash_for_methods_that_read_it(result, methods):
    page = outline((result / "report.html").read_text(encoding="utf-8")).text
    head, *lines = (result / "tables.txt").read_text().splitlines()[1 : 3 + len(TOLD)]
    assert "side slip [deg]" in head and "within 2 sigma" in head
    at = head.index("side slip")
    rows = {line.split()[0]: line[at:].split() for line in lines}
    assert rows["linear"][:2] == ["-", "-"]
    if INSTALLED:
        assert rows["washout"][1] == "-"
    for name in TOLD:
        told = [one["rms_deg"] for one in methods[name]["side_slip"].values()]
        assert rows[name][0] == f"{np.mean(told):.3f}"
        assert rows[name][0] in page
    names = ", ".join(TOLD)
    for file in ("report.html", "tables.txt"):
        assert f"{names}: get no " in (result / file).read_text(encoding="utf-8")
    assert "Side slip estimated by methods without a lateral velocity." in page
    assert faults_of((result / "report.html").read_text(encoding="utf-8")) == []
    assert (result / "side_slip.png").read_bytes().startswith(b"\x89PNG")


def test_without_a_method_that_tells_there_is_no_figure(logs, tmp_path, undrawn):
    words = ["compare", f"{logs / 'slalom.csv'}", "--vehicle", f"{logs / 'car.toml'}"]
    words += ["--method", "linear", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    assert not (tmp_path / "out" / "side_slip.png").exists()


@needs_rivals
def test_a_sample_too_slow_does_not_count_and_one_that_is_off_does(slalom):
    history = identify(slalom, CAR, make_method("washout", CAR))
    found = side_slip(history, 1.0, slalom.v_y)
    moved = slalom.v_y.copy()
    moved[100] += 9.0
    assert side_slip(history, 1.0, moved).rms > found.rms + 0.2
    v_x = slalom.v_x.copy()
    v_x[100] = 0.5
    slow = replace(history, recording=replace(slalom, v_x=v_x))
    assert side_slip(slow, 1.0, moved).rms == pytest.approx(found.rms, rel=0.01)
    linear = identify(slalom, CAR, make_method("linear", CAR))
    assert side_slip(linear, 1.0, slalom.v_y) is None


def test_a_method_that_has_diverged_has_an_infinite_error(slalom):
    history = identify(slalom, CAR, make_method("inertial", CAR))
    outputs = {port: np.full_like(value, np.nan) for port, value in history.outputs.items()}
    found = side_slip(replace(history, outputs=outputs), 1.0, slalom.v_y)
    assert found.rms == np.inf and found.within == 0.0


@pytest.mark.parametrize("name", [*TOLD, "axle"])
def test_a_comparison_shows_no_lateral_velocity_to_a_method_that_tells_it(name, slalom, rng):
    wrong = replace(slalom, v_y=rng.permutation(slalom.v_y))
    method = make_method(name, CAR)
    found, other = (
        cross_replay(method, Course(vehicle=CAR, recordings=(one,), min_speed=1.0)).online
        for one in (slalom, wrong)
    )
    assert (found == other) == (name != "axle")


@pytest.mark.heavy
@pytest.mark.parametrize("method", ["inertial", rival("joint_ekf")])
def test_identify_draws_the_side_slip_that_was_told(logs, tmp_path, method, laid_out):
    for log, name in ((logs / "slalom.csv", "with"), (tmp_path / "blind.csv", "without")):
        if name == "without":
            whole = (logs / "slalom.csv").read_text().splitlines()
            cells = [line.split(",") for line in whole]
            keep = [i for i, column in enumerate(cells[0]) if column != "vy"]
            log.write_text("\n".join(",".join(row[i] for i in keep) for row in cells) + "\n")
        out = tmp_path / name
        words = ["identify", str(log), "--vehicle", str(logs / "car.toml"), "--method", method]
        assert main([*words, "--accept", "--out", str(out)]) == 0
        assert (out / "side_slip.png").exists()
        page = outline((out / "report.html").read_text(encoding="utf-8")).text
        assert "Side slip as it was estimated." in page


def made_up(recording, scale, sd=None):
    return SideSlip(
        v_y=scale * recording.v_y,
        v_y_sd=None if sd is None else np.full(len(recording), sd),
        rms=abs(scale - 1.0),
        within=None if sd is None else 90.0,
    )


def band_of(axes):
    (band,) = axes.collections
    return np.ptp(band.get_paths()[0].vertices[:, 1])


def test_the_figure_has_truth_band_and_errors(slalom):
    name = slalom.name
    slow, fast = made_up(slalom, 0.5, sd=0.01), made_up(slalom, 1.2, sd=0.3)
    told = {"linear_kf": {name: slow}, "inertial": {name: fast}, "axle": {}}
    upper, lower = side_slip_figure([slalom], told).axes
    assert upper.get_ylabel() == "side slip [deg]" and lower.get_ylabel() == "error [deg]"
    labels = upper.get_legend_handles_labels()[1]
    assert set(labels) == {"within 2 standard deviations", "recorded", "linear kf", "inertial"}
    lines = {line.get_label(): line.get_ydata() for line in upper.lines}
    exact = np.degrees(np.arctan(slalom.v_y / slalom.v_x))
    np.testing.assert_allclose(lines["recorded"], exact, atol=1e-9)
    errors = [line.get_ydata() for line in lower.lines[:2]]
    np.testing.assert_allclose(errors[0], lines["linear kf"] - exact, atol=1e-9)
    np.testing.assert_allclose(errors[1], lines["inertial"] - exact, atol=1e-9)
    reach = np.degrees(np.arctan(0.6 / 20.0))  # two standard deviations, both sides of the largest
    assert band_of(upper) > 2.0 * reach
    without = side_slip_figure([slalom], {"linear_kf": {name: slow}}).axes[0]
    assert band_of(without) < band_of(upper)


def test_without_a_recorded_v_y_the_figure_shows_the_estimate_alone(slalom):
    blind = replace(slalom, v_y=None)
    told = {"joint_ekf": {slalom.name: made_up(slalom, 0.9, sd=0.1)}}
    (axes,) = side_slip_figure([blind], told).axes
    assert "recorded" not in axes.get_legend_handles_labels()[1]
    with pytest.raises(ValueError, match="no method estimated a lateral velocity"):
        side_slip_figure([blind], {"axle": {}})
