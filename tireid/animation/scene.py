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
from numpy.typing import NDArray

from codegen.escape import mathtext
from mpc.loop import Drive
from tireid.animation.camera import Camera, Instant
from tireid.animation.ground import Ground
from tireid.animation.panels import DeviationPanel, ForcePanel, Overview, sample_at
from tireid.figures.style import LOOK
from tireid.figures.tire_curve import TireCurve

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
