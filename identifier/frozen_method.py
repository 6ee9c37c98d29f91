"""A network of one's own among the methods: it learns nothing, online and frozen are the same."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identifier.method import FrozenModel, Setup
from identifier.onnx_model import OnnxModel
from models.recordings import Recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrozenMethod:
    """A frozen model that takes part in a comparison of methods.

    Parameters
    ----------
    model : the model, with its car.
    dt : sampling interval of recordings [s]; the model has none of its own.

    Raises
    ------
    ValueError
        Where the interval is not positive.
    """

    model: OnnxModel
    dt: float = 0.01

    def __post_init__(self) -> None:
        if not 0.0 < self.dt < np.inf:
            raise ValueError(f"dt must be positive, it is {self.dt}")

    @property
    def min_speed(self) -> float:
        """Below this speed [m/s] forces read zero."""
        return self.model.min_speed

    def setup(
        self, vehicle: Vehicle, recording: Recording, start: FrozenModel | None = None
    ) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car; the model keeps its own.
        recording : what it will run over; not looked at.
        start : None; there is nothing that a stored model could begin.

        Raises
        ------
        ValueError
            Where a stored model is given.
        """
        del vehicle
        if start is not None:
            raise ValueError("a frozen model learns nothing, it cannot begin with a stored one")
        return self.model.setup(recording)

    def frozen(self, vehicle: Vehicle, carried: Mapping[str, Array]) -> OnnxModel:
        """Return the model itself.

        Parameters
        ----------
        vehicle : the car; the model keeps its own.
        carried : nothing is carried.
        """
        del vehicle, carried
        return self.model
