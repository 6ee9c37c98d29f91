"""What the tracker asked of the steering, and what the wheels did."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mpc.loop import Drive
from tireid.figures.drive_errors import ARC, mark_drops
from tireid.figures.drive_look import tire_look
from tireid.figures.panels import legend_above
from tireid.figures.style import PAGE, PURPLE, new_figure, styled

NEAR = 0.75  # a limit is drawn where a command comes this close to it


@styled
def drive_steering_figure(
    drives: Mapping[str, Drive],
    *,
    angle_limit: float,
    rate_limit: float,
    drops: Sequence[tuple[float, float]] = (),
) -> Figure:
    """Draw commanded angles of the front wheels over arc length, and the rate of the first drive.

    Parameters
    ----------
    drives : by the name in the legend; the first is drawn on top, with its wheels.
    angle_limit : that the tracker keeps [rad].
    rate_limit : that the tracker keeps [rad/s].
    drops : where the friction changes: arc length [m] and friction from there on.
    """
    figure = new_figure(PAGE, 3.4)
    angle, rate = figure.subplots(2, 1, sharex=True)
    for label, drive in reversed(list(drives.items())):
        look = tire_look(label)
        angle.plot(drive.s, np.rad2deg(drive.command), label=label, **look)
    name, first = next(iter(drives.items()))
    angle.plot(
        first.s,
        np.rad2deg(first.delta),
        color=PURPLE,
        linewidth=0.8,
        label=f"wheels of {name}",
    )
    rate.plot(
        first.s[1:],
        np.rad2deg(np.diff(first.command) / np.diff(first.t)),
        **(tire_look(name) | {"linewidth": 0.7, "linestyle": "-"}),
    )
    for axes, limit, label in (
        (angle, angle_limit, "command\n[deg]"),
        (rate, rate_limit, f"rate, {name}\n[deg/s]"),
    ):
        axes.set_ylabel(label)
        _limits(axes, float(np.rad2deg(limit)))
        mark_drops(axes, drops)
    rate.set(xlabel=ARC, xlim=(0.0, max(float(drive.s[-1]) for drive in drives.values())))
    figure.align_ylabels([angle, rate])
    legend_above(figure, order=tuple(drives))
    return figure


def _limits(axes: Axes, limit: float) -> None:
    low, high = axes.get_ylim()
    if max(-low, high) > NEAR * limit:
        for side in (-limit, limit):
            axes.axhline(side, color="#AA4499", linewidth=0.8, linestyle=(0, (4, 2)), label="limit")
