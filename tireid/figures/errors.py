"""The norm of the identifier's error over time, beside the bounds that hold for it."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from identifier.history import History
from tireid.figures.panels import TIME, Window, legend_above, mark_freeze, shown, time_window
from tireid.figures.style import AMBER, BLUE, GREEN, PAGE, PURPLE, new_figure, styled
from tireid.figures.units import impulse_unit, paper_design

WIDE = 20.0  # from this ratio between what is drawn on, the axis is logarithmic


@styled
def error_figure(
    history: History,
    bounds: Mapping[str, float] | None = None,
    freeze_times: Sequence[float] = (),
    *,
    window: Window = None,
) -> Figure:
    """Draw the norm of ξ̃ = ξ - ξ̂ over time and its bounds.

    The axis is logarithmic where a bound lies far above the error.

    Parameters
    ----------
    history : the online run.
    bounds : by name, bounds on the norm [U s]; one that is not finite is left out.
    freeze_times : times at which weights were taken [s].
    window : first and last time to show [s]; None shows all.

    Raises
    ------
    ValueError
        Where the window holds no sample.
    """
    recording = history.recording
    ends = time_window(recording.t, window)
    part = shown(recording.t, ends)
    # A root of squares would overflow where a law diverges; hypot does not.
    norm = np.hypot(history.told["xi_tilde"][part, 0], history.told["xi_tilde"][part, 1])
    known = {name: bound for name, bound in (bounds or {}).items() if np.isfinite(bound)}
    drawn = norm[np.isfinite(norm) & (norm > 0.0) & (norm < 1e12)]
    typical, peak = (float(np.median(drawn)), float(drawn.max())) if drawn.size else (1.0, 1.0)
    top = max(peak, *known.values()) if known else peak

    figure = new_figure(PAGE, 2.6)
    axes = figure.subplots()
    axes.set_xlim(ends)
    if top > WIDE * peak or peak > 100.0 * WIDE * typical:
        axes.set_yscale("log")
        axes.set_ylim(typical / 30.0, 2.0 * top)
    else:
        axes.set_ylim(0.0, 1.08 * top)
    axes.plot(
        recording.t[part],
        np.minimum(norm, 1e3 * top),
        color=BLUE,
        linewidth=0.9,
        label=r"$|\tilde{\xi}|$ online",
    )
    styles = ((PURPLE, "-"), (GREEN, (0, (5, 1.5))), (AMBER, (0, (5, 1.5, 1, 1.5))))
    for number, (name, bound) in enumerate(known.items()):
        color, dashes = styles[number % len(styles)]
        axes.axhline(bound, color=color, linestyle=dashes, linewidth=1.1, label=name)
    for t_freeze in freeze_times:
        mark_freeze(axes, t_freeze, prediction=False)
    axes.set(
        xlabel=TIME,
        ylabel=rf"error norm $|\tilde{{\xi}}|$ [{impulse_unit(paper_design(history).force_unit)}]",
    )
    legend_above(figure, columns=min(4, 1 + len(known) + bool(freeze_times)))
    return figure
