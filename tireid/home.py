"""tireid's own packages are those beside it, whatever else of their names lies on Python's path.

`codegen`, `models`, `identifier` and `mpc` are plain names: a script beside a folder `models/` or a
file `codegen.py` would import these. From the import of tireid on they are looked for in the folder
that holds tireid, first.
"""

import os
import sys
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

_HOME = __file__.rsplit(os.sep, 2)[0]
_PACKAGES = ("codegen", "models", "identifier", "mpc")


class _PackagesBeside:
    """What Python asks where a module lies; it answers for the packages of tireid alone."""

    @staticmethod
    def find_spec(name: str, *_: object) -> ModuleSpec | None:
        return PathFinder.find_spec(name, [_HOME]) if name in _PACKAGES else None


def find_packages() -> None:
    """Look for the packages in the folder that holds tireid, before all other folders."""
    for name in _PACKAGES:
        place = _place(sys.modules.get(name))
        if place and os.path.realpath(place) != os.path.realpath(f"{_HOME}/{name}"):
            raise ImportError(
                f"{place} hides the package {name!r} of tireid, as it was imported first: rename it"
            )
    if _PackagesBeside not in sys.meta_path:
        sys.meta_path.insert(0, _PackagesBeside)


def _place(module: ModuleType | None) -> str:
    """Return the folder of a package, the file of another module; nothing where there is none."""
    folders = list(getattr(module, "__path__", ()))
    return str(folders[0] if folders else getattr(module, "__file__", None) or "")
