"""`tireid lap`: numbers that agree, race lines in and out, engines, refusals, a driven lap."""

import json

import numpy as np
import pytest
from scipy.integrate import trapezoid

import tireid as ti
from models.maneuvers import Slalom
from models.plant import Plant
from tests.tireid.conftest import json_of, page_in, refusal, table_of, typed


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Tires of a slalom, a race line of TUM's format of 300 m, and a straight."""
    folder = tmp_path_factory.mktemp("lap")
    slalom = Slalom(amplitude=0.07, frequency=0.5, onset=1.0, rate_limit=0.5, duration=15.0)
    log = Plant(ti.sedan()).simulate(slalom, speed=15.0).recording()
    run = ti.identify(log, ti.sedan())
    network = ti.make_method("integral", ti.sedan())
    ti.identify(log, ti.sedan(), network).tire.save(folder / "network.json")
    run.tire.save(folder / "weights.json", valid=True)
    run.tire.save(folder / "refused.json", valid=False)
    ti.sedan().to_toml(folder / "car.toml")
    at = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    rows = np.zeros((60, 7))
    rows[:, 1:3] = np.column_stack([60.0 * np.cos(at), 35.0 * np.sin(at)])
    names = "s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2"
    np.savetxt(folder / "line.csv", rows, delimiter="; ", header=f"of a planner\n{names}")
    (folder / "straight.csv").write_text("x,y\n0,0\n100,0\n300,0\n")
    (folder / "ax.csv").write_text("# v_mps, ax_max_machines_mps2\n0, 3\n15, 1\n")
    (folder / "power.csv").write_text("speed_kmh,accel_g\n0,0.3\n54,0.1\n")
    (folder / "three.csv").write_text("v_mps,ax_mps2,gear\n0,3,1\n15,1,2\n")
    return folder


def lap(folder, out, *words, path="line.csv"):
    return typed("lap", folder / "weights.json", "--path", folder / path, *words, "--out", out)


def test_the_files_agree_with_each_other_and_the_race_line_is_the_path(folder, out, capsys):
    assert lap(folder, out) == 0
    summary, page, said = json_of(out / "summary.json"), page_in(out), capsys.readouterr().out
    rows = np.genfromtxt(out / "lap.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    time = summary["lap_time_s"]
    assert rows["t_s"][-1] == pytest.approx(time)
    assert trapezoid(1.0 / rows["v_m_s"], rows["s_m"]) == pytest.approx(time, rel=1e-4)
    np.testing.assert_allclose(rows["a_y_m_s2"], rows["v_m_s"] ** 2 * rows["kappa_1_m"], rtol=1e-6)
    assert rows["used"].max() == pytest.approx(0.82, abs=0.01) and rows["used"].min() >= 0.0
    assert set(rows["axle"]) <= {"front", "rear"}
    assert sum(summary["limited_by"].values()) == pytest.approx(1.0)
    assert f"{time:.2f} s" in said and f"{time:.2f} s" in page
    assert sum("note: " in line for line in said.splitlines()) == len(summary["notes"]) <= 3

    again = ti.paths.Path.from_csv(out / "raceline.csv")
    assert again.closed and again.length == pytest.approx(summary["length_m"], abs=1e-3)
    tum = np.loadtxt(out / "raceline.csv", delimiter=";")
    assert tum.shape[1] == 7 and tum[-1, 0] == pytest.approx(summary["length_m"])
    ahead = np.diff(tum[:, 1:3], axis=0)
    north = np.remainder(np.arctan2(-ahead[:, 0], ahead[:, 1]) - tum[:-1, 3] + 3.0, 2.0 * np.pi)
    assert np.abs(north - 3.0).max() < 0.02  # 0 along Y, counted to the left
    np.testing.assert_allclose(tum[:, 5], rows["v_m_s"], rtol=1e-6)
    assert np.abs(tum[:, 3]).max() <= np.pi


def test_less_share_friction_or_engine_is_slower(folder, out, undrawn):
    def time(*words):
        assert lap(folder, out, *words, "--force") == 0
        return json_of(out / "summary.json")["lap_time_s"]

    full = time()
    assert time("--share", "41%") == pytest.approx(full * np.sqrt(2.0), rel=0.02)
    assert time("--friction", "0.5") == pytest.approx(full * np.sqrt(2.0), rel=0.02)
    assert time("--confidence", "0.99") > full
    assert time("--v-max", "36km/h") == pytest.approx(
        json_of(out / "summary.json")["length_m"] / 10
    )
    slow = time("--engine", folder / "ax.csv")
    assert slow > full and time("--brakes", "0.2g") > full
    v = table_of(out / "lap.csv")["v_m_s"]
    assert time("--engine", folder / "power.csv") == pytest.approx(slow, rel=0.01)
    assert v.min() > 3.0


def test_half_of_the_ellipse_is_used_where_half_of_it_is_asked():
    limits = ti.SpeedLimits.ellipse(8.0, 4.0, 8.0)
    profile = ti.speed_profile(ti.paths.constant_radius(), limits, share=0.5)
    round_ = np.abs(profile.a_y) > 3.9
    np.testing.assert_allclose(profile.used[round_], 0.5, atol=0.01)
    with pytest.raises(ValueError, match="given: plan them"):
        _ = type(profile)(profile.path, 10.0).used


def test_given_speeds_have_no_limits_to_plot():
    with pytest.raises(ValueError, match="plan them by speed_profile to plot"):
        ti.plot(ti.SpeedProfile(ti.paths.handling_course(), 10.0))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--engine", "0"], "--engine wants an acceleration, 4m/s2"),
        (["--engine", "three.csv"], "two columns are needed"),
        (["--engine", "nowhere.csv"], "or a table of speed and acceleration"),
        (["--v-max", "60"], "--v-max wants a speed, 200km/h or 60m/s"),
        (["--share", "170%"], "--share must lie between 0.05 and 1"),
        (["--friction", "0"], "--friction must lie between 0.05 and 1.5"),
        (["--confidence", "0.4"], "--confidence must lie between"),
        (["--mu", "0.5"], "--mu is of a car that drives: add --laps 1"),
        (["--path", "straight.csv"], "nothing limits the speed: give v_max (--v-max"),
        (["--path", "straight.csv", "--laps", "1"], "N times, 'straight' is open"),
        (["--path", "kurve"], "there is no path 'kurve'"),
    ],
)
def test_what_makes_no_lap_is_refused_in_one_line(folder, out, capsys, monkeypatch, words, said):
    monkeypatch.chdir(folder)
    words = ["lap", "weights.json", "--path", "line.csv", *words, "--out", out]
    assert said in refusal(capsys, words) and not out.exists()


def test_weights_that_tell_no_speed_are_refused(folder, out, capsys):
    line = refusal(capsys, ["lap", folder / "refused.json", "--out", out])
    assert "not valid" in line and "tireid plan --weights" in line
    line = refusal(capsys, ["lap", folder / "network.json", "--out", out])
    assert "no speed follows" in line and "tireid identify LOG" in line
    stored = json.loads((folder / "weights.json").read_text())
    stored["vehicle"]["mass"] *= 2.0
    (folder / "heavy.json").write_text(json.dumps(stored))
    words = ["--vehicle", folder / "car.toml", "--out", out]
    assert "is of another car (mass" in refusal(capsys, ["lap", folder / "heavy.json", *words])


def test_a_lap_is_driven_learnt_from_and_kept(folder, out, capsys, undrawn):
    words = ["--laps", "1", "--vehicle", folder / "car.toml"]
    assert lap(folder, out, *words) == 0
    (driven,) = json_of(out / "summary.json")["laps"]
    assert driven["share"] == pytest.approx(0.82) and driven["off_path_m"] < 0.3
    assert driven["driven_s"] == pytest.approx(driven["planned_s"], rel=0.05)
    assert (out / "weights.json").exists() == driven["valid"]
    assert "of the limits, limit of a_y" in capsys.readouterr().out
