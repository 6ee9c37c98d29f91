"""What is mutated: small files that are right, of every format, written by the program itself."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.io

from codegen.arrays import Array
from identifier.methods import make_method
from identifier.paper.design import PaperIdentifier, design_text
from identifier.run import identify
from identifier.tire_model import TireModel
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import Recording, write_recording
from models.sensors import Sensor, Sensors
from models.vehicle import Vehicle, sedan

DATA = Path(__file__).resolve().parents[2] / "models" / "data"
SPEED, DURATION = 20.0, 6.0  # m/s and s
FROZEN = {  # file of weights, and the method that learnt it
    "axle.json": "axle",
    "fit.json": "fit",
    "network.json": "integral",
    "curve.json": "lagged_ekf",
}
DESIGNS = {"integral.toml": "integral", "lead.toml": "pi_lead"}


def write_seeds(folder: Path, needed: Collection[str]) -> Mapping[str, bytes]:
    """Write the files that cases begin with; return their contents by name.

    Parameters
    ----------
    folder : an empty folder.
    needed : names of those that are needed; what takes little is written anyway.
    """
    car = sedan()
    recording = short_drive(car)
    for name in ("log.csv", "other.csv", "log.csv.gz"):
        write_recording(recording, folder / name)
    for name in ("sedan.toml", "sedan.tir"):
        (folder / name).write_bytes((DATA / name).read_bytes())
    replace(car, chassis=None).to_toml(folder / "car.toml")
    for name, law in DESIGNS.items():
        (folder / name).write_text(
            design_text(PaperIdentifier.for_vehicle(car, law=law)), encoding="utf-8"
        )
    _write_path(folder / "path.csv")
    _write_logger(recording, folder / "logger.csv")
    (folder / "log.toml").write_text(LOG_MAP, encoding="utf-8")
    if "log.mat" in needed:
        scipy.io.savemat(folder / "log.mat", _columns(recording))
    if "log.parquet" in needed:
        _write_parquet(recording, folder / "log.parquet")
    for name, law in FROZEN.items():
        if name in needed:
            _learnt(law, recording, car).save(folder / name)
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def short_drive(car: Vehicle) -> Recording:
    """Return a few seconds of slalom with sensor noise.

    Parameters
    ----------
    car : what drives.
    """
    maneuver = Slalom(
        amplitude=np.radians(4.0),
        frequency=0.6,
        onset=0.5,
        rate_limit=np.radians(40.0),
        duration=DURATION,
    )
    sensors = Sensors(v_y=Sensor(noise=0.02), r=Sensor(noise=0.002))
    drive = Plant(car).simulate(maneuver, speed=SPEED, name="log")
    return drive.recording(sensors, np.random.default_rng(1))


def _learnt(law: str, recording: Recording, car: Vehicle) -> TireModel:
    history = identify(recording, car, make_method(law, car))
    return history.freeze(float(recording.t[-1]))


def _columns(recording: Recording) -> dict[str, Array]:
    """Return the columns of a log by their standard names."""
    assert recording.axle_force is not None
    return {
        "t": recording.t,
        "vx": recording.v_x,
        "vy": recording.needed("v_y"),
        "r": recording.r,
        "delta_f": recording.delta_f,
        "Fyf": recording.axle_force[:, 0],
        "Fyr": recording.axle_force[:, 1],
    }


def _write_parquet(recording: Recording, path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.table(_columns(recording)), path)


LOG_MAP = """[signals.delta_f]
channel = "Lenkradwinkel"
ratio = 14.0

[repair.offset]
v_y = 0.01
"""


def _write_logger(recording: Recording, path: Path) -> None:
    """Write a text log with a preamble, a row of units, semicolons and decimal commas."""
    columns = {
        ("Zeit", "s"): recording.t,
        ("Geschwindigkeit", "km/h"): 3.6 * recording.v_x,
        ("Quergeschwindigkeit", "m/s"): recording.needed("v_y"),
        ("Gierrate", "deg/s"): np.degrees(recording.r),
        ("Lenkradwinkel", "deg"): 14.0 * np.degrees(recording.delta_f),
    }
    rows = [f"{value:.5f}" for value in np.column_stack(list(columns.values())).ravel()]
    cells = np.reshape([value.replace(".", ",") for value in rows], (-1, len(columns)))
    lines = ["Fahrzeug;Limousine", ";".join(name for name, _ in columns)]
    lines += [";".join(unit for _, unit in columns), *(";".join(row) for row in cells)]
    path.write_text("\n".join(lines) + "\n", encoding="cp1252")


def _write_path(path: Path) -> None:
    """Write way-points of a lane change 40 m long."""
    x = np.linspace(0.0, 40.0, 21)
    y = 1.0 - np.cos(np.pi * np.clip((x - 10.0) / 20.0, 0.0, 1.0))
    rows = [f"{a:.3f},{b:.3f}" for a, b in zip(x, y, strict=True)]
    path.write_text("\n".join(["X_m,Y_m", *rows]) + "\n", encoding="utf-8")
