"""From a `casadi.Function` to compiled C, cached by content, and to loops over samples."""

from codegen.batch import BatchScan
from codegen.cache import cache_folder
from codegen.compiler import CompilationError, build_library, find_compiler, load_library
from codegen.scan import Scan
from codegen.stepper import Stepper

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
