"""All errors of the interface by name; each is a `TireidError` and the builtin of its meaning.

Arguments that are wrong in themselves raise plain `TypeError` or `ValueError`.
"""

from codegen.errors import TireidError as TireidError
from identifier.frozen import FrozenModelError as FrozenModelError
from identifier.method import CannotFreezeError as CannotFreezeError
from identifier.plan import PlanError as PlanError
from identifier.reproducibility import NeverDrivesError as NeverDrivesError
from identifier.run import DivergedError as DivergedError
from models.plant import PlantError as PlantError
from models.recordings import RecordingError as RecordingError
from models.vehicle import VehicleError as VehicleError
from mpc.path.line import PathError as PathError
from tireid.exporting import SelfTestError as SelfTestError
from tireid.output import OutputError as OutputError
