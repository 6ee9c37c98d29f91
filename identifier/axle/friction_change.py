"""A change of the road's friction: noticed at both axles at once, followed along one direction.

q = e²/S is one where the error model is right. Its fast mean over its slow mean rises at a change;
then the covariance is inflated along d = M w, the change of weights that a change of friction
makes (φ = μ φ₀(α/μ)), so that the weights move along it at once and the shape is kept. Both axles
must alarm: a faulty steering disturbs only one.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.axle.checks import require_positive
from identifier.axle.piecewise import larger, smaller

Array = NDArray[np.float64]

LARGEST_Q = 25.0  # one outlier alone is no alarm
SLOW_Q = 4.0  # and the slow mean shall not follow a change


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeDetector:
    """When friction is taken to have changed, and how fast it is followed.

    Parameters
    ----------
    threshold : of fast over slow mean of q [-]; from twice it on the inflation is full.
    fast, slow : time constants of the means [s].
    step : change of ln μ [-] that ...
    step_time : ... may happen in this time [s] during an alarm.

    Raises
    ------
    ValueError
        Where a number is not positive.
    """

    threshold: float = 4.0
    fast: float = 0.2
    slow: float = 20.0
    step: float = 0.5
    step_time: float = 0.3

    def __post_init__(self) -> None:
        require_positive(self)

    def numbers(self, dt: float) -> Array:
        """Return [1/threshold, dt/fast, dt/slow, inflation a sample], (4,).

        Parameters
        ----------
        dt : sampling interval [s].
        """
        inflation = dt * self.step**2 / self.step_time
        return np.array([1.0 / self.threshold, dt / self.fast, dt / self.slow, inflation])


class ChangeNumbers(NamedTuple):
    """1/threshold, gains of fast and slow mean, inflation a sample."""

    per_threshold: Any
    fast: Any
    slow: Any
    inflation: Any


class ErrorState(NamedTuple):
    """Columns (2,): fast and slow mean of q [-], recent peak of |ŷ| [static axle loads]."""

    fast: Any
    slow: Any
    peak: Any


def error_means(numbers: ChangeNumbers, state: ErrorState, q: Any, learns: Any) -> tuple[Any, Any]:
    """Return fast and slow mean of q after a sample, (2,) each.

    Parameters
    ----------
    numbers : of the detector.
    state : before the sample.
    q : squared error over its variance, (2,).
    learns : 1 where learning runs, else 0.
    """
    q = smaller(q, LARGEST_Q)
    fast = state.fast + learns * numbers.fast * (q - state.fast)
    slow = state.slow + learns * numbers.slow * (smaller(q, SLOW_Q * state.slow) - state.slow)
    return fast, larger(slow, 1)


def alarm(numbers: ChangeNumbers, fast: Any, slow: Any) -> Any:
    """Return how much the friction is taken to have changed, from 0 to 1.

    Parameters
    ----------
    numbers : of the detector.
    fast : mean of q (2,).
    slow : mean of q (2,).
    """
    ratio = fast / slow
    excess = smaller(ratio[0], ratio[1]) * numbers.per_threshold - 1
    return smaller(larger(excess, 0), 1)
