"""What the tracker minimizes: Σ ½ q y² over the stages, Gauss-Newton, and ½ R u² of its input.

y = [e_y, e_psi, course, v_y, yaw rate, δ, progress], see `tracking_errors`.
"""

from dataclasses import dataclass, fields
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
STEERING_RATE_SCALE = 0.5  # rad/s
N_ERRORS = len(SCALES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Weights of the errors, without unit: 1 costs ½ a stage where the error is as large as said.

    Defaults were chosen on the lane changes of ISO 3888 at 90 to 115 % of the grip, friction 1 and
    0.5; the slalom, the circle and the handling course tuned nothing of them. With none on the yaw
    rate and a quarter on the input, plans became jerky and runs beyond the grip failed; with 8 on
    e_y some did at the grip. With 1 the car stays 1.3 times as far from the path.

    Parameters
    ----------
    e_y : deviation from the path, at 0.1 m.
    e_psi : heading against that of the path, at 0.05 rad.
    course : direction of travel against the path, e_psi + v_y/v_x, at 0.05 rad.
    v_y : lateral velocity, at 1 m/s.
    yaw_rate : against that of the path, r - κ v_x, at 0.2 rad/s.
    steering : angle of the front wheels, at 0.1 rad.
    progress : share of the speed that is not made good along the path, at 0.1.
    steering_rate : input, at 0.5 rad/s; it alone must be positive.
    terminal : factor on all errors at the end of the horizon.

    Raises
    ------
    ValueError
        Where a weight is negative or not finite, or steering_rate zero.
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
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0.0 <= value < np.inf:
                raise ValueError(f"{field.name} must be finite and not negative, it is {value}")
        if not self.steering_rate > 0.0:
            raise ValueError(f"steering_rate must be positive, it is {self.steering_rate}")

    def numbers(self) -> Array:
        """Return q (7,) of ½ Σ q y² at a stage, y in SI."""
        return np.array([getattr(self, name) / scale**2 for name, scale in SCALES.items()])

    def terminal_numbers(self) -> Array:
        """Return q (7,) at the end of the horizon."""
        return self.terminal * self.numbers()

    @property
    def R(self) -> float:
        """Of ½ R u², u the steering rate [rad/s]."""
        return self.steering_rate / STEERING_RATE_SCALE**2


def tracking_errors(x: Any, kappa: Any, v_x: Any, s_dot: Any) -> Any:
    """Return y (7,), SI.

    Parameters
    ----------
    x : [e_y, e_psi, v_y, r, δ, ...], SX.
    kappa : curvature of the path [1/m].
    v_x : longitudinal speed [m/s].
    s_dot : speed along the path [m/s].
    """
    per_speed = 1 / v_x
    return ca.vertcat(
        x[0], x[1], x[1] + x[2] * per_speed, x[2], x[3] - kappa * v_x, x[4], 1 - s_dot * per_speed
    )


def gauss_newton(y: Any, x: Any, q: Any) -> tuple[Any, Any]:
    """Return H = C' diag(q) C (n_x, n_x) and h = C' diag(q) y (n_x,), C = ∂y/∂x.

    Parameters
    ----------
    y : errors (7,), SX.
    x : state (n_x,), SX symbol.
    q : weights (7,).
    """
    C = ca.jacobian(y, x)
    weighted = C.T @ ca.diag(q)
    return weighted @ C, weighted @ y
