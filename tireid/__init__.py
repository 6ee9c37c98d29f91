"""Learns a car's lateral tire forces while it drives, and freezes them: `import tireid as ti`.

    car = ti.Vehicle.from_toml("car.toml")      # or ti.sedan()
    log = ti.read_recording("log.csv")          # or a data frame, or a mapping of arrays
    run = ti.identify(log, car)                 # run.verdict says whether the answer is good
    print(run.tire.summary(), run.tire.force(0.05, "front"))

What is not used is not imported: each name is fetched where it is asked for.
"""

import importlib
from typing import TYPE_CHECKING, Any

from tireid.home import find_own_packages

if TYPE_CHECKING:
    from codegen.errors import TireidError
    from identifier.axle import AxleIdentifier
    from identifier.doctor import Diagnosis, diagnose
    from identifier.method import Method
    from identifier.methods import certify, make_method, methods
    from identifier.paper.design import PaperIdentifier
    from identifier.prediction import Prediction
    from identifier.tire_model import TireModel
    from identifier.verdict import Verdict
    from models.recordings import LogMap, Recording, Repair, Wheels, read_recording, read_repaired
    from models.vehicle import Vehicle, sedan
    from mpc import path as paths
    from tireid import errors
    from tireid.driving.learn import sample_recording
    from tireid.driving.runs import drive
    from tireid.emitting import emit
    from tireid.exporting import export
    from tireid.figures.forces import inputs_figure as plot
    from tireid.learning import identify, replay
    from tireid.planning import plan
    from tireid.run import Run

    __version__: str

find_own_packages()

_HOMES = {
    "AxleIdentifier": ("identifier.axle", "AxleIdentifier"),
    "Diagnosis": ("identifier.doctor", "Diagnosis"),
    "LogMap": ("models.recordings", "LogMap"),
    "Method": ("identifier.method", "Method"),
    "PaperIdentifier": ("identifier.paper.design", "PaperIdentifier"),
    "Prediction": ("identifier.prediction", "Prediction"),
    "Recording": ("models.recordings", "Recording"),
    "Run": ("tireid.run", "Run"),
    "Repair": ("models.recordings", "Repair"),
    "TireModel": ("identifier.tire_model", "TireModel"),
    "TireidError": ("codegen.errors", "TireidError"),
    "Vehicle": ("models.vehicle", "Vehicle"),
    "Verdict": ("identifier.verdict", "Verdict"),
    "Wheels": ("models.recordings", "Wheels"),
    "certify": ("identifier.methods", "certify"),
    "diagnose": ("identifier.doctor", "diagnose"),
    "errors": ("tireid.errors", ""),
    "drive": ("tireid.driving.runs", "drive"),
    "emit": ("tireid.emitting", "emit"),
    "export": ("tireid.exporting", "export"),
    "identify": ("tireid.learning", "identify"),
    "make_method": ("identifier.methods", "make_method"),
    "methods": ("identifier.methods", "methods"),
    "paths": ("mpc.path", ""),
    "plan": ("tireid.planning", "plan"),
    "plot": ("tireid.figures.forces", "inputs_figure"),
    "read_recording": ("models.recordings", "read_recording"),
    "read_repaired": ("models.recordings", "read_repaired"),
    "replay": ("tireid.learning", "replay"),
    "sample_recording": ("tireid.driving.learn", "sample_recording"),
    "sedan": ("models.vehicle", "sedan"),
}
__all__ = [
    "AxleIdentifier",
    "Diagnosis",
    "LogMap",
    "Method",
    "PaperIdentifier",
    "Prediction",
    "Recording",
    "Repair",
    "Run",
    "TireModel",
    "TireidError",
    "Vehicle",
    "Verdict",
    "Wheels",
    "__version__",
    "certify",
    "diagnose",
    "drive",
    "emit",
    "errors",
    "export",
    "identify",
    "make_method",
    "methods",
    "paths",
    "plan",
    "plot",
    "read_recording",
    "read_repaired",
    "replay",
    "sample_recording",
    "sedan",
]


def __getattr__(name: str) -> Any:
    """Return a name of the interface, fetched at its first use."""
    if name == "__version__":
        value: Any = _version()
    elif name in _HOMES:
        module, attribute = _HOMES[name]
        home = importlib.import_module(module)
        value = getattr(home, attribute) if attribute else home
    else:
        raise AttributeError(f"module 'tireid' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("tireid")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"
