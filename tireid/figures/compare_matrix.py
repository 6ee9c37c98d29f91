"""Learnt on one recording, replayed on another: a map of errors for each method."""

import math
from collections.abc import Mapping

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LogNorm
from matplotlib.figure import Figure

from identifier.reproducibility import AxleRmse
from tireid.compare_study import Comparison
from tireid.compare_table import ranking
from tireid.figures.compare_labels import method_label, short_names
from tireid.figures.style import PAGE, new_figure, styled

BEST, WORST = 1.0, 100.0  # [%], ends of the color scale
DARK = 0.55  # share of the color scale from which text is white
LONGEST = 17  # letters of a recording's name beside a map


@styled
def matrix_figure(comparison: Comparison) -> Figure:
    """Draw the frozen error of each method, rows learnt on, columns replayed on.

    Parameters
    ----------
    comparison : the methods; signal estimators have no map.

    Raises
    ------
    ValueError
        Where no method can be frozen.
    """
    maps = {
        method_label(name): frozen
        for name in ranking(comparison)
        if (frozen := comparison.trials[name].frozen) is not None
    }
    maps |= {f"floor, {name}": frozen for name, frozen in comparison.floors.items()}
    if not maps:
        raise ValueError("no method of the comparison can be frozen")
    size = len(comparison.names)
    columns = min(len(maps), 4 if size <= 4 else 2)
    rows = math.ceil(len(maps) / columns)
    cell = (PAGE - 1.6) / columns / size
    figure = new_figure(PAGE, 0.6 + rows * (0.42 + size * min(cell, 0.42)))
    grid = figure.subplots(rows, columns, squeeze=False)
    norm, colors = LogNorm(BEST, WORST), colormaps["viridis_r"]
    for axes, (label, frozen) in zip(grid.flat, maps.items(), strict=False):
        _draw_map(axes, comparison, frozen, norm, colors)
        axes.set_title(label, fontsize=7.2)
    for number, axes in enumerate(grid.flat):
        axes.set_visible(number < len(maps))
        if number % columns:
            axes.set_yticklabels([])
    figure.supylabel("learnt on", fontsize=8.0)
    figure.supxlabel("frozen, replayed on", fontsize=8.0)
    figure.suptitle("axle force RMSE, both axles [% of rms force]", fontsize=8.0)
    return figure


def _draw_map(
    axes: Axes,
    comparison: Comparison,
    frozen: Mapping[str, Mapping[str, AxleRmse]],
    norm: LogNorm,
    colors: Colormap,
) -> None:
    names = comparison.names
    shares = np.full((len(names), len(names)), np.nan)
    for i, learnt in enumerate(names):
        for j, name in enumerate(names):
            if learnt in frozen:
                shares[i, j] = comparison.course.share(name, frozen[learnt][name])
    shown = np.clip(np.nan_to_num(shares, nan=WORST), BEST, WORST)
    axes.imshow(shown, norm=norm, cmap=colors, aspect="auto")
    for (i, j), share in np.ndenumerate(shares):
        dark = norm(shown[i, j]) > DARK
        text = f"{share:.1f}" if share < 10.0 else f"{share:.0f}" if share < 1e3 else ">999"
        text = "div." if np.isnan(share) else text
        axes.text(j, i, text, ha="center", va="center", color="white" if dark else "black")
    labels = short_names(names).values()
    letters = [_letter(number) for number in range(len(names))]
    axes.set_xticks(range(len(names)), letters)
    axes.set_yticks(
        range(len(names)),
        [f"{_cut(label)}  {letter}" for label, letter in zip(labels, letters, strict=True)],
    )
    axes.tick_params(length=0.0)
    axes.grid(visible=False)


def _letter(number: int) -> str:
    """A to Z, then numbers: what stands for a recording below a map."""
    return chr(ord("A") + number) if number < 26 else str(number + 1)


def _cut(label: str) -> str:
    return label if len(label) <= LONGEST else f"{label[: LONGEST - 1]}…"
