"""The sway (roll) of the body, which moves the sensor of v_y sideways over the contact patches.

ρ'' = ω² (a - ρ) - 2 ζ ω ρ', driven by a = (F_f + F_r)/m [m/s²] of the model itself. The contact
patch sees α_i - k_i ρ'/(ω² v_x), k in [0, 1] (about m_s h²/(I_x + m_s h²)). Without it the roll
rate is taken for a relaxation length of a meter and more, at one frequency only.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identifier.axle.car import Car
from identifier.axle.checks import require_positive
from models.vehicle import GRAVITY, Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sway:
    """Roll of the body as a second-order system.

    Parameters
    ----------
    frequency : ω [rad/s].
    damping : ζ [-].

    Raises
    ------
    ValueError
        Where a number is not positive.
    """

    frequency: float
    damping: float = 0.3

    def __post_init__(self) -> None:
        require_positive(self)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle) -> "Sway":
        """Return the roll that a car of this size has: 5 sqrt(g/L), 1.5 Hz for a sedan.

        Parameters
        ----------
        vehicle : its wheelbase sets the scale of time.
        """
        return cls(frequency=5.0 * math.sqrt(GRAVITY / vehicle.wheelbase))

    def numbers(self) -> Array:
        """Return [ω², 2 ζ ω, 1/ω²], (3,)."""
        omega = self.frequency
        return np.array([omega**2, 2.0 * self.damping * omega, omega**-2])


class SwayNumbers(NamedTuple):
    """ω² [1/s²], 2 ζ ω [1/s] and 1/ω² [s²]."""

    stiffness: Any
    damping: Any
    compliance: Any


class SwayState(NamedTuple):
    """ρ [m/s²], ρ' [m/s³], and the slip [rad] that a share k = 1 sees: -ρ'/(ω² v_x)."""

    rho: Any
    rate: Any
    slip: Any


def sway(
    numbers: SwayNumbers,
    car: Car,
    dt: Any,
    state: SwayState,
    *,
    first: Any,
    v_x: Any,
    r: Any,
    force: Any,
    slope: Any,
    share: Any,
) -> SwayState:
    """Take one step, semi-implicit in ρ' so that it is stable at any speed.

    Parameters
    ----------
    numbers : of the second-order system.
    car : the car.
    dt : sampling interval [s].
    state : before the step.
    first : 1 at a restart, which begins in steady cornering, else 0.
    v_x : longitudinal speed [m/s].
    r : yaw rate [rad/s].
    force : φ of the last sample [-], (2,).
    slope : dφ/dx of the last sample [1/rad], (2,).
    share : k (2,).
    """
    a = GRAVITY * ca.dot(car.share, force)
    G = GRAVITY * ca.dot(car.share, slope * share) * (1 / v_x)  # swaying out eases the slip
    gain = 1 + dt * G
    rate = state.rate * gain + dt * numbers.stiffness * (a - state.rho)
    rate = (1 - first) * rate / (gain + dt * numbers.damping)
    rho = first * v_x * r + (1 - first) * (state.rho + dt * rate)
    return SwayState(rho, rate, -rate * numbers.compliance * (1 / v_x))
