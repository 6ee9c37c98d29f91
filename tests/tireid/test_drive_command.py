"""`tireid drive` as a user meets it: a short bend, what is written of it, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import tireid as ti
from benchmarks.mpc_cases import cornering_limit
from identifier.tire_model import load_model
from models.files import digest
from models.friction import Friction
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.loop.sensing import CarSensors
from mpc.tires import oracle_tire, prediction_tire
from mpc.tires.tire import curves_at
from tests.pages import outline
from tests.tireid.conftest import json_of, page_in, refusal, table_of, typed
from tireid.driving import learn as drive_learn
from tireid.driving import runs as drive_runs
from tireid.figures import film
from tireid.learning import identify

SIDE = 3.0 * (1.0 - np.cos(np.linspace(0.0, 2.0 * np.pi, 9)))
BEND = np.column_stack([np.linspace(0.0, 70.0, 9), SIDE])


@pytest.fixture(scope="module")
def bend(tmp_path_factory):
    """A file of way-points 70 m ahead, with a bulge of 6 m."""
    file = tmp_path_factory.mktemp("paths") / "bend.csv"
    lines = ["X_m,Y_m", *(f"{x:.3f},{y:.3f}" for x, y in BEND)]
    file.write_text("\n".join(lines))
    return file


@pytest.fixture(scope="module")
def result(bend, tmp_path_factory):
    """Frozen tires that learnt for 15 s, and linear ones, both up to 0.77 g."""
    out = tmp_path_factory.mktemp("result") / "out"
    words = ["drive", "--path", bend, "--tires", "frozen", "linear", "--out", out]
    words += ["--speed", "0.77g"]
    learns_shortly(words, 15.0)
    return out


def learns_shortly(words, seconds):
    """Run a command whose drive to learn on and whose film are short."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drive_learn, "DURATION", seconds)
        patch.setattr(drive_learn, "_FIRST", 4.0)
        patch.setattr(film, "MOST", 20)
        assert typed(*words) == 0


def summary_of(folder):
    return json_of(folder / "summary.json")


def test_summary_has_the_documented_keys_and_the_numbers_of_the_csv(result):
    summary = summary_of(result)
    assert summary["completed"] is True and summary["tires"] == "frozen"
    assert set(summary["solve_ms"]) == {"median", "p99", "max"}
    assert summary["failures"] == {}
    for label, name in (("frozen", "drive.csv"), ("linear", "drive_linear.csv")):
        drive = table_of(result / name)
        numbers = summary["drives"][label]
        assert numbers["rms_e_y_m"] == pytest.approx(np.sqrt(np.mean(drive["e_y_m"] ** 2)))
        assert numbers["peak_e_y_m"] == pytest.approx(np.abs(drive["e_y_m"]).max())
        solve = 1e3 * np.median(drive["solve_time_s"])
        assert numbers["solve_ms"]["median"] == pytest.approx(solve)
    assert summary["rms_e_y_m"] == summary["drives"]["frozen"]["rms_e_y_m"]


def test_the_frozen_car_stays_on_its_path_where_the_linear_one_leaves_it_more(result):
    drives = summary_of(result)["drives"]
    assert drives["frozen"]["peak_e_y_m"] < 0.2
    assert drives["frozen"]["rms_e_y_m"] < 0.5 * drives["linear"]["rms_e_y_m"]


def test_deviation_and_forces_of_the_csv_follow_from_its_motion(result):
    """By Newton and by the way-points, which know nothing of the loop."""
    drive = table_of(result / "drive.csv")
    total = drive["Fyf_N"] + drive["Fyr_N"]
    np.testing.assert_allclose(total, sedan().mass * drive["a_y_m_s2"], atol=250.0)
    assert 60.0 < drive["X_m"][-1] < 72.0
    k = int(np.argmin(np.abs(drive["X_m"] - BEND[4, 0])))
    assert drive["Y_m"][k] == pytest.approx(BEND[4, 1], abs=0.3)
    np.testing.assert_allclose(np.diff(drive["t_s"]), 0.01, atol=1e-9)
    car = sedan()
    moment = car.l_f * drive["Fyf_N"] - car.l_r * drive["Fyr_N"]
    turning = car.yaw_inertia * np.gradient(drive["r_rad_s"], drive["t_s"])
    np.testing.assert_allclose(moment, turning, atol=500.0)
    swapped = car.l_f * drive["Fyr_N"] - car.l_r * drive["Fyf_N"]
    assert np.abs(swapped - turning).max() > 2000.0
    v_x, v_y, r = (drive[name] for name in ("v_x_m_s", "v_y_m_s", "r_rad_s"))
    front = drive["delta_rad"] - np.arctan((v_y + car.l_f * r) / v_x)
    np.testing.assert_allclose(drive["alpha_f_rad"], front, atol=1e-8)
    np.testing.assert_allclose(
        drive["alpha_r_rad"], -np.arctan((v_y - car.l_r * r) / v_x), atol=1e-8
    )


def test_everything_is_written(result):
    for name in ("path", "errors", "steering", "tires", "solve_times"):
        assert (result / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert (result / "drive.webp").read_bytes()[8:12] == b"WEBP"
    with Image.open(result / "drive.webp") as shown:
        assert 10 <= shown.n_frames <= 20
        longest = 120 / shown.n_frames * (result / "drive.webp").stat().st_size
    assert longest < 2e6
    assert load_model(result / "weights.json").vehicle.name == "sedan"


def test_stored_weights_steer_alike_and_the_hash_tells_what_went_in(
    result, bend, tmp_path, undrawn
):
    words = ["drive", "--path", bend, "--film", "none", "--speed", "0.77g"]
    words += ["--weights", result / "weights.json"]
    for name, more in (("same", []), ("other", ["--seed", "1"])):
        assert typed(*words, *more, "--out", tmp_path / name) == 0
    before, same, other = map(summary_of, (result, tmp_path / "same", tmp_path / "other"))
    assert same["rms_e_y_m"] == before["rms_e_y_m"] != other["rms_e_y_m"]
    assert same["inputs"]["weights_hash"] == before["inputs"]["weights_hash"]
    assert same["hash"] == digest(same["inputs"]) != other["hash"]
    assert not (tmp_path / "same" / "drive.webp").exists()


@pytest.mark.heavy
def test_learning_and_oracle_are_told_of_a_friction_that_drops(result, bend, out, capsys, undrawn):
    words = ["drive", "--path", bend, "--tires", "learning", "oracle", "--film", "none"]
    words += ["--weights", result / "weights.json", "--speed", "0.51g"]
    capsys.readouterr()
    assert typed(*words, "--mu-drop", "30:0.5", "--out", out) == 0
    printed = capsys.readouterr().out
    assert "friction 1, 0.5 from 30 m on" in printed
    assert "oracle at " in printed and "given friction 0.5" in printed
    drives = summary_of(out)["drives"]
    assert drives["oracle"]["peak_e_y_m"] < drives["learning"]["peak_e_y_m"]
    reasons = " ".join(entry["note"] for entry in drives["learning"]["notes"])
    assert "friction" in reasons


def test_the_report_is_whole_and_says_the_numbers_of_the_summary(result):
    page = page_in(result)
    summary, told = json_of(result / "summary.json"), outline(page).text
    assert f"{summary['rms_e_y_m']:.3f} m" in told
    assert summary["hash"] in told and "tireid drive" in told
    assert "data:image/webp;base64," in page


@pytest.mark.heavy
def test_without_a_speed_the_tires_tell_it_and_confirm_lets_it_be_earned(
    result, bend, tmp_path, capsys, undrawn
):
    words = ["drive", "--path", bend, "--film", "none", "--weights", result / "weights.json"]
    for name, more in (("sure", []), ("earned", ["--confirm"])):
        assert typed(*words, *more, "--out", tmp_path / name) == 0
    assert "82 % of what the identified tires allow, earned on the way" in capsys.readouterr().out
    sure, earned = (table_of(tmp_path / name / "drive.csv") for name in ("sure", "earned"))
    allowed = ti.speed_limits(load_model(result / "weights.json"))
    assert 0.7 * allowed.a_y[0] < np.abs(sure["a_y_m_s2"]).max() < allowed.a_y[0]
    assert earned["v_x_m_s"][0] < 0.8 * sure["v_x_m_s"][0]
    told = summary_of(tmp_path / "earned")["inputs"]["speed"]
    assert told == {"share": 0.82, "a_y_m_s2": None, "m_s": None, "confirm": True}


def test_a_car_that_leaves_its_path_is_told_with_exit_code_1(bend, out, capsys, undrawn):
    words = ["drive", "--path", bend, "--tires", "linear", "--film", "none"]
    capsys.readouterr()
    assert typed(*words, "--speed", "1.2g", "--out", out) == 1
    assert "no: left the path by more than 2 m" in capsys.readouterr().out
    assert summary_of(out)["completed"] is False


@pytest.mark.heavy
def test_the_drive_to_learn_on_slides_but_does_not_spin():
    car = DoubleTrackCar(sedan(), friction=Friction())
    recording = drive_learn.learning_drive(car, CarSensors(), np.random.default_rng(0), seed=3)
    assert recording.duration == pytest.approx(drive_learn.DURATION, abs=0.02)
    slip = np.abs(recording.alpha(car.vehicle.l_f, car.vehicle.l_r)).max(axis=0)
    assert (slip > np.radians(3.5)).all()
    assert np.abs(recording.a_y).max() > 0.9 * cornering_limit(car.vehicle, car.tire)
    within = np.radians(np.linspace(-4.0, 4.0, 65))
    learnt = curves_at(prediction_tire(identify(recording, sedan()).freeze()), within)
    true = curves_at(oracle_tire(car.vehicle, car.tire), within)
    np.testing.assert_allclose(learnt, true, atol=300.0)


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (["--path", "nowhere"], "--path: there is no path 'nowhere'; iso-3888-1, iso-3888-2"),
        (["--path", "nowhere.csv"], "nowhere.csv"),
        (["--mu-drop", "500:0.5"], "--mu-drop 500 is beyond the path"),
        (["--delay", "15"], "--delay must be 0 to 100 ms in steps of 10 ms, it is 15"),
        (["--laps", "nan"], "laps must be positive"),
        (["--seed", "-1"], "--seed must not be negative"),
        (["--speed", "0.9"], "--speed 0.9 has no unit: write 0.9%, 0.9g or 0.9m/s"),
        (["--speed", "9m/s", "--v-max", "5m/s"], "--speed 9m/s is constant on this path: lower"),
        (["--v-max", "5"], "--v-max wants a speed, 200km/h or 60m/s, not '5'"),
        (["--v-max", "200m/s"], "--v-max in m/s must lie between 3 and 100, it is 200"),
        (["--speed", "0.5g", "--confirm"], "--confirm goes with --speed tires, or with a share"),
        (["--weights", "nowhere.json"], "nowhere.json"),
        (["--weights", "a.json", "--paper"], "give only one of --weights, --paper"),
        (["--vehicle", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_wrong_words_are_one_clear_line_and_leave_nothing(bend, tmp_path, capsys, extra, said):
    words = ["drive", "--path", bend, *extra, "--out", tmp_path / "out"]
    assert said in refusal(capsys, words)
    assert list(tmp_path.iterdir()) == []


def test_without_a_compiler_it_says_so_before_it_learns(bend, tmp_path, capsys, monkeypatch):
    def learns(*_, **__):
        raise AssertionError("it has begun to learn")

    monkeypatch.setattr(drive_runs, "find_compiler", lambda: None)
    monkeypatch.setattr("tireid.commands.drive.learning_drive", learns)
    words = ["drive", "--path", bend, "--out", tmp_path / "out"]
    assert "no C compiler found: the tracker cannot be built" in refusal(capsys, words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.heavy
def test_tires_of_another_car_lead_somewhere(bend, tmp_path, out, capsys, undrawn):
    """The name of a car is no difference, its mass is."""
    car, log = sedan(), ti.sample_recording()
    tire = ti.identify(log, car).freeze()
    heavy = replace(tire, vehicle=replace(car, mass=1.1 * car.mass, name="heavy"))
    heavy.save(tmp_path / "heavy.json")
    car.to_toml(tmp_path / "sedan.toml")
    words = ["drive", "--path", bend, "--weights", tmp_path / "heavy.json"]
    said = refusal(capsys, [*words, "--vehicle", tmp_path / "sedan.toml", "--out", out])
    masses = f"(mass {1.1 * car.mass:.6g}, driven {car.mass:.6g})"
    assert f"heavy.json is of another car {masses}: leave --vehicle out" in said
    replace(tire, vehicle=replace(car, name="mine")).save(tmp_path / "mine.json")
    words = ["drive", "--path", bend, "--weights", tmp_path / "mine.json", "--film", "none"]
    words += ["--speed", "0.7g"]
    assert typed(*[*words, "--out", out]) == 0


def test_a_car_without_chassis_is_driven_on_its_identified_tires(bend, tmp_path, capsys, undrawn):
    """What identify was given is enough; what is assumed of the rest is said and stored."""
    assert typed("init", tmp_path / "car.toml") == 0
    words = ["drive", "--path", bend, "--out", tmp_path / "out", "--film", "none"]
    own = [*words, "--vehicle", tmp_path / "car.toml"]
    assert len(said := refusal(capsys, own)) <= 120 and "or drive with --weights" in said
    tire = ti.identify(ti.sample_recording(), ti.Vehicle.from_toml(tmp_path / "car.toml")).tire
    tire.save(tmp_path / "weights.json")
    for given in (own, words):
        assert typed(*given, "--weights", tmp_path / "weights.json", "--force") == 0
        said = capsys.readouterr().err
        assert "estimated, as" not in said  # identify has said it
        assumed = said[said.index("simulated on the sedan's tires") :].split("  ISO")[0]
        assert "track_front = 1.54" in assumed and "cg_height = 0.54" in assumed
        assert max(map(len, assumed.splitlines()[:4])) <= 120
        summary = summary_of(tmp_path / "out")
        assert "cg_height" in summary["inputs"]["chassis"]["estimated"]
        assert summary["completed"] and summary["rms_e_y_m"] < 0.1
