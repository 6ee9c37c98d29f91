"""Answers are those of a user, and the benchmarks that judge them ring where they should."""

import json
import logging
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import tireid as ti
from benchmarks import beginnings, fault_table, noisy_runs, verdicts
from benchmarks.answers import REFUSED, Answer, answer, blind, drawn, is_dead
from benchmarks.beginnings import Begun
from benchmarks.documents import complaints
from benchmarks.fault_cases import Case, StraightOnly, biased, cases
from benchmarks.faults import Late, Mirrored, Together
from benchmarks.random_cars import CLASSES, random_beginning
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


def test_a_car_that_never_drives_is_refused_and_nothing_stopped(drive, log):
    slow = replace(log, v_x=0.02 * log.v_x)
    found = answer(slow, drive.car.told, drive.exact)
    assert found.codes == (REFUSED,)
    assert not found.stopped
    assert not is_dead(found, (1e5, 1e5))


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


def test_drives_of_one_seed_are_of_one_car_and_differ(drive):
    again, other = drawn("sedan", 7), drawn("sedan", 7, number=1)
    np.testing.assert_array_equal(again.exact.v_y, drive.exact.v_y)
    assert other.car == drive.car
    assert other.exact.v_y[-1] != drive.exact.v_y[-1]


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


def test_a_straight_drive_has_next_to_no_force_and_all_of_the_noise(drive):
    good = drive.car.sensors
    shown = StraightOnly(sensors=good).apply(drive.exact)
    assert np.abs(shown.axle_force).max() < 0.006 * np.abs(drive.exact.axle_force).max()
    assert np.std(shown.v_y) == pytest.approx(good.v_y.noise, rel=0.1)
    assert np.std(shown.r) == pytest.approx(good.r.noise, rel=0.1)


# Beginnings.


def test_beginnings_compare_with_the_same_drive_begun_in_a_corner():
    found = beginnings.begun(("sedan", 0))
    assert [one.beginning for one in found] == ["straight", "biased", "fading", "banked"]
    assert all(math.isfinite(one.learnt.worse) for one in found)
    straight = found[0]
    assert straight.ratio == pytest.approx(
        max(straight.learnt.worse, 1.0) / max(straight.corner.worse, 1.0)
    )
    assert 0.5 < straight.ratio < 1.3


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


def test_verdicts_of_beginnings_are_counted_with_those_at_the_door():
    door = GOOD._replace(valid=False, codes=(REFUSED,))
    answers = [GOOD, BAD, TOLD, door, GOOD._replace(valid=False, codes=("prior",))]
    found = [Begun("sedan", "rough", 1000, one, GOOD, False) for one in answers]
    assert beginnings.Verdicts.of(found) == (2, 1, 3, 2, 1)


# Noisy runs.


@pytest.fixture
def shared(drive, monkeypatch):
    monkeypatch.setattr(noisy_runs, "drive_of", lambda _: drive)


@pytest.mark.usefixtures("shared")
def test_noisy_runs_end_well():
    assert noisy_runs.chunk(range(30)) == []


def test_noisy_logs_are_noisy_by_what_is_said_and_short(drive):
    times, steps = [], set()
    for seed in range(200):
        rng = np.random.default_rng(seed)
        sensors = noisy_runs.noisy(drive.car.sensors, rng)
        times.append(sensors.v_y.noise / drive.car.sensors.v_y.noise)
        log, _, _ = noisy_runs.noisy_log(drive, rng)
        assert log.axle_force is None
        assert log.t[0] == 0.0
        assert 1.5 < log.duration < 14.5
        steps.add(log.dt)
    assert min(times) < 0.02
    assert max(times) > 60.0
    assert steps == set(noisy_runs.SAMPLED)


def test_a_drive_sampled_anew_is_the_same_drive(drive):
    part = drive.exact.between(10.0, 15.0)
    fine = noisy_runs.sampled(part, 0.002)
    assert fine.dt == 0.002
    np.testing.assert_allclose(fine.r[::5], part.r[:-1], atol=1e-9)


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


def test_what_the_doctor_says_of_the_drive_without_the_fault_tells_nothing_of_the_fault():
    late, both = BAD._replace(doctor=("delay delta_f",)), ("delay delta_f", "offset r")
    assert not fault_table.is_told_by_doctor(BAD, GOOD)
    assert fault_table.is_told_by_doctor(late, GOOD)
    assert not fault_table.is_told_by_doctor(late, GOOD._replace(doctor=late.doctor))
    assert fault_table.is_told_by_doctor(late._replace(doctor=both), late)


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


def test_a_dead_axle_that_is_called_valid_is_told_from_one_that_is_not():
    table, dead = (
        dict.fromkeys(cases(fault_table.CARMAKER), GOOD),
        GOOD._replace(stiffness=(1e5, 9.0)),
    )
    table["late/20"], table["late/50"] = dead, dead._replace(valid=False)
    targets = Targets("fault_table")
    fault_table.report({name: [table] for name in (*fault_table.RUNS, *CLASSES)}, targets)
    assert (targets.values["dead"], targets.values["dead_valid"]) == (12, 6)


def test_every_case_has_a_label_of_its_own():
    labels = [fault_table.label_of(name) for name in cases(fault_table.CARMAKER)]
    assert len(set(labels)) == len(labels)


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


def test_refused_right_answers_are_told_by_group_by_cause_and_where_nothing_was_wrong():
    refused = GOOD._replace(valid=False, codes=("prior", "at_bound"))
    door, targets = GOOD._replace(valid=False, codes=(REFUSED,)), Targets("verdicts")
    between = GOOD._replace(error=(15.0, 3.0))
    found = [Judged("sedan", k, "", GOOD) for k in range(6)]
    found += [Judged("race", 1, "", refused, True), Judged("race", 2, "", between)]
    found += [Judged("recordings", 1, "", door), Judged("recordings", 2, "", BAD)]
    verdicts.report(found, targets)
    values = targets.values
    assert (values["plants/right"], values["plants/right_refused"]) == (7, 1)
    assert (values["plants/clean_refused"], values["recordings/clean_refused"]) == (1, 0)
    assert (values["recordings/right_refused"], values["recordings/door"], values["door"]) == (
        1,
        1,
        1,
    )
    assert (values["between"], values["between_valid"], values["plants/between"]) == (1, 1, 1)
    assert values["plants/refused_share"] == pytest.approx(100.0 / 7.0)
    assert values["refused_share"] == pytest.approx(25.0)
    by = {key: value for key, value in values.items() if key.startswith("right_refused_by/")}
    assert by == {f"right_refused_by/{code}": 1 for code in ("prior", "at_bound", REFUSED)}


def test_each_third_of_the_answers_has_its_fate(monkeypatch):
    monkeypatch.setattr(verdicts, "answer", lambda *_: GOOD)
    fates = [one.what for seed in range(3) for one in verdicts.plant_answers(("sedan", seed))]
    assert sum(fate == "nothing wrong" for fate in fates) == 5
    assert sum(fate.startswith("beginning: ") for fate in fates) == 5


def test_parts_of_recordings_are_those_in_which_the_car_drives(drive):
    exact = drive.exact
    stands = replace(exact, v_x=np.where(exact.t < 15.0, 0.0, exact.v_x))
    part = partial(verdicts.part_of, stands, drive.car.told)
    for seed in range(10):
        one = part(np.random.default_rng(seed))
        assert np.mean(one.v_x > 1.0) >= 0.55
        assert one.t[0] == 0.0
    assert drawn("sedan", 7, partial(random_beginning, "standing")).car == drive.car
