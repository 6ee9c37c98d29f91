"""Every method at its best: Pareto fronts of frozen against online error over random designs."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifier.cross_replay import Shares
from identifier.pareto import frozen_share, pareto_front
from identifier.sweep import Candidate
from tireid.compare_study import Comparison
from tireid.compare_table import ranking
from tireid.figures.compare_labels import FARTHEST, method_label, percent_axis
from tireid.figures.panels import legend_above, note
from tireid.figures.style import BLUE, GREY, ORANGE, PAGE, new_figure, styled

DESIGN, FRONT, DEFAULT = "random design", "Pareto front", "default design"
OTHERS, SIGNAL = "fronts of the other methods", "online error of a signal estimator"
Point = tuple[float, float]


@styled
def pareto_figure(comparison: Comparison) -> Figure:
    """Draw a panel for each method: its designs, its front before those of all others.

    Parameters
    ----------
    comparison : with a sweep; designs that diverged are counted in the panel's title.

    Raises
    ------
    ValueError
        Where there was no sweep.
    """
    names = [name for name in ranking(comparison) if name in comparison.sweeps]
    if not names:
        raise ValueError("a Pareto front needs a sweep")
    clouds = {name: _points(comparison.sweeps[name]) for name in names}
    fronts = {name: _points(pareto_front(comparison.sweeps[name])) for name in names}
    columns = min(4, len(names))
    rows = math.ceil(len(names) / columns)
    figure = new_figure(PAGE, 0.9 + 1.55 * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    limits = _limits(comparison, list(clouds.values()), list(fronts.values()))
    for axes, name in zip(grid.flat, names, strict=False):
        percent_axis(axes, "x", *limits[0])
        percent_axis(axes, "y", *limits[1])
        for other in names:
            if other != name and fronts[other]:
                axes.plot(*_stairs(fronts[other]), color="#BBBBBB", linewidth=0.8, label=OTHERS)
        _draw_method(axes, comparison, name, clouds[name], fronts[name])
        axes.set_title(method_label(name))
        lost = sum(bool(candidate.diverged_on) for candidate in comparison.sweeps[name])
        note(axes, f"{lost} diverged" if lost else "")
    for number, axes in enumerate(grid.flat):
        axes.set_visible(number < len(names))
        axes.tick_params(labelbottom=number + columns >= len(names))
    figure.supxlabel("online RMSE [% of rms force]", fontsize=8.0)
    where = "elsewhere" if len(comparison.names) > 1 else "where learnt"
    figure.supylabel(f"frozen {where} [%]", fontsize=8.0)
    signals = any(frozen_share(comparison.shares(name)) is None for name in names)
    legend_above(
        figure, columns=3 if signals else 4, order=(DESIGN, FRONT, DEFAULT, OTHERS, SIGNAL)
    )
    return figure


def _draw_method(
    axes: Axes, comparison: Comparison, name: str, cloud: list[Point], front: list[Point]
) -> None:
    own = comparison.shares(name)
    if cloud:
        ends = axes.get_xlim()[1], axes.get_ylim()[1]
        inside = np.minimum(cloud, ends)  # what is farther away is drawn at the edge
        axes.plot(
            *inside.T, ".", color=BLUE, markersize=2.5, alpha=0.5, label=DESIGN, clip_on=False
        )
        axes.plot(*_stairs(front), color=BLUE, linewidth=1.4, label=FRONT)
    default = _point(own)
    if default is not None:
        axes.plot(
            *np.minimum(default, FARTHEST),
            "*",
            color=ORANGE,
            markersize=8.0,
            markeredgecolor="white",
            markeredgewidth=0.5,
            label=DEFAULT,
        )
    sane = [c.shares.online for c in comparison.sweeps[name] if not c.diverged_on]
    if frozen_share(own) is None and sane:
        axes.axvline(min(sane), color=BLUE, linewidth=1.2, linestyle=(0, (4, 2)), label=SIGNAL)
        note(axes, "signal")
    elif not cloud:
        axes.text(0.5, 0.5, "all diverged", transform=axes.transAxes, ha="center", color=GREY)


def _point(found: Shares) -> Point | None:
    frozen = frozen_share(found)
    if frozen is None or not np.isfinite([found.online, frozen]).all():
        return None
    return found.online, frozen


def _points(candidates: Sequence[Candidate]) -> list[Point]:
    """Points of the designs that did not diverge, the worst at the end of the axis."""
    points = (_point(candidate.shares) for candidate in candidates)
    return [(min(x, FARTHEST), min(y, FARTHEST)) for x, y in filter(None, points)]


def _stairs(front: list[Point]) -> tuple[list[float], list[float]]:
    """Corners of the line below which no design is, from the top edge to the right one."""
    xs, ys = [front[0][0]], [10.0 * FARTHEST]
    for x, y in front:
        xs += [x, x]
        ys += [ys[-1], y]
    return [*xs, 10.0 * FARTHEST], [*ys, ys[-1]]


def _limits(
    comparison: Comparison, clouds: Sequence[list[Point]], fronts: Sequence[list[Point]]
) -> tuple[Point, Point]:
    """Ends of both axes: all fronts, defaults and nine of ten designs are seen in place."""
    defaults = (_point(comparison.shares(name)) for name in comparison.sweeps)
    points = [point for front in fronts for point in front]
    points += [point for point in defaults if point is not None]
    points += [tuple(np.percentile(cloud, 90, axis=0)) for cloud in clouds if cloud]
    points += [
        (c.shares.online, points[0][1] if points else 100.0)
        for candidates in comparison.sweeps.values()
        for c in candidates
        if not c.diverged_on and frozen_share(c.shares) is None
    ]
    xs, ys = zip(*(points or [(10.0, 100.0)]), strict=True)
    return (min(xs), max(xs)), (min(ys), max(ys))
