"""The optimal control problem of the tracker: horizon, cost, limits. Numbers, but for the horizon.

Minimize Σ_k ½ y_k' Q y_k + ½ R u_k² + ½ y_N' Q_N y_N + ½ Σ Z s² over u_0 … u_{N-1}, with x_{k+1}
from one Runge-Kutta step of dt and x_0 given, so that
  |u_k| <= steering_rate,  |δ_k| <= steering                 hard, k = 1 … N
  |e_y,k| <= e_y + s,  |α_k| <= slip + s (front, rear)       soft, k = 1 … N
"""

from dataclasses import dataclass, field

import numpy as np

from mpc.cost import Cost


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds, symmetric, all positive.

    Parameters
    ----------
    steering : angle of the front road wheels [rad], kept exactly.
    steering_rate : [rad/s], kept exactly.
    e_y : deviation from the path [m], soft.
    slip : kinematic slip angle in front and at the rear [rad], soft. A tire whose curves are flat
        before that has its own, see `mpc.tires.reach`.
    soft_e_y : Z of ½ Z s² where the deviation is s beyond its bound [1/m²].
    soft_slip : Z of slip angles [1/rad²]. Chosen on ISO 3888-1, the slalom and a course of other
        turns, at 97 % of the grip on friction 0.5: with 3000 and more plans alternate between the
        limits of the steering rate, with 100 courses are driven up to 1.4 times as far off.

    Raises
    ------
    ValueError
        Where a number is not positive and finite.
    """

    steering: float = 0.5
    steering_rate: float = 0.8
    e_y: float = 1.0
    slip: tuple[float, float] = (0.2, 0.2)
    soft_e_y: float = 1e3
    soft_slip: float = 1e3

    def __post_init__(self) -> None:
        _require_positive(self, ("steering", "steering_rate", "e_y", "soft_e_y", "soft_slip"))
        if len(self.slip) != 2 or not all(0.0 < value < np.inf for value in self.slip):
            raise ValueError(f"slip must be two positive numbers, it is {self.slip}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """The problem; only the horizon is compiled.

    Parameters
    ----------
    horizon : number of stages N.
    dt : length of a stage [s].
    cost : weights.
    limits : bounds.

    Raises
    ------
    ValueError
        Where the horizon is not at least 2 or dt not positive and finite.
    """

    horizon: int = 40
    dt: float = 0.05
    cost: Cost = field(default_factory=Cost)
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if not self.horizon >= 2:
            raise ValueError(f"horizon must be at least 2, it is {self.horizon}")
        _require_positive(self, ("dt",))


def _require_positive(owner: object, names: tuple[str, ...]) -> None:
    for name in names:
        value = getattr(owner, name)
        if not 0.0 < value < np.inf:
            raise ValueError(f"{name} must be positive and finite, it is {value}")
