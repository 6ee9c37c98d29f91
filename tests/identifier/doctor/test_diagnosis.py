"""A diagnosis: the order, what is sure, what is not observable, and a repair of the log."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.faults import Together, WrongUnit
from identifier.axle import AxleIdentifier
from identifier.doctor import Finding, diagnose, diagnosis
from identifier.doctor.diagnosis import Diagnosis, _contradictions
from identifier.doctor.finding import first_of_each
from identifier.doctor.screen import combined
from identifier.run import identify
from models.faults import SensorFault
from models.recordings import Repair
from models.vehicle import sedan
from tests.identifier.conftest import codes_of, drawn


@pytest.fixture(scope="module")
def driven():
    return drawn("sedan", 43)


@pytest.fixture(scope="module")
def ratio(driven):
    """The same drive with the steering-wheel angle in degrees, 14.6 times that of the wheels."""
    car, log = driven
    wheel = SensorFault(channel="delta_f", kind="scaled", size=14.6)
    return car, Together(faults=(wheel, WrongUnit(channel="delta_f", unit="deg"))).apply(log)


@pytest.fixture(scope="module")
def found(ratio):
    car, log = ratio
    return diagnose(log, car)


def test_a_right_log_is_healthy_and_what_it_cannot_tell_is_said(driven):
    car, log = driven
    fine = diagnose(log, car)
    assert fine.healthy
    assert fine.findings == () and not fine.repair
    assert fine.unobservable[0].startswith("mass")
    assert any("mirrored" in line for line in fine.unobservable)
    assert "nothing found" in fine.summary()
    assert not any("a_y" in line for line in fine.unobservable)
    bare = diagnose(replace(log, a_y=None), car)
    assert any("no a_y" in line for line in bare.unobservable)


def test_the_ratio_of_the_steering_wheel_is_found(found):
    first = found.findings[0]
    assert (first.code, first.channel, first.sure) == ("steering_ratio", "delta_f", True)
    assert first.size == pytest.approx(14.6, rel=0.08)
    assert first.deviation > 0.0
    assert not found.healthy


def test_what_is_sure_mends_the_log_as_well_as_the_right_one(driven, ratio, found):
    car, log = driven
    mended, outcome = found.repair.apply(ratio[1], car)
    design = AxleIdentifier.for_vehicle(car)
    errors = []
    for one in (log, mended):
        history = identify(one, car, design)
        model = history.freeze(float(one.t[-1]))
        errors.append(float(np.sqrt(np.mean((model.predict(log) - log.axle_force) ** 2))))
    assert outcome == car
    assert errors[1] < 1.2 * errors[0]
    assert diagnose(mended, outcome).healthy


def test_gross_repairs_come_before_fine_ones_and_only_sure_ones_are_taken():
    findings = (
        Finding(
            code="unit", channel="r", confidence=1.0, repair=Repair(factor={"r": 0.5}), sure=True
        ),
        Finding(
            code="factor", channel="r", confidence=1.0, repair=Repair(factor={"r": 1.1}), sure=True
        ),
        Finding(code="offset", channel="r", confidence=0.6, repair=Repair(offset={"r": 0.1})),
    )
    whole = Diagnosis(name="log", findings=findings, unobservable=())
    assert whole.repair == Repair(factor={"r": 0.55})
    assert combined(findings).offset == {"r": 0.1}


def test_a_unit_comes_before_the_offset_that_is_found_behind_it(driven):
    """Logged in degrees with 0.02 rad/s too much: the offset is told in rad/s, and taken off so."""
    car, log = driven
    biased = SensorFault(channel="r", kind="biased", size=0.02).apply(log)
    found = diagnose(SensorFault(channel="r", kind="scaled", size=57.3).apply(biased), car).findings
    assert codes_of(found[:2]) == ["unit r", "offset r"]
    assert found[1].size == pytest.approx(0.02, abs=0.002)
    assert "bank" in found[1].text, "at one speed a road that is banked looks the same"
    mended, _ = combined(found[:2]).apply(replace(biased, r=57.3 * biased.r), car)
    np.testing.assert_allclose(mended.r, log.r, atol=0.002)


def test_whether_something_is_wrong_is_one_question_and_which_of_several_another():
    one, other = (
        Finding(code=code, channel="v_y", confidence=0.45, group=0.9) for code in ("lag", "delay")
    )
    alone = Finding(code="lag", channel="v_y", confidence=0.45, group=0.45)
    assert one.alarm == 0.9 and one.matters
    assert not Diagnosis(name="log", findings=(one, other), unobservable=()).healthy
    assert Diagnosis(name="log", findings=(alone,), unobservable=()).healthy
    assert one.to_dict()["alarm"] == 0.9
    assert Finding(code="straight", confidence=0.99).alarm == 0.99


def test_nothing_is_looked_for_where_nothing_was_driven(driven):
    _, log = driven
    standing = replace(log, v_x=0.0 * log.v_x, v_y=0.0 * log.v_y, r=0.0 * log.r)
    found = diagnose(standing, sedan())
    assert not found.healthy
    assert any(line.startswith("offsets, delays") for line in found.unobservable)


def test_a_diagnosis_is_told_in_lines_and_numbers():
    repair = Repair(offset={"r": 0.1})
    listed = (
        Finding(code="offset", channel="r", size=0.1, unit="rad/s", confidence=0.999, text="one",
                repair=repair, sure=True),
        Finding(code="delay", channel="v_y", confidence=0.4, text="two", repair=repair),
        Finding(code="yaw_inertia", confidence=0.9, text="three", note=True),
    )  # fmt: skip
    outcome = Diagnosis(name="log", findings=listed, unobservable=("mass",))
    lines = ["one (sure)", "two (confidence 40 %)", "three (note, confidence 90 %)"]
    assert outcome.lines(unobservable=False) == lines
    assert outcome.summary().split("\n") == ["log:", *lines, "not observable: mass"]
    assert not outcome.healthy and outcome.repair == repair
    numbers = outcome.to_dict()
    assert numbers["recording"] == "log" and numbers["not_observable"] == ["mass"]
    assert numbers["repair"] == {"offset": {"r": 0.1}} and not numbers["healthy"]
    first = numbers["findings"][0]
    assert first["size"] == 0.1 and first["deviation"] is None and first["unit"] == "rad/s"
    assert first["repair"] == {"offset": {"r": 0.1}} and numbers["findings"][2]["repair"] is None
    assert repr(outcome) == "<Diagnosis of 'log': offset r, delay v_y, yaw_inertia>"
    assert replace(listed[1], confidence=1e-4).percent == "<1 %"
    assert listed[0].percent == "99 %" and not listed[2].matters
    again = replace(listed[1], channel="r")
    assert first_of_each([*listed, again, listed[1]]) == [*listed, again]


def test_a_log_without_v_y_or_in_a_fixed_frame_is_not_asked_for_sizes(driven):
    car, log = driven
    blind = diagnose(replace(log, v_y=None), car)
    assert blind.healthy and any("no lateral velocity" in line for line in blind.unobservable)
    still = log.r.copy()
    still[300:400] = still[300]
    frozen = diagnose(replace(log, v_y=None, r=still), car)
    assert codes_of(frozen.findings) == ["frozen r"]
    slow = diagnose(replace(log, v_y=None, t=1000.0 * log.t), car)
    assert "clock_unit" in codes_of(slow.findings)


def test_a_law_that_is_broken_is_a_finding_that_matters(driven, monkeypatch):
    car, log = driven
    assert _contradictions(log, car) == []
    monkeypatch.setattr(diagnosis, "physics_contradiction", lambda _: None)
    monkeypatch.setattr(diagnosis, "vehicle_contradiction", lambda *_: "a law is broken")
    (found,) = _contradictions(log, car)
    assert (found.code, found.text, found.confidence) == ("contradiction", "a law is broken", 0.9)
    assert found.matters and not found.sure
