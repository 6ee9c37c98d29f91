"""How the doctor's answers are judged: what is right, at which place, and what is an alarm."""

from dataclasses import replace

import pytest

from benchmarks import doctor_answers
from benchmarks.doctor import drawn
from benchmarks.doctor_answers import PARTS, WHOLE, Clean, judge_clean, rank_of
from benchmarks.targets import Targets
from identifier.doctor import Diagnosis, Finding


@pytest.fixture(scope="module")
def drive():
    return drawn("sedan", 1)


def test_a_fault_is_named_by_its_code_and_one_of_its_channels():
    listed = [Finding(code="delay", channel="r+a_y"), Finding(code="sign", channel="v_y")]
    assert rank_of(listed, (("delay", "a_y"),)) == 1
    assert rank_of(listed, (("sign", "r"), ("sign", "v_y"))) == 2
    assert rank_of(listed, (("sign", ""),)) == 2
    assert rank_of(listed, (("sign", "r"),)) == 0
    assert rank_of([], (("sign", "r"),)) == 0


def test_only_a_half_may_be_called_straight(drive, monkeypatch):
    log, car, _ = drive
    names = ("v_y", "r", "delta_f", "a_y")
    straight = replace(log, **{name: 0.01 * getattr(log, name) for name in names})
    alarms = doctor_answers.said_of_clean("sedan", 1, straight, car).alarms
    assert alarms[WHOLE]
    assert not any(alarms[part] for part in PARTS)
    late = Finding(code="delay", channel="r", confidence=0.3, group=0.9, text="late")
    monkeypatch.setattr(
        doctor_answers.ti,
        "diagnose",
        lambda log, car: Diagnosis(name=log.name, findings=(late,), unobservable=()),
    )
    alarms = doctor_answers.said_of_clean("sedan", 1, log, car).alarms
    assert set(alarms.values()) == {("late",)}


def test_alarms_are_counted_by_drive_and_by_half(capsys):
    quiet: dict[str, tuple[str, ...]] = dict.fromkeys((WHOLE, *PARTS), ())
    loud = {**quiet, "second half": ("v_y is in mm/s",)}
    targets = Targets("doctor")
    judge_clean([Clean("sedan", 1, quiet), Clean("race", 2, loud)], targets)
    assert targets.values["alarms"] == 0.0
    assert targets.values["alarms/halves"] == pytest.approx(100.0 / 4.0)
    assert targets.missed == ["halves of clean drives with an alarm"]
    assert "race 2, second half" in capsys.readouterr().out
