"""From a `casadi.Function` to compiled C, cached by content, and to loops over samples."""

from typing import TYPE_CHECKING

from codegen.face import face

if TYPE_CHECKING:
    from codegen.compiler import CompilationError as CompilationError
    from codegen.compiler import build_library as build_library
    from codegen.compiler import cache_folder as cache_folder
    from codegen.compiler import find_compiler as find_compiler
    from codegen.compiler import load_library as load_library
    from codegen.scan import Scan as Scan
    from codegen.scan import Stepper as Stepper

_COMPILER = ("CompilationError", "build_library", "cache_folder", "find_compiler", "load_library")
_HOMES = {name: f"codegen.compiler:{name}" for name in _COMPILER}
_HOMES |= {name: f"codegen.scan:{name}" for name in ("Scan", "Stepper")}

__getattr__, __dir__ = face(__name__, _HOMES)  # `codegen.errors` needs none of them
