"""`tireid predict`: what a stored model says of a log, with truth and without, on another car."""

import json
from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from identifier.methods import make_method
from models.friction import Friction, FrictionChange
from models.recordings import read_recording, write_recording
from tests.identifier.conftest import steered
from tests.tireid.conftest import json_of, page_in, refusal, rewritten, table_of, typed
from tests.tireid.test_zoom import unpacked


@pytest.fixture(scope="module")
def model(logs, tmp_path_factory):
    tire = ti.identify(read_recording(logs / "slalom.csv"), ti.sedan()).tire
    path = tmp_path_factory.mktemp("model") / "tire.json"
    tire.save(path)
    return path


@pytest.fixture(scope="module")
def blind(logs, tmp_path_factory):
    """The quick drive without its true forces."""
    target = tmp_path_factory.mktemp("blind") / "blind.csv"
    return rewritten(logs / "quick.csv", target, axle_force=None)


@pytest.fixture
def weak(model, tmp_path):
    """A refused model of half the forces at each slip."""
    data = json_of(model)
    for name, one in data["parameters"].items():
        if name.startswith(("ln_stiffness", "ln_grip")):
            one["value"] += np.log(0.5)
        elif name.startswith("residual"):
            one["value"] *= 0.5
    (tmp_path / "weak.json").write_text(json.dumps(data | {"valid": False}), encoding="utf-8")
    return tmp_path / "weak.json"


def predicted(out, *words, status=0):
    assert typed("predict", *words, "--out", out) == status
    return json_of(out / "summary.json"), table_of(out / "forces.csv")


def test_it_says_what_the_interface_says(model, logs, out, capsys, undrawn):
    summary, columns = predicted(out, model, logs / "quick.csv")
    tire, log = ti.TireModel.load(model), read_recording(logs / "quick.csv")
    force = tire.predict(log)
    np.testing.assert_allclose(columns["Fyf_predicted_N"], force[:, 0], rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(columns["Fyr_true_N"], log.axle_force[:, 1], rtol=1e-8, atol=1e-6)
    missed = force - log.axle_force
    for axle, error in zip(("front", "rear"), missed.T, strict=True):
        assert summary["rmse_N"][axle] == pytest.approx(np.sqrt(np.mean(error**2)))
    said = capsys.readouterr()
    assert f"{summary['rmse_N']['front']:.4g} N" in said.out
    assert "wrote" in said.err


def test_it_leaves_a_report_with_figures(model, logs, blind, tmp_path, capsys):
    for name, asked in (("with", logs / "quick.csv"), ("without", blind)):
        out = tmp_path / name
        summary, _ = predicted(out, model, asked)
        page = page_in(out)
        for figure in ("slip", "forces", "inputs"):
            assert (out / f"{figure}.png").read_bytes().startswith(b"\x89PNG")
        assert page.count("<img") == len(unpacked(page)[0]) == 3, "all have a Zoom"
        front, rear = (f"{100.0 * x:.1f}" for x in summary["verdict"]["measures"]["force_missed"])
        assert f"<dd>{front} / {rear} %</dd>" in page
        assert f"model error over the force in the motion: {front} / {rear} %" in (
            capsys.readouterr().out
        )
        assert '<div class="good"><dt>the verdict' in page
        assert page.index("Axle force over slip angle") < page.index("No notes.")


def test_without_truth_it_says_what_of_the_motion_is_explained(model, blind, out, capsys, undrawn):
    summary, columns = predicted(out, model, blind)
    assert (summary["rmse_N"], summary["rms_force_N"]) == (None, None)
    assert not [name for name in columns.dtype.names if "true" in name]
    assert 0.9 < summary["motion"]["explained_lateral"] <= 1.0
    said = capsys.readouterr().out
    assert "cannot be given in newtons" in said
    share = 100.0 * summary["motion"]["explained_lateral"]
    assert f"explained are {share:.1f} % of the lateral" in said


def test_a_model_of_half_the_force_explains_less_and_looks_refused(
    model, weak, logs, tmp_path, undrawn
):
    """(1/2)² of the mean square stays: three quarters are explained, by the lateral balance."""
    whole, _ = predicted(tmp_path / "whole", model, logs / "quick.csv")
    half, _ = predicted(tmp_path / "half", weak, logs / "quick.csv", status=3)
    predicted(tmp_path / "accepted", weak, logs / "quick.csv", "--accept")
    assert whole["verdict"]["valid"]
    errors = [one for one in half["verdict"]["findings"] if one["code"] == "force_missed"]
    assert errors and all(", largest at " in one["text"] for one in errors)
    assert whole["motion"]["explained_lateral"] > 0.98
    assert half["motion"]["explained_lateral"] == pytest.approx(0.75, abs=0.05)
    assert max(half["windows_within_band"]) < 0.6 < min(whole["windows_within_band"])
    page = page_in(tmp_path / "half")
    assert '<div class="bad"><dt>the verdict' in page and 'class="struck"' in page
    assert "NOT VALID. Axle force over slip angle" in page
    assert '<li class="bad">' in page and "has no valid verdict on its identification" in page
    assert '<div class="good">' not in page


def test_slip_beyond_what_is_known_is_told(logs, tmp_path, capsys, undrawn):
    log = read_recording(logs / "slalom.csv")
    tire = ti.identify(log, ti.sedan()).freeze(t=1.6)  # the slalom has just begun
    tire.save(tmp_path / "young.json")
    words = tmp_path / "young.json", logs / "quick.csv", "--accept"
    summary, _ = predicted(tmp_path / "out", *words)
    slip = tire.lagged_slip(read_recording(logs / "quick.csv"))[:, 0]
    beyond = np.mean(np.abs(slip) > 1.01 * tire.known_slip[0])
    assert summary["beyond_known_slip"][0] == pytest.approx(beyond, abs=1e-3)
    assert beyond > 0.2
    assert f"which {100.0 * beyond:.0f} /" in capsys.readouterr().out


def test_it_says_how_often_the_band_held(model, logs, out, capsys, undrawn):
    summary, _ = predicted(out, model, logs / "quick.csv")
    held = summary["windows_within_band"]
    said = f"in {100.0 * held[0]:.0f} / {100.0 * held[1]:.0f} % of the windows of 0.3 s"
    assert said in capsys.readouterr().out
    assert min(held) > 0.7
    table = table_of(out / "forces.csv")
    for k, axle in enumerate(("Fyf", "Fyr")):
        half = table[f"{axle}_half_band_N"]
        away = np.abs(table[f"{axle}_predicted_N"] - table[f"{axle}_true_N"])
        share = np.mean(away[half > 0.0] <= half[half > 0.0])
        assert summary["truth_within_band"][k] == pytest.approx(share, abs=0.01)
        assert share > 0.7


def test_an_axle_model_is_mounted_on_the_car_that_drove(model, logs, tmp_path, capsys, undrawn):
    """A car with more load in the back: forces scale by the loads of the axles."""
    car = ti.sedan()
    laden = replace(car, mass=1.2 * car.mass, name="laden")
    laden.to_toml(tmp_path / "laden.toml")
    words = (logs / "quick.csv", "--vehicle", tmp_path / "laden.toml", "--no-check")
    summary, columns = predicted(tmp_path / "laden", model, *words)
    _, own = predicted(tmp_path / "own", model, logs / "quick.csv")
    assert summary["vehicle"]["mass"] == pytest.approx(1.2 * car.mass)
    assert "scaled by the axle loads" in capsys.readouterr().err
    car.to_toml(tmp_path / "own.toml")  # with its chassis, which no stored model has
    predicted(tmp_path / "same", model, logs / "quick.csv", "--vehicle", tmp_path / "own.toml")
    # Drag slows a heavier car less, so that its ellipse and load transfer differ a little.
    np.testing.assert_allclose(columns["Fyf_predicted_N"], 1.2 * own["Fyf_predicted_N"], rtol=0.02)
    assert "scaled by the axle loads" not in capsys.readouterr().err


@pytest.mark.sweep("words1*", "words2*")
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["missing.json", "log.csv"], "missing.json: there is no such file"),
        (["MODEL", "missing.csv"], "missing.csv"),
        (["NETWORK", "LOG", "--vehicle", "CAR"], "cannot be mounted on 'other'"),
    ],
)
def test_what_cannot_be_asked_is_one_line_and_leaves_nothing(
    words, told, model, logs, tmp_path, out, capsys
):
    car = ti.sedan()
    replace(car, name="other", mass=1.1 * car.mass).to_toml(tmp_path / "other.toml")
    log = read_recording(logs / "slalom.csv")
    ti.identify(log, car, make_method("integral", car)).freeze().save(tmp_path / "network.json")
    names = {
        "MODEL": model,
        "LOG": logs / "slalom.csv",
        "NETWORK": tmp_path / "network.json",
        "CAR": tmp_path / "other.toml",
    }
    line = ["predict", *(str(names.get(word, word)) for word in words), "--out", out]
    assert told in refusal(capsys, line)
    assert not out.exists()


def test_a_folder_is_replaced_only_when_told(model, logs, out, capsys, undrawn):
    line = ["predict", model, logs / "quick.csv", "--out", out]
    assert [typed(*line), typed(*line), typed(*line, "--force")] == [0, 2, 0]
    assert "add --force" in capsys.readouterr().err


def test_another_road_is_told_with_its_friction(model, tmp_path, out, capsys, undrawn):
    wet = Friction(changes=(FrictionChange(scale=0.5, at_time=10.0),))
    run = steered(5, 24.0, amplitude=0.05, friction=wet)
    write_recording(replace(run.recording(), axle_force=None), tmp_path / "wet.csv")
    summary, _ = predicted(out, model, tmp_path / "wet.csv", "--accept")
    (road,) = summary["friction"]["roads"]
    assert 10.0 < road["first"] < 14.0 and abs(road["ratio"] - 0.5) < 3.0 * road["sd"]
    table = table_of(out / "friction.csv")
    assert table["another"][table["t_s"] > road["first"] + 1.0].min() > 0.5
    assert "of the friction of the identification drive" in capsys.readouterr().out


def test_a_band_that_nobody_calibrated_tells_no_road(logs, tmp_path, out, capsys, undrawn):
    unchecked = tmp_path / "unchecked.json"
    log = read_recording(logs / "slalom.csv")
    ti.identify(log, ti.sedan(), make_method("axle", ti.sedan())).freeze().save(unchecked)
    summary, _ = predicted(out, unchecked, logs / "quick.csv")
    assert summary["friction"] is None and not (out / "friction.csv").exists()
    assert "friction: not observable, the band is of the identifier" in capsys.readouterr().out


def test_a_road_that_is_the_same_is_said_to_be(model, logs, out, capsys, undrawn):
    summary, _ = predicted(out, model, logs / "quick.csv")
    assert summary["friction"] is None and summary["verdict"]["valid"]
    assert "friction: that of the identification drive" in capsys.readouterr().out
    found = ti.replay(read_recording(logs / "quick.csv"), ti.TireModel.load(model)).friction()
    assert found.unchanged and not found.roads


def test_a_drive_that_cannot_judge_is_amber_and_no_failure(model, logs, tmp_path, capsys, undrawn):
    log = read_recording(logs / "quick.csv")
    straight = replace(log, v_y=0.02 * log.v_y, r=0.02 * log.r, delta_f=0.02 * log.delta_f)
    for name, one in (("straight", straight), ("moment", log.between(2.0, 3.0))):
        write_recording(replace(one, axle_force=None, a_y=None), tmp_path / f"{name}.csv")
        asked = (model, tmp_path / f"{name}.csv", "--no-check")
        summary, _ = predicted(tmp_path / name, *asked)
        assert (summary["verdict"]["valid"], summary["verdict"]["judged"]) == (False, False)
        assert {one["state"] for one in summary["verdict"]["numbers"]} <= {
            *("not judged", "not identifiable from this drive")
        }
        said = capsys.readouterr().out
        assert "verdict: cannot judge, " in said and "NOT VALID" not in said
        page = page_in(tmp_path / name)
        assert '<div class="doubt"><dt>the verdict' in page and 'class="struck"' not in page
