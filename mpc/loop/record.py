"""What a drive was: all signals over time, what the tracker planned, and how it ended."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.recordings import Recording
from models.vehicle import Vehicle
from mpc.path.path import Path

Array = NDArray[np.float64]


class Plan(NamedTuple):
    """What the tracker meant to do, as seen at one period.

    period: row of the drive's signals at which it was made; s (N + 1,): where along the path [m];
    x (N + 1, n_x): states; u (N,): steering rates [rad/s].
    """

    period: int
    s: Array
    x: Array
    u: Array

    def line(self, path: Path) -> tuple[Array, Array]:
        """Return X and Y [m] of the plan, (N + 1,) each.

        Parameters
        ----------
        path : of the drive.
        """
        X, Y, psi = path.pose(self.s)
        return X - self.x[:, 0] * np.sin(psi), Y + self.x[:, 0] * np.cos(psi)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A drive of n periods along a path; signals without another word are the truth, SI, ISO axes.

    Parameters
    ----------
    name : what was driven.
    vehicle : the car as its tracker was told of it.
    path : that was followed.
    period : control period [s].
    t : time [s], (n,).
    X, Y, psi : position [m] and heading [rad], (n,).
    v_x, v_y, r : velocity in the frame of the body [m/s] and yaw rate [rad/s], (n,).
    a_x, a_y : acceleration along the axes of the body [m/s^2], (n,).
    delta : actual angle of the front road wheels [rad], (n,).
    axle_force : side force of the axles, frame of the body [N], (n, 2).
    s, e_y, e_psi, kappa : arc length [m], deviation to the left [m], heading against the path
        [rad] and curvature of the path [1/m], (n,).
    v_ref : wanted speed [m/s], (n,).
    command : steering angle decided on at this period, which acts `delay` periods later [rad],
        (n,).
    measured : what the sensors said, by the names of `Measured`, (n,) each.
    status : of the tracker, by its number, (n,).
    solve_time : of the tracker [s], (n,).
    plans : some of the tracker's plans.
    notes : what the learner said and when [s].
    completed : whether the car reached the end on the path and without spinning.
    ending : why the drive ended.
    """

    name: str
    vehicle: Vehicle
    path: Path
    period: float
    t: Array
    X: Array
    Y: Array
    psi: Array
    v_x: Array
    v_y: Array
    r: Array
    a_x: Array
    a_y: Array
    delta: Array
    axle_force: Array
    s: Array
    e_y: Array
    e_psi: Array
    kappa: Array
    v_ref: Array
    command: Array
    measured: Mapping[str, Array]
    status: NDArray[np.int64]
    solve_time: Array
    plans: tuple[Plan, ...]
    notes: tuple[tuple[float, str], ...]
    completed: bool
    ending: str

    def __len__(self) -> int:
        return len(self.t)

    def recording(self) -> Recording:
        """Return what an identifier would read of it: measured signals, axle forces as truth.

        Raises
        ------
        RecordingError
            Where the drive is too short to be one.
        """
        zeros = np.zeros_like(self.t)
        signals = {name: self.measured[name] for name in ("v_x", "v_y", "r", "a_y")}
        return Recording(
            name=self.name,
            t=self.t,
            delta_f=self.measured["delta"],
            delta_r=zeros,
            axle_force=self.axle_force,
            **signals,
        )
