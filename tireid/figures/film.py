"""A film of a drive: the car on its path, its plan and axle forces, and the tires of its tracker.

Every picture is drawn anew, with the curves that tracker and identifier had at that instant.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import style
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from codegen.escape import mathtext
from codegen.writing import naming
from mpc.loop.record import Drive
from mpc.problem import size_of
from mpc.tires import PredictionTire
from mpc.tires.tire import curves_at
from tireid.driving.runs import Known
from tireid.figures.drive import (
    AT_THE_END,
    CONES,
    ORACLE,
    PATH,
    Drops,
    car_shape,
    mark_drops,
    tire_look,
)
from tireid.figures.style import AXLES, BLUE, LOOK, PURPLE, SKY, force_range, force_unit_of
from tireid.figures.tires import TireCurve, axle_slip
from tireid.progress import say

FORMATS = ("webp", "gif")
RATE = 10  # frames a second; a GIF counts in hundredths of a second
MOST = 120  # frames: what stays small and quick to draw
HOLD = 12  # frames for which the last picture stays
SIZE, DOTS = (6.4, 4.0), 150  # of the picture [in], dots an inch
BOXES = (0.0, 0.43, 1.0, 0.5), *((x, 0.11, 0.2, 0.2) for x in (0.05, 0.31)), (0.59, 0.11, 0.39, 0.2)
# Of a full-size car, what the picture has of the ground [m]; of a model car less, by its size.
BEHIND, AHEAD, ASIDE = 12.0, 36.0, 7.5


class Film(NamedTuple):
    """What a film shows.

    drives : by the name in the legend, along one path; the first leads, others are outlines.
    curves : steady ones of the tires.   drops : arc length [m] and friction from there on.
    known : what tracker and identifier of the first drive knew, over time, as weights of `tire`.
    """

    title: str
    drives: Mapping[str, Drive]
    curves: Sequence[TireCurve]
    drops: Drops = ()
    known: Sequence[Known] = ()
    tire: PredictionTire | None = None

    @property
    def lead(self) -> Drive:
        return next(iter(self.drives.values()))


class _Writer(PillowWriter):
    """Pillow's at a quality that a page can hold; without it a film is larger by half."""

    _frames: list[Any]

    def finish(self) -> None:
        more: Any = {"append_images": self._frames[1:], "duration": 1000 // RATE, "loop": 0}
        self._frames[0].save(self.outfile, save_all=True, quality=40, minimize_size=True, **more)


def write_film(file: Path, film: Film) -> None:
    """Write a film, .webp or .gif."""
    duration = float(np.ptp(film.lead.t))
    instants = np.linspace(0.0, duration, min(MOST, max(2, round(RATE * duration))))
    pace = RATE * duration / instants.size
    film = film._replace(title=f"{film.title}, {pace:.2g} x real time")
    figure, frames = Figure(figsize=SIZE), [*instants, *[duration] * HOLD]
    FigureCanvasAgg(figure)
    say(f"drawing a film of {len(instants)} frames")
    with style.context(["default", LOOK]), naming(file):
        moving = FuncAnimation(figure, lambda t: draw(figure, film, t), frames)
        moving.save(str(file), _Writer(RATE), dpi=DOTS)


def draw(figure: Figure, film: Film, t: float) -> None:
    """Draw the picture of a time since the drive began [s]."""
    ground, front, rear, below = panels = figure.axes or [figure.add_axes(one) for one in BOXES]
    for axes in panels:
        for artist in [*axes.lines, *axes.collections, *axes.patches, *figure.legends]:
            artist.remove()
    drive, k = film.lead, sample_at(film.lead, t)
    _draw_ground(ground, film, t)
    _draw_forces(front, film, 0, k)
    _draw_forces(rear, film, 1, k)
    _draw_deviation(below, film, t)
    ground.set_title(f" {mathtext(film.title)}", loc="left", fontsize=9.0, fontweight="bold")
    now = f"{t:5.1f} s  {drive.v_x[k]:4.1f} m/s  a_y {drive.a_y[k]:+5.1f} m/s² "
    ground.set_title(f"{now} e_y {drive.e_y[k]:+5.2f} m ", loc="right", family="monospace")
    marks = [axes.get_legend_handles_labels() for axes in (ground, front)]
    entries = {label: mark for some in marks for mark, label in zip(*some, strict=True)}
    columns = len(entries) if len(entries) < 9 else (len(entries) + 1) // 2
    place: Any = {"loc": "center", "bbox_to_anchor": (0.5, 0.388), "fontsize": 6.8}
    figure.legend([*entries.values()], [*entries], ncols=columns, **place)


def sample_at(drive: Drive, t: float) -> int:
    """Return the sample of a drive at a time [s], or its last one."""
    return min(int(np.searchsorted(drive.t, t)), drive.t.size - 1)


def camera(drive: Drive, k: int) -> Affine2D:
    """Return what moves the ground so that the path at a sample is at zero, ahead to the right."""
    path, s, size = drive.path, drive.s[k], size_of(drive.vehicle)
    X, Y, _ = (float(one) for one in path.pose(s))
    winding = path.closed or np.ptp(path.psi) > np.radians(75.0)
    heading = path.pose(s + size * np.linspace(-8.0, 22.0, 24))[2] if winding else path.psi
    view = Affine2D().translate(-X, -Y).rotate(-float(heading.mean()))
    if not winding:  # go straight, as far as the car stays in sight
        side = view.transform(np.column_stack([path.X, path.Y]))[:, 1]
        most = size * (ASIDE - 3.0)
        view.translate(0.0, np.clip(-0.5 * (side.min() + side.max()), -most, most))
    return view


def _draw_ground(axes: Axes, film: Film, t: float) -> None:
    lead, k = film.lead, sample_at(film.lead, t)
    path, view, size = lead.path, camera(lead, k), size_of(lead.vehicle)
    axes.set(xlim=(-size * BEHIND, size * AHEAD), ylim=(-size * ASIDE, size * ASIDE))
    axes.set_axis_off()
    on: Any = {"transform": view + axes.transData}
    grid, far = 5.0 * size, 60.0 * size
    x, y = (grid * np.round(at[k] / grid) + [-far, far] for at in (lead.X, lead.Y))
    lines = grid * np.arange(25.0)  # so that one sees the ground pass [m]
    axes.vlines(x[0] + lines, y[0], y[1], colors="#E2E2DA", linewidth=0.8, **on)
    axes.hlines(y[0] + lines, x[0], x[1], colors="#E2E2DA", linewidth=0.8, **on)
    axes.plot(*path.pose(lead.s[k] + np.linspace(-far, far, 121))[:2], **PATH, **on)
    if len(path.cones):
        axes.plot(*path.cones.T, **{**CONES, "markersize": 4.5}, **on)
    for s, mu in film.drops:
        axes.plot(*path.pose(s)[:2], "X", color=PURPLE, ms=8.0, label=f"friction {mu:g}", **on)
    for number, (label, drive) in enumerate(film.drives.items()):
        _draw_car(axes, label, drive, t, lead=drive is lead, zorder=4.0 - 0.1 * number, **on)
    for plan in [one for one in lead.plans if one.period <= k][-1:]:
        axes.plot(*plan.line(path), "o-", color="#333333", ms=2.2, label="plan", zorder=5.0, **on)
    car, psi = lead.vehicle, lead.psi[k]
    axles = np.outer([car.l_f, -car.l_r], [np.cos(psi), np.sin(psi)])
    axles += lead.X[k], lead.Y[k]
    push = np.outer(lead.axle_force[k] / car.axle_loads, [-np.sin(psi), np.cos(psi)])
    start, end = view.transform(axles), view.transform(axles + 4.0 * size * push)  # [m]
    look: Any = {"units": "xy", "scale_units": "xy", "scale": 1.0, "zorder": 6.0}
    look["width"] = 0.2 * size
    axes.quiver(*start.T, *(end - start).T, color=PURPLE, label="axle force", **look)


def _draw_car(axes: Axes, label: str, drive: Drive, t: float, *, lead: bool, **on: Any) -> None:
    k, look = sample_at(drive, t), tire_look(label)
    axes.plot(drive.X[: k + 1 : 4], drive.Y[: k + 1 : 4], label=label, **look, **on)
    shape = car_shape(drive.vehicle, drive.X[k], drive.Y[k], drive.psi[k], drive.delta[k])
    faces = [(look["color"], 0.5), (look["color"], 0.95)] if lead else [(look["color"], 0.12)]
    parts = [shape.body, shape.glass][: len(faces)]
    axes.add_collection(PolyCollection(list(shape.wheels), facecolors="#222222", **on))
    axes.add_collection(PolyCollection(parts, facecolors=faces, edgecolors=look["color"], **on))


def _draw_forces(axes: Axes, film: Film, axle: int, k: int) -> None:
    """Draw force over slip up to now, and curves; what was known at the end only is left out."""
    drive, unit = film.lead, force_unit_of(film.lead.axle_force)
    slip, force = np.rad2deg(axle_slip(drive)), drive.axle_force / unit.newtons
    reach, seen = 1.15 * float(np.abs(slip).max()), [force]
    curves = {one.label: one for one in film.curves}
    later = bool(film.drops) and drive.s[k] >= film.drops[-1][0] and ORACLE + AT_THE_END in curves
    for label, curve in curves.items():
        true, near = label.startswith(ORACLE), np.abs(np.rad2deg(curve.alpha)) <= reach
        seen += [] if label == "linear" else [curve.force[near] / unit.newtons]
        if label.endswith(AT_THE_END) == (true and later):
            look = tire_look(label.removesuffix(AT_THE_END))
            look |= {"label": "true tire"} if true else {}
            axes.plot(np.rad2deg(curve.alpha), curve.force[:, axle] / unit.newtons, **look)
    for one in [one for one in film.known if one.t <= drive.t[k] + 1e-9][-1:]:
        assert film.tire is not None
        at, v_x = np.linspace(-reach, reach, 141), float(drive.v_x.mean())
        learnt, steering = (
            curves_at(film.tire._replace(weights=w), np.radians(at), v_x)[axle] / unit.newtons
            for w in (one.learnt, one.steering)
        )
        axes.plot(at, learnt, color=SKY, linewidth=2.6, label="identified so far")
        axes.plot(at, steering, color=BLUE, linewidth=1.5, label="used by the tracker")
        edge = min(float(np.nan_to_num(np.rad2deg(one.slip[axle]), nan=reach)), reach)
        for side in (-1.0, 1.0):
            axes.axvspan(side * edge, side * reach, color="#EFE9DD", linewidth=0.0, zorder=0.0)
    past = slice(max(0, k - 80), k + 1)
    axes.plot(slip[past, axle], force[past, axle], color=PURPLE, linewidth=1.0, alpha=0.6)
    axes.plot(slip[k, axle], force[k, axle], "o", markersize=5.0, color=PURPLE)
    axes.set(xlim=(-reach, reach), ylim=force_range(*seen), xlabel="slip [deg]")
    axes.set_title(f"{AXLES[axle]}: force [{unit.name}]")


def _draw_deviation(axes: Axes, film: Film, t: float) -> None:
    for label, drive in film.drives.items():
        axes.plot(drive.s, drive.e_y, **(tire_look(label) | {"alpha": 0.3, "linewidth": 0.8}))
        axes.plot(drive.s[drive.t <= t], drive.e_y[drive.t <= t], **tire_look(label))
    mark_drops(axes, film.drops)
    reach = min(1.1 * max(0.05, *(np.abs(one.e_y).max() for one in film.drives.values())), 2.5)
    axes.set(xlim=(0.0, film.lead.s[-1]), ylim=(-reach, reach), xlabel="arc length [m]")
    axes.set_title("Deviation from the path [m]")
