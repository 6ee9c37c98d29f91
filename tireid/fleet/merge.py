"""One model of many logs, and of many cars where the next one starts.

The information of logs adds up (`identifier.estimate.information`). The model of a group is the
optimum of their sum and the prior of its car, counted once. Sensors are those of the car, in each
log off by an error of its own (`CHOSEN.apart` of their prior). Where the evidence of a log asks for
another friction, by `ESTIMATE_CHOSEN.price` as inside a log, its friction is its own.

Cars of a fleet differ: θ_v ~ N(m, T) of each car v, of which its logs give θ̂_v with covariance P_v.
m and T are found by expectation and maximization (N. Laird and J. Ware, Biometrics 38, 1982), both
held by the prior of the estimate: m ~ N(m₀, S₀), T as by `CHOSEN.worth` more cars. Where the next
car starts is m, as sure as N(m, T + M), M = (V/T + 1/S₀)⁻¹.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from identifier.estimate.chosen import CHOSEN as ESTIMATE_CHOSEN
from identifier.estimate.fit import Reach
from identifier.estimate.information import PLACE, SIZE, Information, coordinates
from identifier.estimate.model import FittedModel
from identifier.estimate.priors import OF_AXLES, SENSORS, Priors
from identifier.estimate.solve import settled
from identifier.motion.parameters import INDEX, NAMES
from models.vehicle import Vehicle
from tireid.fleet.chosen import CHOSEN
from tireid.fleet.store import INDEX as WHICH
from tireid.fleet.store import MOVING, LogRow

_TAGGED = ("vehicle", "tires", "date")
BY = (*_TAGGED, "week", "month", "log", "setting")
_INFORMATION = ("reach", "part_begin", "part_seconds", "matrix", "vector")
COLUMNS = (
    *WHICH,
    *_TAGGED,
    "tags",
    "valid",
    "car",
    *_INFORMATION,
)  # of a row, that are asked for here
_CHANGES = ("steering_zero", "v_y_bias", "v_y_angle")  # of sensors, from log to log
_TIRES = [INDEX[name] for name in MOVING if name not in SENSORS]
_OFF = [INDEX[name] for name in SENSORS]
_ROAD = INDEX["ln_road"]
_Key = tuple[tuple[str, str], ...]


class MergeError(TireidError, ValueError):
    """Rows do not make a model together; the message says which, and what to do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Merged:
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
        """The group in a word: values of its key."""
        return " ".join(value or "-" for _, value in self.key) or "all"


def _key_of(row: LogRow, by: Sequence[str]) -> _Key:
    """Return what a log belongs to.

    by : names of `BY` or of tags.
    """
    return tuple((name, _value(row, name)) for name in by)


def _value(row: LogRow, name: str) -> str:
    if name in ("week", "month"):
        day = day_of(row)
        year, week, _ = day.isocalendar()
        return f"{year}-W{week:02d}" if name == "week" else f"{day:%Y-%m}"
    if name in (*_TAGGED, "log", "setting"):
        return str(getattr(row, name))
    tags = json.loads(row.tags)
    if name not in tags:
        known = ", ".join(dict.fromkeys((*BY, *sorted(tags))))
        raise MergeError(f"{row.name}: {name!r} is none of what is known of it: {known}")
    return str(tags[name])


def day_of(row: LogRow) -> date:
    try:
        return date.fromisoformat(row.date[:10])
    except ValueError:
        raise MergeError(
            f"{row.name}: its date {row.date!r} must begin with year-month-day, as in 2026-03-31"
        ) from None


def usable(row: LogRow, *, refused: bool = False) -> bool:
    """Return whether a model can be made of a row.

    refused : also where the verdict refuses its answer.
    """
    return bool(not row.error and row.part_begin and (refused or row.valid is not False))


def grouped(rows: Iterable[LogRow], by: Sequence[str]) -> Iterator[tuple[_Key, LogRow]]:
    """Yield rows with what they belong to.

    by : names of `BY` or of tags.
    """
    cars: dict[_Key, tuple[str, str]] = {}
    settings: dict[tuple[object, ...], str] = {}
    for row in rows:
        key = _key_of(row, by)
        car, first = cars.setdefault(key, (row.car, row.name))
        if car != row.car:
            raise MergeError(
                f"{first} and {row.name} are of cars whose files differ: merge --by vehicle (or "
                "declare it by --tags), or --by setting; fleet prior is for many cars"
            )
        setting = settings.setdefault((key, *row.key[:2]), row.setting)
        if setting != row.setting:
            raise MergeError(
                f"{row.name} has rows of two settings, {setting} and {row.setting}, and would "
                "count twice: merge --by setting, choose one by --where, or keep the newest by "
                "fleet learn --replace"
            )
        yield key, row


def merge(rows: Callable[[], Iterable[LogRow]], by: Sequence[str]) -> list[Merged]:
    """Return the model of each group of logs, by its key; rows are held one at a time.

    rows : yields them, three times: the sum of all shows on which road each was, and most.
    by : what the logs of a group have in common; empty merges all.
    """
    sums: dict[_Key, _Sum] = {}
    for _ in range(CHOSEN.rounds):
        for key, row in grouped(rows(), by):
            if key not in sums:
                sums[key] = _Sum(row.declared_car)
            sums[key].add(row)
        for one in sums.values():
            one.end_round()
    return [one.merged(key) for key, one in sorted(sums.items(), key=lambda item: item[0])]


class _Sum:
    """The information of the logs of a group, in three rounds.

    At the optimum of all on one road (round 1) the friction of each part over it is found (2);
    their median is the road of the curves, and parts far from it have a friction of their own (3).
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle, self.beliefs = vehicle, Priors.of(vehicle)
        self.errors = errors_of(self.beliefs)
        self.at: tuple[Array, Array] | None = None
        self.ln_m: list[float] = []
        self.road: float | None = None
        self._begin_round()

    def _begin_round(self) -> None:
        self.logs = self.elsewhere = 0
        self.information, self.reach = Information.nothing(), Reach()

    def end_round(self) -> None:
        """Go on to the next round; the last one stays."""
        if self.at is None:
            self.at = coordinates(self.settled()[0])
            self._begin_round()
        elif self.road is None:
            self.road = float(np.median(self.ln_m))
            self._begin_round()

    def add(self, row: LogRow) -> None:
        before = self.elsewhere
        for part in row.parts:
            one = part.loosened(*self.errors)
            own = self._on_its_road(one)
            if own is not one:
                self.elsewhere = before + 1
            self.information += own
        slip, speeds, a_x, unexplained = row.numbers("reach", 4, 2)
        seconds = float(sum(row.part_seconds))
        self.reach = self.reach.with_(Reach(slip, speeds, a_x, seconds * unexplained**2, seconds))
        self.logs += 1

    def _on_its_road(self, one: Information) -> Information:
        """Return the information of a part, its friction its own where the evidence asks for it."""
        if self.at is None:
            return one
        u, slopes = self.at
        along = slopes[:, _ROAD]
        known = along @ one.matrix @ along + ESTIMATE_CHOSEN.another_road**-2
        ln_m = float(along @ (one.vector - one.matrix @ u) / known)
        if self.road is None:
            self.ln_m.append(ln_m)
            return one
        away = ln_m - self.road
        if (
            abs(away) < ESTIMATE_CHOSEN.least_change
            or 0.5 * known * away**2 < ESTIMATE_CHOSEN.price
        ):
            return one
        return one.loosened(along[:, None], np.array([ESTIMATE_CHOSEN.another_road]))

    def settled(self) -> tuple[Array, Array]:
        """Return the optimum and its covariance, as of `settled`."""
        return settled(self.beliefs.after(self.information), self.beliefs.mean)

    def merged(self, key: _Key) -> Merged:
        p, covariance = self.settled()
        of_next = [INDEX[name] for name in _CHANGES]  # its sensors are off by an error of its own
        covariance[of_next, of_next] += self.errors[1] ** 2
        model = _model(self.vehicle, p, covariance, self.reach)
        return Merged(
            key=key,
            logs=self.logs,
            elsewhere=self.elsewhere,
            information=self.information,
            model=model,
        )


def errors_of(beliefs: Priors) -> tuple[Array, Array]:
    """Return along what in u sensors change from log to log (m, k), and by how much (k,)."""
    along = np.zeros((SIZE, len(_CHANGES)))
    for k, name in enumerate(_CHANGES):
        along[PLACE[name], k] = 1.0
    return along, CHOSEN.apart * beliefs.sd[[INDEX[name] for name in _CHANGES]]


# Where the next car starts.


@dataclass(frozen=True, slots=True, kw_only=True)
class _FleetPrior:
    """What cars of a fleet have in common, and how they differ.

    mean : m of `_TIRES`, lengths in wheelbases (q,).
    spread : T + M (q, q).
    cars : V.
    reach : of all their drives.
    """

    mean: Array
    spread: Array
    cars: int
    reach: Reach

    def model(self, vehicle: Vehicle) -> FittedModel:
        """Return where a car starts: a model that `tireid identify --weights` begins with.

        vehicle : the car; its cornering stiffness is not looked at.
        """
        usual, size = Priors.of(vehicle), sizes(vehicle)
        p, covariance = usual.mean.copy(), usual.covariance
        p[_TIRES] = self.mean * size
        covariance[np.ix_(_TIRES, _TIRES)] = self.spread * np.outer(size, size)
        return _model(vehicle, np.clip(p, usual.low, usual.high), covariance, self.reach)


def _model(vehicle: Vehicle, p: Array, covariance: Array, reach: Reach) -> FittedModel:
    found: Any = {"driven": reach.slip, "speeds": reach.speeds, "a_x": reach.a_x}
    found |= {"p": p, "covariance": covariance, "unexplained": reach.unexplained}
    return FittedModel(vehicle=vehicle, **found)


def sizes(vehicle: Vehicle) -> Array:
    """Return what `_TIRES` of a car are measured in: lengths in wheelbases, (q,)."""
    lengths = {
        f"{name}_{axle}" for name, one in OF_AXLES.items() for axle in "fr" if one.per == "L"
    }
    return np.array([vehicle.wheelbase if NAMES[k] in lengths else 1.0 for k in _TIRES])


def fleet_prior(cars: Sequence[Merged]) -> _FleetPrior:
    """Return what many cars have in common."""
    if not cars:
        raise MergeError("no log of the store can be used: nothing is known of where a car starts")
    listed = [_of_size(one) for one in cars]
    m0, S0 = (np.mean([one[k] for one in listed], axis=0) for k in (0, 1))
    m, T, V = m0, S0, len(listed)
    held = np.linalg.inv(S0)
    matrices, vectors = (np.array([one[k] for one in listed]) for k in (2, 3))
    for _ in range(CHOSEN.passes):
        between = np.linalg.inv(T)
        P = np.linalg.inv(between + matrices)
        means = np.einsum("vij,vj->vi", P, between @ m + vectors)
        M = np.linalg.inv(V * between + held)
        m = M @ (between @ means.sum(axis=0) + held @ m0)
        T = (CHOSEN.worth * S0 + (means - m).T @ (means - m) + P.sum(axis=0)) / (CHOSEN.worth + V)
    reach = Reach()
    for one in cars:
        model = one.model
        squares = model.unexplained**2
        reach = reach.with_(Reach(model.driven, model.speeds, model.a_x, squares, 1.0))
    return _FleetPrior(mean=m, spread=T + M, cars=V, reach=reach)


def _of_size(one: Merged) -> tuple[Array, Array, Array, Array]:
    """Return prior mean and covariance of a car's `_TIRES`, and matrix and vector of its logs.

    All over its size; of the sensors the logs' information is marginal.
    """
    model = one.model
    usual, size = Priors.of(model.vehicle), sizes(model.vehicle)
    _, slope, H = one.information.around(model.p)
    known = H[np.ix_(_OFF, _OFF)] + usual.information[np.ix_(_OFF, _OFF)]
    across = H[np.ix_(_TIRES, _OFF)]
    matrix = H[np.ix_(_TIRES, _TIRES)] - across @ np.linalg.solve(known, across.T)
    vector = matrix @ model.p[_TIRES] - slope[_TIRES]  # at the optimum of the sensors
    both = np.outer(size, size)
    covariance = usual.covariance[np.ix_(_TIRES, _TIRES)]
    return usual.mean[_TIRES] / size, covariance / both, matrix * both, vector * size
