"""Where the picture looks: it goes along the path, and turns with it where the path winds."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpc.path import Path

Array = NDArray[np.float64]

WINDING = np.radians(75.0)  # a path that turns farther than this is shown turned to the right
LOOK_BACK, LOOK_AHEAD = 8.0, 22.0  # stretch whose mean heading is the direction of view [m]
LEVEL = 9.0  # a straight path whose sides are this close [m] is not followed sidewards


class View(NamedTuple):
    """A pose of the camera: what is ahead of it along the path is to the right in the picture."""

    center: Array
    angle: float

    def see(self, places: Array) -> Array:
        """Return places on the ground in the picture's meters, the last axis being (X, Y).

        Parameters
        ----------
        places : on the ground [m], (..., 2).
        """
        c, s = np.cos(self.angle), np.sin(self.angle)
        seen: Array = (places - self.center) @ np.array([[c, -s], [s, c]])
        return seen

    def turn(self, directions: Array) -> Array:
        """Return directions on the ground as directions in the picture.

        Parameters
        ----------
        directions : (..., 2).
        """
        return View(np.zeros(2), self.angle).see(directions)


class Instant(NamedTuple):
    """What a frame shows: sample k of the first drive, its time [s], and the view of it."""

    k: int
    t: float
    view: View


class Camera:
    """Follows a path.

    Parameters
    ----------
    path : that is driven.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._winding = bool(path.closed or np.ptp(path.psi) > WINDING)
        self._angle = float(np.mean(path.psi))
        still = View(np.array([path.X[0], path.Y[0]]), self._angle)
        sides = still.see(np.column_stack([path.X, path.Y]))[:, 1]
        self._middle = 0.5 * float(sides.min() + sides.max()) if np.ptp(sides) < LEVEL else None

    def at(self, s: float) -> View:
        """Return the view of a car.

        Parameters
        ----------
        s : arc length of the car along the path [m].
        """
        X, Y, _ = self._path.pose(s)
        center = np.array([float(X), float(Y)])
        if self._winding:
            stretch = np.linspace(s - LOOK_BACK, s + LOOK_AHEAD, 24)
            return View(center, float(np.mean(self._path.pose(stretch)[2])))
        if self._middle is None:
            return View(center, self._angle)
        start = np.array([self._path.X[0], self._path.Y[0]])
        along, _ = View(start, self._angle).see(center)
        c, s_ = np.cos(self._angle), np.sin(self._angle)
        ground = np.array([[c, s_], [-s_, c]])
        return View(start + np.array([along, self._middle]) @ ground, self._angle)
