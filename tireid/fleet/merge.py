"""One model of many logs, and of many cars where the next one starts.

What logs tell adds up (`identifier.axle.information`): the model of a group is that of the sum,
with the prior of its car counted once. Cars of a fleet differ: θ_v ~ N(m, T) of each car v, of
which its logs tell θ̂_v with covariance P_v. m and T are found by expectation and maximization
(N. Laird and J. Ware, Biometrics 38, 1982), T begins at the prior of the identifier and is held by
it as by `WORTH` more cars. Where the next car starts is m, as sure as N(m, T + T/V).
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.curve import EDGES
from identifier.axle.information import Information, Total, merged, posterior, reference_of
from models.vehicle import Vehicle
from tireid.fleet.learn import DT
from tireid.fleet.store import INDEX, LogRow

TAGGED = ("vehicle", "tires", "date")
BY = (*TAGGED, "week", "month", "log", "setting")
TOLD = ("excitation", "part_begin", "part_seconds", "part_samples", "matrix", "vector", "square")
COLUMNS = (*INDEX, *TAGGED, "tags", "valid", "car", *TOLD)  # of a row, that are asked for here
PASSES = 60  # of expectation and maximization
WORTH = 2.0  # cars that the identifier's prior counts as


class MergeError(TireidError, ValueError):
    """Rows do not make a model together; the message says which, and what to do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Merged:
    """What the logs of a group say together.

    Parameters
    ----------
    key : what they have in common, by `BY` or tag.
    """

    key: tuple[tuple[str, str], ...]
    logs: int
    told: Information
    model: AxleModel

    @property
    def name(self) -> str:
        """The group in a word: values of its key."""
        return " ".join(value or "-" for _, value in self.key) or "all"

    @property
    def misfit(self) -> Array:
        """Mean squared error over what is told of it, (2,) [-]."""
        return self.told.misfit(np.hstack([self.model.W, self.model.own]))


def key_of(row: LogRow, by: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return what a log belongs to.

    Parameters
    ----------
    by : names of `BY` or of tags.

    Raises
    ------
    MergeError
        Where a name is neither, or a date is needed and cannot be read.
    """
    return tuple((name, _value(row, name)) for name in by)


def _value(row: LogRow, name: str) -> str:
    if name in ("week", "month"):
        day = day_of(row)
        year, week, _ = day.isocalendar()
        return f"{year}-W{week:02d}" if name == "week" else f"{day:%Y-%m}"
    if name in (*TAGGED, "log", "setting"):
        return str(getattr(row, name))
    tags = json.loads(row.tags)
    if name not in tags:
        known = ", ".join(dict.fromkeys((*BY, *sorted(tags))))
        raise MergeError(f"{row.name}: {name!r} is none of what is known of it: {known}")
    return str(tags[name])


def day_of(row: LogRow) -> date:
    """Return the day of a log.

    Raises
    ------
    MergeError
        Where its date is none of ISO 8601.
    """
    try:
        return date.fromisoformat(row.date[:10])
    except ValueError:
        raise MergeError(
            f"{row.name}: its date {row.date!r} must begin with year-month-day, as in 2026-03-31"
        ) from None


def usable(row: LogRow, *, refused: bool = False) -> bool:
    """Return whether a model can be made of a row.

    Parameters
    ----------
    refused : also where the verdict refuses its answer.
    """
    return bool(not row.error and row.part_begin and (refused or row.valid is not False))


def grouped(
    rows: Iterable[LogRow], by: Sequence[str]
) -> Iterator[tuple[tuple[tuple[str, str], ...], LogRow]]:
    """Yield rows with what they belong to.

    Parameters
    ----------
    by : names of `BY` or of tags.

    Raises
    ------
    MergeError
        Where the logs of a group are of several cars, or a log is in it twice, learnt with two
        settings.
    """
    cars: dict[tuple[tuple[str, str], ...], tuple[str, str]] = {}
    settings: dict[tuple[object, ...], str] = {}
    for row in rows:
        key = key_of(row, by)
        car, first = cars.setdefault(key, (row.car, row.name))
        if car != row.car:
            raise MergeError(
                f"{first} and {row.name} are of cars whose files differ: merge --by vehicle (or "
                "tell it by --tags), or --by setting; fleet prior is for many cars"
            )
        setting = settings.setdefault((key, *row.key[:2]), row.setting)
        if setting != row.setting:
            raise MergeError(
                f"{row.name} was learnt with two settings, {setting} and {row.setting}, and would "
                "count twice: merge --by setting, choose one by --where, or keep the newest by "
                "fleet learn --replace"
            )
        yield key, row


def merge(rows: Iterable[LogRow], by: Sequence[str]) -> list[Merged]:
    """Return the model of each group of logs, by its key; rows are held one at a time.

    Parameters
    ----------
    by : what the logs of a group have in common; empty merges all.

    Raises
    ------
    MergeError
        As of `grouped`.
    """
    sums: dict[tuple[tuple[str, str], ...], _Sum] = {}
    for key, row in grouped(rows, by):
        sums.setdefault(key, _Sum(row)).add(row)
    return [one.merged(key) for key, one in sorted(sums.items(), key=lambda item: item[0])]


class _Sum:
    """What the logs of a group tell, as far as they were added."""

    def __init__(self, row: LogRow) -> None:
        self.vehicle, self.logs = row.told_car, 0
        self.design = AxleIdentifier.for_vehicle(self.vehicle, dt=DT)
        self.told = Total(len(self.design.ladder) + 3)
        self.excitation = np.zeros((2, 1 + len(EDGES)))

    def add(self, row: LogRow) -> None:
        for part in row.parts:
            self.told.add(part)
        self.excitation = excitation_of(self.excitation, row)
        self.logs += 1

    def merged(self, key: tuple[tuple[str, str], ...]) -> Merged:
        told, reference = self.told.information, reference_of(self.design, self.vehicle)
        model = merged(self.design, reference, told, self.excitation)
        return Merged(key=key, logs=self.logs, told=told, model=model)


def excitation_of(before: Array, row: LogRow) -> Array:
    """Return the largest slip and the times of learning of logs and one more, (2, 9).

    Parameters
    ----------
    before : of the logs, (2, 9).
    """
    one = row.numbers("excitation", *before.shape)
    together: Array = before + one
    together[:, 0] = np.maximum(before[:, 0], one[:, 0])
    return together


# Where the next car starts.


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetPrior:
    """What cars of a fleet have in common, and how they differ.

    Parameters
    ----------
    mean : m of [W, own], (2, q), own in wheelbases and speeds of the car's size.
    between : T, (2, q, q).
    cars : V.
    """

    mean: Array
    between: Array
    cars: int

    def model(self, vehicle: Vehicle) -> AxleModel:
        """Return where a car starts: a model that `tireid identify --weights` begins with.

        Parameters
        ----------
        vehicle : the car; its cornering stiffness is not looked at, the fleet knows better.
        """
        design = AxleIdentifier.for_vehicle(vehicle, dt=DT)
        before = reference_of(design, vehicle)
        size = sizes(vehicle, self.mean.shape[1])
        theta = self.mean * size
        P = self.between * (1.0 + 1.0 / self.cars) * size[:, :, None] * size[:, None, :]
        n = len(design.ladder)
        W, own = design.within_bounds(theta[:, :n], theta[:, n:], P)
        return replace(before, W=W, own=own, covariance=P)


def sizes(vehicle: Vehicle, q: int) -> Array:
    """Return what parameters of a car are measured in, (2, q): compliance in wheelbases, the bias
    of v_y in sqrt(g L).

    Parameters
    ----------
    q : parameters of an axle.
    """
    size = np.ones((2, q))
    size[:, q - 3] = vehicle.wheelbase
    size[1, q - 1] = vehicle.froude_speed
    return size


def fleet_prior(cars: Sequence[Merged]) -> FleetPrior:
    """Return what many cars have in common.

    Raises
    ------
    MergeError
        Where there is none, or their curves are of other units.
    """
    if not cars:
        raise MergeError("no log of the store can be used: nothing is known of where a car starts")
    if len({one.model.ladder for one in cars}) > 1:
        raise MergeError("the cars' curves are of other units: ask for them apart by --where")
    listed = [_of_size(one) for one in cars]
    q = listed[0][1].shape[-1]
    first = np.mean([before for before, _, _ in listed], axis=0)
    S0 = np.mean([wide for _, wide, _ in listed], axis=0)
    m, T = first, S0.copy()
    for _ in range(PASSES):
        expected = [posterior(told, m, T) for _, _, told in listed]
        means = np.array([mean for mean, _ in expected])
        m = means.mean(axis=0)
        away = means - m
        spread = np.einsum("vai,vaj->aij", away, away) + sum(P for _, P in expected)
        T = (WORTH * S0 + spread) / (WORTH + len(listed))
    assert m.shape == (2, q)
    return FleetPrior(mean=m, between=T, cars=len(listed))


def _of_size(one: Merged) -> tuple[Array, Array, Information]:
    """Return the prior of a car, mean and covariance, and what is told of it, over its size."""
    vehicle = one.model.vehicle
    before = reference_of(AxleIdentifier.for_vehicle(vehicle, dt=DT), vehicle)
    size = sizes(vehicle, one.told.vector.shape[1])
    told = replace(
        one.told,
        matrix=one.told.matrix * size[:, :, None] * size[:, None, :],
        vector=one.told.vector * size,
    )
    covariance = before.covariance / (size[:, :, None] * size[:, None, :])
    return np.hstack([before.W, before.own]) / size, covariance, told
