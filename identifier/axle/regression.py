"""From motion to a regression that is linear in the weights, without derivative and stiffness.

dξ/dt = φ cos δ - v_x r/g, filtered by L(p) = 1/(p/κ + 1):
y = κ ξ - L(κ ξ - v_x r/g) = L(φ cos δ) = Σ θ_j L(g_j),  so y is measured and h = L(g) known.
The filter is trapezoidal: f⁺ = e f + (1 - e)/2 (u⁺ + u), e = exp(-κ dt), with the state
v = e f + (1 - e)/2 u.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.axle.checks import require_positive

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Regression:
    """Filter, error model and memory; times belong to drivers and sensors, not to the car's size.

    Parameters
    ----------
    bandwidth : κ [1/s].
    memory : of directional forgetting, in time with excitation [s].
    error : additive error of y [static axle loads]: 0.02 is 0.2 m/s².
    relative_error : of y [-], the model's.
    correlation_time : of these errors [s]; it makes the result independent of the sampling.
    clip : largest error that counts in full [its standard deviation].
    widest : trace of the covariance of weights at which forgetting stops, over the prior's [-].
    excitation_time : a force above `error` is excitation for this long [s].

    Raises
    ------
    ValueError
        Where a number is not positive.
    """

    bandwidth: float = 4.0
    memory: float = 10.0
    error: float = 0.02
    relative_error: float = 0.04
    correlation_time: float = 0.1
    clip: float = 5.0
    widest: float = 2.0
    excitation_time: float = 1.0

    def __post_init__(self) -> None:
        require_positive(self)

    def numbers(self, dt: float) -> Array:
        """Return the numbers of `RegressionNumbers`, (9,).

        Parameters
        ----------
        dt : sampling interval [s].
        """
        e = math.exp(-self.bandwidth * dt)
        return np.array(
            [
                self.bandwidth,
                e,
                0.5 * (1.0 - e),
                math.expm1(dt / self.memory),
                self.error,
                self.relative_error,
                self.correlation_time / dt,
                self.clip,
                math.exp(-dt / self.excitation_time),
            ]
        )


class RegressionNumbers(NamedTuple):
    """κ, e, (1 - e)/2; (1 - λ)/λ; errors; correlated samples; clip; decay of excitation."""

    bandwidth: Any
    e: Any
    half: Any
    forgetting: Any
    error: Any
    relative_error: Any
    samples: Any
    clip: Any
    decay: Any


def filtered(numbers: RegressionNumbers, v: Any, u: Any, first: Any) -> tuple[Any, Any]:
    """Return f and the next state of the filter.

    Parameters
    ----------
    numbers : of the filter.
    v : its state.
    u : its input now, which is also its output at a restart.
    first : 1 at a restart, else 0.
    """
    f = first * u + (1 - first) * (v + numbers.half * u)
    return f, numbers.e * f + numbers.half * u
