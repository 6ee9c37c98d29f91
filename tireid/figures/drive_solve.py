"""How long the tracker took for a step: a histogram with its percentiles, and where it failed."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from mpc.loop import Drive
from tireid.figures.panels import TIME, legend_above
from tireid.figures.style import BLUE, ORANGE, PAGE, PURPLE, new_figure, styled

BINS = 60
WIDE = 10.0  # times slower than the median: from there on the axis is logarithmic
MILLI = 1e3


@styled
def drive_solve_figure(drive: Drive) -> Figure:
    """Draw the solve times of a drive as a histogram and over time.

    Parameters
    ----------
    drive : the drive.
    """
    times = MILLI * drive.solve_time
    median, p99, largest = np.quantile(times, [0.5, 0.99, 1.0])
    figure = new_figure(PAGE, 2.7)
    left, right = figure.subplots(1, 2)
    wide = largest > WIDE * median
    low = float(times.min()) / 1.1 if wide else 0.0
    bins = np.geomspace(low, 1.1 * largest, BINS) if wide else np.linspace(low, 1.1 * largest, BINS)
    left.hist(times, bins=list(bins), color=BLUE, alpha=0.8)
    left.set(xlabel="solve time [ms]", ylabel="steps [-]", xlim=(low, 1.1 * largest))
    right.plot(
        drive.t,
        times,
        linestyle="",
        marker=".",
        markersize=2.2,
        markeredgewidth=0.0,
        color=BLUE,
        label="a step",
    )
    failed = drive.status != 0
    if failed.any():
        right.plot(
            drive.t[failed],
            times[failed],
            linestyle="",
            marker="x",
            markersize=4.0,
            color=ORANGE,
            label=f"failed ({np.count_nonzero(failed)})",
        )
    for value, name, color in ((median, "median", PURPLE), (p99, "99 %", ORANGE)):
        text = f"{name} {value:.3g} ms"
        left.axvline(value, color=color, linewidth=1.1, linestyle=(0, (4, 1.5)), label=text)
    right.set(xlabel=TIME, ylabel="solve time [ms]", ylim=(low, 1.3 * largest))
    if wide:
        left.set_xscale("log")
        right.set_yscale("log")
        for axis in (left.xaxis, right.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_locator(NullLocator())
    right.set_title(
        f"largest {largest:.3g} ms of a period of {MILLI * drive.period:g} ms", loc="right"
    )
    left.set_title(f"{times.size} steps")
    legend_above(figure)
    return figure
