"""When what is measured stops being what was learnt: keep the old weights until it is known why.

q = e²/(σ² s + h'Ph), e = y - h'w, is about one where car, road and sensors are as learnt, also
while the weights are not known yet: σ² is the variance of the error that is told, s the slow mean
of e²/σ² over what was told, h'Ph the variance that the weights still have. Its mean over a moment,
m⁺ = m + T_s/τ (min(q, 25) - m), rises with a broken sensor and with another road alike, and at
first both look the same. Where it passes `noticed` at an axle there is an alarm, and two sets of
weights are compared on every sample: those that were followed about a second behind the learnt
ones, kept⁺ = kept + T_s/τ_k (θ - kept), and stay as they are in an alarm; and those that go on
learning, whose lag and offsets rest as do the mean error s and what counts as known. Three ways
lead out:
  the kept weights explain forces that are there     the sensor is good again: go back to them
  after `give_up` only the new ones explain them     the road is another: go on with them
  after twice that it is still not known             the kept weights where they explain what is
                                                     measured, else the new: none waits for ever
Forces are told with the weights that learn throughout. A change of friction is thus followed as
ever, and what a broken sensor taught is gone once it is good.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.car import larger, smaller
from models.rules import require_positive_fields

LARGEST_Q = 25.0  # one outlier alone is no fault
UNSURE = 0.5  # of what was known is lost by going back: frequent alarms are the model's own fault


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """When there is an alarm on the weights, and how long.

    Parameters
    ----------
    moment : time constant of the means of q [s].
    noticed : mean of q at either axle from which on there is an alarm [-].
    calm : mean of q below which weights explain what is measured [-].
    behind : time by which the old weights follow the learnt ones [s].
    again : time for which the old weights must explain forces that are there [s].
    known : time for which weights must have explained forces before there is an alarm on them [s].
    give_up : time of alarm after which it is taken for another road [s].
    """

    moment: float = 0.2
    noticed: float = 4.0
    calm: float = 2.0
    behind: float = 1.0
    again: float = 0.3
    known: float = 3.0
    give_up: float = 6.0

    def __post_init__(self) -> None:
        require_positive_fields(self)

    def at(self, dt: float) -> "WatchNumbers":
        """Return the numbers of a step.

        Parameters
        ----------
        dt : sampling interval [s].
        """
        return WatchNumbers(
            gain=min(dt / self.moment, 1.0),
            noticed=self.noticed,
            calm=self.calm,
            follow=min(dt / self.behind, 1.0),
            again=self.again,
            known=self.known,
            give_up=self.give_up,
        )


class WatchNumbers(NamedTuple):
    """Gain of the means; limits of q; gain of the old weights; times [s]."""

    gain: Any
    noticed: Any
    calm: Any
    follow: Any
    again: Any
    known: Any
    give_up: Any


class WatchState(NamedTuple):
    """Time of alarm, 0 outside of it, and time in which the kept weights explained again [s]; means
    of q of the learnt and of the kept weights, front and rear; time for which the learnt ones
    explained forces that were there, up to `Watch.known` [s].
    """

    alarm: Any
    again: Any
    learnt_front: Any
    learnt_rear: Any
    kept_front: Any
    kept_rear: Any
    known: Any


BEGIN = WatchState(0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0)


class Watched(NamedTuple):
    """What is to be done, 1 or 0, and the next state (7,).

    rests : whether lag, offsets and what is known of errors and slip rest.   returns : whether the
    kept weights take the place of the learnt ones.   follow : share by which the kept weights go
    to the learnt ones.
    """

    rests: Any
    returns: Any
    follow: Any
    state: Any


def watched(
    numbers: WatchNumbers,
    state: WatchState,
    q: Any,
    q_kept: Any,
    *,
    dt: Any,
    learns: Any,
    moving: Any,
) -> Watched:
    """Judge a sample; nothing changes where learning does not run.

    Parameters
    ----------
    q : of the learnt weights, front and rear (2,).
    q_kept : of the kept ones (2,).
    dt : sampling interval [s].
    moving : 1 where there are forces that tell weights apart, else 0.
    """
    share, time = learns * numbers.gain, learns * dt

    def mean(last: Any, now: Any) -> Any:
        return last + share * (smaller(now, LARGEST_Q) - last)

    learnt = [mean(a, b) for a, b in zip(state[2:4], ca.vertsplit(q), strict=True)]
    kept = [mean(a, b) for a, b in zip(state[4:6], ca.vertsplit(q_kept), strict=True)]
    worst, worst_kept = larger(*learnt), larger(*kept)
    wrong = ca.logic_and(worst > numbers.noticed, state.known >= numbers.known)
    rests = ca.logic_or(state.alarm > 0, wrong)
    alarm = ca.if_else(rests, state.alarm + time, 0)
    explained = ca.logic_and(rests, worst_kept < numbers.calm)
    again = ca.if_else(explained, state.again + time * moving, 0)
    late = alarm > 2 * numbers.give_up
    returns = ca.logic_and(explained, ca.logic_or(again > numbers.again, late))
    waited = ca.logic_and(alarm > numbers.give_up, worst < numbers.calm)
    goes_on = ca.logic_and(ca.logic_or(waited, late), ca.logic_not(explained))
    over = ca.logic_or(returns, goes_on)
    calm = ca.logic_and(worst < numbers.calm, ca.logic_not(rests))
    # What is gone back to begins with its own mean; what is gone on with, as if it were right.
    learnt = [
        ca.if_else(returns, b, ca.if_else(goes_on, smaller(a, 1), a))
        for a, b in zip(learnt, kept, strict=True)
    ]
    known = smaller(state.known + time * moving * calm, numbers.known)
    return Watched(
        rests=rests,
        returns=returns,
        follow=ca.if_else(goes_on, 1, calm * learns * numbers.follow),
        state=ca.vertcat(
            ca.if_else(over, 0, alarm),
            ca.if_else(over, 0, again),
            *learnt,
            *kept,
            ca.if_else(goes_on, 0, known * (1 - returns * UNSURE)),
        ),
    )
