"""One model of many logs: their information added up, and the prior of the car once.

The information of logs adds up (`identifier.estimate.information`). Sensors are those of the car,
in each log off by an error of its own (`APART` of their prior). Where the evidence of a log asks
for another friction, by `PRICE` as inside a log, its friction is its own.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import date
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.estimate.information import CHANGES, Information, coordinates
from identifier.estimate.model import FittedModel
from identifier.estimate.posterior import Reach
from identifier.estimate.priors import ANOTHER_ROAD, Priors
from identifier.estimate.roads import LEAST_CHANGE, PRICE
from identifier.estimate.solve import settled
from identifier.motion.parameters import INDEX
from models.vehicle import Vehicle
from tireid.fleet.store import INDEX as WHICH
from tireid.fleet.store import LogRow, StoreError

_TAGGED = ("vehicle", "tires", "date")
BY = (*_TAGGED, "week", "month", "log", "setting")
COLUMNS = (*WHICH, *_TAGGED, "tags", "valid", "car", "reach", "driven", "matrix", "vector")
APART = 1.0  # standard deviation of the zeros from log to log, of that of their prior
_ROAD = INDEX["ln_road"]
_Key = tuple[tuple[str, str], ...]


class Merged(NamedTuple):
    """What the logs of a group say together.

    key : what they have in common, by `BY` or tag.
    elsewhere : how many of them were driven on another road.
    """

    key: _Key
    logs: int
    elsewhere: int
    information: Information
    model: FittedModel

    @property
    def name(self) -> str:
        return name_of(self.key)


def name_of(key: _Key) -> str:
    """Return a group in a word: values of its key."""
    return " ".join(value or "-" for _, value in key) or "all"


def day_of(row: LogRow) -> date:
    try:
        return date.fromisoformat(row.date[:10])
    except ValueError:
        raise StoreError(
            f"{row.name}: its date {row.date!r} must begin with year-month-day, as in 2026-03-31"
        ) from None


def _value(row: LogRow, name: str) -> str:
    """Return what a row says of a name of `BY` or of a tag."""
    if name == "week":
        year, week, _ = day_of(row).isocalendar()
        return f"{year}-W{week:02d}"
    if name == "month":
        return f"{day_of(row):%Y-%m}"
    if name in BY:
        return str(getattr(row, name))
    tags = json.loads(row.tags)
    if name not in tags:
        known = ", ".join(dict.fromkeys((*BY, *sorted(tags))))
        raise StoreError(f"{row.name}: {name!r} is none of what is known of it: {known}")
    return str(tags[name])


def usable(row: LogRow, *, rejected: bool = False) -> bool:
    """Return whether a model can be made of a row.

    rejected : also where the verdict rejects its model.
    """
    return bool(not row.error and row.driven and (rejected or row.valid is not False))


def grouped(rows: Iterable[LogRow], by: Sequence[str]) -> Iterator[tuple[_Key, LogRow]]:
    """Yield rows with what they belong to; refuse what would count twice.

    by : names of `BY` or of tags.
    """
    cars: dict[_Key, tuple[str, str]] = {}
    files: dict[tuple[_Key, str, str], str] = {}
    for row in rows:
        key = tuple((name, _value(row, name)) for name in by)
        car, first = cars.setdefault(key, (row.car, row.name))
        if car != row.car:
            raise StoreError(
                f"{first} and {row.name} are of cars whose files differ: merge --by vehicle (or "
                "declare it by --tags), or --by setting"
            )
        for same in (row.content, row.log):
            file = files.setdefault((key, same, row.run), row.file)
            if file != row.file:
                raise StoreError(
                    f"{row.name} would count twice, by {file} and {row.file}: merge --by setting, "
                    "or delete one of these"
                )
        yield key, row


def merge(rows: Callable[[], Iterable[LogRow]], by: Sequence[str]) -> list[Merged]:
    """Return the model of each group of logs, by its key; rows are held one at a time.

    rows : yields them, three times: the optimum of all on one road (1) shows on which road each
        was (2), and logs far from the median road have a friction of their own (3).
    by : what the logs of a group have in common; empty merges all.
    """
    sums: dict[_Key, _Sum] = {}
    for begin_round in (_Sum.begin, _Sum.look_for_roads, _Sum.part_roads):
        for one in sums.values():
            begin_round(one)
        for key, row in grouped(rows(), by):
            if key not in sums:
                sums[key] = _Sum(row.declared_car)
            sums[key].add(row)
    return [one.merged(key) for key, one in sorted(sums.items(), key=lambda item: item[0])]


class _Sum:
    """The information of the logs of a group."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle, self.beliefs = vehicle, Priors.of(vehicle)
        self.errors = errors_of(self.beliefs)
        self.at: tuple[Array, Array] | None = None  # u and its slopes at the optimum of one road
        self.ln_m: list[float] = []  # friction of each log over that, ln
        self.road: float | None = None  # median of these, the road of the curves
        self.begin()

    def begin(self) -> None:
        self.logs = self.elsewhere = 0
        self.information, self.reach = Information.nothing(), Reach()

    def look_for_roads(self) -> None:
        self.at = coordinates(self._settled()[0])
        self.begin()

    def part_roads(self) -> None:
        self.road = float(np.median(self.ln_m))
        self.begin()

    def add(self, row: LogRow) -> None:
        one, (slip, speeds, a_x, unexplained) = row.learnt()
        one = one.of_one_day(self.errors)
        if self.at is not None:
            u, slopes = self.at
            along = slopes[:, _ROAD]
            known = along @ one.matrix @ along + ANOTHER_ROAD**-2
            ln_m = float(along @ (one.vector - one.matrix @ u) / known)
            if self.road is None:
                self.ln_m.append(ln_m)
            elif (
                abs(ln_m - self.road) >= LEAST_CHANGE
                and 0.5 * known * (ln_m - self.road) ** 2 >= PRICE
            ):
                one = one.loosened(along[:, None], np.array([ANOTHER_ROAD]))
                self.elsewhere += 1
        self.information += one
        seconds = one.seconds
        self.reach = self.reach.with_(Reach(slip, speeds, a_x, seconds * unexplained**2, seconds))
        self.logs += 1

    def _settled(self) -> tuple[Array, Array]:
        """Return the optimum and its covariance."""
        return settled(self.beliefs.after(self.information), self.beliefs.mean)

    def merged(self, key: _Key) -> Merged:
        p, covariance = self._settled()
        of_next = [INDEX[name] for name in CHANGES]  # its sensors are off by an error of its own
        covariance[of_next, of_next] += self.errors**2
        model = FittedModel(vehicle=self.vehicle, p=p, covariance=covariance, reach=self.reach)
        return Merged(key, self.logs, self.elsewhere, self.information, model)


def errors_of(beliefs: Priors) -> Array:
    """Return by how much sensors change from log to log, (3,)."""
    return APART * beliefs.sd[[INDEX[name] for name in CHANGES]]
