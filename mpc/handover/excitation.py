"""Has the car been driven so that there was something to learn, and where was it learnt?"""

import numpy as np
from numpy.typing import NDArray

from identifier.method import FrozenModel
from models.vehicle import Vehicle
from mpc.handover.certificate import LARGEST_SLIP
from mpc.tires import TireModel
from mpc.tires.ladder import LadderAxles

Array = NDArray[np.float64]

LEARNS = 0.005  # rad: below, a tire is a straight line in noise
BEYOND = 1.2  # slip that is trusted over the largest one that was learnt from


class Excitation:
    """What a drive had to teach: time of slip, and how much of it.

    Parameters
    ----------
    dt : sampling interval [s].
    vehicle : the car.
    least_time : with slip at both axles before anything may be handed over [s].
    """

    def __init__(self, dt: float, vehicle: Vehicle, least_time: float) -> None:
        self._dt, self._vehicle, self._least_time = dt, vehicle, least_time
        self._time = np.zeros(2)
        self._largest = np.zeros(2)

    def add(self, v_x: float, v_y: float, r: float, delta: float) -> None:
        """Take a sample.

        Parameters
        ----------
        v_x : longitudinal speed [m/s], positive.
        v_y : lateral velocity [m/s].
        r : yaw rate [rad/s].
        delta : angle of the front road wheels [rad].
        """
        size = np.abs(slips(np.array([[v_x, v_y, r, delta]]), self._vehicle))[0]
        self._time += self._dt * (size >= LEARNS)
        self._largest += 0.1 * np.maximum(size - self._largest, 0.0)  # not of one noisy sample

    def complaint(self, model: FrozenModel, samples: Array) -> str | None:
        """Return why a model is not known well enough where the car is driven, or None.

        Parameters
        ----------
        model : the candidate. One of axles knows where it was learnt; of any other it is taken
            to be known as far as the car slipped.
        samples : rows of v_x, v_y, r, δ_f: where it must be known, (n, 4 or more).
        """
        for axle, time in zip(("front", "rear"), self._time, strict=True):
            if not time >= self._least_time:
                return f"the {axle} axle learnt for {time:.1f} s, not {self._least_time:g} s"
        if model.known_slip is not None:
            driven = np.quantile(np.abs(slips(samples, self._vehicle)), 0.95, axis=0)
            for i, axle in enumerate(("front", "rear")):
                known = BEYOND * model.known_slip[i] + LEARNS
                if driven[i] > known:
                    return (
                        f"the {axle} axle slips {driven[i]:.3f} rad, it is known to {known:.3f} rad"
                    )
        return None

    def trusted_slip(self, tire: TireModel) -> float:
        """Return up to which slip [rad] a tire is to be judged.

        Ladders saturate whatever they have seen; any other tire only as far as the car slipped.

        Parameters
        ----------
        tire : to be judged.
        """
        if isinstance(tire.structure, LadderAxles):
            return LARGEST_SLIP
        return float(np.clip(BEYOND * self._largest.min(), 2.0 * LEARNS, LARGEST_SLIP))


def slips(samples: Array, vehicle: Vehicle) -> Array:
    """Return kinematic slip angles (n, 2) [rad], paper's sign.

    Parameters
    ----------
    samples : rows of v_x (positive), v_y [m/s], r [rad/s], δ_f [rad], (n, 4 or more).
    vehicle : the car.
    """
    v_x, v_y, r, delta = samples[:, :4].T
    front = delta - np.arctan2(v_y + vehicle.l_f * r, v_x)
    return np.column_stack([front, -np.arctan2(v_y - vehicle.l_r * r, v_x)])
