"""The path from above at one scale: cones, the driven tracks, and the car at every few meters."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from codegen.arrays import Array
from models.faults import SensorFault
from models.vehicle import Vehicle
from tireid.figures import style

if TYPE_CHECKING:
    from mpc.loop.record import Drive
    from mpc.path import Path

_BINS = 60
WIDE = 10.0  # times slower than the median: from there on the axis is logarithmic
MILLI = 1e3


@style.styled
def drive_solve_figure(drive: "Drive") -> Figure:
    """Draw the solve times of a drive as a histogram and over time."""
    times = MILLI * drive.solve_time
    median, p99, largest = np.quantile(times, [0.5, 0.99, 1.0])
    figure = style.new_figure(style.PAGE, 2.7)
    left, right = figure.subplots(1, 2)
    wide = largest > WIDE * median
    low = float(times.min()) / 1.1 if wide else 0.0
    bins = (
        np.geomspace(low, 1.1 * largest, _BINS) if wide else np.linspace(low, 1.1 * largest, _BINS)
    )
    left.hist(times, bins=list(bins), color=style.BLUE, alpha=0.8)
    left.set(xlabel="solve time [ms]", ylabel="steps [-]", xlim=(low, 1.1 * largest))
    right.plot(
        drive.t,
        times,
        linestyle="",
        marker=".",
        markersize=2.2,
        markeredgewidth=0.0,
        color=style.BLUE,
        rasterized=True,
        label="a step",
    )
    failed = drive.status != 0
    if failed.any():
        right.plot(
            drive.t[failed],
            times[failed],
            linestyle="",
            marker="x",
            markersize=4.0,
            color=style.ORANGE,
            label=f"failed ({np.count_nonzero(failed)})",
        )
    for value, name, color in ((median, "median", style.PURPLE), (p99, "99 %", style.ORANGE)):
        text = f"{name} {value:.3g} ms"
        left.axvline(value, color=color, linewidth=1.1, linestyle=(0, (4, 1.5)), label=text)
    right.set(xlabel=style.TIME, ylabel="solve time [ms]", ylim=(low, 1.3 * largest))
    if wide:
        left.set_xscale("log")
        right.set_yscale("log")
        for axis in (left.xaxis, right.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_locator(NullLocator())
    right.set_title(
        f"largest {largest:.3g} ms of a period of {MILLI * drive.period:g} ms", loc="right"
    )
    left.set_title(f"{times.size} steps")
    style.legend_above(figure)
    return figure


PATH: Mapping[str, Any] = {
    "color": "#9ADBC6",
    "linewidth": 3.5,
    "solid_capstyle": "butt",
    "label": "path",
}
CONES: Mapping[str, Any] = {
    "linestyle": "",
    "marker": "o",
    "markersize": 2.6,
    "markeredgewidth": 0.4,
    "markeredgecolor": "#7A4B00",
    "markerfacecolor": style.AMBER,
    "label": "cones",
}
ORACLE = "oracle"  # the name of the true tire
AT_THE_END = " at the end"  # what a label ends with that is of a tire as it was then
LATER = (0, (2.5, 0.9))
TIRES: Mapping[str, Mapping[str, Any]] = {
    "linear": {"color": style.GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.3},
    "frozen": {"color": style.ORANGE, "linestyle": "-", "linewidth": 1.2},
    ORACLE: {"color": style.BLACK, "linestyle": (0, (5, 1.5)), "linewidth": 1.1},
    "learning": {"color": style.BLUE, "linestyle": "-", "linewidth": 1.2},
}


def tire_look(label: str) -> dict[str, Any]:
    """Return color, line style and width of a tire in every figure."""
    look = dict(TIRES.get(label.split()[0], TIRES["frozen"]))
    return look | {"linestyle": LATER, "linewidth": 1.4} if label.endswith(AT_THE_END) else look


_REPLANNED, _NOTICED = "plans with another tire or grip", "sensor fault noticed"
ARC = "arc length of the path [m]"


@style.styled
def drive_errors_figure(
    drives: Mapping[str, "Drive"],
    *,
    off_path: float,
    drops: Sequence[tuple[float, float]] = (),
    faults: Sequence[SensorFault] = (),
) -> Figure:
    """Draw lateral deviation, heading error, lateral acceleration and speed over arc length.

    off_path : deviation [m] at which a car counts as off the path, drawn where it comes near.
    drops : where the friction changes: arc length [m] and friction from there on.
    """
    figure = style.new_figure(style.PAGE, 5.2)
    panels = figure.subplots(4, 1, sharex=True)
    labels = (
        "deviation $e_y$\n[m]",
        "heading error\n[deg]",
        "lateral acc.\n[m/s²]",
        "speed $v_x$\n[m/s]",
    )
    for label, drive in reversed(list(drives.items())):
        look = tire_look(label)
        curves = (drive.e_y, np.rad2deg(drive.e_psi), drive.a_y, drive.v_x)
        for axes, curve in zip(panels, curves, strict=True):
            axes.plot(drive.s, curve, label=label, **look)
        _mark_notes(panels[0], drive, look["color"])
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
        mark_drops(axes, drops)
    for axes in panels[:3]:
        axes.axhline(0.0, color="#999999", linewidth=0.6, zorder=1)
    largest = max(float(np.abs(drive.e_y).max()) for drive in drives.values())
    reach = min(1.12 * largest, 1.3 * off_path)
    panels[0].set_ylim(-reach, reach)
    if reach > 0.8 * off_path:
        for side in (-off_path, off_path):
            panels[0].axhline(side, color="#AA4499", linewidth=0.8, label="off the path")
    _roomy(panels[3], min(float(drive.v_x.min()) for drive in drives.values()))
    last = max(float(drive.s[-1]) for drive in drives.values())
    panels[-1].set(xlabel=ARC, xlim=(0.0, last))
    for axes in panels:
        _mark_faults(axes, drives, faults)
    figure.align_ylabels(panels)
    style.legend_above(
        figure, order=(*drives, _REPLANNED, *(friction_label(mu) for _, mu in drops))
    )
    return figure


def mark_drops(axes: Axes, drops: Sequence[tuple[float, float]]) -> None:
    """Mark where the friction of the road changes.

    drops : arc length [m] and friction from there on.
    """
    for place, mu in drops:
        axes.axvline(
            place, color=style.GREY, linewidth=0.8, linestyle=(0, (4, 2)), label=friction_label(mu)
        )


def _mark_faults(axes: Axes, drives: Mapping[str, "Drive"], faults: Sequence[SensorFault]) -> None:
    """Shade where a sensor is broken, and mark where a supervisor came to doubt the sensors."""
    from mpc.handover.rules import Verdict

    first = next(iter(drives.values()))
    for fault in faults:
        if fault.start > first.t[-1]:
            continue
        span = np.interp([fault.start, fault.start + fault.duration], first.t, first.s)
        axes.axvspan(
            *map(float, span),
            facecolor="#F6D9D5",
            edgecolor="none",
            zorder=0,
            label=f"{fault.channel} {fault.kind}",
        )
    for label, drive in drives.items():
        for t, text in drive.notes:
            if text.startswith(Verdict.FAULT.value):
                axes.axvline(
                    float(np.interp(t, drive.t, drive.s)),
                    color=tire_look(label)["color"],
                    linewidth=1.2,
                    linestyle=(0, (1, 1)),
                    label=_NOTICED,
                )


def friction_label(mu: float) -> str:
    """Return what a legend calls a friction of the road.

    mu : over that of the tire's measurement [-].
    """
    return f"friction {mu:g}"


def _mark_notes(axes: Axes, drive: "Drive", color: str) -> None:
    """Mark on the curve from where the tracker plans with another tire or grip."""
    if drive.notes:
        at = np.searchsorted(drive.t, [t for t, _ in drive.notes])
        at = np.minimum(at, drive.t.size - 1)
        axes.plot(
            drive.s[at],
            drive.e_y[at],
            linestyle="",
            marker="D",
            markersize=3.2,
            markerfacecolor="white",
            markeredgewidth=0.9,
            color=color,
            zorder=3.0,
            label=_REPLANNED,
        )


def _roomy(axes: Axes, slowest: float) -> None:
    """Show a speed that is held as a level line, not as noise at full height."""
    low, high = axes.get_ylim()
    if high - low < 2.0:
        middle = 0.5 * (low + high)
        low, high = middle - 1.0, middle + 1.0
    axes.set_ylim(min(low, slowest), high)


NEAR = 0.75  # a limit is drawn where a command comes this close to it


@style.styled
def drive_steering_figure(
    drives: Mapping[str, "Drive"],
    *,
    angle_limit: float,
    rate_limit: float,
    drops: Sequence[tuple[float, float]] = (),
    faults: Sequence[SensorFault] = (),
) -> Figure:
    """Draw commanded angles of the front wheels over arc length, and the rate of the first drive.

    angle_limit : that the tracker keeps [rad].   rate_limit : that the tracker keeps [rad/s].
    drops : where the friction changes: arc length [m] and friction from there on.
    """
    figure = style.new_figure(style.PAGE, 3.4)
    angle, rate = figure.subplots(2, 1, sharex=True)
    for label, drive in reversed(list(drives.items())):
        look = tire_look(label)
        angle.plot(drive.s, np.rad2deg(drive.command), label=label, **look)
    name, first = next(iter(drives.items()))
    angle.plot(
        first.s,
        np.rad2deg(first.delta),
        color=style.PURPLE,
        linewidth=0.8,
        label=f"wheels of {name}",
    )
    rate.plot(
        first.s[1:],
        np.rad2deg(np.diff(first.command) / np.diff(first.t)),
        **(tire_look(name) | {"linewidth": 0.7, "linestyle": "-"}),
    )
    for axes, limit, label in (
        (angle, angle_limit, "command\n[deg]"),
        (rate, rate_limit, f"rate, {name}\n[deg/s]"),
    ):
        axes.set_ylabel(label)
        _limits(axes, float(np.rad2deg(limit)))
        mark_drops(axes, drops)
        _mark_faults(axes, drives, faults)
    rate.set(xlabel=ARC, xlim=(0.0, max(float(drive.s[-1]) for drive in drives.values())))
    figure.align_ylabels([angle, rate])
    style.legend_above(figure, order=tuple(drives))
    return figure


def _limits(axes: Axes, limit: float) -> None:
    low, high = axes.get_ylim()
    if max(-low, high) > NEAR * limit:
        for side in (-limit, limit):
            axes.axhline(side, color="#AA4499", linewidth=0.8, linestyle=(0, (4, 2)), label="limit")


_FRONT_OVERHANG, _REAR_OVERHANG = 0.32, 0.36  # of the wheelbase, beyond the axles
# The car from above as polygons: a body and four wheels, the front ones steered.
#
# Pictures need a length, a width and wheels; a vehicle without a chassis gets those that are usual
# for its wheelbase.

TRACK = 0.57  # of the wheelbase, where no chassis says
_BODY_BESIDE_TRACK = 0.1  # of the wheelbase: how much wider than the track the body is
_WHEEL_LENGTH, _WHEEL_WIDTH = 0.24, 0.085  # of the wheelbase
CORNERS = 6  # points of each rounded corner
ROUNDING = 0.28  # radius of the body's corners, of its width


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
    tracks = (TRACK * long,) * 2 if chassis is None else (chassis.track_front, chassis.track_rear)
    half = 0.5 * (max(tracks) + _BODY_BESIDE_TRACK * long)
    front, rear = vehicle.l_f + _FRONT_OVERHANG * long, -vehicle.l_r - _REAR_OVERHANG * long
    body = _rounded(rear, front, half, 2.0 * half * ROUNDING)
    glass = np.array([(0.32, 0.6), (0.18, 0.78), (0.18, -0.78), (0.32, -0.6)]) * (long, half) + (
        0.05 * long,
        0.0,
    )
    wheels = np.stack(
        [
            _wheel(long) @ _turn(angle).T + (x, 0.5 * side * track)
            for x, track, angle in ((vehicle.l_f, tracks[0], delta), (-vehicle.l_r, tracks[1], 0.0))
            for side in (1.0, -1.0)
        ]
    )
    turn, place = _turn(psi).T, np.array([X, Y])
    return _CarShape(body @ turn + place, glass @ turn + place, wheels @ turn + place)


def _wheel(wheelbase: float) -> Array:
    corners = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    return 0.5 * wheelbase * corners * (_WHEEL_LENGTH, _WHEEL_WIDTH)


def _turn(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def _rounded(rear: float, front: float, half: float, radius: float) -> Array:
    """Return a rectangle with round corners, counterclockwise."""
    quarter = np.linspace(0.0, 0.5 * np.pi, CORNERS)
    points = []
    for turn, x, y in ((0, front, half), (1, rear, half), (2, rear, -half), (3, front, -half)):
        angle = quarter + 0.5 * np.pi * turn
        center = x - np.sign(x - 0.5 * (rear + front)) * radius, y - np.sign(y) * radius
        points.append(np.column_stack([np.cos(angle), np.sin(angle)]) * radius + center)
    return np.concatenate(points)


_ROW_LENGTH = 80.0  # a long and narrow path goes on in the next row after about this many meters
_MOST_ROWS = 5
_NARROW = 4.0  # from this ratio between its extents on a path is long and narrow
MARGIN = 3.0  # around the path [m]
RUN_UP = 16.0  # of the straights before and after the cones that is shown [m]
_INNER_WIDTH = style.PAGE - 0.75  # what labels leave of the page [in]
_HIGHEST = 5.0  # panel [in]
_CARS_EVERY = 2.6  # wheelbases between two outlines
SMALL = 160.0  # in a picture of more than that [m] cars cannot be seen
_ZOOM = 44.0  # a part of such a path that is drawn large, where a car was farthest off [m]
_SEEN = 0.05  # deviations are drawn larger until the largest is this share of the picture


@style.styled
def drive_path_figure(drives: Mapping[str, "Drive"]) -> Figure:
    """Draw the path, its cones and where every car drove; the first with its outlines.

    A path too large for cars to be seen is drawn as a whole with its deviations magnified, as the
    legend says, and beside it the place of the largest deviation at its true scale.
    """
    path = next(iter(drives.values())).path
    low, high = _extent(path, drives)
    width, height = high - low
    if width <= _NARROW * height and max(width, height) > SMALL:
        return _large(path, drives)
    rows = 1
    if width > _NARROW * height:
        rows = min(_MOST_ROWS, max(1, round(width / _ROW_LENGTH)))
    step = width / rows
    inch = min(_INNER_WIDTH / step, _HIGHEST / height)  # of a meter
    figure = style.new_figure(style.PAGE, rows * (height * inch + 0.3) + 0.6)
    panels = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for row, axes in enumerate(panels):
        ends = float(low[0] + row * step), float(low[0] + (row + 1) * step)
        axes.set(xlim=ends, ylim=(low[1], high[1]), aspect="equal", ylabel="Y [m]")
        _draw(axes, path, drives)
        axes.set_yticks(axes.get_yticks()[1:-1:1])
        axes.set_ylim(low[1], high[1])
    panels[-1].set_xlabel("X [m]")
    style.legend_above(figure, order=tuple(drives))
    return figure


def _extent(path: "Path", drives: Mapping[str, "Drive"]) -> tuple[Array, Array]:
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


def _large(path: "Path", drives: Mapping[str, "Drive"]) -> Figure:
    figure = style.new_figure(style.PAGE, 3.6)
    whole, part = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    largest = max(float(np.abs(drive.e_y).max()) for drive in drives.values())
    size = max(float(np.ptp(path.X)), float(np.ptp(path.Y)))
    times = _round(_SEEN * size / max(largest, 1e-3))
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
    half = 0.5 * _ZOOM
    part.set(xlim=(X0 - half, X0 + half), ylim=(Y0 - half, Y0 + half), aspect="equal")
    _draw(part, path, drives)
    part.set_title(f"the largest deviation, {abs(worst.e_y[k]):.2f} m, to scale")
    for axes in (whole, part):
        axes.set(xlabel="X [m]", ylabel="Y [m]")
    style.legend_above(figure, order=tuple(drives))
    return figure


def _round(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that is not larger, at least 1."""
    steps = np.array([a * 10.0**b for b in range(4) for a in (1.0, 2.0, 5.0)])
    return float(steps[steps <= max(value, 1.0)][-1])


def _draw(axes: Axes, path: "Path", drives: Mapping[str, "Drive"]) -> None:
    axes.plot(path.X, path.Y, **PATH)
    if len(path.cones):
        axes.plot(path.cones[:, 0], path.cones[:, 1], **CONES)
    first = next(iter(drives))
    _draw_cars(axes, drives[first], tire_look(first)["color"])
    for label, drive in reversed(list(drives.items())):
        axes.plot(drive.X, drive.Y, label=label, **tire_look(label))


def _draw_cars(axes: Axes, drive: "Drive", color: str) -> None:
    every = _CARS_EVERY * drive.vehicle.wheelbase
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
