"""B, C, D of a Magic Formula per axle by an extended Kalman filter; they freeze to that curve."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.curves import CURVES, CurveModel, measured_slip, unlagged
from identifier.baselines.kalman import NOISE, PORTS, FilteredTire, build_step
from identifier.baselines.ports import LAG_DESCRIBED, OVER, axle_loads
from identifier.method import Method, resumed
from identifier.setup import Port, Setup
from identifier.tire_model import TireModel
from models.bicycle import BicycleParameters
from models.rules import require_positive
from models.vehicle import GRAVITY, Vehicle

# Numbers without limits for parameters that have some: what a filter may add noise to.
#
# θ = 0 is the prior: declared stiffness, usual friction and shape. Logarithms keep stiffness and
# friction positive; a logistic keeps the Magic Formula's shape C between 1 and 2, where the force
# has a peak and keeps its sign.

TYPICAL_SHAPE = 1.4  # C of a passenger tire, Pacejka, Tyre and Vehicle Dynamics, figure 4.9
_LOGIT = math.log((TYPICAL_SHAPE - 1.0) / (2.0 - TYPICAL_SHAPE))
STIFFNESS, SHAPE, FRICTION = range(3)
LIMITS = (2.0, 3.0, 1.5)  # of |θ| by kind: stiffness within a factor of 7.4, friction 4.5
_LAG_LIMIT = 2.0  # of |ln σ/σ₀|: a relaxation length within a factor of 7.4
_OFFSET_LIMITS = (5.0, 8.0)  # spreads of δ₀ and of b: 0.01 rad, for a sedan 0.2 m/s


_SPREADS = ("stiffness_spread", "shape_spread", "friction_spread")  # in the order of the kinds
KINDS = (STIFFNESS, STIFFNESS, SHAPE, SHAPE, FRICTION, FRICTION)  # of each θ of the curve
MAGIC = CURVES["magic_formula"]


def decoded(p: BicycleParameters, friction: Any, loads: Any, theta: Any) -> Any:
    """Return B, C, D (2, 3) of θ: log stiffness, logit shape, log friction; front and rear each."""
    slope = ca.vertcat(p.C_f, p.C_r) * ca.exp(theta[0:2])  # B C D, which data tell sooner than B
    C = 1 + 1 / (1 + ca.exp(-theta[2:4] - _LOGIT))
    D = friction * loads * ca.exp(theta[4:6])
    return ca.horzcat(slope / (C * D), C, D)


def _encoded(vehicle: Vehicle, friction: float, parameters: Array) -> Array:
    """Return the θ that `decoded` makes such parameters of, (6,)."""
    B, C, D = parameters.T
    stated, loads = np.array(vehicle.bicycle)[4:], np.array(vehicle.axle_loads)
    shape = np.log((C - 1.0) / (2.0 - C)) - _LOGIT
    return np.concatenate([np.log(B * C * D / stated), shape, np.log(D / (friction * loads))])


OWN = 4  # unknowns beside those of the curve: ln σ/σ₀ (2,), δ₀ and b over their spreads
_OWN_PRIOR = ("relaxation_length", "steering_spread", "v_y_spread")


def _filtered_tire(textbook: bool) -> FilteredTire:
    """Return what makes the forces of a curve by θ = [curve, ln σ/σ₀, δ₀ and b over spreads].

    Prior: friction [-], then those of `_OWN_PRIOR` where it is not the textbook's.
    textbook : whether it is without lag and offsets; then θ is that of the curve alone.
    """
    n = len(KINDS)

    def slip(p: BicycleParameters, known: Any, theta: Any, v_x: Any, x: Any, u: Any) -> Any:
        if textbook:
            return MAGIC.slip(p, v_x, x, u)
        return measured_slip(MAGIC, p, known[2:4] * theta[n + 2 :], v_x, x, u)

    def force(p: BicycleParameters, known: Any, theta: Any, slip: Any, u: Any) -> Any:
        loads = axle_loads(p, GRAVITY)
        return MAGIC.force(decoded(p, known[0], loads, theta[:n]), loads, slip, u)

    def lag(known: Any, theta: Any) -> Any:
        return known[1] * ca.exp(theta[n : n + 2])

    own, prior = (0, 0) if textbook else (OWN, len(_OWN_PRIOR))
    return FilteredTire(
        slip=slip, force=force, lag=None if textbook else lag, unknowns=n + own, prior=1 + prior
    )


@cache
def _scan(textbook: bool) -> Scan:
    tire = _filtered_tire(textbook)
    return Scan(build_step("magic_formula_ekf", tire), carry=tire.carry, over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveEkf(Method):
    """Tire parameters that walk at random, slowly, in the coordinates of `decoded`.

    With them the lag of the tire and the zeros of both sensors, which the default learns too.
    walk : of every parameter [1/√s].   v_y_noise : standard deviation of measured v_y [m/s].
    r_noise : standard deviation of the measured yaw rate [rad/s].
    v_y_disturbance : what the curve misses, as random change of v_y [m/s/√s].
    r_disturbance : what the curve misses, as random change of the yaw rate [rad/s/√s].
    relaxation_length : what σ of both axles is held for at first [m].
    v_y_spread : standard deviation of the bias of v_y at first [m/s].
    steering_spread : standard deviation of the zero of the front steering at first [rad].
    relaxation_spread : standard deviation of the logarithm of σ at first [-].
    textbook : without lag and offsets, as papers have this filter; the four before do nothing then.
    friction : what friction is held for at first [-].
    stiffness_spread : standard deviation of the logarithm of stiffness at first [-].
    shape_spread : standard deviation of the Magic Formula's shape at first, as its logit [-].
    friction_spread : standard deviation of the logarithm of friction at first [-].
    dt : sampling interval [s].   learning_speed : below this speed [m/s] learning rests.
    min_speed : below this speed [m/s] forces read zero.
    """

    walk: float
    v_y_noise: float
    r_noise: float
    v_y_disturbance: float
    r_disturbance: float
    relaxation_length: float
    v_y_spread: float
    steering_spread: float = 0.002
    relaxation_spread: float = 0.5
    textbook: bool = False
    friction: float = 0.9
    stiffness_spread: float = 0.5
    shape_spread: float = 0.7
    friction_spread: float = 0.4
    outlier: float = 5.0
    dt: float = 0.01
    learning_speed: float = 3.0
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        filtered = ("walk", *NOISE, "friction", *_SPREADS, *_OWN_PRIOR, "relaxation_spread")
        names = (*filtered, "dt", "learning_speed", "min_speed")
        require_positive(ValueError, **{name: getattr(self, name) for name in names})

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01, textbook: bool = False) -> Self:
        """Return the filter for a car: for a sedan noise of 0.02 m/s and 0.002 rad/s.

        Disturbances stand for what the curve misses, for a natural time at once: 8 % of g without
        lag and offsets, half of it with them. The parameters may walk by one percent in a second.
        Both were chosen on 32 random cars of our plant, from a compact to 1:10.
        dt : sampling interval [s].
        """
        time, speed = vehicle.froude_time, vehicle.froude_speed
        missed = 1.0 if textbook else 0.5
        return cls(
            walk=0.0075 / math.sqrt(time),
            v_y_noise=0.004 * speed,
            r_noise=0.001 / time,
            v_y_disturbance=0.08 * missed * speed / math.sqrt(time),
            r_disturbance=0.12 * missed / time**1.5,
            relaxation_length=0.4 * vehicle.wheelbase,
            v_y_spread=0.005 * speed,
            textbook=textbook,
            dt=dt,
            learning_speed=0.6 * speed,
            min_speed=vehicle.lowest_speed,
        )

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return PORTS if self.textbook else (*PORTS, *LAG_DESCRIBED)

    @property
    def remark(self) -> str:
        """Say whether it is more than the textbook's."""
        if self.textbook:
            return "the textbook's, without lag and offsets"
        return "lag of the tires and offsets of the sensors are identified, as by the default"

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; a frozen curve of its kind may begin it, else the prior does."""
        theta, own = np.zeros(len(KINDS)), np.zeros(0 if self.textbook else OWN)
        if start is not None:
            refusal = "the stored model is not a curve 'magic_formula'"
            stored = resumed(start, CurveModel, refusal, curve="magic_formula")
            with np.errstate(invalid="ignore", divide="ignore"):  # judged below
                theta = _encoded(vehicle, self.friction, stored.parameters)
            if not np.isfinite(theta).all():
                raise ValueError(
                    "a curve to begin with must have positive stiffness and friction and a shape "
                    f"between 1 and 2, its parameters are {stored.parameters.tolist()}"
                )
            own = self._own_of(stored)
        lags = 0 if self.textbook else 2
        prior = () if self.textbook else _OWN_PRIOR
        noise = [self.v_y_noise, self.r_noise, *[self.v_y_noise / self.learning_speed] * lags]
        return Setup(
            scan=_scan(self.textbook),
            carry={
                "estimate": np.concatenate([np.zeros(2 + lags), theta, own]),
                "P": np.diag([*noise, *self.spread]) ** 2,
                "before": np.zeros(3),
                "running": np.zeros(1),
                **({} if self.textbook else unlagged()),
            },
            constants={
                "noise": np.array([getattr(self, name) for name in NOISE]),
                "walk": np.full(self.limit.size, self.walk),
                "limit": self.limit,
                "prior": np.array([getattr(self, name) for name in ("friction", *prior)]),
                "learning_speed": np.array(self.learning_speed),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    @property
    def spread(self) -> Array:
        """Standard deviations of the unknowns θ at first, (n,) [-]."""
        of_curve = [getattr(self, _SPREADS[kind]) for kind in KINDS]
        own = [] if self.textbook else [self.relaxation_spread, self.relaxation_spread, 1.0, 1.0]
        return np.array([*of_curve, *own])

    @property
    def limit(self) -> Array:
        """What the unknowns θ stay within, (n,) [-]."""
        of_curve = [LIMITS[kind] for kind in KINDS]
        own = [] if self.textbook else [_LAG_LIMIT, _LAG_LIMIT, *_OFFSET_LIMITS]
        return np.array([*of_curve, *own])

    def model(self, vehicle: Vehicle, theta: Array) -> CurveModel:
        """Return the curve, its lag and its offsets that unknowns make.
        theta : unknowns, (n,).
        """
        n, loads = len(KINDS), ca.DM(vehicle.axle_loads)
        values = decoded(vehicle.bicycle, self.friction, loads, ca.DM(theta[:n]))
        curve = CurveModel(
            vehicle=vehicle,
            curve="magic_formula",
            parameters=np.array(ca.DM(values)),
            min_speed=self.min_speed,
        )
        if self.textbook:
            return curve
        lag, offset = theta[n : n + 2], theta[n + 2 :]
        return replace(
            curve,
            relaxation_length=self.relaxation_length * np.exp(lag),
            offset=offset * (self.steering_spread, self.v_y_spread),
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        """Return the curve with the carried parameters, lag and offsets."""
        return self.model(vehicle, state["estimate"].ravel()[-self.limit.size :])

    def _own_of(self, stored: CurveModel) -> Array:
        """Return the lag and the offsets of a stored curve as unknowns, (4,) or none."""
        if self.textbook:
            return np.zeros(0)
        lag = np.maximum(stored.relaxation_length / self.relaxation_length, math.exp(-_LAG_LIMIT))
        return np.concatenate(
            [np.log(lag), stored.offset / (self.steering_spread, self.v_y_spread)]
        )


def magic_formula_ekf(vehicle: Vehicle, *, dt: float = 0.01, textbook: bool = False) -> CurveEkf:
    """Return the method for a car.
    vehicle : the car; its stiffness B C D is the prior.   dt : sampling interval [s].
    """
    return CurveEkf.for_vehicle(vehicle, dt=dt, textbook=textbook)
