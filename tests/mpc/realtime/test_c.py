"""The C as it is exported: no warnings, and nothing but what C99 has."""

import re
import subprocess

import pytest

from codegen import find_compiler
from mpc.realtime.c_source import c_sources
from mpc.realtime.instance import N_COMMANDS, Status

ABOUT = {"title": "A test", "version": "0", "hash": "0", "version_text": "0"}
WARNINGS = ("all", "extra", "pedantic", "conversion", "shadow", "double-promotion")
STRICT = ["-std=c99", "-O1", *(f"-W{warning}" for warning in WARNINGS)]
NAME = "any_name"

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def lagging_files(lagging):
    return c_sources(lagging.structure, horizon=5, name=NAME, about=ABOUT)


@pytest.mark.sweep("1")
@needs_compiler
@pytest.mark.parametrize("single", [0, 1])
def test_it_compiles_without_a_warning_in_both_precisions(lagging_files, single, tmp_path):
    for path, text in lagging_files.items():
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text)
    sources = sorted(str(path) for path in (tmp_path / "src").glob("*.c"))
    options = [f"-DANY_NAME_SINGLE={single}", f"-I{tmp_path / 'include'}", "-Werror", "-c"]
    command = [*find_compiler(), *STRICT, *options, *sources]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr


def test_nothing_is_allocated_printed_or_left_open(lagging_files):
    code = "".join(re.sub(r"/\*.*?\*/", "", text, flags=re.S) for text in lagging_files.values())
    assert set(re.findall(r"#include <(.*)>", code)) <= {
        "math.h",
        "stdbool.h",
        "stddef.h",
        "stdint.h",
    }
    assert not re.search(r"\b(malloc|free|printf|goto|setjmp)\b", code)
    assert not re.search(r"@\w+@", code)
    called = set(re.findall(r"^#define ANY_NAME_\w+\(x\) (\w+)\(x\)", code, flags=re.M))
    assert called <= {"sqrt", "fabs", "floor", "sqrtf", "fabsf", "floorf"}


def test_the_header_says_what_python_believes(lagging_files):
    header = lagging_files[f"include/{NAME}.h"]
    told = dict(re.findall(r"ANY_NAME_(\w+) = (\d+)", header))
    assert {name: int(value) for name, value in told.items()} == {s.name: s.value for s in Status}
    assert f"ANY_NAME_COMMANDS {N_COMMANDS}U" in header
    assert f"ANY_NAME_STATUSES {len(Status)}U" in header
