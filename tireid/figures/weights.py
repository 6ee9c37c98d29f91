"""The weights over time: what was learnt when, and whether it settled."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from identifier.history import History
from tireid.figures.panels import TIME, Window, legend_beside, mark_freeze, shown, time_window
from tireid.figures.style import GREEN, PAGE, PURPLE, SERIES, new_figure, styled
from tireid.figures.units import drawable, force_range, force_unit_name, paper_design

Array = NDArray[np.float64]
SYMBOLS = {
    "v_y": "$v_y$",
    "r": "$r$",
    "delta_f": r"$\delta_f$",
    "delta_r": r"$\delta_r$",
    "v_x": "$v_x$",
    "alpha_f": r"$\alpha_f$",
    "alpha_r": r"$\alpha_r$",
}


@styled
def weights_figure(
    history: History, freeze_times: Sequence[float] = (), *, window: Window = None
) -> Figure:
    """Draw every entry of W and V over time: W by axle, V by the input it weighs.

    Parameters
    ----------
    history : the online run.
    freeze_times : times at which weights were taken [s].
    window : first and last time to show [s]; None shows all.

    Raises
    ------
    ValueError
        Where the window holds no sample.
    """
    recording, design = history.recording, paper_design(history)
    ends = time_window(recording.t, window)
    part = shown(recording.t, ends)
    t, W, V = recording.t[part], history.carried["W"][:-1][part], history.carried["V"][:-1][part]

    figure = new_figure(PAGE, 4.2)
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.set_xlim(ends)
    _lines(upper, t, W[:, 0, :], GREEN, "front axle")
    _lines(upper, t, W[:, 1, :], PURPLE, "rear axle")
    upper.set_ylabel(rf"weights $\hat{{W}}$ [{force_unit_name(design.force_unit)}]")
    for number, name in enumerate(design.network.inputs):
        _lines(lower, t, V[:, :, number], SERIES[number % len(SERIES)], SYMBOLS[name])
    lower.set(xlabel=TIME, ylabel=r"weights $\hat{V}$ [-]")
    for axes, values in ((upper, W), (lower, V)):
        axes.set_ylim(force_range(_settled(values) if history.diverged_at is not None else values))
        for t_freeze in freeze_times:
            mark_freeze(axes, t_freeze, prediction=False)
        legend_beside(axes)
    figure.align_ylabels()
    return figure


def _lines(axes: Axes, t: Array, values: Array, color: str, label: str) -> None:
    """Draw the columns of `values` (n, k) in one color under one label."""
    lines = axes.plot(t, drawable(values, force_range(values)), color=color, linewidth=0.7)
    lines[0].set_label(label)


def _settled(values: Array) -> Array:
    """Return the samples of `values` (n, i, k) before a law that diverges runs away."""
    peak = np.abs(values).max(axis=(1, 2))
    kept: Array = values[peak <= 10.0 * np.median(peak[np.isfinite(peak)])]
    return kept
