"""Paths to follow: from way-points or a CSV, built-in tests and courses, and speeds along them."""

from mpc.path.courses import BUILT_IN, constant_radius, handling_course
from mpc.path.gates import iso_3888_1, iso_3888_2, slalom
from mpc.path.line import PathError
from mpc.path.path import Path, Projection
from mpc.path.speed import grip_speed, steady_speed

__all__ = [
    "BUILT_IN", "Path", "PathError", "Projection", "constant_radius", "grip_speed",
    "handling_course", "iso_3888_1", "iso_3888_2", "slalom", "steady_speed",
]  # fmt: skip
