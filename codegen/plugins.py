"""What other distributions add: commands and methods, by entry points."""

from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points


@cache
def installed(group: str) -> Mapping[str, EntryPoint]:
    """Return what distributions add by entry points of a group, by name."""
    return {one.name: one for one in entry_points(group=group)}
