"""The friction of the road against that a tire was learnt on: lost at once, regained with care."""

import math
from typing import NamedTuple

import numpy as np

from mpc.handover.certificate import tire_complaint
from mpc.handover.friction import LEAST, FrictionFit, can_scale, fit_friction
from mpc.handover.misfit import Judge, Misfit
from mpc.handover.rules import Rules, Verdict
from mpc.handover.window import Window
from mpc.tires import TireModel


class Road(NamedTuple):
    """What is believed of the road.

    base : the tire as it was learnt.   ratio : friction over that of the base, at most 1 [-].
    changed_at : when it last changed for good [s].   before : the base before friction was lost,
    where another one was learnt since: that road may come back.
    """

    base: TireModel
    ratio: float = 1.0
    changed_at: float = -math.inf
    before: TireModel | None = None

    def on(self, learnt: TireModel) -> "Road":
        """Return the same road where another tire was learnt on it.

        Parameters
        ----------
        learnt : the tire.
        """
        before = self.base if self.before is None and self.ratio < 1.0 else self.before
        return Road(learnt, 1.0, self.changed_at, before)


class Change(NamedTuple):
    """Another belief, how it was found, and misfits before and after [-]."""

    verdict: Verdict
    road: Road
    tire: TireModel
    before: float
    after: float

    @property
    def reason(self) -> str:
        """In words."""
        return (
            f"{self.road.ratio:.2f} of the friction learnt on: misfit {self.before:.0f} -> "
            f"{self.after:.0f}"
        )


def look_at_road(
    road: Road,
    in_use: TireModel,
    window: Window,
    *,
    t: float,
    usual: float,
    trusted: float,
    judge: Judge,
    rules: Rules,
) -> Change | None:
    """Return what changed about the friction of the road, or None.

    A drop shows in the last moments, which another friction must explain well, not only better.
    What was found is corrected as more is seen, and a friction that comes back is believed when it
    lasts. Above the friction that the base was learnt on, a new number would be extrapolation:
    that is left to learning.

    Parameters
    ----------
    road : what is believed so far.
    in_use : the tire in use, the base at that friction.
    window : the last samples.
    t : time [s].
    usual : size of mean misfits [-].
    trusted : slip up to which a tire must be one [rad].
    judge : of misfits.
    rules : times and evidence.
    """
    if not can_scale(road.base):
        return None

    def fit(
        seconds: float, least: float, most: float, *, wrong: float = 1.0
    ) -> tuple[FrictionFit, Misfit] | None:
        if not least < most:
            return None
        samples = window.last(judge.reach(seconds))
        now = judge.misfit(in_use, samples)
        if now.mean <= wrong * usual:
            return None
        between = (least, most)
        found = fit_friction(
            judge, road.base, samples, known=road.ratio, between=between, scale=usual
        )
        complaint = tire_complaint(found.tire, float(samples[-1, 0]), trusted)
        return None if complaint is not None else (found, now)

    def change(verdict: Verdict, found: FrictionFit, now: Misfit, since: float) -> Change:
        belief = road._replace(ratio=found.ratio, changed_at=since)
        return Change(verdict, belief, found.tire, now.total, found.misfit.total)

    drop = fit(rules.last_moments, LEAST, road.ratio, wrong=rules.wrong)
    if drop is not None:
        found, now = drop
        good = found.misfit.mean < min(rules.wrong * usual, 0.5 * now.mean)
        if good and found.gain >= rules.friction_evidence:
            return change(Verdict.FRICTION, found, now, t)
    since = t - road.changed_at
    if since <= rules.follow:
        better = fit(rules.last_moments + since, LEAST, 1.0)
        if better is not None and better[0].gain >= rules.correction:
            return change(Verdict.CORRECTION, *better, road.changed_at)
    elif window.duration >= judge.reach(rules.recovery_seconds):
        back = fit(rules.recovery_seconds, road.ratio, 1.0)
        if back is not None and back[0].gain >= rules.recovery_evidence:
            return change(Verdict.RECOVERY, *back, t)
        return _the_road_before(road, in_use, window, t=t, usual=usual, judge=judge, rules=rules)
    return None


def _the_road_before(
    road: Road,
    in_use: TireModel,
    window: Window,
    *,
    t: float,
    usual: float,
    judge: Judge,
    rules: Rules,
) -> Change | None:
    """Return the change to the tire before friction was lost, where that explains more again."""
    if road.before is None:
        return None
    weights = np.stack([in_use.weights, road.before.weights])
    samples = window.last(judge.reach(rules.recovery_seconds))
    now, then = judge.misfits(in_use, weights, samples)
    if now.mean <= usual or now.total - then.total < rules.recovery_evidence * usual:
        return None
    belief = Road(road.before, changed_at=t)
    return Change(Verdict.RECOVERY, belief, road.before, now.total, then.total)
