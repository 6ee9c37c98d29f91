"""Methods side by side: how far off online, frozen where learnt, and frozen elsewhere."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LogNorm
from matplotlib.figure import Figure

from codegen.escape import mathtext
from identifier.compare.course import same_and_other
from identifier.compare.study import Comparison, ranking
from identifier.reproducibility import AxleRmse
from tireid.figures import style
from tireid.figures.chosen import CHOSEN


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Return the names of recordings without the file where all are runs of one."""
    files = {name.split(":", 1)[0] for name in names}
    if len(files) > 1 or not all(":" in name for name in names):
        return {name: mathtext(name) for name in names}
    return {name: mathtext(name.split(":", 1)[1]) for name in names}


def method_label(name: str) -> str:
    """Return the name of a method as a figure shows it."""
    return mathtext(name.replace("_", " "))


ONLINE, _OWN, _OTHER = "online", "frozen, same drive", "frozen, other recordings"
_KINDS = {
    ONLINE: (style.BLUE, "o", -0.22),
    _OWN: (style.GREEN, "D", 0.0),
    _OTHER: (style.ORANGE, "s", 0.22),
}


@style.styled
def methods_figure(comparison: Comparison) -> Figure:
    """Draw a row for each method: means over recordings, lines from the best to the worst."""
    rows = {method_label(name): _method_errors(comparison, name) for name in ranking(comparison)}
    lost = {method_label(n) for n, trial in comparison.trials.items() if trial.diverged_at}
    figure = style.new_figure(CHOSEN.page, 0.9 + CHOSEN.row * len(rows))
    axes = figure.subplots()
    every = [v for row in rows.values() for vs in row.values() for v in vs]
    finite = [value for value in every if np.isfinite(value)]
    low, high = min(finite, default=1.0), min(max(finite, default=100.0), CHOSEN.compare_farthest)
    axes.set(xscale="log", xlim=(low / 1.2, high * 1.2))
    style.few_ticks(axes.xaxis)
    for position, (label, errors) in enumerate(rows.items()):
        _draw_row(axes, position, errors)
        if label in lost:
            place: Mapping[str, Any] = {"transform": axes.get_yaxis_transform(), "va": "center"}
            axes.text(0.995, position, "diverged", color=style.GREY, ha="right", **place)
        axes.axhline(position + 0.5, color="#DDDDDD", linewidth=0.5)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.tick_params(axis="y", length=0.0)
    axes.grid(visible=False, axis="y")
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlabel(f"{comparison.course.measure}, both axles [% of rms force]")
    style.legend_above(figure)
    return figure


def _method_errors(comparison: Comparison, name: str) -> dict[str, list[float]]:
    """Return by kind all errors of a method that did not diverge [%]."""
    trial, course = comparison.trials[name], comparison.course
    sane = {rec: error for rec, error in trial.online.items() if rec not in trial.diverged_at}
    online = [course.share(rec, error) for rec, error in sane.items()]
    frozen = zip((_OWN, _OTHER), same_and_other(trial.frozen or {}), strict=True)
    return {ONLINE: online} | {kind: [course.share(*one) for one in some] for kind, some in frozen}


def _draw_row(axes: Axes, position: int, errors: Mapping[str, list[float]]) -> None:
    for kind, values in errors.items():
        if not values:
            continue
        color, marker, shift = _KINDS[kind]
        shown = np.minimum(values, CHOSEN.compare_farthest * 1.1)
        y = position + shift
        axes.plot([shown.min(), shown.max()], [y, y], color=color, linewidth=1.0, alpha=0.6)
        mean = min(float(np.mean(values)), CHOSEN.compare_farthest * 1.1)
        axes.plot(mean, y, marker, color=color, ms=4.5, clip_on=False, label=kind)


# Learnt on one recording, replayed on another: a map of errors for each method.


@style.styled
def matrix_figure(comparison: Comparison) -> Figure:
    """Draw the frozen error of each method, rows learnt on, columns replayed on."""
    maps = {
        method_label(name): frozen
        for name in ranking(comparison)
        if (frozen := comparison.trials[name].frozen) is not None
    }
    if not maps:
        raise ValueError("no method of the comparison can be frozen")
    size = len(comparison.names)
    columns = min(len(maps), 4 if size <= 4 else 2)
    rows = math.ceil(len(maps) / columns)
    cell = (CHOSEN.page - 1.6) / columns / size
    figure = style.new_figure(CHOSEN.page, 0.6 + rows * (0.42 + size * min(cell, 0.42)))
    grid = figure.subplots(rows, columns, squeeze=False)
    norm, colors = LogNorm(CHOSEN.best, CHOSEN.worst), colormaps["viridis_r"]
    for axes, (label, frozen) in zip(grid.flat, maps.items(), strict=False):
        _draw_map(axes, comparison, frozen, norm, colors)
        axes.set_title(label, fontsize=7.2)
    for axes in grid.flat[len(maps) :]:
        axes.set_visible(False)
    for axes in grid[:, 1:].flat:
        axes.set_yticklabels([])
    figure.supylabel("learnt on", fontsize=8.0)
    figure.supxlabel("frozen, replayed on", fontsize=8.0)
    figure.suptitle(f"{comparison.course.measure}, both axles [% of rms force]", fontsize=8.0)
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
    shown = np.clip(np.nan_to_num(shares, nan=CHOSEN.worst), CHOSEN.best, CHOSEN.worst)
    axes.imshow(shown, norm=norm, cmap=colors, aspect="auto")
    for (i, j), share in np.ndenumerate(shares):
        dark = norm(shown[i, j]) > CHOSEN.dark
        text = f"{share:.1f}" if share < 10.0 else f"{share:.0f}" if share < 1e3 else ">999"
        text = "div." if np.isnan(share) else text
        axes.text(j, i, text, ha="center", va="center", color="white" if dark else "black")
    labels = short_names(names).values()
    cut = [one if len(one) <= CHOSEN.longest else f"{one[: CHOSEN.longest - 1]}…" for one in labels]
    letters = [chr(ord("A") + k) if k < 26 else str(k + 1) for k in range(len(names))]
    axes.set_xticks(range(len(names)), letters)
    both = [f"{label}  {letter}" for label, letter in zip(cut, letters, strict=True)]
    axes.set_yticks(range(len(names)), both)
    axes.tick_params(length=0.0)
    axes.grid(visible=False)
