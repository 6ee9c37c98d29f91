"""Two short drives of the sedan as log files, and its vehicle file; a doctor that is asked once."""

import hashlib
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from identifier.doctor import diagnose
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import read_recording, write_recording
from models.vehicle import sedan
from tests.pages import faults_of
from tests.tireid.browser import opened_tab
from tireid.cli import main
from tireid.commands.demo_story import run_story


@pytest.fixture(scope="session")
def logs(tmp_path_factory):
    """A folder with slalom.csv, quick.csv and car.toml."""
    folder = tmp_path_factory.mktemp("logs")
    plant = Plant(sedan())
    for name, frequency in (("slalom", 0.5), ("quick", 0.8)):
        maneuver = Slalom(
            amplitude=np.radians(3.0),
            frequency=frequency,
            onset=1.0,
            rate_limit=np.radians(30.0),
            duration=8.0,
        )
        recording = plant.simulate(maneuver, speed=20.0, name=name).recording()
        write_recording(recording, folder / f"{name}.csv")
    sedan().to_toml(folder / "car.toml")
    return folder


DIAGNOSES = {}  # what the doctor said, by a digest of the log and the car that it was asked about


@pytest.fixture(autouse=True, scope="module")
def asked_once():
    """The doctor answers the same to the same, and takes long: a log is looked at once."""

    def answered(recording, vehicle):
        asked = hashlib.sha256(pickle.dumps((recording, vehicle))).digest()
        if asked not in DIAGNOSES:
            DIAGNOSES[asked] = diagnose(recording, vehicle)
        return DIAGNOSES[asked]

    with pytest.MonkeyPatch.context() as patch:
        for command in ("commands.doctor", "commands.identify", "learning"):
            patch.setattr(f"tireid.{command}.diagnose", answered)
        yield


@pytest.fixture(scope="session")
def story():
    return run_story()


@pytest.fixture
def out(tmp_path):
    """Where a command is told to write its results; not there yet."""
    return tmp_path / "out"


@pytest.fixture
def tab(tmp_path):
    with opened_tab(tmp_path) as tab:
        yield tab


@pytest.fixture
def unmeasured(monkeypatch):
    """No package is measured for Arm: costs have tests of their own."""
    monkeypatch.setattr("tireid.exporting.measure", lambda *_: [])


def typed(*words):
    """The exit code of a command; paths are words too."""
    return main([str(word) for word in words])


def learn_words(folder, log="slalom.csv", *more):
    """Words that identify the tires of the car of a folder on a log, of this folder or by path."""
    return ["identify", folder / log, "--vehicle", folder / "car.toml", *more]


def rewritten(log, target, **signals):
    """The path of a log with other signals; those that are functions are asked with the log."""
    told = read_recording(log)
    new = {name: one(told) if callable(one) else one for name, one in signals.items()}
    return write_recording(replace(told, **new), target)


def json_of(path):
    return json.loads(path.read_text(encoding="utf-8"))


def columns_of(log):
    """The signals of a log by the names of its columns, as `read_recording` takes them."""
    return {"t": log.t, "vx": log.v_x, "vy": log.v_y, "r": log.r, "delta_f": log.delta_f}


def table_of(path):
    """The columns of a CSV file by their names."""
    return np.genfromtxt(path, delimiter=",", names=True)


def page_in(folder):
    """The report of a folder, after a look for faults of it."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert faults_of(page) == []
    return page


def refusal(capsys, words):
    """The one line of an error of a command, after checking the exit code."""
    capsys.readouterr()
    assert typed(*words) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "error:" in line]
    return line
