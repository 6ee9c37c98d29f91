"""A stored model beside the motion of a drive: the force that it shows, and the road's friction."""

import numpy as np
from matplotlib.figure import Figure

from codegen.arrays import thinning
from identifier.verdict import RoadFriction, WindowForces
from models.vehicle import Vehicle
from tireid.figures.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    SKY,
    Look,
    axle_panels,
    force_unit_of,
    label_time,
    new_figure,
    styled,
)

_POINTS: Look = {"linestyle": "", "marker": ".", "markersize": 3.0}


@styled
def motion_figure(windows: WindowForces, vehicle: Vehicle) -> Figure:
    """Draw the force that the motion shows and that of the model, and what is missed below."""
    loads = np.array(vehicle.axle_loads)
    measured, modelled = windows.measured * loads, windows.modelled * loads
    unit = force_unit_of(measured)
    figure, panels = axle_panels([2.0, 1.0])
    for axle, (upper, lower) in enumerate(panels.T):
        seen, said = measured[:, axle] / unit.newtons, modelled[:, axle] / unit.newtons
        upper.plot(windows.t, seen, color=BLACK, label="from the motion", **_POINTS)
        upper.plot(windows.t, said, color=ORANGE, label="model", **_POINTS)
        lower.axhline(0.0, color=BLACK, linewidth=0.6)
        lower.plot(windows.t, said - seen, color=ORANGE, **_POINTS)
        label_time(lower, windows.t)
    panels[0, 0].set_ylabel(f"mean force [{unit.name}]")
    panels[1, 0].set_ylabel(f"missed [{unit.name}]")
    return figure


@styled
def friction_figure(friction: RoadFriction) -> Figure:
    """Draw the friction of a drive's road over that of the drive that taught, and its doubt."""
    some = slice(None, None, thinning(len(friction.t)))
    t, ratio, sd = friction.t[some], friction.ratio[some], friction.sd[some]
    figure = new_figure(2.8)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
    ends = ratio * np.exp(-sd), ratio * np.exp(sd)
    upper.fill_between(
        t, *ends, label="one standard deviation", color=SKY, alpha=0.5, linewidth=0.0
    )
    upper.plot(t, ratio, color=BLUE, label="friction")
    upper.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--", label="as taught")
    upper.set(ylabel="friction over that of\nthe identification drive", ylim=(0.0, None))
    lower.plot(t, friction.another[some], color=ORANGE, label="another road")
    lower.plot(
        t,
        friction.unexplained[some],
        label="no friction explains it",
        color=BLACK,
        linestyle=":",
    )
    lower.set(ylabel="probability", ylim=(-0.05, 1.05))
    label_time(lower, friction.t)
    return figure
