"""A car of commonroad-vehicle-models to drive: their equations under our speed and steering."""

import copy
import importlib
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from codegen.arrays import Array
from models.friction import Friction, place_change
from models.plant import Driver
from models.tires import TireForces
from models.vehicle import GRAVITY, Chassis, Vehicle
from mpc.cars.car import HOLDING, CarState

# The package commonroad-vehicle-models, which not everybody has installed.


class MissingCommonRoadError(ImportError):
    """The package is not installed; `pip install tireid[commonroad]` brings it."""


def require_commonroad() -> None:
    """Refuse to go on without the package.

    Raises
    ------
    MissingCommonRoadError
        Where it is not installed.
    """
    try:
        importlib.import_module("vehiclemodels.parameters_vehicle2")
    except ImportError:
        raise MissingCommonRoadError(
            "the CommonRoad cars need the package commonroad-vehicle-models: "
            "pip install tireid[commonroad]"
        ) from None


def bmw_320i() -> Any:
    """Return a copy of the parameters of their BMW 320i.

    Raises
    ------
    MissingCommonRoadError
        Where the package is not installed.
    """
    require_commonroad()
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

    return copy.deepcopy(parameters_vehicle2())


def bmw_tire() -> dict[str, float]:
    """Return the coefficients of its tires by name, in their order and sign."""
    return {key: float(value) for key, value in asdict(bmw_320i().tire).items()}


def bmw_parameters(scale: float = 1.0, *, repaired: bool = False) -> Any:
    """Return their parameter set with friction scaled in both directions.

    Parameters
    ----------
    scale : friction over the tire's own [-].
    repaired : their axle loads put the center of gravity 16 mm behind the point about which their
        yaw moments are taken, because both axles have the same unsprung mass. True moves 6.6 kg
        of it from the rear to the front axle, so that the two points are one.
    """
    parameters = bmw_320i()
    if repaired:
        unsprung = parameters.m_uf + parameters.m_ur
        parameters.m_uf = unsprung * parameters.b / (parameters.a + parameters.b)
        parameters.m_ur = unsprung - parameters.m_uf
    scale_friction(parameters, bmw_tire(), scale)
    return parameters


def scale_friction(parameters: Any, tire: dict[str, float], scale: float) -> None:
    """Set the friction of a parameter set.

    Parameters
    ----------
    parameters : theirs, changed in place.
    tire : the coefficients at scale 1.
    scale : friction over the tire's own [-].
    """
    parameters.tire.p_dy1 = scale * tire["p_dy1"]
    parameters.tire.p_dx1 = scale * tire["p_dx1"]


# The tire of commonroad-vehicle-models: a Magic Formula with every force proportional to load.
#
# Carried over on purpose: the sign of camber (their z axis points down), a camber shift that jumps
# with sign(γ), a vertical shift inside the sine, and no load sensitivity or relaxation.

SMOOTH_CAMBER = 1e-3  # |γ| below which our sign(γ) is a slope, so that it does not chatter [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonRoadTire:
    """Their tire behind our call.

    Parameters
    ----------
    p : coefficients by name, in their order and sign.
    """

    p: tuple[tuple[str, float], ...]

    @classmethod
    def read(cls) -> "CommonRoadTire":
        """Take the coefficients from the package."""
        return cls(p=tuple(bmw_tire().items()))

    def forces(self, alpha: Any, kappa: Any, gamma: Any, F_z: Any, mu: Any = 1.0) -> TireForces:
        """Give F_x, F_y [N].

        Parameters
        ----------
        alpha : slip angle in the paper's sign [rad]; theirs is the opposite.
        kappa : longitudinal slip, positive driving [-]; theirs is the opposite.
        gamma : camber, top to the right [rad]; theirs is the opposite.
        F_z : load [N].
        mu : friction over the tire's own [-].
        """
        p, a, s, g = dict(self.p), -alpha, -kappa, -gamma
        sign = g / ca.sqrt(g**2 + SMOOTH_CAMBER**2)
        mu_x, mu_y = mu * p["p_dx1"] * (1 - p["p_dx3"] * g**2), mu * p["p_dy1"]
        mu_y *= 1 - p["p_dy3"] * g**2
        slip = a + sign * (p["p_hy1"] + p["p_hy3"] * ca.fabs(g))
        F_y = F_z * (
            _sine(slip, p["p_ky1"], mu_y, p["p_cy1"], p["p_ey1"])
            + sign * (p["p_vy1"] + p["p_vy3"] * ca.fabs(g))
        )
        inside = p["p_vx1"] * F_z  # their vertical shift stands inside the sine
        F_x = F_z * _sine(kappa + p["p_hx1"], p["p_kx1"], mu_x, p["p_cx1"], p["p_ex1"], inside)
        B_x = p["r_bx1"] * ca.cos(ca.atan(p["r_bx2"] * s))
        F_x *= _weight(a, p["r_hx1"], B_x, p["r_cx1"], p["r_ex1"])
        B_y = p["r_by1"] * ca.cos(ca.atan(p["r_by2"] * (a - p["r_by3"])))
        F_y *= _weight(s, p["r_hy1"], B_y, p["r_cy1"], p["r_ey1"])
        D_v = mu_y * F_z * (p["r_vy1"] + p["r_vy3"] * g) * ca.cos(ca.atan(p["r_vy4"] * a))
        return TireForces(F_x, F_y + D_v * ca.sin(p["r_vy5"] * ca.atan(p["r_vy6"] * s)))

    def slip_stiffness(self, F_z: Any) -> Any:
        """Give dF_x/dκ at zero [N].

        Parameters
        ----------
        F_z : load [N].
        """
        return dict(self.p)["p_kx1"] * F_z

    def cornering_stiffness(self, F_z: Any) -> Any:
        """Give dF_y/dα at zero [N/rad].

        Parameters
        ----------
        F_z : load [N].
        """
        return -dict(self.p)["p_ky1"] * F_z


def _sine(slip: Any, K: Any, D: Any, C: Any, E: Any, inside: Any = 0.0) -> Any:
    b = K / (C * D) * slip
    return D * ca.sin(C * ca.atan(b - E * (b - ca.atan(b))) + inside)


def _weight(slip: Any, shift: Any, B: Any, C: Any, E: Any) -> Any:
    def cosine(s: Any) -> Any:
        return ca.cos(C * ca.atan(B * s - E * (B * s - ca.atan(B * s))))

    return cosine(slip + shift) / cosine(shift)


# What driving their two cars has in common: an integration, friction, and forces from motion.


def runge_kutta_step(f: Callable[[Array], Array], x: Array, dt: float) -> Array:
    """Return the state after a classical fourth-order step.

    Parameters
    ----------
    f : derivative of the state, inputs held.
    x : state before.
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
    friction : of the road.
    t : time [s].
    X : where its center of gravity is [m].
    """
    scale = float(friction.over_time(np.array([t]))[0])
    return scale + float(place_change(friction.over_place(), X)) if friction.by_place else scale


def axle_force(vehicle: Vehicle, a_y: float, r_dot: float) -> Array:
    """Return the side forces (2,) [N] that move the car like this: m a_y = ΣF, I_z dr/dt = Σ l F.

    Moments of driving forces are taken for moments of side forces.

    Parameters
    ----------
    vehicle : the car.
    a_y : acceleration of the center of gravity to the left [m/s^2].
    r_dot : yaw acceleration [rad/s^2].
    """
    force, moment = vehicle.mass * a_y, vehicle.yaw_inertia * r_dot
    front = (vehicle.l_r * force + moment) / vehicle.wheelbase
    return np.array([front, force - front])


# Indices of their state: steering, v_x, heading, yaw rate, roll and its rate; lateral velocity of
# the sprung mass, of the front and of the rear axle.
STEERING, V_X, HEADING, YAW_RATE, ROLL, V_Y, V_Y_FRONT, V_Y_REAR = 2, 3, 4, 5, 6, 10, 15, 20


# The multi-body car of commonroad-vehicle-models: 29 states, as published or repaired.
#
# Repaired on request: their two centers of gravity (`bmw_parameters`), and their side slip, which
# adds the velocity of the sprung mass to the roll rate of the axle and so misses the sway of the
# axle under the rolling body.


@contextmanager
def slip_at_the_axles(parameters: Any) -> Iterator[Callable[[Array], None]]:
    """Let their tires slip by the velocity of the axle instead of that of the sprung mass.

    Their tire functions are called for the front pair and then for the rear pair; each is wrapped
    so that it adds what the slip angle lacks. Gives the function to call before each evaluation.

    Parameters
    ----------
    parameters : theirs, with the axle distances a and b.
    """
    from vehiclemodels.utils import tire_model

    lacking = [0.0, 0.0]
    names = {"formula_lateral": 0, "formula_longitudinal_comb": 1, "formula_lateral_comb": 1}
    originals = {name: getattr(tire_model, name) for name in names}
    calls = dict.fromkeys(names, 0)

    def wrapped(name: str) -> Callable[..., Any]:
        def shifted(*arguments: Any) -> Any:
            axle = calls[name] % 4 // 2
            calls[name] += 1
            values = list(arguments)
            values[names[name]] += lacking[axle]
            return originals[name](*values)

        return shifted

    def prepare(x: Array) -> None:
        p = parameters
        lacking[0] = (x[V_Y_FRONT] - x[V_Y] - p.a * x[YAW_RATE]) / x[V_X]
        lacking[1] = (x[V_Y_REAR] - x[V_Y] + p.b * x[YAW_RATE]) / x[V_X]

    try:
        for name in names:
            setattr(tire_model, name, wrapped(name))
        yield prepare
    finally:
        for name, original in originals.items():
            setattr(tire_model, name, original)


@contextmanager
def as_published(parameters: Any) -> Iterator[Callable[[Array], None]]:  # noqa: ARG001
    """Leave their program as it is.

    Parameters
    ----------
    parameters : theirs, not needed.
    """
    yield lambda x: None  # noqa: ARG005


class MultiBody:
    """Their equations, and what their state says.

    Parameters
    ----------
    vehicle : the same car for us.
    repaired : let the tires slip at the axles.

    Raises
    ------
    MissingCommonRoadError
        Where the package is not installed.
    """

    def __init__(self, vehicle: Vehicle, *, repaired: bool = False) -> None:
        require_commonroad()
        from vehiclemodels.init_mb import init_mb
        from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

        self.vehicle = vehicle
        self._slip = slip_at_the_axles if repaired else as_published
        self._start, self._dynamics = init_mb, vehicle_dynamics_mb

    def start(self, core: list[float], parameters: Any) -> Array:
        """Return their state.

        Parameters
        ----------
        core : X, Y, steering, speed, heading, yaw rate, side slip.
        parameters : theirs.
        """
        return np.array(self._start(core, parameters), dtype=np.float64)

    def derivative(self, x: Array, rate: float, demand: float, parameters: Any) -> Array:
        """Return the derivative of their state.

        Parameters
        ----------
        x : their state.
        rate : of the steering [rad/s].
        demand : acceleration asked for [m/s^2].
        parameters : theirs.
        """
        with self._slip(parameters) as prepare:
            prepare(x)
            # The list is a copy: their function changes the state it is given.
            return np.array(self._dynamics(list(x), [rate, demand], parameters))

    def lateral(self, values: Array, parameters: Any) -> float:
        """Return what all masses together have of a lateral velocity or its derivative.

        Parameters
        ----------
        values : their state, or its derivative.
        parameters : theirs.
        """
        p = parameters
        parts = p.m_s * values[V_Y] + p.m_uf * values[V_Y_FRONT] + p.m_ur * values[V_Y_REAR]
        return float(parts / p.m)

    def seen(self, t: float, x: Array, x_dot: Array, inner: Any, parameters: Any) -> CarState:
        """Return the state in our words.

        Parameters
        ----------
        t : time [s].
        x, x_dot : their state and its derivative.
        inner : what the car reads when it goes on.
        parameters : theirs.
        """
        v_x, r = float(x[V_X]), float(x[YAW_RATE])
        v_y = self.lateral(x, parameters)
        a_y = self.lateral(x_dot, parameters) + v_x * r
        return CarState(
            t=t,
            X=float(x[0]),
            Y=float(x[1]),
            psi=float(x[HEADING]),
            v_x=v_x,
            v_y=v_y,
            r=r,
            delta=float(x[STEERING]),
            a_x=float(x_dot[V_X]) - v_y * r,
            a_y=a_y,
            axle_force=axle_force(self.vehicle, a_y, float(x_dot[YAW_RATE])),
            inner=inner,
        )


# The single-track drift car of commonroad-vehicle-models (STD): combined slip, wheels that spin.
#
# Its states: X, Y, steering, speed, heading, yaw rate, side slip β of the center of gravity, speeds
# of the front and the rear wheel.


class Drift:
    """Their equations, and what their state says.

    Parameters
    ----------
    vehicle : the same car for us.

    Raises
    ------
    MissingCommonRoadError
        Where the package is not installed.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        require_commonroad()
        from vehiclemodels.init_std import init_std
        from vehiclemodels.vehicle_dynamics_std import vehicle_dynamics_std

        self.vehicle = vehicle
        self._start, self._dynamics = init_std, vehicle_dynamics_std

    def start(self, core: list[float], parameters: Any) -> Array:
        """Return their state.

        Parameters
        ----------
        core : X, Y, steering, speed, heading, yaw rate, side slip.
        parameters : theirs.
        """
        return np.array(self._start(core, parameters), dtype=np.float64)

    def derivative(self, x: Array, rate: float, demand: float, parameters: Any) -> Array:
        """Return the derivative of their state.

        Parameters
        ----------
        x : their state.
        rate : of the steering [rad/s].
        demand : acceleration asked for [m/s^2].
        parameters : theirs.
        """
        # The list is a copy: their function changes the state it is given.
        return np.array(self._dynamics(list(x), [rate, demand], parameters))

    def seen(self, t: float, x: Array, x_dot: Array, inner: Any, parameters: Any) -> CarState:
        """Return the state in our words.

        Parameters
        ----------
        t : time [s].
        x, x_dot : their state and its derivative.
        inner : what the car reads when it goes on.
        parameters : theirs, not needed.
        """
        del parameters
        X, Y, delta, v, psi, r, beta = (float(value) for value in x[:7])
        v_dot, r_dot, beta_dot = (float(x_dot[k]) for k in (3, 5, 6))
        c, s = math.cos(beta), math.sin(beta)
        v_x, v_y = v * c, v * s
        a_y = v_dot * s + v_x * beta_dot + r * v_x
        return CarState(
            t=t,
            X=X,
            Y=Y,
            psi=psi,
            v_x=v_x,
            v_y=v_y,
            r=r,
            delta=delta,
            a_x=v_dot * c - v_y * beta_dot - r * v_y,
            a_y=a_y,
            axle_force=axle_force(self.vehicle, a_y, r_dot),
            inner=inner,
        )


# The BMW 320i of commonroad-vehicle-models as a vehicle of ours, with its chassis.

INSTANT = 0.002  # what stands for "no lag": two steps of the integration [s]


def bmw() -> Vehicle:
    """Return the car, by formulas from their parameters."""
    p = bmw_320i()
    tire = CommonRoadTire.read()
    load = p.m * GRAVITY / (p.a + p.b)
    # Their body rolls on suspension and tire in series; the axle takes its share of the angle.
    springs = (0.5 * p.K_sf * p.T_f**2 - p.K_tsf, 0.5 * p.K_sr * p.T_r**2 - p.K_tsr)
    tires = (0.5 * p.K_zt * p.T_f**2, 0.5 * p.K_zt * p.T_r**2)
    of_springs = [k_t / (k + k_t) for k, k_t in zip(springs, tires, strict=True)]
    front, rear = (k * share for k, share in zip(springs, of_springs, strict=True))
    damping = 0.5 * (p.K_sdf * p.T_f**2 + p.K_sdr * p.T_r**2)
    roll_center = p.h_cg - p.m_s * p.h_s / p.m  # their sprung mass rolls about the ground
    chassis = Chassis(
        track_front=p.T_f,
        track_rear=p.T_r,
        cg_height=p.h_cg,
        roll_center_height_front=roll_center,
        roll_center_height_rear=roll_center,
        roll_stiffness=front + rear,
        roll_stiffness_front_share=front / (front + rear),
        roll_damping=damping,
        roll_inertia=p.I_Phi_s,
        roll_camber_front=1.0 + 0.5 * p.D_f * p.T_f * of_springs[0],
        roll_camber_rear=1.0 + 0.5 * p.D_r * p.T_r * of_springs[1],
        relaxation_length_front=0.05,
        relaxation_length_rear=0.05,
        steering_lag=INSTANT,
        drive_front_share=p.T_se,
    )
    return Vehicle(
        name="BMW 320i",
        mass=p.m,
        yaw_inertia=p.I_z,
        l_f=p.a,
        l_r=p.b,
        cornering_stiffness_front=float(tire.cornering_stiffness(load * p.b)),
        cornering_stiffness_rear=float(tire.cornering_stiffness(load * p.a)),
        chassis=chassis,
    )


STEERING_ANGLE = 2  # of both state vectors
FASTEST_STEERING = 0.4  # what their parameters allow [rad/s]


class CommonRoadError(ArithmeticError):
    """Their car left the range of its equations; the message says when."""


class Equations(Protocol):
    """Their equations of motion."""

    def start(self, core: list[float], parameters: Any) -> Array:
        """Return their state.

        Parameters
        ----------
        core : X, Y, steering, speed, heading, yaw rate, side slip.
        parameters : theirs.
        """

    def derivative(self, x: Array, rate: float, demand: float, parameters: Any) -> Array:
        """Return the derivative of their state.

        Parameters
        ----------
        x : their state.
        rate : of the steering [rad/s].
        demand : acceleration asked for [m/s^2].
        parameters : theirs.
        """

    def seen(self, t: float, x: Array, x_dot: Array, inner: Any, parameters: Any) -> CarState:
        """Return the state in our words.

        Parameters
        ----------
        t : time [s].
        x, x_dot : their state and its derivative.
        inner : what the car reads when it goes on.
        parameters : theirs.
        """


class Inner(NamedTuple):
    """Periods since the start, and their state."""

    periods: int
    x: Array


class CommonRoadCar:
    """The BMW 320i by their equations; `multi_body_car` and `drift_car` make it.

    The road wheels turn to the command within one period, as far as 0.4 rad/s reach.

    Parameters
    ----------
    equations : theirs.
    parameters : theirs, at friction 1; not shared with another car.
    friction : of the road; a change over the place acts on all wheels at once.
    driver : who holds the speed, by proportional gain alone.
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
        x = self._equations.start([X, Y, 0.0, v_x, psi, 0.0, 0.0], self._parameters)
        return self._seen(Inner(0, x), 0.0, 0.0)

    def step(self, state: CarState, command: float, v_ref: float) -> CarState:
        """Return the car one period later.

        Parameters
        ----------
        state : now.
        command : angle asked of the front road wheels [rad].
        v_ref : wanted speed [m/s].

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
            return self._seen(Inner(now, x), rate, demand)
        except (ArithmeticError, ValueError) as error:  # math.sin(inf) is a ValueError
            message = f"their car left its equations before t = {now * self.period:.3f} s: {error}"
            raise CommonRoadError(message) from None

    def _seen(self, inner: Inner, rate: float, demand: float) -> CarState:
        x_dot = self._equations.derivative(inner.x, rate, demand, self._parameters)
        t = inner.periods * self.period
        return self._equations.seen(t, inner.x, x_dot, inner, self._parameters)


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
    friction : of the road.
    driver : who holds the speed.
    period : for which the inputs are held [s].
    repaired : remove the two contradictions in their program, see `multi_body`.

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
    friction : of the road.
    driver : who holds the speed.
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


# Cars of commonroad-vehicle-models, an independent program; the extra `commonroad` brings it.

__all__ = [
    "CommonRoadCar",
    "CommonRoadError",
    "CommonRoadTire",
    "MissingCommonRoadError",
    "bmw",
    "drift_car",
    "multi_body_car",
]
