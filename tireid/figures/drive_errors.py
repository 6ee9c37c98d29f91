"""How far the car was from its path, and how fast, over the arc length of the path."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mpc.loop import Drive
from tireid.figures.drive_look import tire_look
from tireid.figures.panels import legend_above
from tireid.figures.style import GREY, PAGE, new_figure, styled

TOLD = "told of another tire"
ARC = "arc length of the path [m]"


@styled
def drive_errors_figure(
    drives: Mapping[str, Drive], *, off_path: float, drops: Sequence[tuple[float, float]] = ()
) -> Figure:
    """Draw lateral deviation, heading error, lateral acceleration and speed over arc length.

    Parameters
    ----------
    drives : by the name in the legend; the first is drawn on top.
    off_path : deviation [m] at which a car counts as off the path, drawn where it comes near.
    drops : where the friction changes: arc length [m] and friction from there on.
    """
    figure = new_figure(PAGE, 5.2)
    panels = figure.subplots(4, 1, sharex=True)
    labels = (
        "deviation $e_y$\n[m]",
        "heading error\n[deg]",
        "lateral acc.\n[m/s²]",
        "speed $v_x$\n[m/s]",
    )
    for label, drive in reversed(list(drives.items())):
        look = tire_look(label)
        curves = (drive.e_y, np.rad2deg(drive.e_psi), drive.a_y, drive.v_x)
        for axes, curve in zip(panels, curves, strict=True):
            axes.plot(drive.s, curve, label=label, **look)
        _mark_notes(panels[0], drive, look["color"])
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
        mark_drops(axes, drops)
    for axes in panels[:3]:
        axes.axhline(0.0, color="#999999", linewidth=0.6, zorder=1)
    largest = max(float(np.abs(drive.e_y).max()) for drive in drives.values())
    reach = min(1.12 * largest, 1.3 * off_path)
    panels[0].set_ylim(-reach, reach)
    if reach > 0.8 * off_path:
        for side in (-off_path, off_path):
            panels[0].axhline(side, color="#AA4499", linewidth=0.8, label="off the path")
    _roomy(panels[3], min(float(drive.v_x.min()) for drive in drives.values()))
    last = max(float(drive.s[-1]) for drive in drives.values())
    panels[-1].set(xlabel=ARC, xlim=(0.0, last))
    figure.align_ylabels(panels)
    legend_above(figure, order=(*drives, TOLD, *(friction_label(mu) for _, mu in drops)))
    return figure


def mark_drops(axes: Axes, drops: Sequence[tuple[float, float]]) -> None:
    """Mark where the friction of the road changes.

    Parameters
    ----------
    axes : panel over arc length.
    drops : arc length [m] and friction from there on.
    """
    for place, mu in drops:
        axes.axvline(
            place, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), label=friction_label(mu)
        )


def friction_label(mu: float) -> str:
    """Return what a legend calls a friction of the road.

    Parameters
    ----------
    mu : over that of the tire's measurement [-].
    """
    return f"friction {mu:g}"


def _mark_notes(axes: Axes, drive: Drive, color: str) -> None:
    """Mark on the curve where the tracker was told of another tire."""
    if drive.notes:
        at = np.searchsorted(drive.t, [t for t, _ in drive.notes])
        at = np.minimum(at, drive.t.size - 1)
        axes.plot(
            drive.s[at],
            drive.e_y[at],
            linestyle="",
            marker="D",
            markersize=3.2,
            markerfacecolor="white",
            markeredgewidth=0.9,
            color=color,
            zorder=3.0,
            label=TOLD,
        )


def _roomy(axes: Axes, slowest: float) -> None:
    """Show a speed that is held as a level line, not as noise at full height."""
    low, high = axes.get_ylim()
    if high - low < 2.0:
        middle = 0.5 * (low + high)
        low, high = middle - 1.0, middle + 1.0
    axes.set_ylim(min(low, slowest), high)
