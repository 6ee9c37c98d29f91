"""What every way to identify has in common: a compiled step, where it starts, what it freezes to.

The laws of the paper, the better laws and the baselines run, are recorded, frozen and compared by
the same code; they differ in the `Method` that is handed over.
"""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]

SLIP = 0.02  # rad, below the peak of every tire
SLIDE = 300  # samples of 10 ms: after them a lag of the force is over


class CannotFreezeError(ValueError):
    """The method estimates a signal: there is no model of the tire to freeze."""


FrozenModel = TireModel


def steady_stiffness(model: FrozenModel, v_x: float) -> Array:
    """Return the slope of both axle forces over slip between two steady slides, (2,) [N/rad].

    Parameters
    ----------
    model : frozen.
    v_x : speed of the slides [m/s], without yawing or steering.
    """
    t, zeros = np.arange(SLIDE) / 100.0, np.zeros(SLIDE)
    right, left = (
        model.axle_force(
            Recording(
                name="a steady slide",
                t=t,
                v_x=np.full(SLIDE, v_x),
                v_y=np.full(SLIDE, -v_x * np.tan(alpha)),
                r=zeros,
                delta_f=zeros,
                delta_r=zeros,
            )
        )[-1]
        for alpha in (-SLIP, SLIP)
    )
    return np.asarray((left - right) / (2.0 * SLIP))


class Setup(NamedTuple):
    """A run, ready to go: the compiled step, the values it carries at the start, its constants.

    The step reads x = [v_y, r] (2,), u = [δ_f, δ_r] (2,) and v_x sample by sample, SI, and has an
    output axle_force (2,) [N].
    """

    scan: Scan
    carry: Mapping[str, Array]
    constants: Mapping[str, Array]

    def run(self, recording: Recording) -> dict[str, Array]:
        """Return what the compiled step records over a recording, by port.

        Parameters
        ----------
        recording : its signals are the input; its forces are not looked at.
        """
        signals = {"x": recording.x, "u": recording.u, "v_x": recording.v_x}
        sampled = {name: signals[name] for name in self.scan.over}
        return self.scan(len(recording), {**self.carry, **sampled, **self.constants})


class Method(Protocol):
    """A way to identify axle forces: everything that is chosen before the car drives."""

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""

    @property
    def min_speed(self) -> float:
        """Below this speed [m/s] learning rests and forces read zero."""

    def setup(
        self, vehicle: Vehicle, recording: Recording, start: FrozenModel | None = None
    ) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car.
        recording : what it drove; the run begins at its first sample.
        start : model whose weights the run begins with; None begins with those of the method.
        """

    def frozen(self, vehicle: Vehicle, carried: Mapping[str, Array]) -> FrozenModel:
        """Return the model that carried values make.

        Parameters
        ----------
        vehicle : the car.
        carried : values of the carried ports at one instant.

        Raises
        ------
        CannotFreezeError
            For a method that estimates a signal.
        """
