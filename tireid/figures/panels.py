"""Parts that several figures share: time axes, freeze marks, legends, errors in titles."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from numpy.typing import NDArray

from tireid.figures.style import GREY

Array = NDArray[np.float64]
Window = tuple[float, float] | None

TIME = "time [s]"
AXLES = ("Front axle", "Rear axle")
FREEZE, PREDICTION = "freeze", "after the freeze (prediction)"


def time_window(t: Array, window: Window) -> tuple[float, float]:
    """Return the ends of a time axis.

    Parameters
    ----------
    t : times of the samples (n,) [s].
    window : first and last time to show [s], or None for all.

    Raises
    ------
    ValueError
        Where the window is empty or holds no sample.
    """
    if window is None:
        return float(t[0]), float(t[-1])
    first, last = window
    if not (first < last and first < t[-1] and last > t[0]):
        raise ValueError(
            f"a window must lie within {t[0]:g} s to {t[-1]:g} s, it is {first:g} s to {last:g} s"
        )
    return max(first, float(t[0])), min(last, float(t[-1]))


def shown(t: Array, ends: tuple[float, float]) -> NDArray[np.bool_]:
    """Return which samples lie within the ends of a time axis, (n,).

    Parameters
    ----------
    t : times of the samples (n,) [s].
    ends : first and last time [s].
    """
    within: NDArray[np.bool_] = (t >= ends[0]) & (t <= ends[1])
    return within


def mark_freeze(axes: Axes, t_freeze: float, *, prediction: bool) -> None:
    """Draw the freeze as a line and, where the replay goes on, shade what it predicts.

    The limits of the time axis must be set before.

    Parameters
    ----------
    axes : panel over time.
    t_freeze : time of the freeze [s].
    prediction : whether the panel shows a replay.
    """
    first, last = axes.get_xlim()
    if prediction and t_freeze < last:
        axes.axvspan(
            max(t_freeze, first),
            last,
            facecolor="#F1EDE4",
            edgecolor="none",
            zorder=0,
            label=PREDICTION,
        )
    if first <= t_freeze <= last:
        axes.axvline(t_freeze, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), label=FREEZE)


def note(axes: Axes, text: str) -> None:
    """Write a short text above the right end of a panel, opposite to its title.

    Parameters
    ----------
    axes : the panel.
    text : what to write.
    """
    axes.set_title(text, loc="right", color="#444444")


def legend_above(
    figure: Figure, *, columns: int | None = None, order: Sequence[str] = (FREEZE, PREDICTION)
) -> None:
    """Put one legend of all labeled curves above all panels, where it covers no data.

    Parameters
    ----------
    figure : figure with a constrained layout.
    columns : entries in a row; None puts all in one.
    order : labels that come after all others, in this order.
    """
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    for label in order:
        if label in entries:
            entries[label] = entries.pop(label)
    legend = figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside upper center",
        ncols=columns or len(entries),
        borderaxespad=0.2,
    )
    _bolder(legend)


def legend_beside(axes: Axes) -> None:
    """Put the legend of one panel to its right, where it covers no data.

    Parameters
    ----------
    axes : a panel that is as wide as its figure.
    """
    handles, labels = axes.get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    legend = axes.legend(
        list(entries.values()),
        list(entries),
        loc="upper left",
        bbox_to_anchor=(1.01, 1.0),
        borderaxespad=0.0,
    )
    _bolder(legend)


def _bolder(legend: Legend) -> None:
    """Make thin lines and faint dots of a legend large enough to tell their colors."""
    for line in legend.get_lines():
        line.set_linewidth(max(line.get_linewidth(), 1.2))
        if line.get_marker() == ".":
            line.set_markersize(7.0)
            line.set_alpha(1.0)
