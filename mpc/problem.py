"""The optimal control problem of the tracker: horizon, cost, limits. Numbers, but for the horizon.

Defaults are of a full-size car. `of` a model car returns those of the similar problem: lengths are
multiplied by its size, speeds and times by the root of that, so that accelerations are the same.

Minimize Σ_k ½ y_k' Q y_k + ½ R u_k² + ½ y_N' Q_N y_N + ½ Σ Z s² over u_0 … u_{N-1}, with x_{k+1}
from one Runge-Kutta step of dt and x_0 given, so that
  |u_k| <= steering_rate,  |δ_k| <= steering                 hard, k = 1 … N
  |e_y,k| <= e_y + s,  |α_k| <= slip + s (front, rear)       soft, k = 1 … N
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Self

import casadi as ca
import numpy as np

from codegen.arrays import Array
from models.rules import require_not_negative, require_positive
from models.vehicle import Vehicle

_SMALL = 1.5  # m, wheelbase: below are model cars, above karts of 1:2 and road cars


def size_of(vehicle: Vehicle) -> float:
    """Return the lengths of a model car over those of a sedan, 1 for full-size cars [-]."""
    return vehicle.scale**2 if vehicle.wheelbase < _SMALL else 1.0


def _similar(numbers: Any, vehicle: Vehicle, powers: Mapping[str, float]) -> Any:
    """Return numbers for the size of a car, multiplied by that to some powers."""
    size = size_of(vehicle)
    return replace(numbers, **{key: getattr(numbers, key) * size**n for key, n in powers.items()})


# What the tracker minimizes: Σ ½ q y² over the stages, Gauss-Newton, and ½ R u² of its input.
#
# y = [e_y, e_psi, course, v_y, yaw rate, δ, progress], see `tracking_errors`.

# What costs ½ at weight 1; the order is that of y.
SCALES = {
    "e_y": 0.1,  # m
    "e_psi": 0.05,  # rad
    "course": 0.05,  # rad
    "v_y": 1.0,  # m/s
    "yaw_rate": 0.2,  # rad/s
    "steering": 0.1,  # rad
    "progress": 0.1,  # -
}
_STEERING_RATE_SCALE = 0.5  # rad/s
N_ERRORS = len(SCALES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Weights of the errors, without unit: 1 costs ½ a stage where the error is as large as said.

    Defaults were chosen on the lane changes of ISO 3888 at 90 to 115 % of the grip, friction 1 and
    0.5; the slalom, the circle and the handling course tuned nothing of them. With none on the yaw
    rate and a quarter on the input, plans became jerky and runs beyond the grip failed; with 8 on
    e_y some did at the grip. With 1 the car stays 1.3 times as far from the path.
    e_y : deviation from the path, at 0.1 m.
    e_psi : heading against that of the path, at 0.05 rad.
    course : direction of travel against the path, e_psi + v_y/v_x, at 0.05 rad.
    v_y : lateral velocity, at 1 m/s.
    yaw_rate : against that of the path, r - κ v_x, at 0.2 rad/s.
    steering : angle of the front wheels, at 0.1 rad.
    progress : share of the speed that is not made good along the path, at 0.1.
    steering_rate : input, at 0.5 rad/s; it alone must be positive.
    terminal : factor on all errors at the end of the horizon.
    """

    e_y: float = 3.0
    e_psi: float = 0.0
    course: float = 0.05
    v_y: float = 0.0
    yaw_rate: float = 0.2
    steering: float = 0.0
    progress: float = 0.0
    steering_rate: float = 0.2
    terminal: float = 5.0

    def __post_init__(self) -> None:
        require_not_negative(ValueError, **asdict(self))
        require_positive(ValueError, steering_rate=self.steering_rate)

    @classmethod
    def of(cls, vehicle: Vehicle) -> Self:
        """Return the weights for a car of its size."""
        powers = {"e_y": -2.0, "v_y": -1.0, "yaw_rate": 1.0, "steering_rate": 1.0}
        found: Self = _similar(cls(), vehicle, powers)
        return found

    def numbers(self) -> Array:
        """Return q (7,) of ½ Σ q y² at a stage, y in SI."""
        return np.array([getattr(self, name) / scale**2 for name, scale in SCALES.items()])

    def terminal_numbers(self) -> Array:
        """Return q (7,) at the end of the horizon."""
        return self.terminal * self.numbers()

    @property
    def R(self) -> float:
        """Of ½ R u², u the steering rate [rad/s]."""
        return self.steering_rate / _STEERING_RATE_SCALE**2


def tracking_errors(x: Any, kappa: Any, v_x: Any, s_dot: Any) -> Any:
    """Return y (7,), SI.
    x : [e_y, e_psi, v_y, r, δ, ...], SX.   kappa : curvature of the path [1/m].
    v_x : longitudinal speed [m/s].   s_dot : speed along the path [m/s].
    """
    per_speed = 1 / v_x
    return ca.vertcat(
        x[0], x[1], x[1] + x[2] * per_speed, x[2], x[3] - kappa * v_x, x[4], 1 - s_dot * per_speed
    )


def gauss_newton(y: Any, x: Any, q: Any) -> tuple[Any, Any]:
    """Return H = C' diag(q) C (n_x, n_x) and h = C' diag(q) y (n_x,), C = ∂y/∂x.
    y : errors (7,), SX.   x : state (n_x,), SX symbol.   q : weights (7,).
    """
    C = ca.jacobian(y, x)
    weighted = C.T @ ca.diag(q)
    return weighted @ C, weighted @ y


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds, symmetric, all positive.
    steering : angle of the front road wheels [rad], kept exactly.
    steering_rate : [rad/s], kept exactly.   e_y : deviation from the path [m], soft.
    slip : kinematic slip angle in front and at the rear [rad], soft. A tire whose curves are flat
        before that has its own, see `mpc.tires.tire`.
    soft_e_y : Z of ½ Z s² where the deviation is s beyond its bound [1/m²].
    soft_slip : Z of slip angles [1/rad²]. Chosen on ISO 3888-1, the slalom and a course of other
        turns, at 97 % of the grip on friction 0.5: with 3000 and more plans alternate between the
        limits of the steering rate, with 100 courses are driven up to 1.4 times as far off.
    """

    steering: float = 0.5
    steering_rate: float = 0.8
    e_y: float = 1.0
    slip: tuple[float, float] = (0.2, 0.2)
    soft_e_y: float = 1e3
    soft_slip: float = 1e3

    def __post_init__(self) -> None:
        require_positive(
            ValueError, steering=self.steering, steering_rate=self.steering_rate, e_y=self.e_y,
            soft_e_y=self.soft_e_y, soft_slip=self.soft_slip,
        )  # fmt: skip
        if len(self.slip) != 2 or not all(0.0 < value < np.inf for value in self.slip):
            raise ValueError(f"slip must be two positive numbers, it is {self.slip}")

    @classmethod
    def of(cls, vehicle: Vehicle) -> Self:
        """Return the bounds for a car of its size."""
        powers = {"steering_rate": -0.5, "e_y": 1.0, "soft_e_y": -2.0}
        found: Self = _similar(cls(), vehicle, powers)
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """The problem; only the horizon is compiled.   dt : length of a stage [s]."""

    horizon: int = 40
    dt: float = 0.05
    cost: Cost = field(default_factory=Cost)
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if not self.horizon >= 2:
            raise ValueError(f"horizon must be at least 2, it is {self.horizon}")
        require_positive(ValueError, dt=self.dt)

    @classmethod
    def of(cls, vehicle: Vehicle, period: float = 0.0) -> Self:
        """Return the problem for a car of its size.   period : least dt, as far as 0.05 s [s]."""
        most = cls()
        dt = min(most.dt, max(most.dt * size_of(vehicle) ** 0.5, period))
        return replace(most, dt=dt, cost=Cost.of(vehicle), limits=Limits.of(vehicle))


@dataclass(frozen=True, slots=True, kw_only=True)
class Guards:
    """Bounds of measurements and of plans, and the fall-back.

    Without a new plan the old one steers for `hold_time`; then feedback to the path, within the
    hard limits: optimal at each speed for Σ (e_y/`fall_back_e_y`)² + (a/`fall_back_acceleration`)²,
    see `mpc.realtime.fall_back`.
    e_y : |e_y| beyond which the car is off the path [m].
    e_psi : |e_psi| beyond which it is [rad].
    v_y : |v_y| beyond which the tire is not known [m/s].
    yaw_rate : |r| beyond which it is not [rad/s].
    min_speed : v_x below which the prediction does not hold [m/s].
    max_speed : v_x beyond which no measurement and no road is believed [m/s].
    max_curvature : |κ| beyond which none is [1/m].
    hold_time : how long an old plan is followed [s].
    fall_back_e_y : deviation [m] that is worth as much as the acceleration.
    fall_back_acceleration : lateral, to come back by [m/s²].
    """

    e_y: float = 5.0
    e_psi: float = 1.2
    v_y: float = 10.0
    yaw_rate: float = 2.0
    min_speed: float = 2.0
    max_speed: float = 100.0
    max_curvature: float = 1.0
    hold_time: float = 0.2
    fall_back_e_y: float = 1.0
    fall_back_acceleration: float = 2.0

    def __post_init__(self) -> None:
        values = asdict(self)
        require_not_negative(ValueError, hold_time=values.pop("hold_time"))
        require_positive(ValueError, **values)

    @classmethod
    def of(cls, vehicle: Vehicle) -> Self:
        """Return the guards for a car of its size."""
        powers = {"e_y": 1.0, "max_curvature": -1.0, "fall_back_e_y": 1.0, "yaw_rate": -0.5}
        powers |= dict.fromkeys(("v_y", "min_speed", "max_speed", "hold_time"), 0.5)
        found: Self = _similar(cls(), vehicle, powers)
        return found
