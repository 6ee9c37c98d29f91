"""The face of a package: names that are imported at their first use."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def face(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], Any]]:
    """Return `__getattr__` and `__dir__` of a package whose names are imported when asked for.

    homes : where each name lies, "module:name" or "module"; they are also its `__all__`.
    """

    def fetch(name: str) -> Any:
        if name == "__all__":
            return sorted(homes)
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, attribute = homes[name].partition(":")
        home = import_module(module)
        value = getattr(home, attribute) if attribute else home
        setattr(sys.modules[package], name, value)
        return value

    return fetch, lambda: sorted(homes)
