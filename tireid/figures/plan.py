"""A planned maneuver: its passes in the area, what is steered, and the band before and after."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from codegen.arrays import Array
from identifier.axle.band import declared_spread
from identifier.axle.curve import unit_matrix
from identifier.band import LEVEL
from identifier.plan import Plan
from tireid.figures import style
from tireid.figures.chosen import CHOSEN

_ARROW = 0.07  # lengths of the area: of the arrow at the entry of a pass


@style.styled
def plan_area_figure(found: Plan) -> Figure:
    """Draw the passes in the area, with every tire that the car may have."""
    space = found.space
    height = CHOSEN.page * space.width / space.length
    figure = style.new_figure(CHOSEN.page, min(max(1.8, height), CHOSEN.page))
    axes = figure.subplots()
    axes.add_patch(Rectangle((0.0, 0.0), space.length, space.width, fill=False, linewidth=1.2))
    inner = space.length - 2.0 * space.margin, space.width - 2.0 * space.margin
    corner = space.margin, space.margin
    look: Mapping[str, Any] = {"fill": False, "linestyle": "--", "color": style.GREY}
    axes.add_patch(Rectangle(corner, *inner, label="margin", **look))
    for k, one in enumerate(found.passes):
        color = style.SERIES[k % len(style.SERIES)]
        X, Y = one.motion.X[:, 0], one.motion.Y[:, 0]
        others = axes.plot(X[:, 1:], Y[:, 1:], color=color, alpha=0.4, linewidth=0.6)
        axes.plot(X[:, 0], Y[:, 0], color=color, label=f"pass {k + 1}")
        others[0].set_label("other tires" if k == 0 else None)
        (x, y, psi), ahead = one.course(np.zeros(1))[0], _ARROW * space.length
        tail = x - ahead * np.cos(psi), y - ahead * np.sin(psi)
        arrow = {"arrowstyle": "-|>", "color": color}
        axes.annotate("", (x, y), tail, arrowprops=arrow, annotation_clip=False)
    axes.set_xlim(-1.3 * _ARROW * space.length, 1.03 * space.length)
    axes.set(xlabel="X [m]", ylabel="Y [m]", aspect="equal")
    style.legend_above(figure)
    return figure


@style.styled
def plan_steering_figure(found: Plan, ratio: float | None) -> Figure:
    """Draw the angle of the front wheels of each pass, and what force it asks for."""
    figure = style.new_figure(CHOSEN.page, 3.4)
    top, bottom = figure.subplots(2, 1, sharex=True)
    for k, one in enumerate(found.passes):
        color = style.SERIES[k % len(style.SERIES)]
        t = np.linspace(0.0, one.steering.duration, 600)
        top.plot(t, np.degrees(one.steering.steering(t)[:, 0]), color=color, label=f"pass {k + 1}")
        for axle, line in ((0, "-"), (1, "--")):
            used = one.motion.force[:, axle, 0, 0] / found.tires.grip[0, axle]
            bottom.plot(one.t, 100.0 * used, color=color, linestyle=line)
    top.set(ylabel="front wheels [deg]")
    if ratio is not None:
        top.secondary_yaxis(
            "right", functions=(lambda x: ratio * x, lambda x: x / ratio)
        ).set_ylabel("hand wheel [deg]")
    bottom.set(xlabel="time [s]", ylabel="force over grip [%]")
    bottom.set_title("front solid, rear dashed", loc="right", color="#444444")
    style.legend_above(figure)
    return figure


@style.styled
def plan_band_figure(found: Plan) -> Figure:
    """Draw the likely force curves with their band of 90 % before and after the maneuver."""
    tires = found.tires
    loads = np.array(tires.vehicle.axle_loads)
    farthest = 1.2 * float(tires.slip_at(0.98)[0].max())
    slip = np.linspace(0.0, farthest, 200)
    units = unit_matrix(slip, tires.method.ladder)
    unit = style.force_unit_of(tires.grip[0] * loads)
    figure, ((*both,),) = style.axle_panels([2.9])
    for i, axes in enumerate(both):
        force = units @ tires.W[0, i]
        for P, color, label in (
            (tires.covariance, style.GREY, "before"),
            (found.passes[-1].covariance, style.ORANGE, "after"),
        ):
            half = _half_band(units, force, P[i], tires.prior[i])
            low, high = ((force + sign * half) * loads[i] / unit.newtons for sign in (-1.0, 1.0))
            axes.fill_between(np.degrees(slip), low, high, color=color, alpha=0.3, label=label)
        likely = force * loads[i] / unit.newtons
        axes.plot(np.degrees(slip), likely, color=style.BLUE, label="likely")
        axes.set(xlabel="slip angle [deg]")
    both[0].set(ylabel=f"lateral force [{unit.name}]")
    style.legend_above(figure)
    return figure


def _half_band(units: Array, force: Array, P: Array, prior: Array) -> Array:
    """Return half the width of the band [static axle loads], (k,)."""
    n = units.shape[1]
    left, before = (np.einsum("ki,ij,kj->k", units, Q[:n, :n], units) for Q in (P, prior))
    return declared_spread(force, left, before).half_width(1.0, LEVEL)
