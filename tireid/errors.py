"""All errors of the interface by name; each is a `TireidError` and the builtin of its meaning.

Arguments that are wrong in themselves raise plain `TypeError` or `ValueError`.
"""

from codegen.errors import TireidError
from identifier.frozen import FrozenModelError
from identifier.method import CannotFreezeError
from identifier.own_network import UnusableNetworkError
from identifier.plan import PlanError
from identifier.reproducibility import NeverDrivesError
from identifier.run import DivergedError
from identifier.verdict import BoundViolatedError
from models.plant import PlantError
from models.recordings import RecordingError
from models.vehicle import VehicleError
from mpc.path.line import PathError
from tireid.exporting import SelfTestError
from tireid.output import OutputError

__all__ = [
    "BoundViolatedError",
    "CannotFreezeError",
    "DivergedError",
    "FrozenModelError",
    "NeverDrivesError",
    "OutputError",
    "PathError",
    "PlanError",
    "PlantError",
    "RecordingError",
    "SelfTestError",
    "TireidError",
    "UnusableNetworkError",
    "VehicleError",
]
