"""A table as a picture: medians and quartiles by law and column, with the paper's values."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from codegen.escape import mathtext
from identifier.defaults import LAWS
from tireid.figures.panels import legend_above
from tireid.figures.style import AMBER, BLUE, GREEN, ORANGE, PAGE, PURPLE, new_figure, styled

Quartiles = tuple[float, float, float]  # median, lower and upper quartile
MARKS: Mapping[str, tuple[str, str]] = {  # color, marker
    "instantaneous": (ORANGE, "s"),
    "integral": (BLUE, "o"),
    "instantaneous_scaled": (GREEN, "D"),
}
FURTHER = ((PURPLE, "^"), (AMBER, "v"))
WIDE = 20.0  # from this ratio between what is drawn on, the axis is logarithmic
OFFSET = 0.2  # between neighboring laws, as a share of the distance of columns


@styled
def comparison_figure(
    results: Mapping[str, Mapping[str, Quartiles]],
    paper: Mapping[str, Mapping[str, float]] | None = None,
) -> Figure:
    """Draw medians of the force RMSE with whiskers from quartile to quartile, the paper's hollow.

    Parameters
    ----------
    results : by law, by column as it is to be labeled: median, lower, upper quartile [kN]; a law
        that diverged has no column or values that are not finite, which are left out.
    paper : by law, by column: the value that the paper prints [kN].

    Raises
    ------
    ValueError
        Where there is nothing to draw.
    """
    columns = list(dict.fromkeys(name for row in results.values() for name in row))
    if not columns:
        raise ValueError("a comparison needs at least one law with one column")
    figure = new_figure(PAGE, 2.9)
    axes = figure.subplots()
    drawn: list[float] = []
    order: list[str] = []
    for number, (law, row) in enumerate(results.items()):
        if not row:
            continue
        label = LAWS.get(law, law).replace("eta/lambda", "η/λ")
        color, marker = MARKS.get(law, FURTHER[number % len(FURTHER)])
        order += [label, f"{label} (paper)"]
        shift = OFFSET * (number - (len(results) - 1) / 2)
        middle, low, high = np.array(list(row.values()), dtype=np.float64).T
        middle = np.where(np.isfinite(middle), middle, np.nan)
        whiskers = [np.where(np.isfinite(end), abs(middle - end), 0.0) for end in (low, high)]
        axes.errorbar(
            [columns.index(name) + shift for name in row],
            middle,
            yerr=whiskers,
            fmt=marker,
            color=color,
            markersize=4.5,
            elinewidth=1.2,
            capsize=3.0,
            label=label,
        )
        printed = {name: value for name, value in (paper or {}).get(law, {}).items() if name in row}
        if printed:
            axes.plot(
                [columns.index(name) + shift + 0.07 for name in printed],
                list(printed.values()),
                linestyle="",
                marker=marker,
                markersize=5.0,
                markerfacecolor="white",
                markeredgecolor=color,
                markeredgewidth=1.1,
                label=f"{label} (paper)",
            )
        drawn += [*middle, *(middle - whiskers[0]), *(middle + whiskers[1]), *printed.values()]
    positive = [value for value in drawn if value > 0.0]
    if positive and max(positive) > WIDE * min(positive):
        axes.set(yscale="log", ylim=(min(positive) / 1.5, max(positive) * 1.5))
    else:
        axes.set_ylim(0.0, 1.08 * max(positive, default=1.0))
    axes.set_xticks(range(len(columns)), columns)
    axes.tick_params(axis="x", length=0.0)
    axes.grid(visible=False, axis="x")
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylabel="force RMSE [kN]")
    for boundary in range(1, len(columns)):
        axes.axvline(boundary - 0.5, color="#DDDDDD", linewidth=0.6)
    legend_above(figure, columns=len(results), order=order)
    return figure
