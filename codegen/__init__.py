"""From a `casadi.Function` to compiled C, cached by content, and to loops over samples."""

from codegen.batch import BatchScan
from codegen.compiler import (
    CompilationError,
    build_library,
    cache_folder,
    find_compiler,
    load_library,
)
from codegen.scan import Scan, Stepper

__all__ = [
    "BatchScan",
    "CompilationError",
    "Scan",
    "Stepper",
    "build_library",
    "cache_folder",
    "find_compiler",
    "load_library",
]
