"""The C as it is exported has nothing but what C99 has."""

import re

import pytest

from mpc.realtime.c_source import c_sources
from mpc.realtime.instance import N_COMMANDS, Status

ABOUT = {"title": "A test", "version": "0", "hash": "0", "version_text": "0"}
NAME = "any_name"


@pytest.fixture(scope="module")
def lagging_files(lagging):
    return c_sources(lagging.structure, horizon=5, name=NAME, about=ABOUT)


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
