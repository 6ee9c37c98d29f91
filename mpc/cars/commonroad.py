"""A car of commonroad-vehicle-models to drive: their equations under our speed and steering.

It is an independent program; the extra `commonroad` brings it.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.friction import Friction, place_change
from models.plant import Driver
from mpc.cars.bmw import CommonRoadTire, bmw, bmw_parameters, bmw_tire, scale_friction
from mpc.cars.bmw_equations import Drift, Equations, MultiBody
from mpc.cars.car import HOLDING, CarState

FASTEST_STEERING = 0.4  # what their parameters allow [rad/s]


def runge_kutta_step(f: Callable[[Array], Array], x: Array, dt: float) -> Array:
    """Return the state after a classical fourth-order step.

    Parameters
    ----------
    f : derivative of the state, inputs held.
    x : state before (n,).
    dt : step [s].
    """
    k1 = f(x)
    k2 = f(x + 0.5 * dt * k1)
    k3 = f(x + 0.5 * dt * k2)
    return x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + f(x + dt * k3))


def friction_at(friction: Friction, t: float, X: float) -> float:
    """Return the scale [-] under a car, the same for all its wheels.

    Parameters
    ----------
    t : time [s].
    X : where its center of gravity is [m].
    """
    scale = float(friction.over_time(np.array([t]))[0])
    return scale + float(place_change(friction.over_place(), X)) if friction.by_place else scale


class CommonRoadError(TireidError, ArithmeticError):
    """Their car left the range of its equations; the message says when."""


class Inner(NamedTuple):
    """Periods since the start, and their state."""

    periods: int
    x: Array


class CommonRoadCar:
    """The BMW 320i by their equations; `multi_body_car` and `drift_car` make it.

    The road wheels turn to the command within one period, as far as 0.4 rad/s reach.

    Parameters
    ----------
    parameters : theirs, at friction 1; not shared with another car.
    friction : of the road; a change over the place acts on all wheels at once.
    period : for which the inputs are held [s], a multiple of `dt`.
    dt : step of the integration [s].

    Raises
    ------
    ValueError
        When the period is not a multiple of the step, or the driver has an integral.
    """

    def __init__(
        self,
        equations: Equations,
        parameters: Any,
        *,
        friction: Friction | None = None,
        driver: Driver = HOLDING,
        period: float = 0.01,
        dt: float = 1e-3,
    ) -> None:
        self._steps = round(period / dt)
        if not (dt > 0.0 and self._steps >= 1 and abs(self._steps * dt - period) < 1e-9 * period):
            raise ValueError(f"period {period} must be a multiple of dt {dt}")
        if driver.integral_gain != 0.0:
            raise ValueError(f"integral_gain must be zero here, it is {driver.integral_gain}")
        self._equations, self._parameters, self._dt = equations, parameters, dt
        self._tire_at_scale_1 = bmw_tire()
        self._driver = driver
        self.vehicle = bmw()
        self.tire = CommonRoadTire.read()
        self.friction = friction if friction is not None else Friction()
        self.period = period
        self.speed_gain = driver.gain

    def start(self, v_x: float, *, X: float = 0.0, Y: float = 0.0, psi: float = 0.0) -> CarState:
        """Return the car rolling straight ahead."""
        if not v_x > 0.0:
            raise ValueError(f"v_x must be positive at the start, it is {v_x}")
        x = self._equations.start([X, Y, 0.0, v_x, psi, 0.0, 0.0], self._parameters)
        return self._state(Inner(0, x), 0.0, 0.0)

    def step(self, state: CarState, command: float, v_ref: float) -> CarState:
        """Return the car one period later.

        Raises
        ------
        ValueError
            When the inputs are not finite.
        CommonRoadError
            When a state stops being a finite number.
        """
        if not np.isfinite([command, v_ref]).all():
            raise ValueError(f"command and v_ref must be finite, they are {command} and {v_ref}")
        inner: Inner = state.inner
        rate = (command - state.delta) / self.period
        rate = min(max(rate, -FASTEST_STEERING), FASTEST_STEERING)
        limit = self._driver.acceleration_limit
        demand = min(max(self._driver.gain * (v_ref - state.v_x), -limit), limit)
        scale = friction_at(self.friction, state.t + 0.5 * self.period, state.X)
        scale_friction(self._parameters, self._tire_at_scale_1, scale)
        x = inner.x
        now = inner.periods + 1
        try:
            for _ in range(self._steps):
                x = runge_kutta_step(
                    lambda x: self._equations.derivative(x, rate, demand, self._parameters),
                    x,
                    self._dt,
                )
            if not np.isfinite(x).all():
                raise ArithmeticError("a state is not finite")
            return self._state(Inner(now, x), rate, demand)
        except (ArithmeticError, ValueError) as error:  # math.sin(inf) is a ValueError
            message = f"their car left its equations before t = {now * self.period:.3f} s: {error}"
            raise CommonRoadError(message) from None

    def _state(self, inner: Inner, rate: float, demand: float) -> CarState:
        x_dot = self._equations.derivative(inner.x, rate, demand, self._parameters)
        t = inner.periods * self.period
        return self._equations.car_state(t, inner.x, x_dot, inner, self._parameters)


def multi_body_car(
    *,
    friction: Friction | None = None,
    driver: Driver = HOLDING,
    period: float = 0.01,
    repaired: bool = False,
) -> CommonRoadCar:
    """Return their multi-body car, 29 states.

    Parameters
    ----------
    period : for which the inputs are held [s].
    repaired : remove the two contradictions in their program, see `mpc.cars.bmw_equations`.

    Raises
    ------
    MissingCommonRoadError
        Where the package is not installed.
    """
    equations = MultiBody(bmw(), repaired=repaired)
    parameters = bmw_parameters(repaired=repaired)
    return CommonRoadCar(equations, parameters, friction=friction, driver=driver, period=period)


def drift_car(
    *, friction: Friction | None = None, driver: Driver = HOLDING, period: float = 0.01
) -> CommonRoadCar:
    """Return their single-track drift car, 9 states.

    Parameters
    ----------
    period : for which the inputs are held [s].

    Raises
    ------
    MissingCommonRoadError
        Where the package is not installed.
    """
    equations = Drift(bmw())
    return CommonRoadCar(
        equations, bmw_parameters(), friction=friction, driver=driver, period=period
    )
