"""Whether a car's tires changed: one number for each car and day.

The first days of a car, until they hold `baseline` of driving, are its reference, one merged
estimate. z = [ln C front, ln C rear, ln of the friction] of a later day says how its tires differ
from that, errors of the day's sensors left out (`_change_from`). The number of the day is

    x² = z' (S_day + S_reference + T + T/m)⁻¹ z,   p = P(χ²(3) > x²),   alarm where p < `alarm`

S are the covariances of both estimates, m is how many days the reference has. T, diagonal, is how
days of an unchanged car differ (roads, speeds, curves that are not the tire's): half the median
square of the steps from a day to the next of all cars, less S_day, where `USUAL` counts as ten such
steps. A change of the tires is one step of many, a slow loss makes each step small: neither hides
in T.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.estimate.information import PLACE, SIZE, Information, coordinates
from identifier.estimate.priors import SENSORS, Priors
from identifier.estimate.solve import settled
from identifier.motion.parameters import INDEX
from tireid.fleet.merge import day_of, errors_of, grouped, name_of
from tireid.fleet.store import LogRow

BASELINE = 1200.0  # [s] of driving, from which on a stiffness is known to a few percent
ALARM = 1e-4  # probability of a false alarm, for each car and day
SHORTEST = 60.0  # [s] of driving, below which a day is not judged
LARGEST = 0.5  # standard deviation of ln C and ln friction that is believed before
USUAL = np.array([0.02, 0.02, 0.05])  # standard deviation of z from day to day that counts as
USUAL_STEPS = 10.0  # steps
MEDIAN = 0.455  # of χ² of one degree of freedom
CHANGED = [INDEX[name] for name in ("ln_stiffness_f", "ln_stiffness_r", "ln_road")]


class Day(NamedTuple):
    """A car's day against its reference.

    seconds : of driving that counts [s].
    change : ln of both stiffnesses and of the friction over the reference (3,) [-].
    sd : of these, with the difference of days (3,) [-].
    """

    car: str
    day: str
    seconds: float
    change: tuple[float, ...]
    sd: tuple[float, ...]
    chi_square: float
    p: float
    alarm: bool

    @property
    def line(self) -> str:
        words = ", ".join(
            f"{what} {100.0 * math.expm1(change):+.0f} % (sd {100.0 * sd:.0f} %)"
            for what, change, sd in zip(
                ("stiffness front", "rear", "friction"), self.change, self.sd, strict=True
            )
        )
        return f"{self.car}, {self.day}: {words}; chi-square {self.chi_square:.1f}, p {self.p:.1g}"


def watch(
    rows: Iterable[LogRow], by: Sequence[str], *, baseline: float = BASELINE, alarm: float = ALARM
) -> tuple[list[Day], list[str]]:
    """Return each car's days against its reference, and the cars that have no such day yet.

    by : what keeps cars, or their sets of tires, apart.
    baseline : driving of a car that is its reference [s].
    alarm : p below which a day is an alarm.
    """
    if not (baseline > 0.0 and 0.0 < alarm < 1.0):
        raise ValueError(
            f"baseline must be positive and alarm between 0 and 1, not {baseline:g} and {alarm:g}"
        )
    from scipy.special import chdtrc  # which the other tasks do without

    beliefs: dict[str, Priors] = {}
    driven: dict[str, dict[str, Information]] = {}
    for key, row in grouped(rows, by):
        car, day = name_of(key), str(day_of(row))
        if car not in beliefs:
            beliefs[car], driven[car] = Priors.of(row.declared_car), {}
        one = row.learnt()[0].of_one_day(errors_of(beliefs[car]))
        driven[car][day] = driven[car].get(day, Information.nothing()) + one
    compared = {car: _compared(driven[car], beliefs[car], baseline) for car in sorted(driven)}
    T = _scatter(list(compared.values()))
    days = []
    for car, some in compared.items():
        for day, z, S_day, S_reference, m in some:
            S = S_day + S_reference + T + T / m
            x2, sd = float(z @ np.linalg.solve(S, z)), np.sqrt(np.diag(S)).tolist()
            p, seconds = float(chdtrc(3, x2)), driven[car][day].seconds
            days.append(Day(car, day, seconds, tuple(z.tolist()), tuple(sd), x2, p, p < alarm))
    return days, [car for car, some in compared.items() if not some]


_Compared = list[tuple[str, Array, Array, Array, int]]  # days with z, S_day, S_reference and m


def _compared(days: Mapping[str, Information], beliefs: Priors, baseline: float) -> _Compared:
    """Return the days after the reference."""
    reference, later = Information.nothing(), _Compared()
    p, S_reference, m = beliefs.mean, np.zeros((3, 3)), 0
    for day, information in sorted(days.items()):
        if reference.seconds < baseline:
            reference, m = reference + information, m + 1
            p = settled(beliefs.after(reference), beliefs.mean)[0]
            S_reference = _change_from(reference, p, beliefs)[1]
        elif information.seconds >= SHORTEST:
            z, S_day = _change_from(information, p, beliefs)
            later.append((day, z, S_day, S_reference, m))
    return later


def _change_from(given: Information, p: Array, beliefs: Priors) -> tuple[Array, Array]:
    """Return z (3,) over a car's parameters p, and its covariance (3, 3).

    Sensors may be off otherwise than when the car was learnt: that is estimated beside it.
    """
    u, slopes = coordinates(p)
    sensors = np.zeros((SIZE, len(SENSORS)))
    sensors[[PLACE[name] for name in SENSORS], np.arange(len(SENSORS))] = 1.0
    along = np.hstack([slopes[:, CHANGED], sensors])
    sd = np.array([LARGEST] * 3 + [beliefs.sd[INDEX[name]] for name in SENSORS])
    known = along.T @ given.matrix @ along + np.diag(sd**-2.0)
    P = np.asarray(np.linalg.inv(known), dtype=np.float64)
    value = P @ (along.T @ (given.vector - given.matrix @ u))
    return value[:3], P[:3, :3]


def _scatter(cars: Sequence[_Compared]) -> Array:
    """Return T (3, 3)."""
    steps = [(late[1] - early[1]) ** 2 for days in cars for early, late in pairwise(days)]
    known = [np.diag(day[2]) for days in cars for day in days]
    found = np.zeros(3)
    if steps:
        found = np.maximum(np.median(steps, axis=0) / MEDIAN / 2.0 - np.median(known, axis=0), 0.0)
    return np.diag((USUAL_STEPS * USUAL**2 + len(steps) * found) / (USUAL_STEPS + len(steps)))
