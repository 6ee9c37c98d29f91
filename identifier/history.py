"""What a method did over a recording: forces, and everything that its step carries and tells."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identifier.method import Method
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]
IMPOSSIBLE_FORCE = 100.0  # times the car's weight: no tire reaches it, so the law has diverged


class DivergedError(ArithmeticError):
    """The law diverged before the instant that was asked for."""


def carried_index(recording: Recording, t: float) -> int:
    """Return which carried values are in effect at a time: those before that sample; n at the end.

    Parameters
    ----------
    recording : n samples.
    t : time in the recording's own clock [s].

    Raises
    ------
    ValueError
        Where the recording begins after that time.
    """
    times, tolerance = recording.t, 1e-6 * recording.dt
    if not t >= times[0]:
        raise ValueError(f"cannot freeze at {t:g} s, the recording begins at {times[0]:g} s")
    if t > times[-1] - tolerance:
        return int(times.size)
    return int(np.searchsorted(times, t + tolerance, side="right")) - 1


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class History:
    """An online run over n samples.

    Parameters
    ----------
    vehicle : the car the method was told of.
    design : the method that ran.
    recording : what it ran over.
    axle_force : forces that were identified online (n, 2) [N].
    carried : by port, the carried values in effect at each sample and after the last (n + 1, ...).
    told : by port, the other outputs of the step at each sample (n, ...).
    """

    vehicle: Vehicle
    design: Method
    recording: Recording
    axle_force: Array
    carried: Mapping[str, Array]
    told: Mapping[str, Array]

    @property
    def diverged_at(self) -> float | None:
        """Time [s] from which a force is not finite or a hundred times the weight, or None."""
        possible = np.abs(self.axle_force) < IMPOSSIBLE_FORCE * self.vehicle.weight
        sane = possible.all(axis=1)
        return None if sane.all() else float(self.recording.t[np.argmin(sane)])

    def carried_at(self, t: float) -> dict[str, Array]:
        """Return the carried values in effect at a time; from the end on, those after the last.

        Parameters
        ----------
        t : time in the recording's own clock [s].

        Raises
        ------
        ValueError
            Where the recording begins after that time.
        """
        index = carried_index(self.recording, t)
        return {name: values[index] for name, values in self.carried.items()}

    def freeze(self, t: float | None = None) -> TireModel:
        """Return the model with the weights in effect at a time.

        Parameters
        ----------
        t : time in the recording's own clock [s]; None is the end.

        Raises
        ------
        DivergedError
            Where the law had diverged by then.
        CannotFreezeError
            Where the method estimates a signal, not a model.
        ValueError
            Where the recording begins after that time.
        """
        t = float(self.recording.t[-1]) if t is None else t
        carried = self.carried_at(t)
        diverged_at = self.diverged_at
        if diverged_at is not None and diverged_at <= t:
            raise DivergedError(f"the law diverged at {diverged_at:g} s, before {t:g} s")
        return self.design.frozen(self.vehicle, carried)

    def __repr__(self) -> str:
        diverged = "" if self.diverged_at is None else f", diverged at {self.diverged_at:g} s"
        return f"<{type(self.design).__name__} over {self.recording!r}{diverged}>"
