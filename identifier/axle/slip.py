"""The slip angle that makes the force: lagged by a carcass that is in series with the rubber.

α = δ - atan2(v_y - b ± l r, v_x) + δ₀ + k (sway) in the paper's sign, with the zero δ₀ of the
front steering and the bias b of v_y.   x' = (v_x/σ)(α - x), σ = s C(x): s is the deflection per
load, C(x) the slope of the force curve, so that the lag shortens by itself where the tire slides.
Solved exactly for α linear over the step (first-order hold): then the force still depends on s
where σ is short against a step, and learning cannot get stuck at s = 0.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.car import Car, within
from identifier.axle.curve import Curve
from identifier.axle.gate import Gate
from models.rules import require_within
from models.vehicle import GRAVITY, Vehicle

_SLOWEST = 0.1  # rad/s, of a body that rolls on springs
FASTEST = 100.0  # rad/s, of a body that rolls on springs
# per wheelbase: ∂x/∂s stays below it, also where its recursion does not settle
_MOST_SENSITIVE = 1e4
_MOST_SWAY = 10.0  # g: ρ and ρ'/ω stay below it, at any sampling and however speed changes

SHORTEST = 1e-3  # wheelbases: the lag never vanishes
# [rad] over which the corners of a play are round, so that slopes over it are steady; chosen on
# planted plays of .02 rad, which are found within a tenth
_ROUND = 0.003


class SlipState(NamedTuple):
    """Columns (2,): lagged slip x and slip α [rad]; slope C [1/rad] and force φ [-] at x."""

    x: Any
    alpha: Any
    slope: Any
    force: Any


class SensitivityState(NamedTuple):
    """Columns (2,): ∂x/∂s [rad per m/load], ∂x/∂k [rad], and dC/dx [1/rad²] at x."""

    of_compliance: Any
    of_share: Any
    bend: Any


class Hold(NamedTuple):
    """One step of the lag, (2,): 1/σ [1/m], z = v_x dt/σ, e = exp(-z), φ = (1 - e)/z."""

    per_sigma: Any
    z: Any
    e: Any
    phi: Any


class Sensors(NamedTuple):
    """Errors of sensors that are known beforehand: v_y by β v_x + x_s r [rad, m], δ_f by a share
    of it [-].
    """

    v_y_angle: Any = 0.0
    v_y_lever: Any = 0.0
    steering_gain: Any = 0.0

    def v_y(self, v_y: Any, r: Any, v_x: Any) -> Any:
        """Return v_y without them [m/s]."""
        return v_y - self.v_y_angle * v_x - self.v_y_lever * r

    def steering(self, delta: Any) -> Any:
        """Return δ_f without them [rad]."""
        return delta + self.steering_gain * delta


def beyond_play(alpha: Any, play: Any) -> Any:
    """Return the slip beyond a play of the steering to both sides [rad], numbers or symbols.

    A loose wheel turns to where it runs without slip, as its aligning moment does, until the play
    is used up: so it is the slip that has a dead zone, and not the angle of the steering.
    """
    near, far = (((alpha + side * play) ** 2 + _ROUND**2) ** 0.5 for side in (-1, 1))
    return alpha + (near - far) / 2


def kinematic_slip(car: Car, gated: Gate, offset: Any) -> Any:
    """Return α without sway [rad], (2,).
    offset : δ₀ [rad] and b [m/s], (2,).
    """
    sideways = gated.v_y - offset[1] + car.arm * gated.r
    zero = ca.vertcat(offset[0], 0)
    return gated.delta - ca.atan(sideways * (1 / gated.v_x)) + zero  # v_x > 0: atan2 is atan


def hold(car: Car, v_x: Any, dt: Any, compliance: Any, slope: Any) -> Hold:
    """Return the numbers of one step of the lag.
    v_x : longitudinal speed [m/s].   dt : sampling interval [s].   compliance : s [m], (2,).
    slope : C(x) of the last sample [1/rad], (2,).
    """
    sigma = compliance * slope + SHORTEST * (car.arm[0] - car.arm[1])
    z = v_x * dt * (1 / sigma)
    e = ca.exp(-z)
    return Hold(1 / sigma, z, e, (1 - e) * sigma * (1 / (v_x * dt)))


def lagged_slip(h: Hold, last: SlipState, alpha: Any, first: Any) -> Any:
    """Return x after the step [rad], (2,).
    h : numbers of the step.   alpha : slip angle now [rad], (2,).
    first : 1 at a restart, which begins without lag, else 0.
    """
    change = alpha - last.alpha
    x = h.e * last.x + (1 - h.e) * last.alpha + (1 - h.phi) * change
    return first * alpha + (1 - first) * x


def sensitivity(
    h: Hold,
    last: SlipState,
    lasting: SensitivityState,
    *,
    compliance: Any,
    alpha: Any,
    first: Any,
    sway_before: Any,
    sway_now: Any,
    wheelbase: Any,
) -> tuple[Any, Any]:
    """Return ∂x/∂s and ∂x/∂k after the step, (2,) each.
    h : numbers of the step.   compliance : s [m], (2,).   alpha : slip angle now [rad], (2,).
    sway_before : ∂α/∂k at the last sample [rad].   sway_now : ∂α/∂k now [rad].   wheelbase : L [m].
    """
    p_s, p_k = lasting.of_compliance, lasting.of_share
    change = alpha - last.alpha
    by_sigma = ((h.e - h.phi) * change - h.z * h.e * (last.alpha - last.x)) * h.per_sigma
    most = _MOST_SENSITIVE * (1 / wheelbase)
    p_s = h.e * p_s + by_sigma * (last.slope + compliance * lasting.bend * p_s)
    p_s = within(p_s, -most, most)
    p_k = h.e * p_k + (1 - h.e) * sway_before + (1 - h.phi) * (sway_now - sway_before)
    return (1 - first) * p_s, first * sway_now + (1 - first) * p_k


def force_gradient(c: Curve, of_compliance: Any, of_share: Any, cos_delta: Any, v_x: Any) -> Any:
    """Return g = ∂(φ cos δ)/∂[w, s, k, offset], (2, n + 3).

    The bias b of v_y is learnt at the rear axle: it acts on slip as b/v_x.
    c : force curve at x.   of_compliance : ∂x/∂s (2,).   of_share : ∂x/∂k (2,).
    cos_delta : cos δ (2,).   v_x : longitudinal speed [m/s].
    """
    slope = c.slope * cos_delta
    of_offset = ca.vertcat(1, 1 / v_x)
    units = c.units * ca.repmat(cos_delta, 1, c.units.shape[1])
    return ca.horzcat(units, slope * of_compliance, slope * of_share, slope * of_offset)


# The sway (roll) of the body, which moves the sensor of v_y sideways over the contact patches.
#
# ρ'' = ω² (a - ρ) - 2 ζ ω ρ', driven by a = (F_f + F_r)/m [m/s²] of the model itself. The contact
# patch sees α_i - k_i ρ'/(ω² v_x), k in [0, 1] (about m_s h²/(I_x + m_s h²)). Without it the roll
# rate is taken for a relaxation length of a meter and more, at one frequency only.


@dataclass(frozen=True, slots=True, kw_only=True)
class Sway:
    """Roll of the body as a second-order system.
    frequency : ω [rad/s].   damping : ζ [-].
    """

    frequency: float
    damping: float = 0.3

    def __post_init__(self) -> None:
        require_within(ValueError, _SLOWEST, FASTEST, frequency=self.frequency)
        require_within(ValueError, 0.01, 10.0, damping=self.damping)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle) -> "Sway":
        """Return the roll that a car of this size has: 5 sqrt(g/L), 1.5 Hz for a sedan; of a toy
        below 7 cm 10 Hz.
        """
        return cls(frequency=min(5.0 * math.sqrt(GRAVITY / vehicle.wheelbase), 0.6 * FASTEST))

    def numbers(self) -> "SwayNumbers":
        """Return the numbers of a step."""
        omega, most = self.frequency, _MOST_SWAY * GRAVITY
        return SwayNumbers(
            stiffness=omega**2,
            damping=2.0 * self.damping * omega,
            compliance=omega**-2,
            most=most,
            most_rate=omega * most,
        )


class SwayNumbers(NamedTuple):
    """ω² [1/s²], 2 ζ ω [1/s] and 1/ω² [s²]; the most that ρ [m/s²] and ρ' [m/s³] may be."""

    stiffness: Any
    damping: Any
    compliance: Any
    most: Any
    most_rate: Any


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
    numbers : of the second-order system.   dt : sampling interval [s].
    first : 1 at a restart, which begins in steady cornering, else 0.
    v_x : longitudinal speed [m/s].   r : yaw rate [rad/s].
    force : φ of the last sample [-], (2,).   slope : dφ/dx of the last sample [1/rad], (2,).
    share : k (2,).
    """
    a = GRAVITY * ca.dot(car.share, force)
    G = GRAVITY * ca.dot(car.share, slope * share) * (1 / v_x)  # swaying out eases the slip
    gain = 1 + dt * G
    rate = state.rate * gain + dt * numbers.stiffness * (a - state.rho)
    rate = (1 - first) * rate / (gain + dt * numbers.damping)
    rate = within(rate, -numbers.most_rate, numbers.most_rate)
    rho = first * v_x * r + (1 - first) * (state.rho + dt * rate)
    rho = within(rho, -numbers.most, numbers.most)
    return SwayState(rho, rate, -rate * numbers.compliance * (1 / v_x))
