"""The path from above at one scale: cones, the driven tracks, and the car at every few meters."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from codegen.arrays import Array
from models.faults import SensorFault
from models.vehicle import Vehicle
from tireid.figures.style import (
    AMBER,
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    PAGE,
    PURPLE,
    TIME,
    Look,
    few_ticks,
    legend_above,
    new_figure,
    styled,
)

if TYPE_CHECKING:
    from mpc.loop.record import Drive
    from mpc.path import Path

# dashes of tires as they are at the end of a drive [points]
_LATER = (0, (2.5, 0.9))
_NEAR = 0.75  # a limit is drawn where a command comes this close to it
_FRONT_OVERHANG = 0.32  # of the wheelbase, beyond the front axle
_REAR_OVERHANG = 0.36  # of the wheelbase, beyond the rear axle
_TRACK = 0.57  # of the wheelbase, where no chassis says
_BODY_BESIDE_TRACK = 0.1  # of the wheelbase: how much wider than the track the body is
_WHEEL_LENGTH = 0.24  # of the wheelbase
_WHEEL_WIDTH = 0.085  # of the wheelbase
_CORNERS = 33  # points of the body
_ROUNDING = 0.3  # of its corners: exponent of a circle that becomes a rectangle
# a long and narrow path goes on in the next row after about this many meters
_ROW_LENGTH = 80.0
_MOST_ROWS = 5  # of a path
_NARROW = 4.0  # from this ratio between its extents on a path is long and narrow
_MARGIN = 3.0  # around the path [m]
_RUN_UP = 16.0  # of the straights before and after the cones that is shown [m]
_HIGHEST = 5.0  # panel [in]
_CARS_EVERY = 2.6  # wheelbases between two outlines


_Drives = Mapping[str, "Drive"]  # by their tires
Drops = Sequence[tuple[float, float]]  # arc length [m] and friction from there on


@styled
def drive_solve_figure(drive: "Drive") -> Figure:
    """Draw the solve times of a drive, their median and the time that one of a hundred exceeds."""
    times = 1e3 * drive.solve_time  # ms
    figure = new_figure(2.5)
    axes = figure.subplots()
    axes.plot(drive.t, times, ".", ms=2.2, mew=0.0, color=BLUE, label="a step")
    failed = drive.status != 0
    if failed.any():
        label = f"failed ({np.count_nonzero(failed)})"
        axes.plot(drive.t[failed], times[failed], "x", ms=4.0, color=ORANGE, label=label)
    for share, name, color in ((0.5, "median", PURPLE), (0.99, "99 %", ORANGE)):
        value = float(np.quantile(times, share))
        axes.axhline(value, color=color, linewidth=1.1, label=f"{name} {value:.3g} ms")
    axes.set(xlabel=TIME, ylabel="solve time [ms]", yscale="log")
    few_ticks(axes.yaxis)
    period = f"largest {times.max():.3g} ms of a period of {1e3 * drive.period:g} ms"
    axes.set_title(period, loc="right")
    axes.set_title(f"{times.size} steps")
    return figure


PATH: Look = {
    "color": "#9ADBC6",
    "linewidth": 3.5,
    "solid_capstyle": "butt",
    "label": "path",
}
CONES: Look = {
    "linestyle": "",
    "marker": "o",
    "markersize": 2.6,
    "markeredgewidth": 0.4,
    "markeredgecolor": "#7A4B00",
    "markerfacecolor": AMBER,
    "label": "cones",
}
ORACLE = "oracle"  # the name of the true tire
AT_THE_END = " at the end"  # what a label ends with that is of a tire as it was then
_TIRES = {
    "linear": {"color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.3},
    "frozen": {"color": ORANGE, "linestyle": "-", "linewidth": 1.2},
    ORACLE: {"color": BLACK, "linestyle": (0, (5, 1.5)), "linewidth": 1.1},
    "learning": {"color": BLUE, "linestyle": "-", "linewidth": 1.2},
}


def tire_look(label: str) -> dict[str, Any]:
    """Return color, line style and width of a tire in every figure."""
    look = dict(_TIRES.get(label.split()[0], _TIRES["frozen"]))
    return look | {"linestyle": _LATER, "linewidth": 1.4} if label.endswith(AT_THE_END) else look


_REPLANNED, _NOTICED = "plans with another tire or grip", "sensor fault noticed"
ARC = "arc length of the path [m]"
_ERRORS = (
    "deviation $e_y$\n[m]", "heading error\n[deg]", "lateral acc.\n[m/s²]", "speed $v_x$\n[m/s]",
)  # fmt: skip


@styled
def drive_errors_figure(
    drives: _Drives,
    *,
    off_path: float,
    drops: Drops = (),
    faults: Sequence[SensorFault] = (),
) -> Figure:
    """Draw lateral deviation, heading error, lateral acceleration and speed over arc length.

    off_path : deviation [m] at which a car counts as off the path, drawn where it comes near.
    drops : where the friction changes: arc length [m] and friction from there on.
    """
    figure = new_figure(5.2)
    panels = figure.subplots(4, 1, sharex=True)
    for label, drive in reversed(list(drives.items())):
        look = tire_look(label)
        curves = (drive.e_y, np.rad2deg(drive.e_psi), drive.a_y, drive.v_x)
        for axes, curve in zip(panels, curves, strict=True):
            axes.plot(drive.s, curve, label=label, **look)
        if drive.notes:
            at = np.searchsorted(drive.t, [t for t, _ in drive.notes]).clip(max=drive.t.size - 1)
            panels[0].plot(
                drive.s[at],
                drive.e_y[at],
                "D",
                label=_REPLANNED,
                color=look["color"],
                ms=3.2,
                mfc="white",
                zorder=3.0,
            )
    for axes, label in zip(panels, _ERRORS, strict=True):
        axes.set_ylabel(label)
        _mark_road(axes, drives, drops, faults)
    for axes in panels[:3]:
        axes.axhline(0.0, color="#999999", linewidth=0.6, zorder=1)
    largest = max(float(np.abs(drive.e_y).max()) for drive in drives.values())
    reach = min(1.12 * largest, 1.3 * off_path)
    panels[0].set_ylim(-reach, reach)
    if reach > 0.8 * off_path:
        for side in (-off_path, off_path):
            panels[0].axhline(side, color="#AA4499", linewidth=0.8, label="off the path")
    low, high = panels[3].get_ylim()
    room = max(0.5 * (2.0 - high + low), 0.0)  # a speed that is held is a level line
    panels[3].set_ylim(low - room, high + room)
    panels[-1].set(xlabel=ARC, xlim=(0.0, max(float(drive.s[-1]) for drive in drives.values())))
    figure.align_ylabels(panels)
    legend_above(figure, last=(*drives, _REPLANNED))
    return figure


def mark_drops(axes: Axes, drops: Drops) -> None:
    """Mark where the friction of the road changes.

    drops : arc length [m] and friction from there on.
    """
    for place, mu in drops:
        axes.axvline(
            place, label=f"friction {mu:g}", color=GREY, linewidth=0.8, linestyle=(0, (4, 2))
        )


def _mark_road(
    axes: Axes,
    drives: _Drives,
    drops: Drops,
    faults: Sequence[SensorFault],
) -> None:
    """Mark drops, shade where a sensor is broken, mark where a supervisor came to doubt it."""
    from mpc.handover.rules import Verdict

    mark_drops(axes, drops)
    first = next(iter(drives.values()))
    for fault in faults:
        if fault.start <= first.t[-1]:
            span = np.interp([fault.start, fault.start + fault.duration], first.t, first.s)
            axes.axvspan(
                *map(float, span),
                label=f"{fault.channel} {fault.kind}",
                facecolor="#F6D9D5",
                edgecolor="none",
                zorder=0,
            )
    for label, drive in drives.items():
        for t, text in drive.notes:
            if text.startswith(Verdict.FAULT.value):
                axes.axvline(
                    float(np.interp(t, drive.t, drive.s)),
                    label=_NOTICED,
                    color=tire_look(label)["color"],
                    linewidth=1.2,
                    linestyle=(0, (1, 1)),
                )


@styled
def drive_steering_figure(
    drives: _Drives,
    *,
    angle_limit: float,
    rate_limit: float,
    drops: Drops = (),
    faults: Sequence[SensorFault] = (),
) -> Figure:
    """Draw commanded angles of the front wheels over arc length, and the rate of the first drive.

    angle_limit : that the tracker keeps [rad].   rate_limit : that the tracker keeps [rad/s].
    drops : where the friction changes: arc length [m] and friction from there on.
    """
    figure = new_figure(3.4)
    angle, rate = figure.subplots(2, 1, sharex=True)
    for label, drive in reversed(list(drives.items())):
        look = tire_look(label)
        angle.plot(drive.s, np.rad2deg(drive.command), label=label, **look)
    name, first = next(iter(drives.items()))
    angle.plot(
        first.s,
        np.rad2deg(first.delta),
        linewidth=0.8,
        color=PURPLE,
        label=f"wheels of {name}",
    )
    speed = np.rad2deg(np.diff(first.command) / np.diff(first.t))
    rate.plot(first.s[1:], speed, **(tire_look(name) | {"linewidth": 0.7, "linestyle": "-"}))
    for axes, limit, label in (
        (angle, angle_limit, "command\n[deg]"),
        (rate, rate_limit, f"rate, {name}\n[deg/s]"),
    ):
        axes.set_ylabel(label)
        most = float(np.rad2deg(limit))
        if max(np.abs(axes.get_ylim())) > _NEAR * most:
            for side in (-most, most):
                look = {"color": "#AA4499", "linewidth": 0.8, "linestyle": (0, (4, 2))}
                axes.axhline(side, label="limit", **look)
        _mark_road(axes, drives, drops, faults)
    rate.set(xlabel=ARC, xlim=(0.0, max(float(drive.s[-1]) for drive in drives.values())))
    figure.align_ylabels([angle, rate])
    legend_above(figure, last=tuple(drives))
    return figure


# The car from above as polygons: a body and four wheels, the front ones steered.
#
# Pictures need a length, a width and wheels; a vehicle without a chassis gets those that are usual
# for its wheelbase.


class _CarShape(NamedTuple):
    """Polygons in the ground's frame [m]: body (k, 2), glass (4, 2) and wheels (4, 4, 2)."""

    body: Array
    glass: Array
    wheels: Array


def car_shape(vehicle: Vehicle, X: float, Y: float, psi: float, delta: float = 0.0) -> _CarShape:
    """Return a car at a pose; wheels in the order front left, front right, rear left, rear right.

    X, Y : center of gravity [m].   psi : heading [rad].
    delta : angle of the front wheels [rad], positive to the left.
    """
    long = vehicle.wheelbase
    chassis = vehicle.chassis
    tracks = (_TRACK * long,) * 2 if chassis is None else (chassis.track_front, chassis.track_rear)
    half = 0.5 * (max(tracks) + _BODY_BESIDE_TRACK * long)
    front, rear = vehicle.l_f + _FRONT_OVERHANG * long, -vehicle.l_r - _REAR_OVERHANG * long
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS)
    round_ = np.column_stack([np.cos(angle), np.sin(angle)])
    body = np.sign(round_) * np.abs(round_) ** _ROUNDING * (0.5 * (front - rear), half)
    body += (0.5 * (front + rear), 0.0)
    glass = np.array([(0.37, 0.6), (0.23, 0.78), (0.23, -0.78), (0.37, -0.6)]) * (long, half)
    corners = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    wheel = 0.5 * long * corners * (_WHEEL_LENGTH, _WHEEL_WIDTH)
    wheels = np.stack(
        [
            wheel @ _turn(angle).T + (x, 0.5 * side * track)
            for x, track, angle in ((vehicle.l_f, tracks[0], delta), (-vehicle.l_r, tracks[1], 0.0))
            for side in (1.0, -1.0)
        ]
    )
    turn, place = _turn(psi).T, np.array([X, Y])
    return _CarShape(body @ turn + place, glass @ turn + place, wheels @ turn + place)


def _turn(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


_INNER_WIDTH = PAGE - 0.75  # what labels leave of the page [in]


@styled
def drive_path_figure(drives: _Drives) -> Figure:
    """Draw the path, its cones and where every car drove; the first with its outlines."""
    path = next(iter(drives.values())).path
    low, high = _extent(path, drives)
    width, height = high - low
    long = width > _NARROW * height
    rows = min(_MOST_ROWS, max(1, round(width / _ROW_LENGTH))) if long else 1
    step = width / rows
    inch = min(_INNER_WIDTH / step, _HIGHEST / height)  # of a meter
    figure = new_figure(rows * (height * inch + 0.3) + 0.6)
    panels = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for row, axes in enumerate(panels):
        ends = float(low[0] + row * step), float(low[0] + (row + 1) * step)
        axes.set(xlim=ends, ylim=(low[1], high[1]), aspect="equal", ylabel="Y [m]")
        _draw(axes, path, drives)
        axes.set_yticks(axes.get_yticks()[1:-1])
        axes.set_ylim(low[1], high[1])
    panels[-1].set_xlabel("X [m]")
    legend_above(figure, last=tuple(drives))
    return figure


def _extent(path: "Path", drives: _Drives) -> tuple[Array, Array]:
    """Corners of what is shown: the path with its cones, and the tracks as far as not absurd."""
    places = np.vstack([np.column_stack([path.X, path.Y]), path.cones])
    low, high = places.min(axis=0) - _MARGIN, places.max(axis=0) + _MARGIN
    if len(path.cones):
        X = path.cones[:, 0]
        low[0], high[0] = max(low[0], X.min() - _RUN_UP), min(high[0], X.max() + _RUN_UP)
    driven = np.concatenate([drive.Y for drive in drives.values()])
    room = 2.0 * _MARGIN
    low[1] = np.clip(driven.min() - 2.0, low[1] - room, low[1])
    high[1] = np.clip(driven.max() + 2.0, high[1], high[1] + room)
    return low, high


def _draw(axes: Axes, path: "Path", drives: _Drives) -> None:
    axes.plot(path.X, path.Y, **PATH)
    if len(path.cones):
        axes.plot(*path.cones.T, **CONES)
    label, drive = next(iter(drives.items()))
    color, every = tire_look(label)["color"], _CARS_EVERY * drive.vehicle.wheelbase
    at = np.searchsorted(drive.s, np.arange(drive.s[0], drive.s[-1], every))
    shapes = [
        car_shape(drive.vehicle, drive.X[k], drive.Y[k], drive.psi[k], drive.delta[k])
        for k in at[at < drive.s.size]
    ]
    bodies, wheels = [one.body for one in shapes], [wheel for one in shapes for wheel in one.wheels]
    outline = PolyCollection(bodies, facecolors=(color, 0.12), edgecolors=color, linewidths=0.5)
    axes.add_collection(outline)
    axes.add_collection(PolyCollection(wheels, facecolors="#333333", edgecolors="none"))
    for label, drive in reversed(list(drives.items())):
        axes.plot(drive.X, drive.Y, label=label, **tire_look(label))
