"""The small panels of the film: force over slip with the learnt curve, deviation, whole course."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from mpc.loop import Drive
from tireid.animation.camera import Instant
from tireid.figures.drive_errors import mark_drops
from tireid.figures.drive_look import tire_look
from tireid.figures.panels import AXLES
from tireid.figures.style import GREEN, PURPLE
from tireid.figures.tire_curve import TireCurve, axle_slip
from tireid.figures.units import drawable, force_range, force_unit_of

Moved = list[tuple[Axes, Artist]]

TAIL = 80  # samples
SMALL = 7.0  # points of the text


def sample_at(drive: Drive, t: float) -> int:
    """Return the sample of a drive at a time, or its last one.

    Parameters
    ----------
    drive : the drive.
    t : time [s].
    """
    return min(int(np.searchsorted(drive.t, t)), drive.t.size - 1)


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
