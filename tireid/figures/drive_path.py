"""The path from above at one scale: cones, the driven tracks, and the car at every few meters."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mpc.loop import Drive
from mpc.path import Path
from tireid.figures.car_shape import car_shape
from tireid.figures.drive_look import CONES, PATH, tire_look
from tireid.figures.panels import legend_above
from tireid.figures.style import PAGE, new_figure, styled

Array = NDArray[np.float64]

ROW_LENGTH = 80.0  # a long and narrow path goes on in the next row after about this many meters
MOST_ROWS = 5
NARROW = 4.0  # from this ratio between its extents on a path is long and narrow
MARGIN = 3.0  # around the path [m]
RUN_UP = 16.0  # of the straights before and after the cones that is shown [m]
INNER_WIDTH = PAGE - 0.75  # what labels leave of the page [in]
HIGHEST = 5.0  # panel [in]
CARS_EVERY = 2.6  # wheelbases between two outlines
SMALL = 160.0  # in a picture of more than that [m] cars cannot be seen
ZOOM = 44.0  # a part of such a path that is drawn large, where a car was farthest off [m]
SEEN = 0.05  # deviations are drawn larger until the largest is this share of the picture


@styled
def drive_path_figure(drives: Mapping[str, Drive]) -> Figure:
    """Draw the path, its cones and where every car drove; the first with its outlines.

    A path too large for cars to be seen is drawn as a whole with its deviations magnified, as the
    legend says, and beside it the place of the largest deviation at its true scale.

    Parameters
    ----------
    drives : by the name in the legend, along one path; the first is drawn on top.
    """
    path = next(iter(drives.values())).path
    low, high = _extent(path, drives)
    width, height = high - low
    if width <= NARROW * height and max(width, height) > SMALL:
        return _large(path, drives)
    rows = 1
    if width > NARROW * height:
        rows = min(MOST_ROWS, max(1, round(width / ROW_LENGTH)))
    step = width / rows
    inch = min(INNER_WIDTH / step, HIGHEST / height)  # of a meter
    figure = new_figure(PAGE, rows * (height * inch + 0.3) + 0.6)
    panels = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for row, axes in enumerate(panels):
        ends = float(low[0] + row * step), float(low[0] + (row + 1) * step)
        axes.set(xlim=ends, ylim=(low[1], high[1]), aspect="equal", ylabel="Y [m]")
        _draw(axes, path, drives)
        axes.set_yticks(axes.get_yticks()[1:-1:1])
        axes.set_ylim(low[1], high[1])
    panels[-1].set_xlabel("X [m]")
    legend_above(figure, order=tuple(drives))
    return figure


def _extent(path: Path, drives: Mapping[str, Drive]) -> tuple[Array, Array]:
    """Corners of what is shown: the path with its cones, and the tracks as far as not absurd."""
    places = np.column_stack([path.X, path.Y])
    low, high = places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN
    if len(path.cones):
        first, last = path.cones.min(axis=0), path.cones.max(axis=0)
        low, high = np.minimum(low, first - MARGIN), np.maximum(high, last + MARGIN)
        low[0], high[0] = max(low[0], first[0] - RUN_UP), min(high[0], last[0] + RUN_UP)
    room = 2.0 * MARGIN
    for drive in drives.values():
        driven = np.column_stack([drive.X, drive.Y])
        low[1] = max(min(low[1], driven[:, 1].min() - 2.0), low[1] - room)
        high[1] = min(max(high[1], driven[:, 1].max() + 2.0), high[1] + room)
    return low, high


def _large(path: Path, drives: Mapping[str, Drive]) -> Figure:
    figure = new_figure(PAGE, 3.6)
    whole, part = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    largest = max(float(np.abs(drive.e_y).max()) for drive in drives.values())
    size = max(float(np.ptp(path.X)), float(np.ptp(path.Y)))
    times = _round(SEEN * size / max(largest, 1e-3))
    whole.plot(path.X, path.Y, **PATH)
    for label, drive in reversed(list(drives.items())):
        X, Y, psi = path.pose(drive.s)
        off = times * drive.e_y
        look = tire_look(label)
        whole.plot(X - off * np.sin(psi), Y + off * np.cos(psi), label=label, **look)
    whole.set(aspect="equal", title=f"deviation drawn {times:g} times larger")
    worst = max(drives.values(), key=lambda drive: float(np.abs(drive.e_y).max()))
    k = int(np.abs(worst.e_y).argmax())
    X0, Y0, _ = (float(value) for value in path.pose(worst.s[k]))
    whole.plot(X0, Y0, marker="s", markersize=9.0, markerfacecolor="none", color="#AA4499")
    half = 0.5 * ZOOM
    part.set(xlim=(X0 - half, X0 + half), ylim=(Y0 - half, Y0 + half), aspect="equal")
    _draw(part, path, drives)
    part.set_title(f"the largest deviation, {abs(worst.e_y[k]):.2f} m, to scale")
    for axes in (whole, part):
        axes.set(xlabel="X [m]", ylabel="Y [m]")
    legend_above(figure, order=tuple(drives))
    return figure


def _round(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that is not larger, at least 1."""
    steps = np.array([a * 10.0**b for b in range(4) for a in (1.0, 2.0, 5.0)])
    return float(steps[steps <= max(value, 1.0)][-1])


def _draw(axes: Axes, path: Path, drives: Mapping[str, Drive]) -> None:
    axes.plot(path.X, path.Y, **PATH)
    if len(path.cones):
        axes.plot(path.cones[:, 0], path.cones[:, 1], **CONES)
    first = next(iter(drives))
    _draw_cars(axes, drives[first], tire_look(first)["color"])
    for label, drive in reversed(list(drives.items())):
        axes.plot(drive.X, drive.Y, label=label, **tire_look(label))


def _draw_cars(axes: Axes, drive: Drive, color: str) -> None:
    every = CARS_EVERY * drive.vehicle.wheelbase
    at = np.searchsorted(drive.s, np.arange(drive.s[0], drive.s[-1], every))
    signals = (drive.X, drive.Y, drive.psi, drive.delta)
    shapes = [
        car_shape(drive.vehicle, *(float(values[k]) for values in signals))
        for k in at[at < drive.s.size]
    ]
    bodies = [shape.body for shape in shapes]
    wheels = [wheel for shape in shapes for wheel in shape.wheels]
    axes.add_collection(
        PolyCollection(bodies, facecolors=(color, 0.12), edgecolors=color, linewidths=0.5)
    )
    axes.add_collection(PolyCollection(wheels, facecolors="#333333", edgecolors="none"))
