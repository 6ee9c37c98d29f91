"""A planned lap: on the map and over arc length, which axle limits it, and how far it goes."""

from itertools import product

import numpy as np
from matplotlib.figure import Figure

from mpc.path.speed import POWER, TOP, SpeedProfile
from tireid.figures.drive import ARC
from tireid.figures.style import BLACK, BLUE, Look, new_figure, styled

_POINTS = 2500  # of a lap that are drawn
_AXLES = {"front": "#A5D2ED", "rear": "#F6CBB0"}
_ABOVE = 1.15  # of the top speed, up to which the limit of the turn is drawn
_DASHED: Look = {"color": BLACK, "linewidth": 1.0, "linestyle": (0, (3, 1.5))}


@styled
def lap_figure(profile: SpeedProfile) -> Figure:
    """Draw planned speeds and accelerations along a path, and where which axle limits them."""
    assert profile.planned is not None
    path, (planner, share) = profile.path, profile.planned
    k = np.linspace(0, path.s.size - 1, _POINTS).astype(int)
    s, v, X, Y = path.s[k], profile.v[k], path.X[k], path.Y[k]
    figure = new_figure(8.0)
    above, *below = figure.subplots(4, 1, height_ratios=(4.0, 1.4, 1.0, 1.0))
    turn = share * np.interp(v, planner.limits.v, planner.limits.a_y)
    turn = np.sqrt(turn / np.maximum(np.abs(path.kappa[k]), 1e-9))
    turn[turn > _ABOVE * v.max()] = np.nan
    below[0].plot(s, turn, label="limit of the turn", **_DASHED)
    drawn = {"speed [m/s]": v, "$a_y$ [m/s²]": profile.a_y[k], "$a_x$ [m/s²]": profile.a_x[k]}
    limiting = np.where(np.isin(profile.limited_by, (POWER, TOP)), "", profile.axle)[k]
    for axes, (name, values) in zip(below, drawn.items(), strict=True):
        axes.plot(s, values, color=BLUE, linewidth=1.1)
        axes.set(ylabel=name, xlim=(0.0, path.length))
        ends = axes.get_xaxis_transform()
        for axle, color in _AXLES.items():
            there, label = limiting == axle, f"{axle} axle limits"
            axes.fill_between(s, 0.0, 1.0, there, transform=ends, color=color, lw=0.0, label=label)
            above.plot(np.where(there, X, np.nan), Y, color=color, linewidth=7.0)
    below[-1].set_xlabel(ARC)
    figure.colorbar(above.scatter(X, Y, c=v, s=3.0, zorder=3.0), ax=above, label="speed [m/s]")
    above.plot(X[0], Y[0], "wo", mec=BLACK, zorder=4.0, label="start")
    above.set(xlabel="X [m]", ylabel="Y [m]")
    above.axis("equal")
    figure.align_ylabels(below)
    return figure


@styled
def lap_gg_figure(profile: SpeedProfile) -> Figure:
    """Draw what planned speeds ask of the tires in the plane, and what they allow."""
    assert profile.planned is not None
    (planner, share), v = profile.planned, profile.v
    limits, figure = planner.limits, new_figure(4.2)
    axes = figure.subplots()
    points = axes.scatter(profile.a_y, profile.a_x + limits.drag * v**2, c=v, s=3.0, zorder=3.0)
    figure.colorbar(points, ax=axes, label="speed [m/s]")
    for speed, side in product((v.min(), v.max()), (limits.push.most, -limits.brake.most)):
        row = int(np.abs(limits.v - speed).argmin())
        edge = np.append(side[row, ::-1], side[row])
        turn = limits.a_y[row] * np.linspace(-1.0, 1.0, edge.size)
        axes.plot(turn, edge, color=BLACK, linewidth=1.0, label="limit")
        axes.plot(share * turn, share * edge, label=f"{100.0 * share:.3g} % of it", **_DASHED)
    axes.set(xlabel="$a_y$ to the left [m/s²]", ylabel="$a_x$ and drag [m/s²]")
    axes.axis("equal")
    return figure
