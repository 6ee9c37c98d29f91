"""The norm of the identifier's error over time, beside the bounds that hold for it."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codegen.arrays import Array
from identifier.paper.design import VARIANTS
from identifier.run import History
from identifier.setup import force_unit_name
from identifier.stability.loop import Loop, eigenvalues, root_locus
from identifier.stability.margins import gain_margin, phase_margin
from tireid.figures.style import (
    AMBER,
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ONLINE,
    ORANGE,
    PURPLE,
    SERIES,
    drawable,
    force_range,
    label_time,
    legend_above,
    legend_beside,
    mark_freeze,
    new_figure,
    paper_design,
    styled,
)
from tireid.figures.thinned import drawn_of_run

_WIDE = 20.0  # from this ratio between what is drawn on, the axis is logarithmic
_OFFSET = 0.2  # between neighboring laws, as a share of the distance of columns

SCHEME = Path(__file__).with_name("fig1_scheme.png")  # Fig. 1, and as .svg beside it


@styled
def error_figure(
    history: History,
    bounds: Mapping[str, float] | None = None,
    freeze_times: Sequence[float] = (),
) -> Figure:
    """Draw the norm of ξ̃ = ξ - ξ̂ over time and its bounds.

    The axis is logarithmic where a bound lies far above the error.

    bounds : by name, bounds on the norm [U s]; one that is not finite is left out.
    freeze_times : times at which weights were taken [s].
    """
    recording = history.recording
    # A root of squares would overflow where a law diverges; hypot does not.
    t, (norm,) = drawn_of_run(history, lambda block: [np.hypot(*block.outputs["xi_tilde"].T)])
    known = {name: bound for name, bound in (bounds or {}).items() if np.isfinite(bound)}
    drawn = norm[np.isfinite(norm) & (norm > 0.0) & (norm < 1e12)]
    typical, peak = (float(np.median(drawn)), float(drawn.max())) if drawn.size else (1.0, 1.0)
    top = max(peak, *known.values()) if known else peak

    figure = new_figure(2.6)
    axes = figure.subplots()
    axes.set_xlim(recording.t[0], recording.t[-1])
    if top > _WIDE * peak or peak > 100.0 * _WIDE * typical:
        axes.set_yscale("log")
        axes.set_ylim(typical / 30.0, 2.0 * top)
    else:
        axes.set_ylim(0.0, 1.08 * top)
    look = {**ONLINE, "label": r"$|\tilde{\xi}|$ online"}
    axes.plot(t, np.minimum(norm, 1e3 * top), **look)
    looks = (PURPLE, "-"), (GREEN, "--"), (AMBER, "-.")
    for (name, bound), (color, dashes) in zip(known.items(), cycle(looks), strict=False):
        axes.axhline(bound, color=color, linestyle=dashes, linewidth=1.1, label=name)
    for t_freeze in freeze_times:
        mark_freeze(axes, t_freeze)
    unit = force_unit_name(paper_design(history).force_unit)
    axes.set(ylabel=rf"error norm $|\tilde{{\xi}}|$ [{unit} s]")
    label_time(axes, recording.t)
    legend_above(figure, columns=4)
    return figure


_SYMBOLS = {
    "v_y": "$v_y$",
    "r": "$r$",
    "delta_f": r"$\delta_f$",
    "delta_r": r"$\delta_r$",
    "v_x": "$v_x$",
    "alpha_f": r"$\alpha_f$",
    "alpha_r": r"$\alpha_r$",
}


@styled
def weights_figure(history: History, freeze_times: Sequence[float] = ()) -> Figure:
    """Draw every entry of W and V over time: W by axle, V by the input it weighs.

    freeze_times : times at which weights were taken [s].
    """
    recording, design = history.recording, paper_design(history)
    t, (W, V) = drawn_of_run(history, lambda block: [block.before["W"], block.before["V"]])

    figure = new_figure(4.2)
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.set_xlim(recording.t[0], recording.t[-1])
    _lines(upper, t, W[:, 0, :], GREEN, "front axle")
    _lines(upper, t, W[:, 1, :], PURPLE, "rear axle")
    upper.set_ylabel(rf"weights $\hat{{W}}$ [{force_unit_name(design.force_unit)}]")
    for number, name in enumerate(design.network.inputs):
        _lines(lower, t, V[:, :, number], SERIES[number % len(SERIES)], _SYMBOLS[name])
    lower.set(ylabel=r"weights $\hat{V}$ [-]")
    label_time(lower, recording.t)
    for axes, values in ((upper, W), (lower, V)):
        if history.diverged_at is not None:  # before the law runs away
            peak = np.abs(values).max(axis=(1, 2))
            values = values[peak <= 10.0 * np.median(peak[np.isfinite(peak)])]
        axes.set_ylim(force_range(values))
        for t_freeze in freeze_times:
            mark_freeze(axes, t_freeze)
        legend_beside(axes)
    figure.align_ylabels()
    return figure


def _lines(axes: Axes, t: Array, values: Array, color: str, label: str) -> None:
    """Draw the columns of `values` (n, k) in one color under one label."""
    drawn = drawable(values, force_range(values))
    axes.plot(t, drawn, color=color, linewidth=0.7)[0].set_label(label)


Quartiles = tuple[float, float, float]  # median, lower and upper quartile
_MARKS = {  # color, marker
    "instantaneous": (ORANGE, "s"),
    "integral": (BLUE, "o"),
    "instantaneous_scaled": (GREEN, "D"),
}


@styled
def comparison_figure(
    results: Mapping[str, Mapping[str, Quartiles]],
    paper: Mapping[str, Mapping[str, float]],
) -> Figure:
    """Draw medians of the force RMSE with whiskers from quartile to quartile, the paper's hollow.

    results : by law, by column as it is to be labeled: median, lower, upper quartile [kN]; a law
    that diverged has no column or values that are not finite, which are left out.
    paper : by law, by column: the value that the paper prints [kN].
    """
    columns = list(dict.fromkeys(name for row in results.values() for name in row))
    figure = new_figure(2.9)
    axes = figure.subplots()
    order: list[str] = []
    for number, (law, row) in enumerate(results.items()):
        if not row:
            continue
        label = VARIANTS[law].title.replace("eta/lambda", "η/λ")
        color, marker = _MARKS[law]
        order += [label, f"{label} (paper)"]
        places = {name: k + _OFFSET * (number - 1) for k, name in enumerate(columns)}
        middle, *ends = np.array(list(row.values()), dtype=np.float64).T
        middle[~np.isfinite(middle)] = np.nan
        axes.errorbar(
            [places[name] for name in row],
            middle,
            yerr=np.nan_to_num(np.abs(middle - ends), nan=0.0, posinf=0.0),
            fmt=marker,
            label=label,
            color=color,
            ms=4.5,
            elinewidth=1.2,
            capsize=3.0,
        )
        printed = {name: value for name, value in paper.get(law, {}).items() if name in row}
        if printed:
            axes.plot(
                [places[name] + 0.07 for name in printed],
                list(printed.values()),
                marker,
                label=f"{label} (paper)",
                ms=5.0,
                mfc="white",
                mec=color,
                mew=1.1,
            )
    low, high = axes.dataLim.minposy, axes.dataLim.ymax
    if high > _WIDE * low:
        axes.set(yscale="log", ylim=(low / 1.5, 1.5 * high))
    else:
        axes.set_ylim(0.0, 1.08 * high if high > 0.0 else 1.0)
    axes.set_xticks(range(len(columns)), columns)
    axes.tick_params(axis="x", length=0.0)
    axes.grid(visible=False, axis="x")
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylabel="force RMSE [kN]")
    for boundary in range(1, len(columns)):
        axes.axvline(boundary - 0.5, color="#DDDDDD", linewidth=0.6)
    legend_above(figure, columns=len(results), last=order)
    return figure


_FACTORS = np.geomspace(1e-3, 1e3, 1500)  # on the loop gain, along the locus


@styled
def locus_figure(loop: Loop, dt: float) -> Figure:
    """Draw the root locus of the sampled loop, with the design on it and the gain at its limit.

    Left all of the unit circle, right the part near z = 1, where slow poles are.

    dt : sampling interval [s].
    """
    locus = 1.0 + root_locus(loop, _FACTORS).ravel() * dt
    design = 1.0 + eigenvalues(loop.matrix()) * dt
    margin = gain_margin(loop, dt)
    circle = np.exp(1j * np.linspace(-np.pi, np.pi, 2881))
    figure = new_figure(3.5)
    panels = figure.subplots(1, 2)
    span = 1.3 * float(np.abs(1.0 - design).max())
    views = (-1.1, 1.1, 1.1), (1.0 - 1.5 * span, 1.0 + 0.5 * span, span)
    for axes, (left, right, height) in zip(panels, views, strict=True):
        axes.plot(circle.real, circle.imag, linewidth=0.9, color=BLACK, label="stability limit")
        axes.plot(locus.real, locus.imag, ".", color=GREY, markersize=1.0, label="any gain")
        axes.plot(design.real, design.imag, "o", color=BLUE, markersize=4.5, label="design")
        if 0.0 < margin.factor < np.inf:
            edge = 1.0 + eigenvalues(loop.scaled(margin.factor).matrix()) * dt
            name = f"{margin.factor:.3g} times its gain"
            axes.plot(edge.real, edge.imag, "x", color=ORANGE, markersize=5.5, label=name)
        axes.set(xlim=(left, right), ylim=(-height, height), aspect="equal")
        axes.set_xlabel("real part of z [-]")
    panels[0].set_ylabel("imaginary part of z [-]")
    panels[0].set_title("Poles of the sampled loop")
    phase = phase_margin(loop, dt)
    panels[1].set_title(f"Near z = 1; phase margin {phase:.0f}°")
    return figure
