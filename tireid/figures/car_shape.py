"""The car from above as polygons: a body and four wheels, the front ones steered.

Pictures need a length, a width and wheels; a vehicle without a chassis gets those that are usual
for its wheelbase.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.vehicle import Vehicle

Array = NDArray[np.float64]

FRONT_OVERHANG, REAR_OVERHANG = 0.32, 0.36  # of the wheelbase, beyond the axles
TRACK = 0.57  # of the wheelbase, where no chassis says
BODY_BESIDE_TRACK = 0.1  # of the wheelbase: how much wider than the track the body is
WHEEL_LENGTH, WHEEL_WIDTH = 0.24, 0.085  # of the wheelbase
CORNERS = 6  # points of each rounded corner
ROUNDING = 0.28  # radius of the body's corners, of its width


class CarShape(NamedTuple):
    """Polygons in the ground's frame [m]: body (k, 2), glass (4, 2) and wheels (4, 4, 2)."""

    body: Array
    glass: Array
    wheels: Array


def car_shape(vehicle: Vehicle, X: float, Y: float, psi: float, delta: float = 0.0) -> CarShape:
    """Return a car at a pose; wheels in the order front left, front right, rear left, rear right.

    Parameters
    ----------
    vehicle : gives the size.
    X, Y : center of gravity [m].
    psi : heading [rad].
    delta : angle of the front wheels [rad], positive to the left.
    """
    long = vehicle.wheelbase
    chassis = vehicle.chassis
    tracks = (TRACK * long,) * 2 if chassis is None else (chassis.track_front, chassis.track_rear)
    half = 0.5 * (max(tracks) + BODY_BESIDE_TRACK * long)
    front, rear = vehicle.l_f + FRONT_OVERHANG * long, -vehicle.l_r - REAR_OVERHANG * long
    body = _rounded(rear, front, half, 2.0 * half * ROUNDING)
    glass = np.array([(0.32, 0.6), (0.18, 0.78), (0.18, -0.78), (0.32, -0.6)]) * (long, half) + (
        0.05 * long,
        0.0,
    )
    wheels = np.stack(
        [
            _wheel(long) @ _turn(angle).T + (x, 0.5 * side * track)
            for x, track, angle in (
                (vehicle.l_f, tracks[0], delta),
                (-vehicle.l_r, tracks[1], 0.0),
            )
            for side in (1.0, -1.0)
        ]
    )
    turn, place = _turn(psi).T, np.array([X, Y])
    return CarShape(body @ turn + place, glass @ turn + place, wheels @ turn + place)


def _wheel(wheelbase: float) -> Array:
    corners = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    return 0.5 * wheelbase * corners * (WHEEL_LENGTH, WHEEL_WIDTH)


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
