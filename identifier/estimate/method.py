"""The estimate as a method: tires from the whole of a log, not sample by sample."""

from collections.abc import Callable
from dataclasses import dataclass

from identifier.estimate.fit import fit
from identifier.estimate.model import FittedModel
from identifier.method import Method
from identifier.setup import Setup
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.rules import require_positive
from models.vehicle import Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class FitMethod(Method):
    """Maximum a posteriori of tires, body and sensors over a whole log (`estimate.solve`).

    Parameters
    ----------
    min_speed : below this speed [m/s] forces read zero.
    dt : sampling interval of the log [s].

    Raises
    ------
    ValueError
        Where a number is not positive.
    """

    judged_by = "tireid predict on another drive"

    min_speed: float
    dt: float = 0.01

    def __post_init__(self) -> None:
        require_positive(ValueError, dt=self.dt, min_speed=self.min_speed)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> "FitMethod":
        """Return the method for a car: its size sets the lowest speed."""
        return cls(min_speed=vehicle.lowest_speed, dt=dt)

    @property
    def whole(self) -> bool:
        """Whether it learns from a whole log at once."""
        return True

    def fitted(
        self,
        recording: Recording,
        vehicle: Vehicle,
        start: TireModel | None = None,
        *,
        progress: Callable[[float], None] | None = None,
    ) -> FittedModel:
        """Return the tires that a log taught.

        Raises
        ------
        ValueError
            Where it is told to go on from a stored model, or no sample is fast enough.
        """
        if start is not None:
            raise ValueError(
                "--method fit learns from whole logs: give it all of them, in place of a model"
            )
        return fit([recording], vehicle, progress=progress).model

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Refuse: there is no step.

        Raises
        ------
        ValueError
            Always.
        """
        del vehicle, start
        raise ValueError(
            "the method fit learns from whole logs: in a car, the axle identifier does"
        )
