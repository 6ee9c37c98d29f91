"""The fuzz harness finds what is planted behind a door, and repeats what it did."""

import os
import random
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import tireid.commands.check
from benchmarks.fuzz import server
from benchmarks.fuzz.cases import MUTATORS, Case, draw, lay_out
from benchmarks.fuzz.doors import DOORS
from benchmarks.fuzz.session import Session
from identifier.paper.design import PaperIdentifier, design_text
from models.vehicle import sedan

pytestmark = pytest.mark.skipif(
    not hasattr(os, "pidfd_open"), reason="the harness watches its forks as Linux lets it"
)
(CHECK,) = (door for door in DOORS if door.name == "check design")


@pytest.fixture
def session(tmp_path, monkeypatch):
    """A session whose seeds are those of one door."""
    monkeypatch.setattr(server, "CPU", 2)
    monkeypatch.setattr(server, "SILENCE", 1.0)
    design = design_text(PaperIdentifier.for_vehicle(sedan()))
    car = tmp_path / "whole.toml"
    replace(sedan(), chassis=None).to_toml(car)
    seeds = {"car.toml": car.read_bytes(), "integral.toml": design.encode()}
    return Session(tmp_path, seeds, {}, 0.0)


def kinds(session, case=None):
    case = case or Case(0, 1, CHECK, (), "none", drawn=False)
    return [finding.kind for finding in session.run(case).findings]


def key_error(options):
    return {}[options.design]


def hangs(options):
    while True:
        pass


def dies(options):
    os.kill(os.getpid(), signal.SIGSEGV)


def unknown_code(options):
    return 7


def loses(options):
    Path("notes.txt").unlink()


def overwrites(options):
    Path("data/run.csv").write_text("1,2\n")


def leaves(options):
    Path(".out-x.part").mkdir()


def writes_and_fails(options):
    Path("result.json").write_text("{}")
    raise ValueError("it went wrong")


def rings(options):
    print("a car named \x07")


def chatters(options):
    print("a warning of somebody's library", file=sys.stderr)
    raise ValueError("x")


def no_number(options):
    print("rms nan N")


def nulls(options):
    from tireid.output import write_json

    write_json(Path("summary.json"), {"rms": float("nan")})


def empty_cells(options):
    Path("forces.csv").write_text("t_s,F\n0,nan\n")


PLANTED = {
    key_error: "traceback",
    hangs: "hang",
    dies: "crash",
    unknown_code: "exit code",
    loses: "user file lost",
    overwrites: "user file lost",
    leaves: "left behind",
    writes_and_fails: "written and failed",
    rings: "control character",
    chatters: "not one line",
    no_number: "not finite",
    nulls: "not finite",
    empty_cells: "not finite",
}


def test_nothing_is_found_behind_a_door_that_is_sound(session):
    assert kinds(session) == []


@pytest.mark.heavy
def test_doors_open_to_right_files(tmp_path, monkeypatch):
    for name in ("PATH", "TIREID_CACHE"):  # which a session changes for its process
        monkeypatch.setenv(name, os.environ.get(name, str(tmp_path / "cache")))
    assert Session.begin(tmp_path, [door for door in DOORS if "axle" in door.name]).seeds


@pytest.mark.sweep("nulls", "overwrites", "key_error")
@pytest.mark.parametrize("fault", PLANTED, ids=lambda fault: fault.__name__)
def test_what_is_planted_behind_a_door_is_found(session, monkeypatch, fault):
    monkeypatch.setattr(tireid.commands.check, "run", fault)
    assert kinds(session) == [PLANTED[fault]]


def test_a_car_may_be_called_nan(session, monkeypatch):
    def names(options):
        print("of the car nan")

    monkeypatch.setattr(tireid.commands.check, "run", names)
    assert kinds(session) == ["not finite"]
    text = session.seeds["car.toml"].decode()
    renamed = text.replace('name = "sedan"', 'name = "nan"')
    assert renamed != text
    session.seeds["car.toml"] = renamed.encode()
    assert kinds(session) == []


@pytest.mark.heavy
def test_a_command_that_tells_how_far_it_came_does_not_hang(session, monkeypatch):
    def works(options):
        while True:
            print("  another share", file=sys.stderr, flush=True)

    monkeypatch.setattr(tireid.commands.check, "run", works)
    assert kinds(session) == []


def test_an_axle_that_does_not_push_is_found(session, monkeypatch):
    def freezes(options):
        Path("out").mkdir()
        Path("out/weights.json").write_text("{}")

    monkeypatch.setattr(tireid.commands.check, "run", freezes)
    monkeypatch.setattr(server, "stiffness_shares", lambda path: [0.9, 0.004])
    assert kinds(session) == ["dead axle"]
    monkeypatch.setattr(server, "stiffness_shares", lambda path: [0.9, float("nan")])
    assert kinds(session) == ["dead axle"]
    monkeypatch.setattr(server, "stiffness_shares", lambda path: [0.9, 0.7])
    assert kinds(session) == []


@pytest.mark.heavy
def test_a_door_without_a_check_is_found_by_mutations(session, monkeypatch):
    """A reader that takes what the file says, as it would be without its schema."""
    import tomllib

    def unchecked(options):
        return min(0, int(tomllib.loads(options.design.read_text())["network"]["hidden"]))

    monkeypatch.setattr(tireid.commands.check, "run", unchecked)
    found = set()
    for number in range(40):
        found.update(kinds(session, draw(1, number, [CHECK])))
    assert "traceback" in found


def test_a_case_is_the_same_whenever_it_is_drawn(session, tmp_path):
    laid = []
    for name in ("first", "second"):
        cases = [draw(7, number, [CHECK]) for number in range(20)]
        folders = [tmp_path / name / str(case.number) for case in cases]
        for folder in folders:
            folder.mkdir(parents=True)
        words = [
            lay_out(case._replace(around="none"), session.seeds, folder)
            for case, folder in zip(cases, folders, strict=True)
        ]
        files = [
            (folder / file).read_bytes()
            for folder in folders
            for file in ("integral.toml", "car.toml")
            if (folder / file).is_file() and not (folder / file).is_symlink()
        ]
        laid.append((words, files))
    assert laid[0] == laid[1]
    assert len(set(laid[0][1])) > 15  # and it is another one each time


@pytest.mark.sweep("parquet")
@pytest.mark.parametrize("ending", MUTATORS)
def test_a_mutator_takes_whatever_an_earlier_one_made(ending):
    for number in range(300):
        rng = random.Random(number)
        data = b"t,vx\n" + b"1,2\n" * 20 if number % 2 else b""
        for _ in range(3):
            data = MUTATORS[ending](rng, data)[:100_000]
        assert isinstance(data, bytes)
