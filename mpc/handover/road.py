"""The friction of the road against that a tire was learnt on: lost at once, regained with care."""

import math
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from mpc.handover.certificate import tire_complaint
from mpc.handover.judge import ChiSquare, Judge, Window
from mpc.handover.rules import Rules, Verdict
from mpc.tires import PredictionTire

_LEAST = 0.15  # of the friction that a tire was learnt on: ice, after a dry road
_GRID = 13  # frictions that are tried at once
_PRIOR_SD = 0.7  # standard deviation of ln μ where nothing is seen

# A tire on a road of another friction, and the friction that explains the last moments best.
#
# Similarity: φ(α) = μ φ₀(α/μ): the stiffness stays, force and the slip of the peak shrink. Ladders
# and networks of slip keep their structure under it, so that only weights change. One number is
# known after a third of a second, when a whole curve is not.


class _FrictionFit(NamedTuple):
    """Friction over that of the tire it began with [-], the tire, and how it explains the samples.

    `gain` is by how much the chi-square, with what is known of roads, falls by the change.
    """

    ratio: float
    tire: PredictionTire
    chi_square: ChiSquare
    gain: float


def at_friction(tire: PredictionTire, ratio: float) -> PredictionTire:
    """Return a tire where the friction is another.

    ratio : friction over the one that the tire has [-].
    """
    if not 0.0 < ratio < math.inf:
        raise ValueError(f"ratio must be positive, it is {ratio}")
    weights = tire.structure.at_friction(tire.weights, ratio)
    if weights is None:
        kind = type(tire.structure).__name__
        raise ValueError(f"a {kind} cannot be scaled to another friction")
    return tire._replace(weights=weights)


def fit_friction(
    judge: Judge,
    tire: PredictionTire,
    samples: Array,
    *,
    known: float = 1.0,
    between: tuple[float, float] = (_LEAST, 1.0),
    scale: float = 1.0,
) -> _FrictionFit:
    """Return the friction that explains samples best, and what is known of roads beforehand.

    known : friction over that of the tire that was taken so far [-].
    between : least and largest friction over that of the tire that is looked for [-].
    scale : of chi-squares: they are that many times as large as expected even of a good tire [-].
    """
    center, (least, most) = math.log(known), np.log(between)

    def costs(log_ratios: Array) -> tuple[Array, list[ChiSquare]]:
        weights = np.stack([at_friction(tire, math.exp(at)).weights for at in log_ratios])
        chi_squares = judge.chi_squares(tire, weights, samples)
        total = np.array([chi_square.total for chi_square in chi_squares])
        return total / scale + ((log_ratios - center) / _PRIOR_SD) ** 2, chi_squares

    grid = np.linspace(least, most, _GRID)
    cost, _ = costs(grid)
    around = grid[int(np.argmin(cost))] + (grid[1] - grid[0]) * np.linspace(-1.0, 1.0, _GRID)
    fine = np.append(np.clip(around, least, most)[:-1], center)  # what is known, too
    cost, chi_squares = costs(fine)
    best = int(np.argmin(cost))
    ratio = math.exp(fine[best])
    gain = float(cost[-1] - cost[best])
    return _FrictionFit(ratio, at_friction(tire, ratio), chi_squares[best], gain)


class Road(NamedTuple):
    """The estimate of the road's friction.

    base : the tire as it was learnt.   ratio : friction over that of the base, at most 1 [-].
    changed_at : when it last changed for good [s].   before : the base before friction was lost,
    where another one was learnt since: that road may come back.
    """

    base: PredictionTire
    ratio: float = 1.0
    changed_at: float = -math.inf
    before: PredictionTire | None = None

    def on(self, learnt: PredictionTire) -> "Road":
        """Return the same road where another tire was learnt on it."""
        before = self.base if self.before is None and self.ratio < 1.0 else self.before
        return Road(learnt, 1.0, self.changed_at, before)


class Change(NamedTuple):
    """Another estimate, how it was found, and chi-squares before and after [-]."""

    verdict: Verdict
    road: Road
    tire: PredictionTire
    before: float
    after: float

    @property
    def reason(self) -> str:
        return (
            f"{self.road.ratio:.2f} of the identified friction: chi-square {self.before:.0f} -> "
            f"{self.after:.0f}"
        )


def look_at_road(
    road: Road,
    in_use: PredictionTire,
    window: Window,
    *,
    t: float,
    baseline: float,
    trusted: float,
    judge: Judge,
    rules: Rules,
    moments: ChiSquare | None = None,
) -> Change | None:
    """Return what changed about the friction of the road, or None.

    A drop shows in the last moments, which another friction must explain well, not only better.
    What was found is corrected as more is seen, however well it fits, and a friction that comes
    back is believed when it lasts. Above the friction that the base was learnt on, a new number
    would be extrapolation: that is left to learning.

    t : time [s].
    baseline : mean chi-square of the tire in use where the road does not change [-].
    trusted : slip up to which a tire must be one [rad].
    moments : chi-square of the tire in use in the last moments; None computes it.
    """
    if road.base.structure.at_friction(road.base.weights, 1.0) is None:
        return None

    def fit(
        seconds: float, least: float, most: float, *, wrong: float = 1.0
    ) -> tuple[_FrictionFit, ChiSquare] | None:
        if not least < most:
            return None
        samples = window.last(judge.lookback(seconds))
        known = moments if seconds == rules.last_moments else None
        now = known or judge.chi_square(in_use, samples)
        if now.mean <= wrong * baseline:
            return None
        between = (least, most)
        found = fit_friction(
            judge, road.base, samples, known=road.ratio, between=between, scale=baseline
        )
        complaint = tire_complaint(found.tire, float(samples[-1, 0]), trusted)
        return None if complaint is not None else (found, now)

    def change(verdict: Verdict, found: _FrictionFit, now: ChiSquare, since: float) -> Change:
        estimate = road._replace(ratio=found.ratio, changed_at=since)
        return Change(verdict, estimate, found.tire, now.total, found.chi_square.total)

    drop = fit(rules.last_moments, _LEAST, road.ratio, wrong=rules.wrong)
    if drop is not None:
        found, now = drop
        good = found.chi_square.mean < min(rules.wrong * baseline, 0.5 * now.mean)
        if good and found.gain >= rules.friction_evidence:
            return change(Verdict.FRICTION, found, now, t)
    since = t - road.changed_at
    if since <= rules.follow:
        better = fit(rules.last_moments + since, _LEAST, 1.0, wrong=0.0)
        if better is not None and better[0].gain >= rules.correction:
            return change(Verdict.CORRECTION, *better, road.changed_at)
    elif window.duration >= judge.lookback(rules.recovery_seconds):
        back = fit(rules.recovery_seconds, road.ratio, 1.0)
        if back is not None and back[0].gain >= rules.recovery_evidence:
            return change(Verdict.RECOVERY, *back, t)
        if (before := road.before) is not None:  # where that explains more again
            weights = np.stack([in_use.weights, before.weights])
            samples = window.last(judge.lookback(rules.recovery_seconds))
            now, then = judge.chi_squares(in_use, weights, samples)
            if now.mean > baseline and now.total - then.total >= rules.recovery_evidence * baseline:
                estimate = Road(before, changed_at=t)
                return Change(Verdict.RECOVERY, estimate, before, now.total, then.total)
    return None


class Look(NamedTuple):
    """What a look at the road found.

    now : chi-square of the tire in use in the last moments.   change : what is known from now on.
    suspected : whether a loss showed that the next look has to confirm.
    """

    now: ChiSquare
    change: Change | None
    suspected: bool


class RoadWatch:
    """Looks at the road now and then, and remembers what it found.

    Attributes: road; baseline, the mean chi-square of the tire in use where the road does not
    change [-].
    base : the tire as it was learnt.
    """

    def __init__(self, base: PredictionTire, rules: Rules) -> None:
        self.road, self.baseline = Road(base), 1.0
        self._rules, self._suspected_at = rules, -math.inf

    def look(
        self, judge: Judge, in_use: PredictionTire, window: Window, t: float, trusted: float
    ) -> Look:
        """Take a look: a loss counts where two in a row show it, one in a turn-in may err.

        window : of samples that last for the last moments.   t : time [s].
        trusted : slip up to which a tire must be one [rad].
        """
        rules = self._rules
        now = judge.chi_square(in_use, window.last(judge.lookback(rules.last_moments)))
        change = look_at_road(
            self.road, in_use, window, t=t, baseline=self.baseline, trusted=trusted, judge=judge,
            rules=rules, moments=now,
        )  # fmt: skip
        if change is not None and change.verdict is Verdict.FRICTION:
            again, self._suspected_at = t - self._suspected_at < 1.5 * rules.every, t
            if not again:
                return Look(now, None, True)
        if change is not None:
            self.road = change.road
            return Look(now, change, False)
        share = rules.every / rules.baseline_time
        rise = min(now.mean, 4.0 * self.baseline) - self.baseline  # shall not follow a change
        self.baseline = max(1.0, self.baseline + share * rise)
        return Look(now, None, False)
