"""`tireid doctor` as a user meets it: a faulty log goes to a valid verdict without an editor."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.doctor import Diagnosis, Finding
from identifier.verdict import Verdict
from identifier.verdict.verdict import Objection
from models.recordings import LogMap, Repair, read_recording, write_recording
from tests.tireid.conftest import json_of, learn_words, page_in, typed
from tireid.diagnoses import (
    _size_text,
    diagnosis_notes,
    diagnosis_text,
    unsure_text,
    with_doctor,
    write_repair,
)

RATIO = 14.6


@pytest.fixture(scope="module")
def clinic(tmp_path_factory):
    """A car's file, a good log, and one in km/h and degrees, with the steering wheel's angle."""
    folder = tmp_path_factory.mktemp("clinic")
    assert typed("init", folder / "car.toml") == 0
    assert typed("sample", folder / "good.csv") == 0
    good = read_recording(folder / "good.csv")
    bad = replace(
        good,
        v_x=3.6 * good.v_x,
        v_y=3.6 * good.v_y,
        r=np.degrees(good.r),
        delta_f=-RATIO * np.degrees(good.delta_f),
        axle_force=None,
    )
    write_recording(bad, folder / "bad.csv")
    return folder


def doctor(clinic, log, *words):
    return typed("doctor", clinic / log, "--vehicle", clinic / "car.toml", *words)


def test_a_good_log_ends_with_0_and_says_what_it_cannot_tell(clinic, capsys):
    assert doctor(clinic, "good.csv") == 0
    told = capsys.readouterr().out
    assert "doctor: nothing found" in told
    assert "not observable: mass" in told


def test_a_faulty_log_ends_with_3_and_each_fault_has_a_line(clinic, capsys):
    assert doctor(clinic, "bad.csv") == 3
    told = capsys.readouterr().out
    for text in ("r is in deg/s", "v_x is in km/h", "v_y is in km/h", "steering wheel in degrees"):
        assert text in told
    assert doctor(clinic, "bad.csv", "--accept") == 0


@pytest.mark.usefixtures("unmade")
def test_repaired_by_the_doctor_the_log_is_learnt_and_valid(clinic, tmp_path, capsys):
    log_map, out = tmp_path / "log.toml", tmp_path / "out"
    assert doctor(clinic, "bad.csv", "--repair", log_map, "--out", out) == 0
    assert "after the repair, doctor: nothing found" in capsys.readouterr().out
    repair = LogMap.from_toml(log_map).repair
    assert repair.factor["v_x"] == pytest.approx(1.0 / 3.6)
    assert -np.radians(1.0) / repair.factor["delta_f"] == pytest.approx(RATIO, rel=0.03)
    summary = json_of(out / "summary.json")
    assert summary["applied"] == repair.tables()
    assert summary["after"]["healthy"] and not summary["healthy"]
    assert "Doctor" in page_in(out)
    assert (out / "slip.png").read_bytes().startswith(b"\x89PNG")
    words = learn_words(clinic, "bad.csv")
    learnt = tmp_path / "learnt"
    assert typed(*words, "--log", log_map, "--out", learnt) == 0
    assert "verdict: valid" in capsys.readouterr().out


def test_identify_refuses_a_faulty_log_and_names_the_doctor(clinic, out, capsys):
    words = learn_words(clinic, "bad.csv")
    assert typed(*words, "--out", out) == 2
    assert "tireid doctor LOG" in capsys.readouterr().err


@pytest.mark.usefixtures("unmade")
def test_identify_repairs_what_is_sure_and_says_so(clinic, tmp_path, capsys):
    out, log_map = tmp_path / "out", tmp_path / "log.toml"
    words = learn_words(clinic, "bad.csv")
    assert typed(*words, "--repair", log_map, "--out", out) == 0
    told = capsys.readouterr().out
    assert "repaired, in identification and replay: factor.r" in told
    assert "verdict: valid" in told
    found = json_of(out / "doctor.json")
    assert found["applied"] == LogMap.from_toml(log_map).repair.tables()
    assert "Doctor" in page_in(out)


def test_with_repair_a_log_that_no_repair_mends_is_refused_all_the_same(
    clinic, tmp_path, out, capsys
):
    words = [*learn_words(clinic, "good.csv"), "--repair"]
    words += [tmp_path / "log.toml", "--replay", clinic / "bad.csv", "--out", out]
    assert typed(*words) == 2
    assert "bad: " in capsys.readouterr().err.splitlines()[-1]
    assert not out.exists()


def test_nothing_sure_changes_nothing_and_what_is_there_stays(clinic, tmp_path, capsys):
    log_map = tmp_path / "log.toml"
    assert doctor(clinic, "good.csv", "--repair", log_map) == 0
    assert "no sure repair" in capsys.readouterr().out
    assert LogMap.from_toml(log_map) == LogMap()
    assert doctor(clinic, "good.csv", "--log", log_map) == 0  # the next command of docs/doctor.md
    (tmp_path / "mine.toml").write_text("mine")
    assert doctor(clinic, "bad.csv", "--repair", tmp_path / "mine.toml") == 2
    assert (tmp_path / "mine.toml").read_text() == "mine"
    assert doctor(clinic, "bad.csv", "--repair", tmp_path / "log.txt") == 2


def test_what_is_found_in_a_log_that_its_map_repairs_is_taken_out_after_that(tmp_path):
    told = LogMap(repair=Repair(offset={"r": 0.1}, vehicle={"mass": 1500.0}))
    halved = Finding(
        code="factor", channel="r", confidence=1.0, repair=Repair(factor={"r": 0.5}), sure=True
    )
    diagnosis = Diagnosis(name="log", findings=(halved,), unobservable=())
    write_repair(tmp_path / "log.toml", told, diagnosis)
    assert LogMap.from_toml(tmp_path / "log.toml").repair == Repair(
        factor={"r": 0.5}, offset={"r": 0.05}, vehicle={"mass": 1500.0}
    )  # (r - 0.1) / 2


def test_sizes_have_the_digits_that_their_deviations_leave():
    delay = Finding(code="delay", channel="r", size=0.09123, deviation=0.0021, unit="s")
    assert _size_text(delay) == "91.2 ± 2.1 ms"
    angle = Finding(code="offset", channel="delta_f", size=np.radians(1.0), unit="rad")
    assert _size_text(angle) == "1.00 deg"
    assert _size_text(Finding(code="straight")) == ""


def test_a_verdict_never_passes_over_what_the_doctor_is_sure_of():
    """A wrong unit refuses the answer, a size is noted, and what was repaired says nothing."""
    unit, late, doubtful = (
        Finding(code=code, channel="r", confidence=1.0, text=code, repair=repair, sure=sure)
        for code, repair, sure in (
            ("unit", Repair(factor={"r": 0.02}), True),
            ("delay", Repair(delay={"r": 0.1}), True),
            ("offset", Repair(offset={"r": 0.1}), False),
        )
    )
    fine, nothing = Verdict(findings=(), numbers=(), measures={}), Repair()

    def said(*findings, repair=nothing):
        return with_doctor(fine, Diagnosis(name="log", findings=findings, unobservable=()), repair)

    assert said(doubtful) == fine
    noted = said(late)
    assert noted.valid and noted.lines[1] == "note: doctor: delay"
    refused = said(late, unit)
    assert not refused.valid
    assert [one.text for one in refused.findings] == ["doctor: unit", "doctor: delay"]
    assert said(late, unit, repair=late.repair) == fine
    assert not said(replace(unit, code="factor", channel="v_x")).valid, "it scales all forces"
    assert said(replace(unit, code="factor", channel="a_y")).valid


def test_a_repair_that_is_not_sure_can_be_written_by_hand(tmp_path):
    repair, path = Repair(factor={"delta_f": 1.298}), tmp_path / "log.toml"
    finding = Finding(code="factor", channel="delta_f", confidence=0.99, repair=repair)
    said = unsure_text(Diagnosis(name="x", findings=(finding,), unobservable=()), path)
    assert "rival" in said
    path.write_text("[repair]\n" + said.rpartition(": ")[2], encoding="utf-8")
    assert LogMap.from_toml(path).repair == repair


def test_what_the_verdict_notes_of_v_y_is_not_noted_again():
    found = Finding(
        code="v_y_reads", channel="v_y", size=-0.13, deviation=0.02, unit="m/s", note=True,
        confidence=0.9, text="v_y reads 0.13 m/s too little",
    )  # fmt: skip
    diagnosis = Diagnosis(name="log", findings=(found,), unobservable=())
    noted = Objection("v_y_reads", None, "v_y reads 0.14 m/s too little", False)
    verdict = Verdict(findings=(), numbers=(), measures={})
    assert len(diagnosis_notes(diagnosis, verdict)) == 1
    assert diagnosis_notes(diagnosis, replace(verdict, findings=(noted,))) == []
    assert "v_y reads wrong by  -0.130 ± 0.020 m/s" in diagnosis_text(diagnosis)
