"""One picture of the film: the car on its path, its plan, its tire forces, and how far it is off.

Everything that stays is drawn once; a frame copies it and draws only what moved.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from codegen.escape import mathtext
from mpc.loop import Drive
from tireid.animation.ground import Camera, Ground, Instant, sample_at
from tireid.figures.drive import mark_drops, tire_look
from tireid.figures.style import AXLES, GREEN, LOOK, PURPLE, drawable, force_range, force_unit_of
from tireid.figures.tires import TireCurve, axle_slip

# The small panels of the film: force over slip with the learnt curve, deviation, whole course.

Moved = list[tuple[Axes, Artist]]

TAIL = 80  # samples
SMALL = 7.0  # points of the text


class ForcePanel:
    """Force of an axle over its slip: the curves, and where the tire is now.

    Parameters
    ----------
    axes : the panel.
    drive : the drive.
    curves : the tires.
    axle : 0 is the front axle, 1 the rear.
    """

    def __init__(self, axes: Axes, drive: Drive, curves: Sequence[TireCurve], axle: int) -> None:
        slip = axle_slip(drive)
        unit = force_unit_of(drive.axle_force)
        self._axes = axes
        self._alpha = np.rad2deg(slip[:, axle])
        self._force = drive.axle_force[:, axle] / unit.newtons
        reach = 1.15 * float(np.abs(np.rad2deg(slip)).max())
        limits = force_range(drive.axle_force / unit.newtons)
        for curve in curves:
            axes.plot(
                np.rad2deg(curve.alpha),
                drawable(curve.force[:, axle] / unit.newtons, limits),
                label=curve.label,
                **tire_look(curve.label),
            )
        axes.set(xlim=(-reach, reach), ylim=limits)
        axes.set_title(AXLES[axle], fontsize=SMALL + 0.5)
        axes.set_xlabel("slip [deg]", fontsize=SMALL, labelpad=1.0)
        if axle == 0:
            axes.set_ylabel(f"force [{unit.name}]", fontsize=SMALL, labelpad=1.0)
        else:
            axes.tick_params(labelleft=False)
        _small(axes)
        (self._tail,) = axes.plot([], [], color=PURPLE, linewidth=1.0, alpha=0.6, animated=True)
        (self._now,) = axes.plot(
            [], [], marker="o", markersize=5.0, color=PURPLE, linestyle="", animated=True
        )

    def show(self, now: Instant) -> Moved:
        """Return what moved.

        Parameters
        ----------
        now : the instant.
        """
        part = slice(max(0, now.k - TAIL), now.k + 1)
        self._tail.set_data(self._alpha[part], self._force[part])
        self._now.set_data(self._alpha[now.k : now.k + 1], self._force[now.k : now.k + 1])
        return [(self._axes, self._tail), (self._axes, self._now)]


class DeviationPanel:
    """Deviation over arc length: faint as a whole, strong up to now.

    Parameters
    ----------
    axes : the panel.
    drives : by the name in the legend, along one path; the first is in the middle.
    drops : arc length [m] and friction from there on.
    """

    def __init__(
        self, axes: Axes, drives: Mapping[str, Drive], drops: Sequence[tuple[float, float]]
    ) -> None:
        self._axes, self._drives = axes, list(drives.values())
        self._lines = []
        for label, drive in drives.items():
            look = tire_look(label)
            axes.plot(drive.s, drive.e_y, **(look | {"alpha": 0.3, "linewidth": 0.8}))
            (line,) = axes.plot([], [], animated=True, **look)
            self._lines.append(line)
        largest = 1.1 * max(float(np.abs(drive.e_y).max()) for drive in self._drives)
        reach = min(max(largest, 0.05), 2.5)
        axes.axhline(0.0, color="#999999", linewidth=0.6)
        mark_drops(axes, drops)
        axes.set(
            xlim=(0.0, max(float(drive.s[-1]) for drive in self._drives)), ylim=(-reach, reach)
        )
        axes.set_title("Deviation from the path [m]", fontsize=SMALL + 0.5)
        axes.set_xlabel("arc length [m]", fontsize=SMALL, labelpad=1.0)
        _small(axes)

    def show(self, now: Instant) -> Moved:
        """Return what moved.

        Parameters
        ----------
        now : the instant.
        """
        for drive, line in zip(self._drives, self._lines, strict=True):
            part = drive.t <= now.t
            line.set_data(drive.s[part], drive.e_y[part])
        return [(self._axes, line) for line in reversed(self._lines)]


class Overview:
    """A closed course as a whole, and where the cars are.

    Parameters
    ----------
    axes : the panel.
    drives : by the name in the legend, along one path; the first is in the middle.
    """

    def __init__(self, axes: Axes, drives: Mapping[str, Drive]) -> None:
        self._axes, self._drives = axes, list(drives.values())
        path = self._drives[0].path
        (self._line,) = axes.plot(path.X, path.Y, color=GREEN, linewidth=0.9, animated=True)
        axes.set(xticks=[], yticks=[], aspect="equal")
        axes.patch.set_animated(True)  # it is drawn over the ground, frame by frame
        for side in axes.spines.values():
            side.set_visible(False)
        axes.margins(0.08)
        self._dots = [
            axes.plot(
                [],
                [],
                marker="o",
                markersize=4.0,
                linestyle="",
                color=tire_look(label)["color"],
                animated=True,
            )[0]
            for label in drives
        ]

    def show(self, now: Instant) -> Moved:
        """Return what moved.

        Parameters
        ----------
        now : the instant.
        """
        for drive, dot in zip(self._drives, self._dots, strict=True):
            k = sample_at(drive, now.t)
            dot.set_data([drive.X[k]], [drive.Y[k]])
        moved = [self._axes.patch, self._line, *reversed(self._dots)]
        return [(self._axes, artist) for artist in moved]


def _small(axes: Axes) -> None:
    axes.tick_params(labelsize=SMALL - 0.5, pad=1.5)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))


Pixels = NDArray[np.uint8]

SIZE = (6.4, 4.0)  # [in]
DOTS = 100  # an inch
BEHIND, AHEAD = 12.0, 36.0  # what is shown along the path [m]


class Scene:
    """The stage on which a drive is shown.

    Parameters
    ----------
    drives : by the name in the legend, along one path; the first is in the middle.
    curves : tire curves behind the forces of the first.
    drops : arc length [m] and friction from there on.
    pace : of the film, said in the picture.
    title : what the film is about.
    """

    def __init__(
        self,
        drives: Mapping[str, Drive],
        curves: Sequence[TireCurve],
        *,
        drops: Sequence[tuple[float, float]],
        pace: float,
        title: str,
    ) -> None:
        first = next(iter(drives.values()))
        path, self._drive, self._pace = first.path, first, pace
        self._camera = Camera(path)
        with style.context(["default", LOOK]):
            self._figure = Figure(figsize=SIZE, dpi=DOTS)
            canvas: Any = FigureCanvasAgg(self._figure)  # its methods have no types
            self._canvas = canvas
            width, height = SIZE
            box = (0.0, 0.43, 1.0, 0.5)
            ground = self._figure.add_axes(box, xticks=[], yticks=[], frame_on=False)
            half = 0.5 * (BEHIND + AHEAD) * box[3] * height / width
            ground.set(xlim=(-BEHIND, AHEAD), ylim=(-half, half), facecolor="#F6F6F2")
            self._parts: list[Any] = [Ground(ground, drives, drops)]
            if path.closed:
                self._parts.append(Overview(self._axes((0.86, 0.69, 0.135, 0.235)), drives))
            left = self._axes((0.075, 0.11, 0.19, 0.2)), self._axes((0.3, 0.11, 0.19, 0.2))
            for axle, axes in enumerate(left):
                self._parts.append(ForcePanel(axes, first, curves, axle))
            self._parts.append(DeviationPanel(self._axes((0.585, 0.11, 0.39, 0.2)), drives, drops))
            self._figure.text(0.012, 0.955, mathtext(title), fontsize=9.0, fontweight="bold")
            self._figure.legend(
                *self._parts[0].legend(),
                loc="center",
                bbox_to_anchor=(0.5, 0.392),
                ncols=9,
                fontsize=7.0,
                handlelength=1.5,
                handletextpad=0.5,
                columnspacing=1.1,
            )
            self._says = self._figure.text(
                0.988, 0.955, "", ha="right", family="DejaVu Sans Mono", fontsize=7.5
            )
            self._says.set_animated(True)
            self._canvas.draw()
            self._still = self._canvas.copy_from_bbox(self._figure.bbox)

    def picture(self, t: float) -> Pixels:
        """Return the picture of an instant, RGB (height, width, 3).

        Parameters
        ----------
        t : time [s].
        """
        drive = self._drive
        k = sample_at(drive, t)
        now = Instant(k, float(drive.t[k]), self._camera.at(float(drive.s[k])))
        self._canvas.restore_region(self._still)
        for part in self._parts:
            moved: list[tuple[Axes, Artist]] = part.show(now)
            for axes, artist in moved:
                axes.draw_artist(artist)
        pace = "" if self._pace == 1.0 else f"  {self._pace:g} x real time"
        self._says.set_text(
            f"{t:5.1f} s  {drive.v_x[k]:4.1f} m/s  a_y {drive.a_y[k]:+5.1f} m/s²  "
            f"e_y {drive.e_y[k]:+5.2f} m{pace}"
        )
        self._figure.draw_artist(self._says)
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _axes(self, box: tuple[float, float, float, float]) -> Axes:
        return self._figure.add_axes(box)
