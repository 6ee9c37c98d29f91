"""C steps as loops over a recording, built and called alike: void run(long n, const double*, ...).

Each loop is one shared library, built in a folder of its own with the flags that are handed over.
"""

import ctypes
import re
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from codegen import find_compiler
from codegen.arrays import Array
from codegen.package import renamed
from identifier.export.package import Package

Loop = Callable[[Array], Array]
HAND_WRITTEN = Path(__file__).with_name("hand_written_step.c")

PACKAGE_LOOP = """
#include "tireid.h"
void run(long n, const double *s, double *force)
{
    tireid_state state;
    tireid_params params;
    tireid_default_params(&params);
    tireid_init(&state);
    for (long k = 0; k < n; ++k, s += %(width)d) {
        const tireid_input in = { %(sample)s };
        tireid_real now[2];
        tireid_step(&state, &params, &in);
        tireid_get_forces(&state, now);
        force[2 * k] = (double)now[0];
        force[2 * k + 1] = (double)now[1];
    }
}
"""
LITERAL_LOOP = """
#include <string.h>
void run(long n, const double *s, const double *constants, const double *start, double *force)
{
    double memory[2][%(carried)d], w[%(work)d];
    casadi_int iw[%(integers)d];
    memcpy(memory[0], start, sizeof memory[0]);
    for (long k = 0; k < n; ++k, s += 5) {
        double *now = memory[k %% 2], *next = memory[(k + 1) %% 2];
        const double *arg[%(arguments)d] = { now, now + 2, now + 4, now + %(V)d, s + 1, s + 3, s,
            constants, constants + 6, constants + 10, constants + 15 };
        double *res[%(results)d] = { next, next + 2, next + 4, next + %(V)d, force + 2 * k };
        literal(arg, res, iw, w, 0);
    }
}
"""


def release_flags(package: Package) -> tuple[str, ...]:
    """Return the flags that a package's own CMakeLists.txt builds its release with, for gcc."""
    text = package.files["CMakeLists.txt"]
    found = re.search(r"target_compile_options\(\w+ PRIVATE ([^)]*)\)", text)
    standard = re.search(r"C_STANDARD (\d+)", text)
    assert found and standard
    return ("-O3", "-DNDEBUG", f"-std=c{standard[1]}", *found[1].split(), "-fPIC")


def package_loop(package: Package, *, single: bool, flags: Sequence[str]) -> Loop:
    """Return a package as a loop over samples (n, k) that gives forces (n, 2) [N]."""
    name = package.specialized.name
    files = {p: t for p, t in package.files.items() if p.startswith(("include/", "src/"))}
    define = f"-D{name.upper()}_SINGLE={int(single)}"
    width = len(package.specialized.inputs)
    sample = ", ".join(f"(tireid_real)s[{i}]" for i in range(width))
    source = renamed(PACKAGE_LOOP % {"width": width, "sample": sample}, {"tireid": name})
    library = _build({**files, "loop.c": source}, [*flags, define, "-Iinclude", "-Isrc"])
    return lambda samples: _forces(library, samples)


def literal_loop(step: ca.Function, constants: Array, start: Array, flags: Sequence[str]) -> Loop:
    """Return a literal CasADi step as such a loop."""
    generator = ca.CodeGenerator("literal.c")
    generator.add(step)
    sizes = {
        "carried": start.size,
        "V": 4 + step.numel_in(2),
        "work": max(step.sz_w(), 1),
        "integers": max(step.sz_iw(), 1),
        "arguments": max(step.sz_arg(), step.n_in()),
        "results": max(step.sz_res(), step.n_out()),
    }
    library = _build({"loop.c": generator.dump() + LITERAL_LOOP % sizes}, flags)
    return lambda samples: _forces(library, samples, constants, start)


def hand_written_loop(numbers: Array, start: Array, flags: Sequence[str]) -> Loop:
    """Return the hand-written step as such a loop."""
    library = _build({"loop.c": HAND_WRITTEN.read_text(encoding="utf-8")}, flags)
    return lambda samples: _forces(library, samples, numbers, start)


def _forces(library: ctypes.CDLL, samples: Array, *given: Array) -> Array:
    force = np.empty((len(samples), 2))
    pointers = (ctypes.c_void_p(array.ctypes.data) for array in (samples, *given, force))
    library.run(ctypes.c_long(len(samples)), *pointers)
    return force


def _build(files: Mapping[str, str], flags: Sequence[str]) -> ctypes.CDLL:
    """Compile every C file by itself, as any build does, and load what they make."""
    compiler = find_compiler()
    assert compiler is not None, "this benchmark needs a C compiler"
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder = Path(scratch)
        for path, text in files.items():
            (folder / path).parent.mkdir(exist_ok=True)
            (folder / path).write_text(text, encoding="utf-8")
        sources = sorted(path for path in files if path.endswith(".c"))
        command = [*compiler, *flags, *sources, "-shared", "-o", "loop.so", "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        return ctypes.CDLL(str(folder / "loop.so"))
