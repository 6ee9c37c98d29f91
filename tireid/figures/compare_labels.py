"""Labels and scales that the figures of a comparison share."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from codegen.escape import mathtext

TICKS = ((1, 1.5, 2, 2.5, 3, 4, 5, 6, 8), (1, 1.5, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,))
MOST = 6  # ticks of an axis
FARTHEST = 300.0  # [%], what is worse is drawn at the end of the axis


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Return the names of recordings without the file where all are runs of one.

    Parameters
    ----------
    names : FILE or FILE:RUN.
    """
    files = {name.split(":", 1)[0] for name in names}
    if len(files) > 1 or not all(":" in name for name in names):
        return {name: mathtext(name) for name in names}
    return {name: mathtext(name.split(":", 1)[1]) for name in names}


def method_label(name: str) -> str:
    """Return the name of a method as a figure shows it.

    Parameters
    ----------
    name : as in the registry.
    """
    return mathtext(name.replace("_", " "))


def percent_axis(axes: Axes, which: str, low: float, high: float) -> None:
    """Make an axis logarithmic from low to high, at most to FARTHEST, with ticks in percent.

    Parameters
    ----------
    axes : panel.
    which : "x" or "y".
    low : smallest value shown [%].
    high : largest value shown [%].
    """
    axis = axes.xaxis if which == "x" else axes.yaxis
    limits = low / 1.2, min(high, FARTHEST) * 1.2
    axes.set(**{f"{which}scale": "log", f"{which}lim": limits})
    axis.set_major_locator(FixedLocator(_ticks(*limits)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _ticks(low: float, high: float) -> list[float]:
    """As many ticks as fit, by the steps of one decade."""
    for steps in TICKS:
        every = [step * 10.0**decade for decade in range(-3, 4) for step in steps]
        ticks = [tick for tick in every if low <= tick <= high]
        if len(ticks) <= MOST:
            break
    return ticks
