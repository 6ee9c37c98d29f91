"""From a `casadi.Function` to compiled C, cached by content, and to loops over samples."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from codegen.compiler import (
        CompilationError,
        build_library,
        cache_folder,
        find_compiler,
        load_library,
    )
    from codegen.scan import Scan, Stepper

__all__ = [
    "CompilationError",
    "Scan",
    "Stepper",
    "build_library",
    "cache_folder",
    "find_compiler",
    "load_library",
]
_HOMES = {"Scan": "scan", "Stepper": "scan"}  # all others: compiler


def __getattr__(name: str) -> Any:
    """Return a name of the package, fetched at its first use: `codegen.errors` needs none."""
    if name not in __all__:
        raise AttributeError(f"module 'codegen' has no attribute {name!r}")
    home = importlib.import_module(f"codegen.{_HOMES.get(name, 'compiler')}")
    globals()[name] = value = getattr(home, name)
    return value
