"""The ground as the camera sees it: grid, path, cones, cars, their plan and their forces."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from codegen.arrays import Array
from mpc.loop.record import Drive
from mpc.path import Path
from tireid.animation.chosen import CHOSEN
from tireid.figures.drive import CONES, PATH, car_shape, friction_label, tire_look
from tireid.figures.style import PURPLE

_WINDING = np.radians(75.0)  # a path that turns farther than this is shown turned to the right


class _View(NamedTuple):
    """A pose of the camera: what is ahead of it along the path is to the right in the picture."""

    center: Array
    angle: float

    def see(self, places: Array) -> Array:
        """Return places on the ground in the picture's meters, the last axis being (X, Y).

        places : on the ground [m], (..., 2).
        """
        c, s = np.cos(self.angle), np.sin(self.angle)
        seen: Array = (places - self.center) @ np.array([[c, -s], [s, c]])
        return seen


class Instant(NamedTuple):
    """What a frame shows: sample k of the first drive, its time [s], and the view of it."""

    k: int
    t: float
    view: _View


class Camera:
    """Follows a path."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._winding = bool(path.closed or np.ptp(path.psi) > _WINDING)
        self._angle = float(np.mean(path.psi))
        still = _View(np.array([path.X[0], path.Y[0]]), self._angle)
        sides = still.see(np.column_stack([path.X, path.Y]))[:, 1]
        self._middle = (
            0.5 * float(sides.min() + sides.max()) if np.ptp(sides) < CHOSEN.level else None
        )

    def at(self, s: float) -> _View:
        """Return the view of a car.

        s : arc length of the car along the path [m].
        """
        X, Y, _ = self._path.pose(s)
        center = np.array([float(X), float(Y)])
        if self._winding:
            stretch = np.linspace(s - CHOSEN.look_back, s + CHOSEN.look_ahead, 24)
            return _View(center, float(np.mean(self._path.pose(stretch)[2])))
        if self._middle is None:
            return _View(center, self._angle)
        start = np.array([self._path.X[0], self._path.Y[0]])
        along, _ = _View(start, self._angle).see(center)
        c, s_ = np.cos(self._angle), np.sin(self._angle)
        ground = np.array([[c, s_], [-s_, c]])
        return _View(start + np.array([along, self._middle]) @ ground, self._angle)


_PLAN = "#333333"
_DROP: Mapping[str, Any] = {"color": "#AA4499", "linewidth": 1.6, "linestyle": (0, (3, 1.5))}
_ARROW = np.array([(0.0, 0.1), (0.0, -0.1), (1.0, -0.1), (1.0, -0.42), (1.7, 0.0), (1.0, 0.42),
                  (1.0, 0.1)])  # fmt: skip


class Ground:
    """The upper part of the picture.

    drives : by the name in the legend, along one path; the first is in the middle.
    drops : arc length [m] and friction from there on.
    """

    def __init__(
        self, axes: Axes, drives: Mapping[str, Drive], drops: Sequence[tuple[float, float]]
    ) -> None:
        self._drives = list(drives.values())
        path = self._path = self._drives[0].path
        plans = self._drives[0].plans
        self._plan_at = np.array([plan.period for plan in plans])
        self._plan_lines = [np.column_stack(plan.line(path)) for plan in plans]
        self._room = 1.1 * np.hypot(*(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())))
        self._grid = LineCollection([], colors="#E2E2DA", linewidths=0.8, zorder=CHOSEN.below)
        axes.add_collection(self._grid)
        (self._line,) = axes.plot([], [], zorder=CHOSEN.below, **PATH)
        (self._cones,) = axes.plot([], [], zorder=1.0, **{**CONES, "markersize": 4.5})
        across = [(_across(path, s), {**_DROP, "label": friction_label(mu)}) for s, mu in drops]
        self._drops = [(ends, axes.plot([], [], **look)[0]) for ends, look in across]
        self._tracks, self._bodies, self._wheels = [], [], []
        for number, label in enumerate(drives):
            color = tire_look(label)["color"]
            order = CHOSEN.car if number == 0 else CHOSEN.ghost - 0.1 * number
            self._tracks += axes.plot([], [], color=color, linewidth=1.4, alpha=0.8, zorder=order)
            faces = [(color, 0.5), (color, 0.95)] if number == 0 else [(color, 0.12)]
            edge: Mapping[str, Any] = {"edgecolors": color, "linewidths": 1.2}
            body = PolyCollection([], facecolors=faces, zorder=order + 0.04, **edge)
            over = order + (0.02 if number == 0 else 0.06)
            wheels = PolyCollection([], facecolors="#222222", edgecolors="none", zorder=over)
            for collection in (body, wheels):
                axes.add_collection(collection)
            self._bodies.append(body)
            self._wheels.append(wheels)
        look: Mapping[str, Any] = {"color": _PLAN, "linewidth": 1.3, "marker": "o", "ms": 2.2}
        (self._plan,) = axes.plot([], [], zorder=CHOSEN.above, **look)
        self._forces = PolyCollection(
            [], facecolors=PURPLE, edgecolors="none", zorder=CHOSEN.above + 1
        )
        axes.add_collection(self._forces)
        self._names = ["path", "plan", *drives]

    def legend(self) -> tuple[list[Artist], list[str]]:
        more = [self._cones] * bool(len(self._path.cones)) + [line for _, line in self._drops]
        names = [*self._names, *(str(line.get_label()) for line in more)]
        marks = [self._line, self._plan, *self._tracks, *more, self._forces]
        return marks, [*names, "forces"]

    def show(self, now: Instant) -> None:
        drive, (k, t, view) = self._drives[0], now
        self._grid.set_segments(self._grid_lines(view))
        around = drive.s[k] + np.linspace(-CHOSEN.shown, CHOSEN.shown, 121)
        if not self._path.closed:
            around = np.clip(around, 0.0, self._path.length)
        X, Y, _ = self._path.pose(around)
        self._line.set_data(*view.see(np.column_stack([X, Y])).T)
        if len(self._path.cones):
            self._cones.set_data(*view.see(self._path.cones).T)
        for ends, line in self._drops:
            line.set_data(*view.see(ends).T)
        for number in range(len(self._drives)):
            self._car(number, t, view)
        if self._plan_at.size:
            kept = max(int(np.searchsorted(self._plan_at, k, side="right")) - 1, 0)
            self._plan.set_data(*view.see(self._plan_lines[kept]).T)
        self._forces.set_verts(self._arrows(drive, k, view))

    def _car(self, number: int, t: float, view: _View) -> None:
        drive = self._drives[number]
        k = sample_at(drive, t)
        places = np.column_stack([drive.X[: k + 1], drive.Y[: k + 1]])[-1200::4]
        self._tracks[number].set_data(*view.see(places).T)
        pose = (float(values[k]) for values in (drive.X, drive.Y, drive.psi, drive.delta))
        shape = car_shape(drive.vehicle, *pose)
        body = [shape.body, shape.glass] if number == 0 else [shape.body]
        self._bodies[number].set_verts([view.see(one) for one in body])
        self._wheels[number].set_verts(list(view.see(shape.wheels)))

    def _arrows(self, drive: Drive, k: int, view: _View) -> list[Array]:
        """Lateral axle forces as arrows from the axles, to the side to which they push."""
        car, psi = drive.vehicle, float(drive.psi[k])
        ahead, left = np.array([np.cos(psi), np.sin(psi)]), np.array([-np.sin(psi), np.cos(psi)])
        place = np.array([drive.X[k], drive.Y[k]])
        arrows = []
        for axle, x in enumerate((car.l_f, -car.l_r)):
            length = CHOSEN.force_length * drive.axle_force[k, axle] / car.axle_loads[axle]
            if abs(length) < CHOSEN.smallest:
                continue
            head = _ARROW.copy()
            shaft = max(abs(length) - 0.7, 0.01)
            head[:, 0] = np.where(_ARROW[:, 0] < 0.5, 0.0, shaft + _ARROW[:, 0] - 1.0)
            head[:, 0] *= np.sign(length)
            arrows.append(view.see(place + x * ahead + head[:, :1] * left + head[:, 1:] * ahead))
        return arrows

    def _grid_lines(self, view: _View) -> list[Array]:
        """Lines on the ground every few meters, so that one sees it pass."""
        reach = 0.5 * self._room + 10.0
        lines = []
        for axis in (0, 1):
            low, high = view.center[axis] - reach, view.center[axis] + reach
            for at in (
                np.arange(np.ceil(low / CHOSEN.grid), np.floor(high / CHOSEN.grid) + 1.0)
                * CHOSEN.grid
            ):
                ends = np.empty((2, 2))
                ends[:, axis] = at
                ends[:, 1 - axis] = view.center[1 - axis] + np.array([-1.5, 1.5]) * reach
                lines.append(view.see(ends))
        return lines


def _across(path: Path, s: float) -> Array:
    """Ends of a line across the path at a place, (2, 2) [m]."""
    X, Y, psi = (float(value) for value in path.pose(s))
    sides = CHOSEN.half_road * np.array([[1.0], [-1.0]])
    ends: Array = np.array([X, Y]) + sides * np.array([-np.sin(psi), np.cos(psi)])
    return ends


def sample_at(drive: Drive, t: float) -> int:
    """Return the sample of a drive at a time [s], or its last one."""
    return min(int(np.searchsorted(drive.t, t)), drive.t.size - 1)
