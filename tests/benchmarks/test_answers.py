"""Answers are those of a user, and the benchmarks that judge them ring where they should."""

import json
import logging
import math

import numpy as np
import pytest

import tireid as ti
from benchmarks import beginnings, fault_table, noisy_runs, verdicts
from benchmarks.answers import REFUSED, Answer, answer, blind, drawn, is_dead
from benchmarks.beginnings import Begun
from benchmarks.documents import complaints
from benchmarks.fault_cases import Case, StraightOnly, biased, cases
from benchmarks.faults import Late, Mirrored, Together
from benchmarks.random_cars import CLASSES
from benchmarks.targets import Targets
from benchmarks.verdicts import Judged
from identifier.doctor import Diagnosis, Finding
from models.faults import SensorFault
from models.recordings import RecordingError, write_recording
from tireid.cli import main

GOOD = Answer((3.0, 4.0), (1e5, 1e5), True, ())
BAD = Answer((3.0, 40.0), (1e5, 1e5), True, ())
TOLD = BAD._replace(valid=False, codes=("at_bound",))
NONE = Answer((math.inf, math.inf), (math.nan, math.nan), False, ("ValueError",))


@pytest.fixture(scope="module")
def drive():
    return drawn("sedan", 7)


@pytest.fixture(scope="module")
def log(drive):
    return drive.log(np.random.default_rng(1))


@pytest.mark.heavy
def test_the_error_is_that_of_the_frozen_model_in_percent_of_the_rms_force(drive, log):
    found = answer(log, drive.car.told, drive.exact)
    force = ti.identify(blind(log), drive.car.told).freeze().predict(drive.exact)
    truth = drive.exact.axle_force
    by_hand = 100.0 * np.linalg.norm(force - truth, axis=0) / np.linalg.norm(truth, axis=0)
    np.testing.assert_allclose(found.error, by_hand, rtol=1e-9)
    assert found.worse == max(found.error) < 15.0
    vehicle = drive.car.vehicle
    true = vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear
    np.testing.assert_allclose(found.stiffness, true, rtol=0.3)
    assert not is_dead(found, true)


def test_nothing_that_judges_sees_a_true_force(drive, log, monkeypatch):
    seen = []

    def sees(recording, *_, **__):
        seen.append(recording.axle_force)
        raise RecordingError

    monkeypatch.setattr("models.recordings.reader.check_physics", lambda one: sees(one))
    answer(log, drive.car.told, drive.exact)
    monkeypatch.undo()
    monkeypatch.setattr("benchmarks.answers.ti.identify", sees)
    answer(log, drive.car.told, drive.exact)
    assert seen == [None, None, None]  # the check of the table; learning, and of who insists
    assert log.axle_force is not None


@pytest.mark.sweep("refused")
@pytest.mark.parametrize(
    ("fault", "code"),
    [(None, 0), (Mirrored(channels=("r",)), 2), (Late(channels=("r",), delay=0.3), 3)],
    ids=["good", "refused", "not valid"],
)
@pytest.mark.usefixtures("undrawn")
def test_answers_are_those_of_the_command(drive, log, tmp_path, fault, code):
    shown, car, out = Case(fault).log(log), drive.car.told, tmp_path / "out"
    words = [str(write_recording(blind(shown), tmp_path / "log.csv")), "--out", str(out)]
    car.to_toml(tmp_path / "car.toml")
    ended = main(["identify", *words, "--vehicle", str(tmp_path / "car.toml")])
    found = answer(shown, car, drive.exact)
    assert ended == code
    assert found.valid == (code == 0)
    assert (REFUSED in found.codes) == (code == 2)
    if code != 2:
        verdict = json.loads((out / "summary.json").read_text(encoding="utf-8"))["verdict"]
        against = {one["code"] for one in verdict["findings"] if one["refuses"]}
        assert found.codes == tuple(sorted(against))


def test_a_log_that_is_not_let_in_is_refused_and_measured_all_the_same(drive, log):
    found = answer(Mirrored(channels=("r",)).apply(log), drive.car.told, drive.exact)
    assert found.codes == (REFUSED,)
    assert found.valid is False
    assert math.isfinite(found.worse)
    assert not is_dead(found._replace(stiffness=(1.0, 1.0)), (1e5, 1e5))


def test_a_program_that_stops_is_no_valid_answer(drive, log, monkeypatch):
    def stops(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr("benchmarks.answers.force_error", stops)
    found = answer(log, drive.car.told, drive.exact)
    assert found == NONE._replace(codes=("ZeroDivisionError",), stiffness=found.stiffness)
    assert is_dead(found, (1e5, 1e5))
    assert found.stopped
    assert found.worse == math.inf


def test_the_verdict_is_asked_and_what_refuses_is_kept(drive, log, monkeypatch):
    class Finding:
        def __init__(self, code, refuses):
            self.code, self.refuses = code, refuses

    class Verdict:
        valid = False
        findings = (Finding("b", True), Finding("note", False), Finding("a", True))

    monkeypatch.setattr("tireid.run.judge", lambda _: Verdict)
    asked = answer(log, drive.car.told, drive.exact)
    assert (asked.valid, asked.codes) == (False, ("a", "b"))


def test_what_the_doctor_warns_of_is_kept(drive, log, monkeypatch):
    seen = []

    def diagnose(recording, vehicle):
        seen.append(recording.axle_force)
        finding = Finding(code="delay", channel="delta_f", confidence=0.6)
        return Diagnosis(name="", findings=(finding, Finding(code="offset")), unobservable=())

    monkeypatch.setattr("tireid.learning.diagnose", diagnose)
    assert answer(log, drive.car.told, drive.exact).doctor == ("delay delta_f",)
    assert seen == [None]
    assert not logging.getLogger("tireid.doctor").filters


def test_judged_is_what_stays_wrong_without_what_passes(drive):
    exact, noise = drive.exact, SensorFault(channel="r", kind="noisy", size=0.1)
    bias = biased("v_y", 0.2)
    assert Case(noise).judged(exact) is exact
    straight = StraightOnly(sensors=drive.car.sensors)
    assert Case(straight).judged(exact) is exact
    assert Case().judged(exact) is exact
    both = Case(Together(faults=(noise, bias.fault)))
    np.testing.assert_array_equal(both.judged(exact).v_y, bias.log(exact).v_y)
    np.testing.assert_array_equal(both.judged(exact).r, exact.r)


# Beginnings.


def test_a_bad_beginning_is_counted():
    def missed(learnt):
        targets = Targets("beginnings")
        begun = Begun("sedan", "rough", 1000, learnt, GOOD, is_dead(learnt, (1e5, 1e5)))
        beginnings.report([begun], targets)
        return [key for key, (_, met) in targets.limits.items() if not met]

    assert missed(GOOD) == []
    assert missed(BAD) == ["beyond", "ratio/median", "wrong", "wrong_valid"]
    assert missed(TOLD) == ["beyond", "ratio/median", "wrong"]
    assert missed(GOOD._replace(valid=False)) == ["right_refused_share"]
    assert missed(GOOD._replace(stiffness=(1e5, 9e3))) == ["dead"]
    assert missed(NONE) == ["beyond", "ratio/median", "wrong", "dead", "stopped"]


# Noisy runs.


@pytest.fixture
def shared(drive, monkeypatch):
    monkeypatch.setattr(noisy_runs, "drive_of", lambda _: drive)


@pytest.mark.heavy
@pytest.mark.usefixtures("shared")
def test_noisy_runs_end_well():
    assert noisy_runs.chunk(range(30)) == []


@pytest.mark.usefixtures("shared")
def test_an_exception_and_a_stiffness_of_nothing_are_found(monkeypatch):
    class Tire:
        stiffness = np.array([1e5, 0.0])

        def predict(self, log):
            return log.x

    class History:
        def freeze(self, _):
            return Tire()

    monkeypatch.setattr("benchmarks.noisy_runs.ti.identify", lambda *_, **__: History())
    assert noisy_runs.run(3).what == "stiffness that is none"

    def stops(*_, **__):
        raise ValueError("covariance")

    monkeypatch.setattr("benchmarks.noisy_runs.ti.identify", stops)
    assert noisy_runs.run(3).what == "ValueError: covariance"


@pytest.mark.usefixtures("shared")
def test_a_verdict_that_stops_or_is_none_is_found_where_it_is_asked(monkeypatch):
    def stops(_):
        raise ZeroDivisionError("of a verdict")

    judged, not_judged = noisy_runs.JUDGED, noisy_runs.JUDGED + 1
    assert math.gcd(noisy_runs.JUDGED, noisy_runs.DRIVES) == 1
    monkeypatch.setattr("tireid.run.judge", stops)
    assert noisy_runs.run(judged).what == "ZeroDivisionError: of a verdict"
    assert noisy_runs.run(not_judged).what == ""
    for value in (math.nan, math.inf):
        none = ti.Verdict(findings=(), numbers=(), measures={"force_missed": (0.1, value)})
        monkeypatch.setattr("tireid.run.judge", lambda _, none=none: none)
        assert noisy_runs.run(judged).what == "verdict that is none"


# The table of faults.


@pytest.mark.parametrize(
    ("found", "told"),
    [(GOOD, True), (BAD, False), (TOLD, True), (NONE, True)],
)
def test_an_error_that_doubles_must_be_told(found, told):
    assert fault_table.is_told(found, GOOD) is told


def test_a_wrong_mass_is_forgiven_what_it_adds_to_all_forces_and_no_more():
    off = fault_table.UNSEEN["mass/1.2"]
    assert off == pytest.approx(100.0 * (1.2 - 1.0))
    assert fault_table.is_told(GOOD._replace(error=(27.9, 24.0)), GOOD, off)
    assert not fault_table.is_told(GOOD._replace(error=(28.1, 24.0)), GOOD, off)


def test_the_table_is_markdown_whose_numbers_are_those_recorded():
    table, targets = dict.fromkeys(cases(fault_table.CARMAKER), GOOD), Targets("fault_table")
    table["late/50"] = BAD
    found = {name: [table] for name in (*fault_table.RUNS, *CLASSES)}
    text = fault_table.report(found, targets)
    assert complaints(text, {"fault_table": targets.values}) == []
    assert "| steering 50 ms late | 100 / 100 | 3.0 / 40.0 | " in text
    assert targets.values["silent"] == targets.values["late/50/silent"] == len(found)
    assert targets.values["late/20/silent"] == 0
    assert text.splitlines()[2 + list(table).index("late/50")].endswith(f"| {len(found)} | 6 | 6 |")
    targets.values["late/50/sine/error/rear"] = 50.0
    assert len(complaints(text, {"fault_table": targets.values})) == 1


def test_an_answer_is_silent_where_neither_verdict_nor_doctor_says_something():
    table, targets = dict.fromkeys(cases(fault_table.CARMAKER), GOOD), Targets("fault_table")
    table["late/50"], table["late/80"] = BAD, BAD._replace(doctor=("delay delta_f",))
    fault_table.report({name: [table] for name in (*fault_table.RUNS, *CLASSES)}, targets)
    assert (targets.values["silent"], targets.values["silent_with_doctor"]) == (12, 6)
    assert targets.values["late/80/silent_with_doctor"] == targets.values["clean/doctor"] == 0


# Verdicts.


def test_the_verdict_is_judged_on_answers_that_are_wrong_and_on_those_that_are_right():
    def missed(*answers):
        targets = Targets("verdicts")
        verdicts.report([Judged("sedan", 1, "", one) for one in answers], targets)
        return targets.missed

    refused = GOOD._replace(valid=False)
    between = GOOD._replace(error=(15.0, 3.0))
    assert missed(GOOD, TOLD, NONE, between, between._replace(valid=False)) == []
    silent = "of these, answers of which the doctor says nothing"
    assert missed(GOOD, BAD) == ["answers more than 20 % wrong and called valid", silent]
    alarmed = BAD._replace(doctor=("delay r",))
    assert missed(GOOD, alarmed) == ["answers more than 20 % wrong and called valid"]
    assert missed(refused, TOLD) == ["answers within 8 % and refused"]
    assert missed(*[GOOD] * 40, refused, TOLD) == []
    assert missed(TOLD) == ["answers right, and wrong"]
