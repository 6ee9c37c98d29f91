"""Two short drives of the sedan as log files, and its vehicle file."""

import numpy as np
import pytest

from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import write_recording
from models.vehicle import sedan


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
