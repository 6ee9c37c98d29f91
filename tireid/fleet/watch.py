"""Which car's tires changed, when, and to what they are likely due: with a false-alarm rate.

The parts of a car's logs stand in the order of time. The first of them are its baseline, one merged
model; of each later part z = [ln C front, ln C rear, ln of the friction] says how its tires differ
from it, errors of its sensors left out (`_change_from`). Under no change z ~ N(0, S + T): S is what
the part leaves open, T how parts of an unchanged car differ (roads, speeds, curves that are not the
tire's): the median of squared deviations in the car's own baseline, held by the fleet's.

A change by δ is looked for by a cumulative sum of log-likelihood ratios (E. S. Page, Biometrika 41,
1954), both ways, for the stiffness of each axle and the friction of both:

    g⁺ = min(h, max(0, g + ℓ)),   ℓ = δ (z - δ/2)/(S + T),   alarm where g reaches h

and ends where g is back at zero. Between false alarms lie at least exp(h) parts on average (G.
Lorden, Annals of Mathematical Statistics 42, 1971), so that h follows from how many are accepted.
A part adds at most its share of `CHOSEN.least` of driving: no sensor that fails for a few minutes
alarms.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.estimate.information import PLACE, SIZE, Information, coordinates
from identifier.estimate.priors import SENSORS, Priors
from identifier.estimate.solve import settled
from identifier.motion.parameters import INDEX
from models.vehicle import Vehicle
from tireid.fleet.chosen import CHOSEN
from tireid.fleet.merge import day_of, errors_of, grouped
from tireid.fleet.store import LogRow

_CHANGED = [INDEX[name] for name in ("ln_stiffness_f", "ln_stiffness_r", "ln_road")]
TITLES = ("stiffness of the front axle", "stiffness of the rear axle", "friction of both axles")


@dataclass(frozen=True, slots=True, kw_only=True)
class Watching:
    """What is looked for, and how many false alarms are accepted.

    baseline : learning of a car that its baseline takes [s].
    false_alarms : in a thousand hours of learning, of all statistics of a car together.
    stiffness, friction : change of ln C and of ln μ that is looked for, δ [-].
    """

    baseline: float = 1200.0
    false_alarms: float = 1.0
    stiffness: float = 0.07
    friction: float = 0.25

    def __post_init__(self) -> None:
        for name in ("baseline", "false_alarms", "stiffness", "friction"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, it is {value}")

    def threshold(self, part: float) -> float:
        """Return h.

        part : learning of a part, on average [s].
        """
        statistics = 2.0 * len(TITLES)
        parts = 3.6e6 / max(part, 1.0) / self.false_alarms
        return math.log(max(statistics * parts, math.e))


class _Part(NamedTuple):
    """A part of a log: its log, when it began, and its information on the tires."""

    log: str
    date: str
    begin: float
    information: Information


class Seen(NamedTuple):
    """What the parts of a car say after its baseline, k of them.

    parts : in the order of time.   z (k, 3), variance (k, 3) of the statistics in `TITLES`.
    driven (k,) : learning since the baseline, up to and with each part [s].
    sums (k, 2, 3) : g of a rise and of a fall.   h : the threshold.
    """

    parts: tuple[_Part, ...]
    z: Array
    variance: Array
    driven: Array
    sums: Array
    h: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """A change that was noticed.

    statistic : index of `TITLES`.
    after : learning from the baseline to the alarm [s].
    change : of all statistics since it began, ln, (3,) [-].
    sd : of these (3,) [-].
    distance : of the posteriors before and after, in standard deviations [-].
    abrupt : whether it came in a step.
    ended : log in which it was over; empty where it lasts.
    """

    car: str
    statistic: int
    began: str
    log: str
    date: str
    after: float
    change: tuple[float, ...]
    sd: tuple[float, ...]
    distance: float
    abrupt: bool
    ended: str = ""

    @property
    def cause(self) -> str:
        front, rear, friction = self.change
        clear = [abs(value) > 3.0 * sd for value, sd in zip(self.change, self.sd, strict=True)]
        softer = min(front, rear)
        if self.statistic == 2 and friction < 0.0:
            return "wet or slippery road" if abs(softer) < -0.5 * friction else "other tires"
        if clear[0] and clear[1] and abs(front - rear) < 0.3 * max(abs(front), abs(rear)):
            return (
                "both axles alike: other tires, or another load"
                if self.abrupt
                else "both axles alike: wear, or tire pressure"
            )
        return "other tires or a loss of pressure" if self.abrupt else "wear, or a slow leak"

    @property
    def line(self) -> str:
        percent = 100.0 * math.expm1(self.change[self.statistic])
        sd = 100.0 * self.sd[self.statistic]
        when = f"; over since {self.ended}" if self.ended else ""
        return (
            f"{self.car}: {TITLES[self.statistic]} {percent:+.0f} % (sd {sd:.0f} %) since "
            f"{self.began}, {'in a step' if self.abrupt else 'slowly'}, noticed at {self.log} "
            f"after {self.after / 60.0:.0f} min of learning: {self.cause}{when}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the alarm as plain numbers and words, ready for JSON."""
        return {
            "car": self.car,
            "what": TITLES[self.statistic],
            "change": math.expm1(self.change[self.statistic]),
            "changes_ln": list(self.change),
            "sd_ln": list(self.sd),
            "distance_sd": self.distance,
            "abrupt": self.abrupt,
            "likely": self.cause,
            "began": self.began,
            "noticed": self.log,
            "date": self.date,
            "learning_s": self.after,
            "over_since": self.ended or None,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """What was seen of a fleet.

    alarms : in the order of cars and time.
    """

    alarms: tuple[Alarm, ...]
    seen: dict[str, Seen]
    short: tuple[str, ...]

    @property
    def hours(self) -> float:
        """Learning after baselines, of all cars [h]."""
        return sum(float(one.driven[-1]) for one in self.seen.values()) / 3600.0


def watch(rows: Iterable[LogRow], by: Sequence[str], watching: Watching) -> Watch:
    """Return which cars' tires changed.

    by : what keeps cars, or their sets of tires, apart.
    """
    cars: dict[str, Vehicle] = {}
    parts: dict[str, list[_Part]] = {}
    for key, row in grouped(rows, by):
        name = " ".join(value or "-" for _, value in key) or "all"
        cars.setdefault(name, row.declared_car)
        parts.setdefault(name, []).extend(_parts_of(row))
    compared = {
        name: _against_baseline(sorted(some, key=_when), cars[name], watching)
        for name, some in sorted(parts.items())
    }
    there = {name: one for name, one in compared.items() if one is not None}
    short = tuple(name for name, one in compared.items() if one is None)
    scatter = [one.scatter for one in there.values() if len(one.baseline) > 2]
    fleet = np.median(scatter, axis=0) if scatter else np.zeros(3)
    seen: dict[str, Seen] = {}
    alarms: list[Alarm] = []
    for name, one in there.items():
        seen[name] = _summed(one, fleet, watching)
        alarms += _alarms(name, seen[name])
    return Watch(alarms=tuple(alarms), seen=seen, short=short)


class _Compared(NamedTuple):
    """Parts of a car against its baseline: z and S (k, 3), which of them are the baseline."""

    parts: tuple[_Part, ...]
    z: Array
    S: Array
    baseline: list[int]

    @property
    def scatter(self) -> Array:
        """Median squared deviation within the baseline, as a variance (3,)."""
        z = self.z[self.baseline]
        return np.asarray(
            (CHOSEN.normal * np.median(np.abs(z - np.median(z, axis=0)), axis=0)) ** 2
        )


def _parts_of(row: LogRow) -> list[_Part]:
    day_of(row)
    return [
        _Part(row.name, row.date, begin, given)
        for begin, given in zip(row.part_begin, row.parts, strict=True)
        if given.seconds >= CHOSEN.shortest
    ]


def _when(part: _Part) -> tuple[str, str, float]:
    return part.date, part.log, part.begin


def _against_baseline(
    parts: Sequence[_Part], vehicle: Vehicle, watching: Watching
) -> _Compared | None:
    """Return the parts of a car against its baseline; None where there are none after it."""
    learnt = np.cumsum([one.information.seconds for one in parts])
    count = int(np.searchsorted(learnt, watching.baseline)) + 1
    if count >= len(parts):
        return None
    beliefs, given = Priors.of(vehicle), Information.nothing()
    for one in parts[:count]:
        given += one.information.loosened(*errors_of(beliefs))
    p, _ = settled(beliefs.after(given), beliefs.mean)
    changes = [_change_from(one.information, p, beliefs) for one in parts]
    z, S = (np.array(each) for each in zip(*changes, strict=True))
    return _Compared(tuple(parts), z, S, list(range(count)))


def _change_from(given: Information, p: Array, beliefs: Priors) -> tuple[Array, Array]:
    """Return ln of both stiffnesses and of the friction over a car's, and variances, (3,) each.

    Sensors may be off otherwise than when the car was learnt: that is estimated beside it.

    p : parameters of the car (p,).
    """
    u, slopes = coordinates(p)
    sensors = np.zeros((SIZE, len(SENSORS)))
    sensors[[PLACE[name] for name in SENSORS], np.arange(len(SENSORS))] = 1.0
    along = np.hstack([slopes[:, _CHANGED], sensors])
    sd = np.array(
        [*(CHOSEN.largest for _ in _CHANGED), *(beliefs.sd[INDEX[name]] for name in SENSORS)]
    )
    P = np.linalg.inv(along.T @ given.matrix @ along + np.diag(sd**-2.0))
    value = P @ (along.T @ (given.vector - given.matrix @ u))
    return value[: len(_CHANGED)], np.diag(P)[: len(_CHANGED)]


def _summed(one: _Compared, fleet: Array, watching: Watching) -> Seen:
    """Return the cumulative sums of a car's parts after its baseline."""
    count = len(one.baseline)
    floor = np.array([CHOSEN.floor, CHOSEN.floor, CHOSEN.floor_friction]) ** 2
    T = np.maximum(
        (CHOSEN.scatter_parts * fleet + count * one.scatter) / (CHOSEN.scatter_parts + count), floor
    )
    usual = np.median(one.z[one.baseline], axis=0)
    z, variance = one.z[count:] - usual, one.S[count:] + T
    seconds = np.array([part.information.seconds for part in one.parts[count:]])
    h = watching.threshold(float(seconds.mean()))
    delta = np.array([watching.stiffness, watching.stiffness, watching.friction])
    sums, g = np.zeros((len(z), 2, 3)), np.zeros((2, 3))
    for k in range(len(z)):
        most = h * seconds[k] / CHOSEN.least
        ratio = (
            np.stack([delta * (z[k] - 0.5 * delta), -delta * (z[k] + 0.5 * delta)]) / variance[k]
        )
        g = np.clip(g + np.clip(ratio, -most, most), 0.0, h)
        sums[k] = g
    return Seen(one.parts[count:], z, variance, np.cumsum(seconds), sums, h)


def _alarms(car: str, seen: Seen) -> list[Alarm]:
    """Return the alarms of a car, each from where its sum left zero to where it is back there."""
    found = []
    for way in (0, 1):
        for statistic in range(len(TITLES)):
            g = seen.sums[:, way, statistic]
            first = 0
            for k, value in enumerate(g):
                if value <= 0.0:
                    first = k + 1
                elif value >= seen.h * (1.0 - 1e-12) and not _lasts(g, first, k, seen.h):
                    found.append(_alarm(car, seen, statistic, first, k, g))
    return sorted(found, key=lambda alarm: (alarm.after, alarm.statistic))


def _lasts(g: Array, first: int, k: int, h: float) -> bool:
    return bool((g[first:k] >= h * (1.0 - 1e-12)).any())


def _alarm(car: str, seen: Seen, statistic: int, first: int, k: int, g: Array) -> Alarm:
    inside = slice(first, k + 1)
    weights = 1.0 / seen.variance[inside]
    change = (weights * seen.z[inside]).sum(axis=0) / weights.sum(axis=0)
    sd = np.sqrt(1.0 / weights.sum(axis=0))
    over = np.flatnonzero(g[k:] <= 0.0)
    return Alarm(
        car=car,
        statistic=statistic,
        began=seen.parts[first].log,
        log=seen.parts[k].log,
        date=seen.parts[k].date,
        after=float(seen.driven[k]),
        change=tuple(float(value) for value in change),
        sd=tuple(float(value) for value in sd),
        distance=float(np.sqrt(np.sum((change / sd) ** 2))),
        abrupt=_abrupt(seen.z[: k + 1, statistic], first),
        ended=seen.parts[k + int(over[0])].log if over.size else "",
    )


def _abrupt(z: Array, first: int) -> bool:
    """Return whether values follow a step at `first` rather than a line that rises from zero."""
    t = np.arange(1.0, len(z) + 1.0)
    step = z - np.where(np.arange(len(z)) >= first, z[first:].mean(), 0.0)
    ramp = z - t * (t @ z) / (t @ t)
    return bool(step @ step <= ramp @ ramp)
