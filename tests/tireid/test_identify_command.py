"""`tireid identify` as a user meets it: what it writes, and one clear line for what it refuses."""

import contextlib
import io
import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fuzz.server import SLIP, steady_stiffness
from identifier.estimate.model import FittedModel
from identifier.measured import with_doubt
from identifier.methods import METHODS, draws_weights, make_method
from identifier.paper.design import PaperIdentifier, design_text
from identifier.tire_model import load_model
from models.recordings import read_recording
from models.vehicle import sedan
from tests.pages import outline
from tests.rivals import rival
from tests.tireid.conftest import (
    json_of,
    learn_words,
    page_in,
    refusal,
    rewritten,
    table_of,
    typed,
)

METHOD_FILES = {  # figures and tables that belong to a method
    "fit": (),
    "axle": ("learnt.png",),
    "integral": ("error.png", "weights.png", "errors.csv"),
}


@pytest.fixture(scope="module", params=METHOD_FILES)
def law(request):
    return request.param


@pytest.fixture(scope="module")
def ended(law, logs, tmp_path_factory):
    """The folder of a run, and what it printed."""
    out, printed = tmp_path_factory.mktemp("result") / "out", io.StringIO()
    words = learn_words(logs)
    words += ["--freeze", "4", "8", "--replay", logs / "quick.csv", "--out", out]
    words += {"fit": [], "axle": ["--method", "axle"], "integral": ["--paper", "--accept"]}[law]
    with contextlib.redirect_stdout(printed):
        assert typed(*words) == 0
    return out, printed.getvalue()


@pytest.fixture(scope="module")
def result(ended):
    return ended[0]


@pytest.mark.sweep("fit")
def test_the_summary_has_the_right_numbers(result, logs):
    summary = json_of(result / "summary.json")
    assert set(summary["rms_force_N"]) == {"slalom", "quick"}
    rmse = summary["rmse_N"]
    assert set(rmse["frozen"]) == {"4", "8"}
    certificate = summary["certificate"]
    if summary["law"] == "fit":
        assert certificate is None
        assert rmse["online"] == {"slalom": None, "quick": None}
        assert rmse["frozen_against_online"]["8"] == {"slalom": None, "quick": None}
    elif summary["law"] == "axle":
        assert certificate["verdict"] == "pass"
        assert certificate["limits"]["grip_static_axle_loads"] == [0.1, 3.0]
    else:
        assert certificate["verdict"] in ("pass", "warn", "fail")
    quick = read_recording(logs / "quick.csv")
    force = load_model(result / "weights.json").predict(quick)
    front, rear = np.sqrt(np.mean((force - quick.axle_force) ** 2, axis=0))
    assert rmse["frozen"]["8"]["quick"] == pytest.approx({"front": front, "rear": rear})
    rms = np.sqrt(np.mean(quick.axle_force**2, axis=0))
    assert summary["rms_force_N"]["quick"] == pytest.approx({"front": rms[0], "rear": rms[1]})


def test_the_summary_has_the_paper_s_measure_of_the_drive_that_was_learnt(ended, law):
    """The past, t < T_freeze, against the online output: from the curves that lie beside it."""
    result, printed = ended
    sides = json_of(result / "summary.json")["rmse_N"]["reproducibility"]
    assert {t: set(by_name) for t, by_name in sides.items()} == {"4": {"slalom"}, "8": {"slalom"}}
    if law == "fit":
        assert sides["4"]["slalom"]["past_against_online"] is None
        return
    forces = table_of(result / "forces.csv")
    past, after = forces["t_s"] < 4.0 - 1e-9, forces["t_s"] > 4.0 + 1e-9
    for axle, letter in (("front", "f"), ("rear", "r")):
        frozen, online, truth = (
            forces[f"Fy{letter}_{name}_N"] for name in ("frozen_4s", "online", "true")
        )
        for key, missed in (
            ("past_against_online", (frozen - online)[past]),
            ("past_against_truth", (frozen - truth)[past]),
            ("after_against_truth", (frozen - truth)[after]),
        ):
            rms = np.sqrt(np.mean(missed**2))
            assert sides["4"]["slalom"][key][axle] == pytest.approx(rms, rel=1e-6), key
    lines = printed.splitlines()
    own = [k for k, line in enumerate(lines) if "its past, against online" in line]
    assert [lines[k - 1].split()[2] for k in own] == ["slalom"] * 2  # none below another drive
    assert f"{sides['4']['slalom']['past_against_online']['front']:.4g} N" in lines[own[0]]


def test_a_fit_of_a_whole_log_says_nothing_of_online_learning(ended, law):
    """No forces, weights or figure over time, no certificate; replayed logs are not fitted anew."""
    if law != "fit":
        return
    result, printed = ended
    assert "online" not in printed and "certificate" not in printed
    assert "online" not in outline(page_in(result)).text
    head = (result / "forces_quick.csv").read_text().splitlines()[0]
    assert "online" not in head and "Fyf_frozen_8s_N" in head
    assert not [name for name in ("weights.csv", "learnt.png") if (result / name).exists()]
    assert json_of(result / "weights.json")["kind"] == "fit"


def test_every_curve_is_also_data(result, law):
    drawn = ("forces.png", "slip.png", "inputs.png", "replay_quick.png")
    for name in (*METHOD_FILES[law], *drawn, "forces_quick.csv", "weights_4s.json"):
        assert (result / name).is_file()
    forces = table_of(result / "forces.csv")
    assert "Fyr_frozen_4s_N" in forces.dtype.names
    if law == "fit":
        return
    truth, online = forces["Fyf_true_N"], forces["Fyf_online_N"]
    summary = json_of(result / "summary.json")
    front = summary["rmse_N"]["online"]["slalom"]["front"]
    assert np.sqrt(np.mean((truth - online) ** 2)) == pytest.approx(front, rel=1e-6)


def test_slip_angles_and_forces_of_every_axle_are_in_its_own_column(result, logs):
    """The columns alone say it: slips by the other columns, truth by the log."""
    car = sedan()
    for name, log in (("forces.csv", "slalom"), ("forces_quick.csv", "quick")):
        told = table_of(result / name)
        v_x, v_y, r = (told[column] for column in ("v_x_m_s", "v_y_m_s", "r_rad_s"))
        front = told["delta_f_rad"] - np.arctan((v_y + car.l_f * r) / v_x)
        rear = told["delta_r_rad"] - np.arctan((v_y - car.l_r * r) / v_x)
        np.testing.assert_allclose(told["alpha_f_rad"], front, atol=1e-8)
        np.testing.assert_allclose(told["alpha_r_rad"], rear, atol=1e-8)
        assert np.abs(front - rear).max() > 0.01
        truth = table_of(logs / f"{log}.csv")
        written = np.column_stack([told["Fyf_true_N"], told["Fyr_true_N"]])
        np.testing.assert_allclose(
            written, np.column_stack([truth["Fyf"], truth["Fyr"]]), rtol=1e-6, atol=1e-3
        )
        frozen = load_model(result / "weights_4s.json").predict(read_recording(logs / f"{log}.csv"))
        written = np.column_stack([told["Fyf_frozen_4s_N"], told["Fyr_frozen_4s_N"]])
        np.testing.assert_allclose(written, frozen, rtol=1e-6, atol=1e-3)


def test_the_filtered_error_is_the_one_that_the_law_saw_at_that_sample(result, law):
    """z = 0 at the first sample; from one row to the next Euler's step of dz/dt = ξ̃ - λ z."""
    if law != "integral":
        assert not (result / "errors.csv").exists()  # there is no filtered error
        return
    told = table_of(result / "errors.csv")
    gains = json_of(result / "summary.json")["gains"]
    lam, dt = gains["forgetting"], np.diff(told["t_s"])
    for axle in "fr":
        xi_tilde, z = told[f"xi_tilde_{axle}_Us"], told[f"z_{axle}_Us2"]
        assert z[0] == 0.0
        steps = z[:-1] + dt * (xi_tilde[:-1] - lam * z[:-1])
        np.testing.assert_allclose(z[1:], steps, rtol=1e-6, atol=1e-7 * np.abs(z).max())
        assert np.abs(z).max() > 0.0


def test_weights_of_a_row_are_those_in_effect_at_that_sample(result, law):
    """At the freeze time they are those of the frozen model."""
    if law == "fit":
        return
    told = table_of(result / "weights.csv")
    row = told[np.argmin(np.abs(told["t_s"] - 4.0))]
    weights = json_of(result / "weights_4s.json")
    W = np.array(weights["W"] if "W" in weights else weights["weights"]["W"])
    written = np.array([[row[f"W_{i + 1}_{j + 1}"] for j in range(W.shape[1])] for i in (0, 1)])
    np.testing.assert_allclose(written, W, rtol=1e-7, atol=1e-9)
    ahead = told[np.argmin(np.abs(told["t_s"] - 4.0)) + 1]
    assert any(abs(row[name] - ahead[name]) > 1e-6 for name in told.dtype.names if name != "t_s")


def test_the_report_is_whole_and_says_the_numbers_of_the_summary(result):
    told = outline(page_in(result)).text
    assert "tireid identify" in told and "hash" in told, "what it was made by"
    summary = json_of(result / "summary.json")
    assert summary["version"] in told
    (name, *_) = summary["rms_force_N"]
    error = summary["rmse_N"]["frozen"]["8"][name]
    assert f"{error['front']:.4g}" in told and f"{error['rear']:.4g}" in told


def test_the_first_screen_says_what_is_missed_and_shows_the_curve(ended, law):
    result, printed = ended
    verdict = verdict_of(result)
    front, rear = (f"{100.0 * share:.1f}" for share in verdict["measures"]["force_missed"])
    page = page_in(result)
    tiles = re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", page)
    assert len(tiles) == 3 and tiles[1][1] == f"{front} / {rear} %"
    assert f"model error over the force in the motion: {front} / {rear} %" in printed
    curve = page.index("Figure 1.</b> ")
    refusal = '<span class="bad">NOT VALID</span>. '
    assert page[curve + 14 :].removeprefix(refusal).startswith("Axle force over slip angle")
    notes = page.index('<div class="notes' if '<div class="notes' in page else "No notes.")
    assert page.index("<dl") < curve < notes
    refused = 'class="bad"><dt>the verdict' in page
    assert refused == (not verdict["valid"])
    stiff = next(one for one in verdict["numbers"] if one["title"] == "cornering stiffness")
    if law != "integral":
        assert 'class="struck"' not in page
        assert verdict["valid"] and json_of(result / "weights.json")["valid"] is True
        assert (stiff["axle"], stiff["state"]) == ("front", "valid")
    words = with_doubt(*(x and 1e-3 * x for x in (stiff["value"], stiff["sd"])))
    assert words in outline(page).text.replace("\xa0", " ")
    assert "cornering stiffness [kN/rad]" in printed and " N/rad" not in printed


def test_a_replayed_log_has_the_verdict_of_predict(ended, logs, tmp_path, unmade):
    result, printed = ended
    summary = json_of(result / "summary.json")
    ask = ["predict", result / "weights.json", logs / "quick.csv", "--accept"]
    assert typed(*ask, "--out", tmp_path / "asked") == 0
    expected = json_of(tmp_path / "asked" / "summary.json")["verdict"]
    found = summary["replay_verdicts"]["quick"]
    assert (found["valid"], found["findings"]) == (expected["valid"], expected["findings"])
    missed = found["measures"]["force_missed"]
    assert missed == pytest.approx(expected["measures"]["force_missed"])
    said = "valid" if found["valid"] else "NOT VALID"
    assert f"replayed on quick: verdict: {said}" in printed


def test_a_replayed_log_that_the_model_does_not_explain_refuses(logs, tmp_path, capsys, unmade):
    log = rewritten(logs / "quick.csv", tmp_path / "biased.csv", v_y=lambda log: log.v_y + 0.6)
    words = learn_words(logs)
    words += ["--replay", log, "--out", tmp_path / "out"]
    assert typed(*words) == 3
    said = capsys.readouterr().out
    assert "replayed on biased: verdict: NOT VALID" in said and "\nverdict: valid" in said
    assert typed(*words, "--accept", "--force") == 0


def test_the_curve_is_that_of_the_model_and_says_where_it_is_known(result):
    head, *rows = (result / "curve.csv").read_text().splitlines()
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    model = load_model(result / "weights.json")
    names = head.split(",")
    assert names[:3] == ["slip_rad", "Fyf_N", "Fyr_N"]
    slip = table[:, 0]
    np.testing.assert_allclose(table[:, 1:3], model.force(slip), rtol=1e-6, atol=1e-3)
    assert (names[3:5] == ["front_known", "rear_known"]) == (model.known_slip is not None)
    if model.known_slip is not None:
        for axle, known in enumerate(model.known_slip):
            clear = ~np.isclose(np.abs(slip), known, rtol=1e-7)  # nine digits of it are written
            inside = np.abs(slip) <= known
            np.testing.assert_array_equal((table[:, 3 + axle] == 1.0)[clear], inside[clear])
            assert 0.0 < table[:, 3 + axle].mean() < 1.0
    ends = ["Fyf_low_N", "Fyr_low_N", "Fyf_high_N", "Fyr_high_N"]
    assert (names[5:] == ends) == (model.band is not None)
    if model.band is not None:
        sides = np.hstack(model.band.at(slip))
        np.testing.assert_allclose(table[:, 5:], sides, rtol=1e-6, atol=1e-3)
        assert model.band.calibrated  # the weights file keeps it
        page = page_in(result)
        assert "nine of ten forces of other drives" in page
        assert model.band.origin in page


def test_a_log_without_forces_has_no_error_against_them(logs, tmp_path, out, laid_out):
    blind = rewritten(logs / "slalom.csv", tmp_path / "blind.csv", axle_force=None)
    words = learn_words(logs, blind)
    assert typed(*words, "--out", out) == 0
    summary = json_of(out / "summary.json")
    assert summary["rms_force_N"] == {"blind": None}
    assert summary["rmse_N"]["online"] == {"blind": None}
    assert summary["rmse_N"]["frozen"]["8"] == {"blind": None}
    assert summary["rmse_N"]["frozen_against_online"]["8"] == {"blind": None}
    assert typed(*words, "--method", "axle", "--out", tmp_path / "axle") == 0
    summary = json_of(tmp_path / "axle" / "summary.json")
    assert summary["rmse_N"]["frozen_against_online"]["8"]["blind"]["front"] > 0.0


@pytest.mark.heavy
def test_a_log_on_a_unix_clock_keeps_its_freeze_times_apart(logs, tmp_path, out, laid_out):
    log = rewritten(logs / "slalom.csv", tmp_path / "unix.csv", t=lambda log: log.t + 1.7e9)
    words = [*learn_words(logs, log), "--out", out]
    assert typed(*words, "--freeze", "1700000004", "1700000008") == 0
    frozen = json_of(out / "summary.json")["rmse_N"]["frozen"]
    assert set(frozen) == {"1700000004", "1700000008"}
    assert (out / "weights_1700000004s.json").is_file()
    forces = table_of(out / "forces.csv")
    assert "Fyf_frozen_1700000004s_N" in forces.dtype.names
    np.testing.assert_allclose(np.diff(forces["t_s"]), 0.01, atol=1e-5)


def test_samples_at_rest_count_nowhere(logs, tmp_path, out, capsys, laid_out):
    """A halt of the second half, with forces that are not zero, changes neither size nor error."""
    log = rewritten(
        logs / "slalom.csv", tmp_path / "halt.csv", v_x=lambda log: log.v_x * (log.t < 4.0)
    )
    words = [*learn_words(logs, log), "--no-check"]
    capsys.readouterr()
    assert typed(*words, "--out", out) == 0
    printed = capsys.readouterr().out
    summary = json_of(out / "summary.json")
    whole = read_recording(logs / "slalom.csv")
    moving = whole.axle_force[whole.t < 4.0]
    rms = np.sqrt(np.mean(moving**2, axis=0))
    size = summary["rms_force_N"]["halt"]
    assert size == pytest.approx({"front": rms[0], "rear": rms[1]}, rel=1e-6)
    (frozen,) = summary["rmse_N"]["frozen"].values()
    assert f"{100 * frozen['halt']['front'] / rms[0]:.0f} %" in printed


def written_design(path, **changes):
    design = PaperIdentifier.for_vehicle(sedan())
    names = changes.keys() & {"eta_W", "eta_V", "rho_W", "rho_V"}
    gains = {name: changes.pop(name) for name in names}
    path.write_text(design_text(replace(design, gains=replace(design.gains, **gains), **changes)))
    return path


def test_a_design_from_a_file_is_the_one_that_runs(logs, tmp_path, out, capsys, unmade):
    design = written_design(tmp_path / "design.toml", law="instantaneous", seed=3, eta_W=12.5)
    words = learn_words(logs)
    words += ["--accept", "--design", design, "--out", out]
    capsys.readouterr()
    assert typed(*words) == 0
    assert "certificate: " in capsys.readouterr().out
    summary = json_of(out / "summary.json")
    assert (summary["law"], summary["seed"]) == ("instantaneous", 3)
    assert summary["gains"]["eta_W"] == 12.5
    for extra, said in (
        (["--method", "integral"], "give only one of --method, --design"),
        (["--seed", "0"], f"--seed is for a method: the seed of a design is in {design}"),
    ):
        assert said in refusal(capsys, [*words[:-1], tmp_path / "other", *extra])


def test_a_seed_that_would_change_nothing_is_refused(logs, out, capsys):
    words = [*learn_words(logs), "--seed", "3"]
    words += ["--out", out]
    assert "fit begins with none" in refusal(capsys, words)
    assert "linear begins with none" in refusal(capsys, [*words, "--method", "linear"])
    for name, factory in METHODS.items():  # what is told is what is so
        drawn = factory(sedan(), 0) != factory(sedan(), 1)
        assert draws_weights(name) == drawn, name


@pytest.mark.heavy
def test_a_law_that_diverges_on_a_replayed_log_is_refused_by_its_name(
    logs, tmp_path, out, capsys, laid_out
):
    """Nothing is learnt at rest and nothing diverges there; on the other drive it does."""
    design = written_design(
        tmp_path / "design.toml", law="instantaneous", eta_W=1e7, eta_V=1e7, rho_W=0.0, rho_V=0.0
    )

    before = lambda log: log.v_x * (log.t < 0.5)  # noqa: E731 - the steering begins later
    calm = rewritten(logs / "slalom.csv", tmp_path / "calm.csv", v_x=before)
    words = [*learn_words(logs, calm), "--design", design, "--no-check"]
    assert typed(*[*words, "--out", tmp_path / "alone", "--accept"]) == 0
    line = refusal(capsys, [*words, "--replay", logs / "quick.csv", "--out", out])
    assert "quick: the method instantaneous diverged at" in line
    assert not out.exists()


def test_recordings_whose_files_would_be_the_same_are_refused(logs, tmp_path, capsys):
    header, *lines = (logs / "slalom.csv").read_text().splitlines()
    runs = [f"{line},{run}" for run in ("a b", "a/b") for line in lines]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([f"{header},run", *runs]))
    words = learn_words(logs, f"{log}:a b")
    line = refusal(capsys, [*words, "--replay", f"{log}:a/b", "--out", tmp_path / "out"])
    assert "every recording needs a different name" in line


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (["--freeze", "4", "4.00000000000001"], "--freeze 4 is given twice"),
        (["--freeze", "99"], "--freeze 99 is outside the recording: slalom lasts from 0 to 8 s"),
        (["--replay", "nowhere.csv"], "nowhere.csv: there is no such file"),
        (["--columns", "yaw_rate"], "--columns wants NAME=COLUMN"),
        (["--vehicle", "nowhere.toml"], "nowhere.toml"),
        (["--vehicle", "slalom.csv"], "--vehicle slalom.csv: must be the .toml of a car"),
        rival(["--method", "linear_kf"], "not a tire"),
    ],
)
def test_wrong_words_are_one_clear_line_and_leave_nothing(logs, tmp_path, out, capsys, extra, said):
    words = [*learn_words(logs), *extra, "--out", out]
    assert said in refusal(capsys, words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.sweep("fit", "axle")
def test_learning_goes_on_from_stored_weights(result, law, logs, tmp_path, unmade):
    """Tires of the slalom serve from the first sample of the next drive."""
    words = learn_words(logs, "quick.csv")
    words += ["--method", law, "--accept"]  # the paper's network needs a longer drive
    if law == "fit":
        sd = []
        for name, more in (("a", []), ("b", ["--weights", result / "weights.json"])):
            assert typed(*words, *more, "--out", tmp_path / name) == 0
            told = json_of(tmp_path / name / "weights.json")
            sd.append(told["parameters"]["ln_stiffness_f"]["sd"])
        assert sd[1] < 0.95 * sd[0]
        return
    errors = {}
    for name, more in (("afresh", []), ("stored", ["--weights", result / "weights.json"])):
        assert typed(*words, *more, "--out", tmp_path / name) == 0
        summary = json_of(tmp_path / name / "summary.json")
        errors[name] = summary["rmse_N"]["online"]["quick"]["front"]
    assert errors["stored"] < 0.9 * errors["afresh"]


@pytest.mark.sweep("axle")
def test_weights_of_another_structure_are_refused(logs, out, capsys, result, law):
    words = learn_words(logs, "quick.csv")
    words += ["--out", out]
    other = "axle" if law == "integral" else "integral"
    said = refusal(capsys, [*words, "--method", other, "--weights", result / "weights.json"])
    assert "the stored weights are of another structure" in said
    assert not out.exists()


LAWS = ["integral", "instantaneous", "instantaneous_scaled", "axle", "fit"]


@pytest.mark.heavy
@pytest.mark.parametrize("name", LAWS)
def test_a_recorded_car_is_identified_by_every_law(shared_data, tmp_path, out, name, laid_out):
    """On the high-fidelity slalom each law beats the linear tire it started from."""
    car = tmp_path / "car.toml"
    car.write_text(
        "mass = 2027.0\nyaw_inertia = 2877.0\nl_f = 0.924\nl_r = 1.626\n"
        "cornering_stiffness_front = 110e3\ncornering_stiffness_rear = 130e3\n"
    )
    log = shared_data / "carmaker.csv.gz"
    words = ["identify", f"{log}:slalom1_14_5ms", "--vehicle", car]
    words += [
        "--method",
        name,
        "--replay",
        f"{log}:experiment2_40kmh",
        "--out",
        out,
    ]
    assert typed(*words) == (0 if name in ("axle", "fit") else 3)
    summary = json_of(out / "summary.json")
    (frozen,) = summary["rmse_N"]["frozen"].values()
    errors = frozen if name == "fit" else summary["rmse_N"]["online"]
    error = errors["carmaker:slalom1_14_5ms"]
    recording = read_recording(log, run="slalom1_14_5ms")
    linear = recording.alpha(0.924, 1.626) * [110e3, 130e3]
    missed = np.sqrt(np.mean((linear - recording.axle_force) ** 2, axis=0))
    assert error["front"] < missed[0]
    assert error["rear"] < missed[1]
    assert set(frozen) == {"carmaker:slalom1_14_5ms", "carmaker:experiment2_40kmh"}


@pytest.mark.sweep("fit", "inertial")
@pytest.mark.parametrize("name", METHODS)
def test_every_method_with_a_model_writes_all_of_its_files(logs, out, name, undrawn):
    words = learn_words(logs)
    words += ["--replay", logs / "quick.csv", "--method", name, "--accept"]
    assert typed(*words, "--out", out) == 0
    model = load_model(out / "weights.json")
    assert (out / "report.html").stat().st_size > 1000
    assert (out / "weights.csv").exists() == (name != "fit")
    if name == "fit":
        return
    told = table_of(out / "weights.csv")
    for port in ("W", "V", "own"):
        values = getattr(model, port, getattr(getattr(model, "weights", None), port, None))
        if name == "axle" and port == "own":
            values = model.beside_curve
        columns = [one for one in told.dtype.names if one.split("_")[0] == port]
        if name != "inertial" or port != "own":  # whose two compliances stand in a larger table
            assert len(columns) == np.size(values) * (values is not None)
        else:
            assert columns == ["own_1", "own_2"]
            assert [told[one][-1] for one in columns] == pytest.approx(model.compliance, rel=1e-3)


def verdict_of(out):
    return json_of(out / "summary.json")["verdict"]


@pytest.mark.heavy
def test_an_axle_that_does_not_push_is_not_handed_on(logs, tmp_path, monkeypatch, laid_out):
    whole = FittedModel.predict
    words = learn_words(logs)
    for number, share in enumerate(([1.0, 0.004], [1.0, -1.0])):
        dying = np.array(share)
        monkeypatch.setattr(
            FittedModel, "predict", lambda self, drive, dying=dying: whole(self, drive) * dying
        )
        out = tmp_path / str(number)
        assert typed(*words, "--out", out) == 3
        missed = [one for one in verdict_of(out)["findings"] if one["code"] == "force_missed"]
        assert "rear" in {one["axle"] for one in missed}
        assert json_of(out / "weights.json")["valid"] is False


def test_what_cannot_be_read_back_as_tires_is_refused_by_the_name_of_its_log(
    logs, tmp_path, monkeypatch, capsys
):
    whole = FittedModel._steady
    turned = lambda self, alpha, v_x: whole(self, alpha, v_x) * [1.0, -1.0]  # noqa: E731
    monkeypatch.setattr(FittedModel, "_steady", turned)
    words = learn_words(logs)
    line = refusal(capsys, [*words, "--out", tmp_path / "out"])
    assert "slalom: at 8 s no tires were identified: axle forces must rise with slip" in line
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_valid_exits_with_three_unless_it_is_accepted(logs, tmp_path, capsys, unmade):
    log = rewritten(logs / "slalom.csv", tmp_path / "mirrored.csv", v_y=lambda log: -log.v_y)
    words = [*learn_words(logs, log), "--no-check"]
    assert typed(*words, "--out", tmp_path / "refused") == 3
    said = capsys.readouterr().out
    assert "verdict: NOT VALID" in said
    assert typed(*words, "--accept", "--out", tmp_path / "accepted") == 0
    assert "verdict: NOT VALID" in capsys.readouterr().out
    for name in ("refused", "accepted"):
        assert verdict_of(tmp_path / name)["valid"] is False
        page = page_in(tmp_path / name)
        assert "NOT VALID" in page
        assert "Verdict" in page
        assert '<div class="bad"><dt>the verdict' in page
        assert page.count('class="struck"') >= 2, "numbers of the refused axles"
        assert '<div class="good">' not in page
    ask = ["predict", tmp_path / "refused" / "weights.json", logs / "quick.csv"]
    assert typed(*ask, "--accept", "--out", tmp_path / "asked") == 0
    assert "has no valid verdict on its identification drive" in capsys.readouterr().err


@pytest.mark.parametrize("law", ["axle", "integral", "lagged_ekf"])
def test_the_stiffness_of_a_slide_is_the_slope_of_the_steady_curve(law):
    car = sedan()
    method = make_method(law, car)
    model = method.frozen(car, method.setup(car).carry)
    force = model.force(np.array([-SLIP, SLIP]))
    slope = (force[1] - force[0]) / (2.0 * SLIP)
    assert steady_stiffness(model, 10.0) == pytest.approx(slope, rel=0.02)
    assert (slope > 1e4).all()
