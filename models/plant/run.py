"""What a plant recorded: the motion, and the forces behind it, which no car measures."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.recordings import Recording
from models.sensors import Sensors
from models.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantRun:
    """The truth of a run: n samples, SI, ISO axes; wheels in the order FL, FR, RL, RR.

    Parameters
    ----------
    name : of the run.
    vehicle : the car that drove.
    t : time [s], (n,).
    v_x, v_y : velocity of the center of gravity in the body frame [m/s], (n,).
    r : yaw rate [rad/s], (n,).
    a_x, a_y : acceleration of the center of gravity, a_y = dv_y/dt + v_x r [m/s^2], (n,).
    command : steering asked for, [δ_f, δ_r] [rad], (n, 2).
    delta_f, delta_r : actual angles of the road wheels [rad], (n,).
    roll, roll_rate : of the body, positive when the right side dips [rad], [rad/s], (n,).
    X, Y, psi : position [m] and heading [rad], (n,).
    F_x, F_y : forces of the wheels in their own frame [N], (n, 4).
    F_z : loads of the wheels [N], (n, 4).
    alpha : slip angles of the wheels in the paper's sign, δ - atan2(v_y, v_x) [rad], (n, 4); the
        force follows them over the relaxation length.
    axle_force : sum of F_y cos δ + F_x sin δ over each axle [N], (n, 2).
    """

    name: str
    vehicle: Vehicle
    t: Array
    v_x: Array
    v_y: Array
    r: Array
    a_x: Array
    a_y: Array
    command: Array
    delta_f: Array
    delta_r: Array
    roll: Array
    roll_rate: Array
    X: Array
    Y: Array
    psi: Array
    F_x: Array
    F_y: Array
    F_z: Array
    alpha: Array
    axle_force: Array

    @classmethod
    def from_record(
        cls, name: str, vehicle: Vehicle, t: Array, command: Array, record: Mapping[str, Array]
    ) -> "PlantRun":
        """Name the columns of what the compiled loop recorded.

        Parameters
        ----------
        name : of the run.
        vehicle : the car that drove.
        t : time [s], (n,).
        command : steering asked for [rad], (n, 2).
        record : state "x" (n, 18) in the order of `models.plant.dynamics`, and its outputs.
        """
        names = ("v_x", "v_y", "r", "roll", "roll_rate", "X", "Y", "psi")
        motion = dict(zip(names, record["x"].T, strict=False))
        delta_f, delta_r = record["x"][:, 12], record["x"][:, 13]
        a_x, a_y = record["acceleration"].T
        forces = {key: record[key] for key in ("F_x", "F_y", "F_z", "alpha", "axle_force")}
        return cls(
            name=name,
            vehicle=vehicle,
            t=t,
            a_x=a_x,
            a_y=a_y,
            command=command,
            delta_f=delta_f,
            delta_r=delta_r,
            **motion,
            **forces,
        )

    def recording(
        self, sensors: Sensors | None = None, rng: np.random.Generator | None = None
    ) -> Recording:
        """Return what a log of this run would hold, with the axle forces as truth.

        Parameters
        ----------
        sensors : what the signals go through; None measures exactly.
        rng : source of the noise; needed when there are sensors.

        Raises
        ------
        ValueError
            When sensors come without a generator.
        """
        exact = Recording(
            name=self.name,
            t=self.t,
            v_x=self.v_x,
            v_y=self.v_y,
            r=self.r,
            delta_f=self.delta_f,
            delta_r=self.delta_r,
            a_y=self.a_y,
            axle_force=self.axle_force,
        )
        if sensors is None:
            return exact
        if rng is None:
            raise ValueError("sensors need a random generator: pass rng")
        return sensors.apply(exact, rng)
