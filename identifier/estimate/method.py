"""The estimate as a method: tires from the whole of a log, and their frozen step."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import get_args

from codegen.arrays import Array
from identifier.axle.gate import GATE_PORT
from identifier.estimate.fit import Days, fit
from identifier.estimate.model import FittedModel
from identifier.estimate.poor import on_time
from identifier.estimate.priors import Priors
from identifier.method import CannotFreezeError, Method, WholeLog
from identifier.motion.model import REPLAYED
from identifier.setup import AXLE_FORCE, Port, Setup
from identifier.tire_model import TireModel
from identifier.verdict.verdict import LARGEST_MODEL_ERROR
from models.recordings import Recording
from models.rules import require_positive
from models.vehicle import Vehicle

_log = logging.getLogger("tireid.estimate")

PORTS = (
    AXLE_FORCE,
    Port("lagged_slip", "rad", "slip angles that make the forces, paper's sign"),
    Port("slip_size", "rad", "larger of the slip angle and its lag, without sign"),
    GATE_PORT,
    Port("motion", "SI", f"of the forward model: {', '.join(REPLAYED)}"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FitMethod(Method):
    """Maximum a posteriori of tires, body and sensors over a whole log.

    By `estimate.solve`, without a v_y by `estimate.latent`.
    min_speed : below this speed [m/s] forces read zero.   dt : sampling interval of the log [s].
    days : of zeros of the sensors, as of `fit.fit`.
    """

    judged_by = "tireid predict on another drive"

    min_speed: float
    dt: float = 0.01
    days: Days = "found"

    def __post_init__(self) -> None:
        require_positive(ValueError, dt=self.dt, min_speed=self.min_speed)
        if self.days not in get_args(Days):
            raise ValueError(f"days must be one of {get_args(Days)}, it is {self.days!r}")

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> "FitMethod":
        """Return the method for a car: its size sets the lowest speed."""
        return cls(min_speed=vehicle.lowest_speed, dt=dt)

    ports = PORTS

    @property
    def whole(self) -> WholeLog:
        return WholeLog(on_time, self._fitted)

    def _fitted(
        self,
        recording: Recording,
        vehicle: Vehicle,
        start: TireModel | None,
        progress: Callable[[float], None] | None,
    ) -> FittedModel:
        """Return the tires of a log.

        start : a fit of other logs, which add up with this one; None believes the table alone.
        """
        if start is not None and not isinstance(start, FittedModel):
            raise ValueError(
                "--method fit begins with a fit: give it all logs, in place of a model of another "
                "method"
            )
        priors = Priors.of(vehicle)
        if start is not None:
            priors = priors.with_play() if start["steering_play"] > 0.0 else priors
            start = _beginning(start, recording, vehicle)
        return fit(
            [recording], vehicle, priors, start=start, days=self.days, progress=progress
        ).model

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> TireModel:
        del vehicle, state
        raise CannotFreezeError(
            "the tires of a fit stay as they are: without --method fit the axle identifier goes on "
            "learning from them"
        )

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what the step of learnt tires needs, which stay as they are."""
        if not isinstance(start, FittedModel):
            raise ValueError(
                "the method fit learns from whole logs: sample by sample it outputs the forces "
                "of the weights.json of a fit; the method axle learns"
            )
        return (start if start.vehicle == vehicle else start.mounted_on(vehicle)).setup(self.dt)


def _beginning(start: FittedModel, recording: Recording, vehicle: Vehicle) -> FittedModel | None:
    """Return the tires that a log adds to; None of such that a verdict refuses."""
    missed = start.model_error
    if start.drives.at_bounds or (missed is not None and missed.max() > LARGEST_MODEL_ERROR):
        _log.warning("%s: the tires to begin with are not valid: they teach nothing",
                     recording.name)  # fmt: skip
        return None
    return start.mounted_on(vehicle)
