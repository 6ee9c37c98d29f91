"""The built-in paths by the names that a command line knows them by."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from mpc.path.courses import constant_radius, handling_course
from mpc.path.iso_3888 import iso_3888_1, iso_3888_2
from mpc.path.path import Path
from mpc.path.slalom import slalom

BUILT_IN: Mapping[str, Callable[[], Path]] = MappingProxyType(
    {
        "iso-3888-1": iso_3888_1,
        "iso-3888-2": iso_3888_2,
        "slalom": slalom,
        "circle": constant_radius,
        "course": handling_course,
    }
)
