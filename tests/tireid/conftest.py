"""Two short drives of the sedan as log files, and its vehicle file; a doctor that is asked once."""

import hashlib
import pickle

import numpy as np
import pytest

from identifier.doctor import diagnose
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import write_recording
from models.vehicle import sedan
from tireid.cli import main


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


@pytest.fixture(scope="session")
def diagnoses():
    """What the doctor said, by a digest of the log and the car that it was asked about."""
    return {}


@pytest.fixture(autouse=True, scope="module")
def asked_once(diagnoses):
    """The doctor answers the same to the same, and takes long: a log is looked at once."""

    def answered(recording, vehicle):
        asked = hashlib.sha256(pickle.dumps((recording, vehicle))).digest()
        if asked not in diagnoses:
            diagnoses[asked] = diagnose(recording, vehicle)
        return diagnoses[asked]

    with pytest.MonkeyPatch.context() as patch:
        for command in ("commands.doctor", "commands.identify", "learning"):
            patch.setattr(f"tireid.{command}.diagnose", answered)
        yield


def refusal(capsys, words):
    """The one line of an error of a command, after checking the exit code."""
    capsys.readouterr()
    assert main([str(word) for word in words]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "error:" in line]
    return line
