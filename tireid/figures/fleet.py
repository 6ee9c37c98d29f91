"""A fleet: what its logs say of the tires, one by one, merged, and over time."""

from collections.abc import Sequence
from datetime import datetime

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codegen.arrays import Array
from codegen.escape import mathtext
from tireid.figures.chosen import CHOSEN
from tireid.figures.style import (
    AXLES,
    BLACK,
    GREY,
    ORANGE,
    SERIES,
    axle_panels,
    legend_above,
    new_figure,
    note,
    styled,
)
from tireid.fleet.merge import Merged
from tireid.fleet.store import LogRow
from tireid.fleet.watch import TITLES, Alarm, Seen

_NAMED = len(SERIES) - 1  # groups that have a color of their own; the others are gray
_SLIP = 0.25  # rad, up to which curves are drawn that nobody knows farther
_PERCENT = 100.0
_DAY = 86_400.0  # s


@styled
def stiffness_figure(rows: Sequence[LogRow]) -> Figure:
    """Draw the cornering stiffness identified in each log, over the days, a color for each car.

    rows : of logs that were learnt; what the verdict refuses is drawn hollow.
    """
    figure = new_figure(CHOSEN.page, 4.4)
    panels = figure.subplots(2, 1, sharex=True)
    when = _days(rows)
    cars = list(dict.fromkeys(row.vehicle for row in rows))
    for k, car in enumerate(cars):
        mine = np.array([row.vehicle == car for row in rows])
        refused = np.array([row.valid is False for row in rows])
        for axes, axle in zip(panels, ("front", "rear"), strict=True):
            C = np.array([getattr(row, f"stiffness_{axle}") for row in rows], dtype=np.float64)
            color, label = _look(k, car, len(cars))
            some = mine & ~refused
            axes.plot(when[some], C[some] / 1e3, "o", ms=3.0, color=color, label=label)
            some = mine & refused
            axes.plot(when[some], C[some] / 1e3, "o", ms=3.0, color=color, mfc="none")
    for axes, name in zip(panels, AXLES, strict=True):
        axes.set(title=name, ylabel="cornering stiffness [kN/rad]")
        axes.set_ylim(0.0, 1.08 * axes.get_ylim()[1])
    panels[-1].set(xlabel="day since the first log")
    legend_above(figure, columns=4)
    return figure


@styled
def curves_figure(groups: Sequence[Merged]) -> Figure:
    """Draw the force curves of groups, as far as they are known."""
    figure, (panels,) = axle_panels([3.0])
    for k, one in enumerate(groups):
        color, label = _look(k, one.name, len(groups))
        for i, axes in enumerate(panels):
            known = float(one.model.known_slip[i])
            slip = np.linspace(0.0, known or _SLIP, 100)
            force = np.asarray(one.model.force(slip))[:, i] / one.model.vehicle.axle_loads[i]
            style = "-" if known else ":"
            axes.plot(np.degrees(slip), force, style, color=color, label=label)
    for axes in panels:
        axes.set(xlabel="slip angle [deg]")
    panels[0].set(ylabel="force [static axle loads]")
    legend_above(figure, columns=4)
    return figure


@styled
def watch_figure(car: str, seen: Seen, alarms: Sequence[Alarm]) -> Figure:
    """Draw how a car's tires differ from its baseline, part by part, and what was noticed."""
    figure = new_figure(CHOSEN.page, 4.8)
    panels = figure.subplots(len(TITLES), 1, sharex=True)
    minutes = seen.driven / 60.0
    for k, (axes, title) in enumerate(zip(panels, TITLES, strict=True)):
        sd = np.sqrt(seen.variance[:, k])
        _points(axes, minutes, _PERCENT * seen.z[:, k], _PERCENT * sd)
        axes.set(ylabel="[%]")
        axes.set_title(title, loc="left")
        for one in alarms:
            if one.statistic == k:
                axes.axvline(one.after / 60.0, color=ORANGE, label="noticed")
    note(panels[0], mathtext(car))
    panels[-1].set(xlabel="learning since the baseline [min]")
    legend_above(figure)
    return figure


def _points(axes: Axes, x: Array, z: Array, sd: Array) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.errorbar(
        x, z, 2.0 * sd, fmt="o", ms=2.5, color=BLACK, ecolor=GREY, elinewidth=0.6,
        label="change of ln, two standard deviations",
    )  # fmt: skip


def _look(k: int, name: str, of: int) -> tuple[str, str]:
    """Return the color and the label of a group."""
    if k < _NAMED:
        return SERIES[k], mathtext(name)
    return GREY, f"{of - _NAMED} others"


def _days(rows: Sequence[LogRow]) -> Array:
    """Return when logs were driven, in days since the first; else in their order."""
    try:
        when = np.array([datetime.fromisoformat(row.date).timestamp() for row in rows])
    except ValueError:
        return np.arange(len(rows), dtype=np.float64)
    return np.asarray((when - when.min()) / _DAY, dtype=np.float64)
