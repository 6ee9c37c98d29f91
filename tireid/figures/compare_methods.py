"""Methods side by side: how far off online, frozen where learnt, and frozen elsewhere."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifier.cross_replay import where_learnt_and_elsewhere
from tireid.compare_study import Comparison, Frozen
from tireid.compare_table import ranking
from tireid.figures.compare_labels import FARTHEST, method_label, percent_axis
from tireid.figures.panels import legend_above
from tireid.figures.style import BLUE, GREEN, GREY, ORANGE, PAGE, new_figure, styled

ONLINE, OWN, OTHER = "online", "frozen, where learnt", "frozen, other recordings"
KINDS = {ONLINE: (BLUE, "o", -0.22), OWN: (GREEN, "D", 0.0), OTHER: (ORANGE, "s", 0.22)}
ROW = 0.3  # height of a method [in]


@styled
def methods_figure(comparison: Comparison) -> Figure:
    """Draw a row for each method: means over recordings, lines from the best to the worst.

    Parameters
    ----------
    comparison : the methods; floors are rows at the end.
    """
    rows = {method_label(name): method_errors(comparison, name) for name in ranking(comparison)}
    lost = {method_label(n) for n, trial in comparison.trials.items() if trial.diverged_at}
    floors = {f"floor, {name}": floor_errors(comparison, name) for name in comparison.floors}
    figure = new_figure(PAGE, 0.9 + ROW * (len(rows) + len(floors)))
    axes = figure.subplots()
    every = [v for row in (*rows.values(), *floors.values()) for vs in row.values() for v in vs]
    finite = [value for value in every if np.isfinite(value)]
    percent_axis(axes, "x", min(finite, default=1.0), max(finite, default=100.0))
    for position, (label, errors) in enumerate((rows | floors).items()):
        _draw_row(axes, position, errors)
        if label in lost:
            axes.text(
                0.995,
                position,
                "diverged",
                color=GREY,
                ha="right",
                va="center",
                transform=axes.get_yaxis_transform(),
            )
        axes.axhline(position + 0.5, color="#DDDDDD", linewidth=0.5)
    axes.axhline(len(rows) - 0.5, color=GREY, linewidth=0.8)
    axes.set_yticks(range(len(rows) + len(floors)), [*rows, *floors])
    axes.tick_params(axis="y", length=0.0)
    axes.grid(visible=False, axis="y")
    axes.set_ylim(len(rows) + len(floors) - 0.5, -0.5)
    axes.set_xlabel("axle force RMSE, both axles [% of rms force]")
    legend_above(figure)
    return figure


def method_errors(comparison: Comparison, name: str) -> dict[str, list[float]]:
    """Return by kind all errors of a method that did not diverge [%].

    Parameters
    ----------
    comparison : the methods.
    name : of the method.
    """
    trial, course = comparison.trials[name], comparison.course
    sane = {rec: error for rec, error in trial.online.items() if rec not in trial.diverged_at}
    online = [course.share(rec, error) for rec, error in sane.items()]
    return {ONLINE: online, **_frozen_errors(comparison, trial.frozen or {})}


def floor_errors(comparison: Comparison, name: str) -> dict[str, list[float]]:
    """Return by kind all errors of offline fits [%].

    Parameters
    ----------
    comparison : the methods.
    name : of the floor.
    """
    return _frozen_errors(comparison, comparison.floors[name])


def _frozen_errors(comparison: Comparison, frozen: Frozen) -> dict[str, list[float]]:
    course = comparison.course
    return {
        kind: [course.share(name, error) for name, error in pairs]
        for kind, pairs in zip((OWN, OTHER), where_learnt_and_elsewhere(frozen), strict=True)
    }


def _draw_row(axes: Axes, position: int, errors: Mapping[str, list[float]]) -> None:
    for kind, values in errors.items():
        if not values:
            continue
        color, marker, shift = KINDS[kind]
        shown = np.minimum(values, FARTHEST * 1.1)
        y = position + shift
        axes.plot([shown.min(), shown.max()], [y, y], color=color, linewidth=1.0, alpha=0.6)
        axes.plot(
            min(float(np.mean(values)), FARTHEST * 1.1),
            y,
            marker=marker,
            color=color,
            linestyle="",
            markersize=4.5,
            label=kind,
            clip_on=False,
        )
