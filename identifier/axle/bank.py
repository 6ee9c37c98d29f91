"""The side force of the road, by an accelerometer: what pushes the car and is no tire.

An accelerometer feels what tires (and wind) push: a_y = dv_y/dt + v_x r - g sin β on a road that
falls to the left by β. Motion alone has all of it. In static axle loads the road pushes both axles
alike, dξ_i/dt = φ_i cos δ_i - v_x r/g + sin β, so y = L(φ cos δ) + L(sin β) and what is learnt from
is y - sin β. Both sides go through the same filter and no derivative is needed:
m = Σ (F_z,i/W) y_i = L(dv_y/dt + v_x r)/g,  gap = m - L(a_y)/g, of which
slope s' = (gap - s)/τ and motion n' = (m - n)/τ are slow means.
What the gap may be without a bank is taken off: a body that rolls by up to ρ per g outwards, which
shows (1 + ρ) a_y, and a sensor that is not level. What is left is the bank, within its bounds. Wind
an accelerometer feels as it feels tires: it makes no gap, and is learnt.

It is used unless the channel is no acceleration of this car: over what is fast, and so no bank,
u' = share² (m - n)² - (gap - s)² averaged over a long time must not fall below -doubt². A channel
with the other sign, in another unit, or dead is wrong by about all of (m - n). Before it has
explained any motion (u <= 0) no more is believed than what teaches the sensors' offsets alone.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.car import larger, smaller, within
from identifier.axle.learning import RegressionNumbers, filtered
from models.rules import Positive
from models.vehicle import GRAVITY

UNPROVEN = 0.5  # of the force that teaches curves: the most that an unproven channel may change


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadSlope(Positive):
    """What of the difference between accelerometer and motion is a road that is not level.
    time : τ of its mean [s].
    level : sine of an angle by which the sensor may be off level [-]; from twice that on it is a
        bank, in full.
    roll : ρ, of the body [rad per g], outwards.   most : sine of the steepest road [-].
    step : largest difference from the mean that counts in full [-]: roads bend slowly, and what is
        more is a sensor that fails.
    largest : acceleration that no car has [m/s²]; what is not below it, as NaN, is absent.
    share : of the fast motion that the channel may miss [-].
    doubt : what it may miss beside, noise and the changes of the road [-].
    memory : of that comparison [s].
    """

    time: float = 1.0
    level: float = 0.01
    roll: float = 0.08
    most: float = 0.2
    step: float = 0.05
    largest: float = 10.0 * GRAVITY
    share: float = 0.15
    doubt: float = 0.03
    memory: float = 20.0

    def at(self, dt: float) -> "SlopeNumbers":
        """Return the numbers of a step.
        dt : sampling interval [s].
        """
        return SlopeNumbers(
            gain=-math.expm1(-dt / self.time),
            level=self.level,
            roll=self.roll,
            most=self.most,
            step=self.step,
            largest=self.largest,
            share=self.share**2,
            doubt=self.doubt**2,
            memory=-math.expm1(-dt / self.memory),
        )


class SlopeNumbers(NamedTuple):
    """Gain of the means; limits; squares of share and doubt, and the gain of the comparison."""

    gain: Any
    level: Any
    roll: Any
    most: Any
    step: Any
    largest: Any
    share: Any
    doubt: Any
    memory: Any


class SlopeState(NamedTuple):
    """Filter of a_y/g; slow means of gap and motion; mean of what is explained [-]."""

    low: Any
    gap: Any
    motion: Any
    explained: Any


def slope_step(
    numbers: SlopeNumbers,
    regression: RegressionNumbers,
    state: SlopeState,
    *,
    a_y: Any,
    motion: Any,
    first: Any,
    on: Any,
    learns: Any,
) -> Any:
    """Return the state after the sample, (4,).
    a_y : of the accelerometer [m/s²], or NaN.   motion : m = L(dv_y/dt + v_x r)/g [-].
    on : 1 where the car drives, else 0; at rest all stays as it is.
    """
    there = ca.fabs(a_y) < numbers.largest
    felt = ca.if_else(there, a_y * (1 / GRAVITY), motion)
    begins = ca.if_else(there, first, 1)
    low, filter_state = filtered(regression, state.low, felt, begins)
    gap, on = motion - low, on * (1 - first)
    change = within(gap - state.gap, -numbers.step, numbers.step)
    mean_gap = state.gap + on * numbers.gain * change
    mean_motion = state.motion + on * numbers.gain * (motion - state.motion)
    fast, residual = motion - mean_motion, gap - mean_gap
    explained = numbers.share * fast**2 - residual**2
    counts = numbers.memory * ca.if_else(there, learns, 0)
    mean_explained = state.explained + counts * (explained - state.explained)
    return ca.vertcat(filter_state, mean_gap, mean_motion, mean_explained)


def road_push(numbers: SlopeNumbers, state: SlopeState, offsets_alone: Any) -> Any:
    """Return what the road pushes to the left [weights], 0 where nothing tells it.
    offsets_alone : force that teaches the sensors' offsets alone, the most that is believed of a
        channel that has not explained any motion yet [weights].
    """
    wrong = ca.logic_or(state.explained + numbers.doubt < 0, ca.fabs(state.gap) > numbers.most)
    most = ca.if_else(state.explained > 0, numbers.most, offsets_alone)
    most = ca.if_else(wrong, 0, most)
    return within(_beyond(numbers, state.gap, state.motion), -most, most)


def _beyond(numbers: SlopeNumbers, gap: Any, motion: Any) -> Any:
    """Return what of a gap is neither roll, -ρ n to 0, nor a sensor that is off level.

    Of what roll leaves nothing counts up to `level`, all of it from twice that on.
    """
    rolled = -numbers.roll * motion
    left = gap - within(gap, smaller(rolled, 0), larger(rolled, 0))
    rest = larger(2 * numbers.level - ca.fabs(left), 0)
    return left - within(left, -rest, rest)
