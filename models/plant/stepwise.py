"""The plant one control period at a time: for a driver or a controller that looks before it steers.

The same compiled loop as `Plant.simulate`, so that the same commands give the same numbers.
"""

from collections.abc import Hashable
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from models.friction import Friction
from models.plant.dynamics import N_STATES
from models.plant.simulate import Plant, PlantError, compiled_loop

Array = NDArray[np.float64]


class PlantState(NamedTuple):
    """The plant at one instant; nothing changes it, `StepwisePlant.step` returns the next.

    Forces and acceleration are those under the inputs of the period that ends here.
    """

    steps: int
    """Steps of the integration since the start."""
    x: Array
    """State (18,) in the order of `models.plant.dynamics`."""
    axle_force: Array
    """Side force of the front and the rear axle, frame of the body, (2,) [N]."""
    acceleration: Array
    """Of the center of gravity along the axes of the body, (2,) [m/s^2]."""
    alpha: Array
    """Slip angles of the wheels FL, FR, RL, RR in the paper's sign, (4,) [rad]."""
    F_z: Array
    """Loads of the wheels, (4,) [N]."""


class StepwisePlant:
    """A plant that is driven period by period.

    Parameters
    ----------
    plant : the car on its tires.
    friction : of the road; None is what the tire was measured on.
    period : for which command and wanted speed are held [s], a multiple of `dt`.
    dt : step of the integration [s].

    Raises
    ------
    ValueError
        When the period is not a multiple of the step.
    """

    def __init__(
        self,
        plant: Plant,
        *,
        friction: Friction | None = None,
        period: float = 0.01,
        dt: float = 1e-3,
    ) -> None:
        every = round(period / dt)
        if not (dt > 0.0 and every >= 1 and abs(every * dt - period) < 1e-9 * period):
            raise ValueError(f"period {period} must be a multiple of dt {dt}")
        self.plant = plant
        self.friction = friction if friction is not None else Friction()
        self.period = period
        self.dt = dt
        self._every = every
        self._places = self.friction.over_place()
        self._scan = compiled_loop(plant.vehicle, cast(Hashable, plant.tire), plant.driver, dt)

    def start(self, v_x: float, *, X: float = 0.0, Y: float = 0.0, psi: float = 0.0) -> PlantState:
        """Return the car rolling straight ahead.

        Parameters
        ----------
        v_x : speed [m/s].
        X, Y : position of the center of gravity [m].
        psi : heading [rad].

        Raises
        ------
        ValueError
            When the speed is not positive.
        """
        if not v_x > 0.0:
            raise ValueError(f"v_x must be positive at the start, it is {v_x}")
        x = np.zeros(N_STATES)
        x[[0, 5, 6, 7]] = v_x, X, Y, psi
        return self._run(0, 1, x, np.zeros(2), v_x)

    def step(self, state: PlantState, command: Array, v_ref: float) -> PlantState:
        """Return the plant one period later.

        Parameters
        ----------
        state : now.
        command : steering angles asked for, [δ_f, δ_r] [rad].
        v_ref : wanted speed [m/s].

        Raises
        ------
        ValueError
            When the inputs are not finite.
        PlantError
            When a state stops being a finite number.
        """
        if not np.isfinite([*command, v_ref]).all():
            raise ValueError(f"command and v_ref must be finite, they are {command} and {v_ref}")
        # One step more than the period has: its outputs are those of the period's end.
        return self._run(state.steps, self._every + 1, state.x, command, v_ref)

    def _run(self, start: int, n: int, x: Array, command: Array, v_ref: float) -> PlantState:
        middle = self.dt * np.arange(start, start + n, dtype=np.float64) + 0.5 * self.dt
        values = {
            "x": x,
            "command": np.tile(command, (n, 1)),
            "v_ref": np.full(n, v_ref),
            "mu": self.friction.over_time(middle),
            "places": self._places,
        }
        record = self._scan(n, values, every=max(n - 1, 1))
        now = start + n - 1
        if not np.isfinite(record["x"][-1]).all():
            raise PlantError(f"the car's state is not finite from t = {now * self.dt:.3f} s")
        outputs = (record[name][-1] for name in PlantState._fields[2:])
        return PlantState(now, record["x"][-1], *outputs)
