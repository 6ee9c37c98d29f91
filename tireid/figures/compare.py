"""Methods side by side: how far off online, frozen where learnt, and frozen elsewhere."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from codegen.escape import mathtext
from identifier.compare.course import same_and_other
from identifier.compare.study import Comparison, ranking
from tireid.figures.style import BLUE, GREEN, GREY, ORANGE, few_ticks, new_figure, styled

_FARTHEST = 300.0  # [%], what is worse is drawn at the end of the axis
_ROW = 0.3  # height of a method [in]


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Return the names of recordings without the file where all are runs of one."""
    parted = {name: name.partition(":") for name in names}
    one_file = len({file for file, _, _ in parted.values()}) == 1
    runs = all(run for _, _, run in parted.values())
    return {n: mathtext(run if one_file and runs else n) for n, (_, _, run) in parted.items()}


def method_label(name: str) -> str:
    """Return the name of a method as a figure shows it."""
    return mathtext(name.replace("_", " "))


ONLINE, _SAME, _OTHER = "online", "frozen, same drive", "frozen, other recordings"
_KINDS = {
    ONLINE: (BLUE, "o", -0.22),
    _SAME: (GREEN, "D", 0.0),
    _OTHER: (ORANGE, "s", 0.22),
}


@styled
def methods_figure(comparison: Comparison) -> Figure:
    """Draw a row for each method: means over recordings, lines from the best to the worst."""
    rows = {method_label(name): _method_errors(comparison, name) for name in ranking(comparison)}
    lost = {method_label(n) for n, trial in comparison.trials.items() if trial.diverged_at}
    figure = new_figure(0.9 + _ROW * len(rows))
    axes = figure.subplots()
    every = [v for row in rows.values() for vs in row.values() for v in vs]
    finite = [value for value in every if np.isfinite(value)]
    low, high = min(finite, default=1.0), min(max(finite, default=100.0), _FARTHEST)
    axes.set(xscale="log", xlim=(low / 1.2, high * 1.2))
    few_ticks(axes.xaxis)
    for position, (label, errors) in enumerate(rows.items()):
        for kind, values in errors.items():
            if values:
                color, marker, shift = _KINDS[kind]
                y, drawn = position + shift, np.minimum(values, _FARTHEST * 1.1)
                axes.hlines(y, drawn.min(), drawn.max(), color=color, linewidth=1.0, alpha=0.6)
                mean = min(float(np.mean(values)), _FARTHEST * 1.1)
                axes.plot(mean, y, marker, color=color, ms=4.5, clip_on=False, label=kind)
        if label in lost:
            axes.text(
                0.995,
                position,
                "diverged",
                color=GREY,
                ha="right",
                transform=axes.get_yaxis_transform(),
                va="center",
            )
        axes.axhline(position + 0.5, color="#DDDDDD", linewidth=0.5)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.tick_params(axis="y", length=0.0)
    axes.grid(visible=False, axis="y")
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlabel(f"{comparison.course.measure}, both axles [% of rms force]")
    return figure


def _method_errors(comparison: Comparison, name: str) -> dict[str, list[float]]:
    """Return by kind all errors of a method that did not diverge [%]."""
    trial, course = comparison.trials[name], comparison.course
    sane = {rec: error for rec, error in trial.online.items() if rec not in trial.diverged_at}
    online = [course.share(rec, error) for rec, error in sane.items()]
    frozen = zip((_SAME, _OTHER), same_and_other(trial.frozen or {}), strict=True)
    return {ONLINE: online} | {kind: [course.share(*one) for one in some] for kind, some in frozen}
