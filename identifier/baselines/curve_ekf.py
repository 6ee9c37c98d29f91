"""The parameters of a tire curve by an extended Kalman filter; they freeze to that curve.

Magic Formula: B, C, D per axle. Dugoff: stiffness per axle and the friction of the road.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.curves import CURVES, CurveModel
from identifier.baselines.kalman import CARRY, NOISE, PORTS, build_step
from identifier.baselines.ports import OVER, axle_loads
from identifier.method import Method, Port, Setup, resumed
from identifier.tire_model import TireModel
from identifier.tuning import Range, around
from models.bicycle import BicycleParameters
from models.rules import require_positive
from models.vehicle import GRAVITY, Vehicle

# Numbers without limits for parameters that have some: what a filter may add noise to.
#
# θ = 0 is the prior: the stiffness told, a friction, a usual shape. Logarithms keep stiffness and
# friction positive; a logistic keeps the Magic Formula's shape C between 1 and 2, where the force
# has a peak and keeps its sign.

TYPICAL_SHAPE = 1.4  # C of a passenger tire, Pacejka, Tyre and Vehicle Dynamics, figure 4.9
LOGIT = math.log((TYPICAL_SHAPE - 1.0) / (2.0 - TYPICAL_SHAPE))
STIFFNESS, SHAPE, FRICTION = range(3)
LIMITS = (2.0, 3.0, 1.5)  # of |θ| by kind: stiffness within a factor of 7.4, friction 4.5


class Parametrization(NamedTuple):
    """How θ makes the parameters of a curve.

    kinds : of each θ: STIFFNESS, SHAPE or FRICTION.
    decode(bicycle parameters, prior friction, loads (2,), θ) -> parameters (2, n).
    encode(vehicle, prior friction, parameters (2, n)) -> θ.
    """

    kinds: tuple[int, ...]
    decode: Callable[[BicycleParameters, Any, Any, Any], Any]
    encode: Callable[[Vehicle, float, Array], Array]


def _stated(p: BicycleParameters) -> Any:
    return ca.vertcat(p.C_f, p.C_r)


def _decode_magic(p: BicycleParameters, friction: Any, loads: Any, theta: Any) -> Any:
    """θ: log stiffness, logit shape, log friction; front and rear each."""
    slope = _stated(p) * ca.exp(theta[0:2])  # B C D, which data tell sooner than B
    C = 1 + 1 / (1 + ca.exp(-theta[2:4] - LOGIT))
    D = friction * loads * ca.exp(theta[4:6])
    return ca.horzcat(slope / (C * D), C, D)


def _encode_magic(vehicle: Vehicle, friction: float, parameters: Array) -> Array:
    B, C, D = parameters.T
    stated, loads = np.array(vehicle.bicycle)[4:], np.array(vehicle.axle_loads)
    shape = np.log((C - 1.0) / (2.0 - C)) - LOGIT
    return np.concatenate([np.log(B * C * D / stated), shape, np.log(D / (friction * loads))])


def _decode_dugoff(p: BicycleParameters, friction: Any, loads: Any, theta: Any) -> Any:
    """θ: log stiffness front and rear, log friction of the road, which both axles share."""
    del loads
    mu = friction * ca.exp(theta[2])
    return ca.horzcat(_stated(p) * ca.exp(theta[0:2]), ca.vertcat(mu, mu))


def _encode_dugoff(vehicle: Vehicle, friction: float, parameters: Array) -> Array:
    C, mu = parameters.T
    stated = np.array(vehicle.bicycle)[4:]
    return np.append(np.log(C / stated), np.log(mu.mean() / friction))


PARAMETRIZATIONS: Mapping[str, Parametrization] = {
    "magic_formula": Parametrization(
        (STIFFNESS, STIFFNESS, SHAPE, SHAPE, FRICTION, FRICTION), _decode_magic, _encode_magic
    ),
    "dugoff": Parametrization((STIFFNESS, STIFFNESS, FRICTION), _decode_dugoff, _encode_dugoff),
}
SPREADS = ("stiffness_spread", "shape_spread", "friction_spread")  # in the order of the kinds


def build_curve_step(curve: str) -> ca.Function:
    """Return the filter's step for a curve, see `kalman.build_step`; prior (1,) is a friction.

    Parameters
    ----------
    curve : "magic_formula" or "dugoff".
    """
    shape, decode = CURVES[curve].force, PARAMETRIZATIONS[curve].decode

    def force(p: BicycleParameters, known: Any, theta: Any, v_x: Any, x: Any, u: Any) -> Any:
        loads = axle_loads(p, GRAVITY)
        return shape(p, decode(p, known, loads, theta), loads, v_x, x, u)

    n = len(PARAMETRIZATIONS[curve].kinds)
    return build_step(f"{curve}_ekf", force, unknowns=n, prior=1, follows=False)


@cache
def _scan(curve: str) -> Scan:
    return Scan(build_curve_step(curve), carry=CARRY, over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveEkf(Method):
    """Tire parameters that walk at random, slowly, in the coordinates of `PARAMETRIZATIONS`.

    Parameters
    ----------
    curve : "magic_formula" or "dugoff".
    walk : of every parameter [1/√s].
    v_y_noise : standard deviation of measured v_y [m/s].
    r_noise : standard deviation of the measured yaw rate [rad/s].
    v_y_disturbance : what the curve misses, as random change of v_y [m/s/√s].
    r_disturbance : what the curve misses, as random change of the yaw rate [rad/s/√s].
    friction : what friction is held for at first [-].
    stiffness_spread : standard deviation of the logarithm of stiffness at first [-].
    shape_spread : standard deviation of the Magic Formula's shape at first, as its logit [-].
    friction_spread : standard deviation of the logarithm of friction at first [-].
    outlier : standard deviations from which an innovation teaches no more.
    dt : sampling interval [s].
    learning_speed : below this speed [m/s] learning rests.
    min_speed : below this speed [m/s] forces read zero.

    Raises
    ------
    ValueError
        Where the curve is unknown or a number not positive.
    """

    curve: str
    walk: float
    v_y_noise: float
    r_noise: float
    v_y_disturbance: float
    r_disturbance: float
    friction: float = 0.9
    stiffness_spread: float = 0.5
    shape_spread: float = 0.7
    friction_spread: float = 0.4
    outlier: float = 5.0
    dt: float = 0.01
    learning_speed: float = 3.0
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        if self.curve not in PARAMETRIZATIONS:
            raise ValueError(f"curve must be one of {list(PARAMETRIZATIONS)}, not {self.curve!r}")
        names = ("walk", *NOISE, "friction", *SPREADS, "dt", "learning_speed", "min_speed")
        require_positive(ValueError, **{name: getattr(self, name) for name in names})

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, curve: str, dt: float = 0.01) -> Self:
        """Return the filter for a car: for a sedan noise of 0.02 m/s and 0.002 rad/s.

        Disturbances stand for what a static curve misses: 8 % of g, for a natural time at once.
        The parameters may walk by one percent in a second.

        Parameters
        ----------
        curve : "magic_formula" or "dugoff".
        dt : sampling interval [s].
        """
        time, speed = vehicle.froude_time, vehicle.froude_speed
        return cls(
            curve=curve,
            walk=0.0075 / math.sqrt(time),
            v_y_noise=0.004 * speed,
            r_noise=0.001 / time,
            v_y_disturbance=0.08 * speed / math.sqrt(time),
            r_disturbance=0.12 / time**1.5,
            dt=dt,
            learning_speed=0.6 * speed,
            min_speed=vehicle.lowest_speed,
        )

    @property
    def tunables(self) -> Mapping[str, Range]:
        """What a search may vary, around the numbers that it has."""
        factors = {"walk": 10.0, "v_y_noise": 4.0, "r_noise": 4.0}
        factors |= {"v_y_disturbance": 5.0, "r_disturbance": 5.0, "friction": 1.5}
        factors |= {"stiffness_spread": 3.0, "friction_spread": 3.0}
        if SHAPE in PARAMETRIZATIONS[self.curve].kinds:
            factors |= {"shape_spread": 3.0}
        return {name: around(getattr(self, name), factor) for name, factor in factors.items()}

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return PORTS

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car; its stiffness is the prior.
        start : a frozen curve of the same kind to begin with; None begins with the prior.

        Raises
        ------
        ValueError
            Where the stored model is of another kind.
        """
        kinds, _, encode = PARAMETRIZATIONS[self.curve]
        theta = np.zeros(len(kinds))
        if start is not None:
            refusal = f"the stored model is not a curve {self.curve!r}"
            stored = resumed(start, CurveModel, refusal, curve=self.curve)
            with np.errstate(invalid="ignore", divide="ignore"):  # judged below
                theta = encode(vehicle, self.friction, stored.parameters)
            if not np.isfinite(theta).all():
                raise ValueError(
                    "a curve to begin with must have positive stiffness and friction and a shape "
                    f"between 1 and 2, its parameters are {stored.parameters.tolist()}"
                )
        spread = [getattr(self, SPREADS[kind]) for kind in kinds]
        return Setup(
            scan=_scan(self.curve),
            carry={
                "estimate": np.concatenate([np.zeros(2), theta]),
                "P": np.diag([self.v_y_noise, self.r_noise, *spread]) ** 2,
                "before": np.zeros(3),
                "running": np.zeros(1),
            },
            constants={
                "noise": np.array([getattr(self, name) for name in NOISE]),
                "walk": np.full(len(kinds), self.walk),
                "limit": np.array([LIMITS[kind] for kind in kinds]),
                "prior": np.array([self.friction]),
                "learning_speed": np.array(self.learning_speed),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        """Return the curve with the carried parameters.

        Parameters
        ----------
        state : estimate (2 + n,).
        """
        decode = PARAMETRIZATIONS[self.curve].decode
        loads = ca.DM(vehicle.axle_loads)
        theta = ca.DM(state["estimate"][2:])
        return CurveModel(
            vehicle=vehicle,
            curve=self.curve,
            parameters=np.array(ca.DM(decode(vehicle.bicycle, self.friction, loads, theta))),
            min_speed=self.min_speed,
        )


# Dugoff's tire, stiffness per axle and friction of the road by an extended Kalman filter.


def dugoff_ekf(vehicle: Vehicle, *, dt: float = 0.01) -> CurveEkf:
    """Return the method for a car.

    Parameters
    ----------
    vehicle : the car; its stiffness is the prior.
    dt : sampling interval [s].
    """
    return CurveEkf.for_vehicle(vehicle, curve="dugoff", dt=dt)


# B, C and D of a Magic Formula per axle, learnt by an extended Kalman filter.


def magic_formula_ekf(vehicle: Vehicle, *, dt: float = 0.01) -> CurveEkf:
    """Return the method for a car.

    Parameters
    ----------
    vehicle : the car; its stiffness B C D is the prior.
    dt : sampling interval [s].
    """
    return CurveEkf.for_vehicle(vehicle, curve="magic_formula", dt=dt)
