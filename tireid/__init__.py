"""Learns a car's lateral tire forces while it drives, and freezes them: `import tireid as ti`.

    car = ti.Vehicle.from_toml("car.toml")      # or ti.sedan()
    log = ti.read_recording("log.csv")          # or a data frame, or a mapping of arrays
    run = ti.identify(log, car)                 # run.verdict says whether the answer is good
    print(run.tire.summary(), run.tire.force(0.05, "front"))

What is not used is not imported: each name is fetched where it is asked for.
"""

from typing import TYPE_CHECKING

from tireid.home import find_packages

if TYPE_CHECKING:
    from codegen.errors import TireidError as TireidError
    from identifier.axle import AxleIdentifier as AxleIdentifier
    from identifier.doctor import Diagnosis as Diagnosis
    from identifier.doctor import diagnose as diagnose
    from identifier.method import Method as Method
    from identifier.methods import certify as certify
    from identifier.methods import make_method as make_method
    from identifier.methods import methods as methods
    from identifier.paper.design import PaperIdentifier as PaperIdentifier
    from identifier.plan import plan as plan
    from identifier.prediction import Prediction as Prediction
    from identifier.speed_limits import SpeedLimits as SpeedLimits
    from identifier.speed_limits import speed_limits as speed_limits
    from identifier.tire_model import TireModel as TireModel
    from identifier.verdict import Verdict as Verdict
    from models.recordings import LogMap as LogMap
    from models.recordings import Recording as Recording
    from models.recordings import Repair as Repair
    from models.recordings import Wheels as Wheels
    from models.recordings import read_recording as read_recording
    from models.recordings import read_repaired as read_repaired
    from models.vehicle import Vehicle as Vehicle
    from models.vehicle import sedan as sedan
    from mpc import path as _path
    from mpc.path.speed import SpeedProfile as SpeedProfile
    from mpc.path.speed import speed_profile as speed_profile
    from tireid import errors as errors
    from tireid.driving.learn import sample_recording as sample_recording
    from tireid.driving.runs import drive as drive
    from tireid.driving.tracker import Tracker as Tracker
    from tireid.driving.tracker import VehicleState as VehicleState
    from tireid.emitting import emit as emit
    from tireid.exporting import export as export
    from tireid.figures.plot import plot as _plot
    from tireid.learning import identify as identify
    from tireid.learning import replay as replay
    from tireid.live.live import Live as Live
    from tireid.live.state import State as State
    from tireid.run import Run as Run

    paths, plot = _path, _plot
    __version__: str

find_packages()

from codegen.face import face  # noqa: E402 - the package that was just found

_NAMES = {  # by the module that they lie in
    "codegen.errors": "TireidError",
    "identifier.axle": "AxleIdentifier",
    "identifier.doctor": "Diagnosis diagnose",
    "identifier.method": "Method",
    "identifier.methods": "certify make_method methods",
    "identifier.paper.design": "PaperIdentifier",
    "identifier.plan": "plan",
    "identifier.prediction": "Prediction",
    "identifier.speed_limits": "SpeedLimits speed_limits",
    "identifier.tire_model": "TireModel",
    "identifier.verdict": "Verdict",
    "models.recordings": "LogMap Recording Repair Wheels read_recording read_repaired",
    "models.vehicle": "Vehicle sedan",
    "mpc.path.speed": "SpeedProfile speed_profile",
    "tireid.driving.learn": "sample_recording",
    "tireid.driving.runs": "drive",
    "tireid.driving.tracker": "Tracker VehicleState",
    "tireid.live.live": "Live",
    "tireid.live.state": "State",
    "tireid.emitting": "emit",
    "tireid.exporting": "export",
    "tireid.learning": "identify replay",
    "tireid.run": "Run",
}
_HOMES = {name: f"{module}:{name}" for module, names in _NAMES.items() for name in names.split()}
_HOMES |= {"errors": "tireid.errors", "paths": "mpc.path"}
_HOMES |= {"plot": "tireid.figures.plot:plot", "__version__": "tireid.version:VERSION"}
__getattr__, __dir__ = face(__name__, _HOMES)
