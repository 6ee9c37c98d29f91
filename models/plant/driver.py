"""The driver who holds the speed: proportional plus integral, with a limit and no wind-up."""

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca

from models.rules import require_positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """Gains of the speed controller; the defaults hold the speed within about 0.1 m/s.

    Parameters
    ----------
    gain : acceleration per speed error [1/s].
    integral_gain : acceleration per integrated speed error [1/s^2], zero for none.
    acceleration_limit : largest demand, driving and braking [m/s^2].

    Raises
    ------
    ValueError
        For a gain that is negative, zero where it must not be, or NaN.
    """

    gain: float = 2.0
    integral_gain: float = 0.5
    acceleration_limit: float = 3.0

    def __post_init__(self) -> None:
        require_positive(ValueError, gain=self.gain, acceleration_limit=self.acceleration_limit)
        if not (self.integral_gain >= 0.0 and math.isfinite(self.integral_gain)):
            raise ValueError(f"integral_gain must not be negative, it is {self.integral_gain}")

    def demand(self, error: Any, integral: Any) -> tuple[Any, Any]:
        """Return the demanded acceleration [m/s^2] and the derivative of the integral [m/s].

        Parameters
        ----------
        error : wanted minus actual speed [m/s].
        integral : of the error [m].
        """
        wanted = self.gain * error + self.integral_gain * integral
        limit = self.acceleration_limit
        demand = ca.fmin(ca.fmax(wanted, -limit), limit)
        return demand, error + (demand - wanted) / self.gain  # the integral stops at the limit
