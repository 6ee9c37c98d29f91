"""Paths to follow: from way-points or a CSV, built-in tests and courses, and speeds along them."""

from mpc.path.courses import BUILT_IN, constant_radius, handling_course
from mpc.path.gates import iso_3888_1, iso_3888_2, slalom
from mpc.path.line import PathError
from mpc.path.path import Path, Projection
from mpc.path.speed import SpeedProfile, speed_profile, steady_speed

__all__ = [
    "BUILT_IN", "Path", "PathError", "Projection", "SpeedProfile", "constant_radius",
    "handling_course", "iso_3888_1", "iso_3888_2", "slalom", "speed_profile", "steady_speed",
]  # fmt: skip
