"""What an identifier did over a recording: weights, errors and forces at every sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identifier.design import Design
from identifier.frozen_model import FrozenModel
from identifier.network import Weights
from models.recordings import Recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]
IMPOSSIBLE_FORCE = 100.0  # times the car's weight: no tire reaches it, so the law has diverged


class DivergedError(ArithmeticError):
    """The law diverged before the instant that was asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """An online run; n samples of the recording, U the force unit of the design.

    Parameters
    ----------
    vehicle : the car the identifier was told of.
    design : the design that ran.
    recording : what it ran over.
    axle_force : forces that were identified online (n, 2) [N].
    f_hat : output of the network (n, 2) [U].
    xi_tilde : error ξ - ξ̂ (n, 2) [U s].
    z : filtered error (n, 2) [U s²].
    W : weights in effect at each sample, and after the last (n + 1, 2, n_h) [U].
    V : weights in effect at each sample, and after the last (n + 1, n_h, n_in).
    """

    vehicle: Vehicle
    design: Design
    recording: Recording
    axle_force: Array
    f_hat: Array
    xi_tilde: Array
    z: Array
    W: Array
    V: Array

    @property
    def diverged_at(self) -> float | None:
        """Time [s] from which a force is not finite or a hundred times the weight, or None."""
        possible = np.abs(self.axle_force) < IMPOSSIBLE_FORCE * self.vehicle.weight
        sane = possible.all(axis=1) & np.isfinite(self.xi_tilde).all(axis=1)
        return None if sane.all() else float(self.recording.t[np.argmin(sane)])

    def weights_at(self, t: float) -> Weights:
        """Return the weights in effect at a time; from the end on, those after the last sample.

        Parameters
        ----------
        t : time in the recording's own clock [s].

        Raises
        ------
        ValueError
            Where the recording begins after that time.
        """
        times = self.recording.t
        if not t >= times[0]:
            raise ValueError(f"cannot freeze at {t:g} s, the recording begins at {times[0]:g} s")
        tolerance = 1e-6 * self.design.dt
        index = int(np.searchsorted(times, t + tolerance, side="right")) - 1
        index = times.size if t > times[-1] - tolerance else index
        return Weights(W=self.W[index], V=self.V[index])

    def freeze(self, t: float) -> FrozenModel:
        """Return the model with the weights in effect at a time.

        Parameters
        ----------
        t : time in the recording's own clock [s].

        Raises
        ------
        DivergedError
            Where the law had diverged by then.
        ValueError
            Where the recording begins after that time.
        """
        weights = self.weights_at(t)
        diverged_at = self.diverged_at
        if diverged_at is not None and diverged_at <= t:
            raise DivergedError(f"the law diverged at {diverged_at:g} s, before {t:g} s")
        return FrozenModel(
            vehicle=self.vehicle,
            network=self.design.network,
            weights=weights,
            force_unit=self.design.force_unit,
            min_speed=self.design.min_speed,
        )
