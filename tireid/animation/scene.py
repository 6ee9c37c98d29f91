"""One picture of the film: the car on its path, its plan, its tire forces, and how far it is off.

What is drawn stays; an instant moves it to where it was then, curves as they were known then.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from codegen.arrays import Array
from codegen.escape import mathtext
from mpc.loop.record import Drive
from tireid.animation.chosen import CHOSEN
from tireid.animation.ground import Camera, Ground, Instant, sample_at
from tireid.animation.known import KnownCurves
from tireid.figures.drive import AT_THE_END, ORACLE, mark_drops, tire_look
from tireid.figures.style import (
    AXLES,
    BLUE,
    GREEN,
    LOOK,
    PURPLE,
    SKY,
    drawable,
    force_range,
    force_unit_of,
)
from tireid.figures.tires import TireCurve, axle_slip

_STEERING: Mapping[str, Any] = {"color": BLUE, "linewidth": 1.5, "label": "steered by, now"}
_LEARNT: Mapping[str, Any] = {"color": SKY, "linewidth": 2.6, "label": "identified so far"}


class _ForcePanel:
    """Force of an axle over its slip: the curves as they were known then, and where the tire is.

    axle : 0 is the front axle, 1 the rear.
    known : what was known over time; None where nothing was learnt, so that nothing changes.
    drop : arc length [m] from which the true tire is that of the end; infinite for never.
    """

    def __init__(
        self,
        axes: Axes,
        drive: Drive,
        curves: Sequence[TireCurve],
        axle: int,
        *,
        known: KnownCurves | None,
        drop: float,
    ) -> None:
        slip = axle_slip(drive)
        self._unit = force_unit_of(drive.axle_force)
        self._axle, self._drive, self._known, self._drop = axle, drive, known, drop
        self._alpha = np.rad2deg(slip[:, axle])
        self._force = drive.axle_force[:, axle] / self._unit.newtons
        self._reach = 1.15 * float(np.abs(np.rad2deg(slip)).max())
        self._limits = self._all_forces([c for c in curves if c.label.startswith(ORACLE)])
        self._true = {}
        for curve in curves:
            if curve.label.endswith(AT_THE_END) and not curve.label.startswith(ORACLE):
                continue  # what was known only then
            look = {**tire_look(curve.label.removesuffix(AT_THE_END)), "label": curve.label}
            (line,) = axes.plot(np.rad2deg(curve.alpha), self._drawn(curve.force), **look)
            if curve.label.startswith(ORACLE):
                self._true[curve.label.endswith(AT_THE_END)] = line
        self._moving: list[Any] = []
        self._shades: list[Rectangle] = []
        if known is not None:
            self._moving = [axes.plot([], [], **look)[0] for look in (_LEARNT, _STEERING)]
            shade: dict[str, Any] = {"facecolor": "#EFE9DD", "edgecolor": "none", "zorder": 0}
            shade["transform"] = axes.get_xaxis_transform()
            self._shades = [Rectangle((0.0, 0.0), 0.0, 1.0, **shade) for _ in range(2)]
            for patch in self._shades:
                axes.add_patch(patch)
        axes.set(xlim=(-self._reach, self._reach), ylim=self._limits)
        if axle == 0:
            axes.set_ylabel(f"force [{self._unit.name}]", fontsize=CHOSEN.small, labelpad=1.0)
        else:
            axes.tick_params(labelleft=False)
        _small(axes, AXLES[axle], "slip [deg]")
        (self._tail,) = axes.plot([], [], color=PURPLE, linewidth=1.0, alpha=0.6)
        (self._now,) = axes.plot([], [], marker="o", markersize=5.0, color=PURPLE, linestyle="")

    def legend(self) -> tuple[list[Artist], list[str]]:
        marks = [*self._moving, *list(self._true.values())[:1]]
        names = [str(line.get_label()) for line in self._moving] + ["true tire"] * bool(self._true)
        return marks, names

    def show(self, now: Instant) -> None:
        part = slice(max(0, now.k - CHOSEN.tail), now.k + 1)
        self._tail.set_data(self._alpha[part], self._force[part])
        self._now.set_data(self._alpha[now.k : now.k + 1], self._force[now.k : now.k + 1])
        dropped = float(self._drive.s[now.k]) >= self._drop
        for at_the_end, line in self._true.items():
            line.set_visible(at_the_end == (dropped and True in self._true))
        if self._known is None:
            return
        known = self._known
        k = max(int(np.searchsorted(known.t, now.t + 1e-9, side="right")) - 1, 0)
        for line, force in zip(self._moving, (known.learnt[k], known.steering[k]), strict=True):
            line.set_data(np.rad2deg(known.alpha), self._drawn(force))
        slip = min(float(np.rad2deg(known.slip[k, self._axle])), self._reach)
        shown = self._reach - slip if np.isfinite(slip) else 0.0
        for patch, left in zip(self._shades, (-self._reach, self._reach - shown), strict=True):
            patch.set(x=left, width=shown)

    def _all_forces(self, true: Sequence[TireCurve]) -> tuple[float, float]:
        """Return the ends of an axis that shows the drive, and the tires as far as it slips."""
        seen = [(one.alpha, one.force) for one in true]
        if self._known is not None:
            seen += [(self._known.alpha, one) for one in self._known.steering]
        within = [force[np.abs(np.rad2deg(alpha)) <= self._reach] for alpha, force in seen]
        newtons = self._unit.newtons
        return force_range(self._drive.axle_force / newtons, *(one / newtons for one in within))

    def _drawn(self, force: Array) -> Array:
        return drawable(force[:, self._axle] / self._unit.newtons, self._limits)


class _DeviationPanel:
    """Deviation over arc length: faint as a whole, strong up to now.

    drives : by the name in the legend, along one path; the first is in the middle.
    drops : arc length [m] and friction from there on.
    """

    def __init__(
        self, axes: Axes, drives: Mapping[str, Drive], drops: Sequence[tuple[float, float]]
    ) -> None:
        self._drives = list(drives.values())
        self._lines = []
        for label, drive in drives.items():
            look = tire_look(label)
            axes.plot(drive.s, drive.e_y, **(look | {"alpha": 0.3, "linewidth": 0.8}))
            (line,) = axes.plot([], [], **look)
            self._lines.append(line)
        largest = 1.1 * max(float(np.abs(drive.e_y).max()) for drive in self._drives)
        reach = min(max(largest, 0.05), 2.5)
        axes.axhline(0.0, color="#999999", linewidth=0.6)
        mark_drops(axes, drops)
        last = max(float(drive.s[-1]) for drive in self._drives)
        axes.set(xlim=(0.0, last), ylim=(-reach, reach))
        _small(axes, "Deviation from the path [m]", "arc length [m]")

    def show(self, now: Instant) -> None:
        for drive, line in zip(self._drives, self._lines, strict=True):
            part = drive.t <= now.t
            line.set_data(drive.s[part], drive.e_y[part])


class _Overview:
    """A closed course as a whole, and where the cars are.

    drives : by the name in the legend, along one path; the first is in the middle.
    """

    def __init__(self, axes: Axes, drives: Mapping[str, Drive]) -> None:
        self._drives = list(drives.values())
        path = self._drives[0].path
        axes.plot(path.X, path.Y, color=GREEN, linewidth=0.9)
        axes.set(aspect="equal")
        axes.set_axis_off()
        axes.margins(0.08)
        colors = [tire_look(label)["color"] for label in drives]
        self._dots = [axes.plot([], [], "o", ms=4.0, color=color)[0] for color in colors]

    def show(self, now: Instant) -> None:
        for drive, dot in zip(self._drives, self._dots, strict=True):
            k = sample_at(drive, now.t)
            dot.set_data([drive.X[k]], [drive.Y[k]])


def _small(axes: Axes, title: str, label: str) -> None:
    axes.set_title(title, fontsize=CHOSEN.small + 0.5)
    axes.set_xlabel(label, fontsize=CHOSEN.small, labelpad=1.0)
    axes.tick_params(labelsize=CHOSEN.small - 0.5, pad=1.5)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))


class Scene:
    """The stage on which a drive is shown.

    drives : by the name in the legend, along one path; the first is in the middle.
    drops : arc length [m] and friction from there on.
    known : of the tires while the first drove; None where nothing was learnt.
    Attributes: figure.
    """

    def __init__(
        self,
        drives: Mapping[str, Drive],
        curves: Sequence[TireCurve],
        *,
        drops: Sequence[tuple[float, float]],
        pace: float,
        title: str,
        known: KnownCurves | None = None,
    ) -> None:
        first = next(iter(drives.values()))
        path, self._drive, self._pace = first.path, first, pace
        self._camera = Camera(path)
        with style.context(["default", LOOK]):
            self.figure = Figure(figsize=CHOSEN.size)
            FigureCanvasAgg(self.figure)
            width, height = CHOSEN.size
            box = (0.0, 0.43, 1.0, 0.5)
            ground = self.figure.add_axes(box, xticks=[], yticks=[], frame_on=False)
            half = 0.5 * (CHOSEN.behind + CHOSEN.ahead) * box[3] * height / width
            ground.set(xlim=(-CHOSEN.behind, CHOSEN.ahead), ylim=(-half, half), facecolor="#F6F6F2")
            self._parts: list[Any] = [Ground(ground, drives, drops)]
            add = self.figure.add_axes
            if path.closed:
                self._parts.append(_Overview(add((0.86, 0.69, 0.135, 0.235)), drives))
            drop = drops[-1][0] if drops else np.inf
            for axle, x in enumerate((0.075, 0.3)):
                axes = add((x, 0.11, 0.19, 0.2))
                forces = _ForcePanel(axes, first, curves, axle, known=known, drop=drop)
                self._parts.append(forces)
            (marks, names), (more, said) = self._parts[0].legend(), forces.legend()
            self._parts.append(_DeviationPanel(add((0.585, 0.11, 0.39, 0.2)), drives, drops))
            self.figure.text(0.012, 0.955, mathtext(title), fontsize=9.0, fontweight="bold")
            entries = len(names) + len(said)
            look: Mapping[str, Any] = {
                **{"fontsize": 7.0, "handlelength": 1.5, "handletextpad": 0.5},
                **{"columnspacing": 1.1, "loc": "center", "bbox_to_anchor": (0.5, 0.388)},
                "ncols": entries if entries < CHOSEN.many else (entries + 1) // 2,
            }
            self.figure.legend([*marks, *more], [*names, *said], **look)
            mono: Mapping[str, Any] = {"family": "DejaVu Sans Mono", "fontsize": 7.5}
            self._says = self.figure.text(0.988, 0.955, "", ha="right", **mono)

    def show(self, t: float) -> None:
        drive = self._drive
        k = sample_at(drive, t)
        now = Instant(k, float(drive.t[k]), self._camera.at(float(drive.s[k])))
        for part in self._parts:
            part.show(now)
        pace = "" if abs(self._pace - 1.0) < 0.01 else f"  {self._pace:.2g} x real time"
        self._says.set_text(
            f"{t:5.1f} s  {drive.v_x[k]:4.1f} m/s  a_y {drive.a_y[k]:+5.1f} m/s²  "
            f"e_y {drive.e_y[k]:+5.2f} m{pace}"
        )
