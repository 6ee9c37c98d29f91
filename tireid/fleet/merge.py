"""One model of many logs, and of many cars where the next one starts.

What logs tell adds up (`identifier.axle.information`): the model of a group is that of the sum,
with the prior of its car counted once. Cars of a fleet differ: θ_v ~ N(m, T) of each car v, of
which its logs tell θ̂_v with covariance P_v. m and T are found by expectation and maximization
(N. Laird and J. Ware, Biometrics 38, 1982), T begins at the prior of the identifier and is held by
it as by `WORTH` more cars. Where the next car starts is m, as sure as N(m, T + T/V).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date

import numpy as np

from codegen.arrays import Array
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.curve import EDGES
from identifier.axle.information import Information, merged, posterior, reference_of, total
from models.vehicle import Vehicle
from tireid.fleet.learn import DT
from tireid.fleet.store import LogRow

TAGGED = ("vehicle", "tires", "date")
BY = (*TAGGED, "week", "month", "log")
PASSES = 60  # of expectation and maximization
WORTH = 2.0  # cars that the identifier's prior counts as


class MergeError(ValueError):
    """Rows do not make a model together; the message says which, and what to do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Merged:
    """What the logs of a group say together.

    Parameters
    ----------
    key : what they have in common, by `BY` or tag.
    logs : how many there are.
    told : what they tell.
    model : of it.
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
    row : of the log.
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
    if name in (*TAGGED, "log"):
        return str(getattr(row, name))
    tags = json.loads(row.tags)
    if name not in tags:
        known = ", ".join(dict.fromkeys((*BY, *sorted(tags))))
        raise MergeError(f"{row.log}: {name!r} is none of what is known of it: {known}")
    return str(tags[name])


def day_of(row: LogRow) -> date:
    """Return the day of a log.

    Parameters
    ----------
    row : of the log.

    Raises
    ------
    MergeError
        Where its date is none of ISO 8601.
    """
    try:
        return date.fromisoformat(row.date[:10])
    except ValueError:
        raise MergeError(
            f"{row.log}: its date {row.date!r} must begin with year-month-day, as in 2026-03-31"
        ) from None


def usable(rows: Sequence[LogRow], *, refused: bool = False) -> list[LogRow]:
    """Return the rows that a model can be made of.

    Parameters
    ----------
    rows : of logs.
    refused : also those whose answer the verdict refuses.
    """
    return [
        row
        for row in rows
        if not row.error and row.part_begin and (refused or row.valid is not False)
    ]


def merge(rows: Sequence[LogRow], by: Sequence[str]) -> list[Merged]:
    """Return the model of each group of logs, by its key.

    Parameters
    ----------
    rows : usable ones.
    by : what the logs of a group have in common; empty merges all.

    Raises
    ------
    MergeError
        Where the logs of a group are of several cars.
    """
    groups: dict[tuple[tuple[str, str], ...], list[LogRow]] = {}
    for row in rows:
        groups.setdefault(key_of(row, by), []).append(row)
    return [_merged(key, some) for key, some in sorted(groups.items())]


def _merged(key: tuple[tuple[str, str], ...], rows: Sequence[LogRow]) -> Merged:
    cars = {row.car: row for row in rows}
    if len(cars) > 1:
        first, second = [row.log for row in cars.values()][:2]
        raise MergeError(
            f"{first} and {second} are of cars whose files differ: merge --by vehicle (or tell it "
            "by --tags), fleet prior is for many cars"
        )
    vehicle = rows[0].told_car
    design = AxleIdentifier.for_vehicle(vehicle, dt=DT)
    told = total((part for row in rows for part in row.parts), len(design.ladder) + 3)
    reference = reference_of(design, vehicle)
    model = merged(design, reference, told, excitation_of(rows))
    return Merged(key=key, logs=len(rows), told=told, model=model)


def excitation_of(rows: Sequence[LogRow]) -> Array:
    """Return the largest slip and the times of learning of all logs together, (2, 9).

    Parameters
    ----------
    rows : of logs.
    """
    each = np.array([row.numbers("excitation", 2, 1 + len(EDGES)) for row in rows])
    together: Array = each.sum(axis=0)
    together[:, 0] = each[:, :, 0].max(axis=0)
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

    Parameters
    ----------
    cars : a merged model for each.

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
