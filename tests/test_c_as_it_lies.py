"""The C of this repository is C where it lies: it compiles, lints and formats without an export."""

import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from codegen import find_compiler
from tests.c_reference.write import FOLDER, reference

ROOT = Path(__file__).parents[1]
FOLDERS = (
    "codegen/target", "identifier/export/c", "identifier/export/c_fmu", "identifier/export/target",
    "mpc/c", "mpc/export/c", "mpc/export/pair", "mpc/export/target", "tests/identifier/export",
    "tests/mpc/export",
)  # fmt: skip
ARM = "codegen/target/board.c"  # for a compiler of its own
HERE = [
    str(path.relative_to(ROOT))
    for folder in FOLDERS
    for path in sorted((ROOT / folder).glob("*.c"))
    if str(path.relative_to(ROOT)) != ARM
]
NUMBER = re.compile(r"(?<![\w.])-?\d+\.\d*(?:e[-+]?\d+)?")


def run(*command):
    if shutil.which(command[0]) is None:
        pytest.skip(f"needs {command[0]}")
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def compiled(compiler, file, single):
    macros = [f"-DTIREID_SINGLE={single}", f"-DTIREID_MPC_SINGLE={single}"]
    return run(compiler, "@compile_flags.txt", "-Werror", "-fsyntax-only", *macros, str(file))


def test_there_is_c_to_look_at():
    names = {Path(file).name for file in HERE}
    assert {"tireid.c", "tireid_mpc_qp.c", "tireid_handover.c", "fmi.c", "main.c"} <= names


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("single", [0, 1])
@pytest.mark.parametrize("file", HERE)
def test_every_file_compiles_as_it_lies_without_a_warning(file, single, compiler):
    answer = compiled(compiler, file, single)
    assert (answer.returncode, answer.stderr) == (0, ""), file


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize(
    ("option", "file"),
    [
        ("-Impc/export/target", "codegen/target/replay.c"),  # what is replayed of a tracker
        ("-DMODEL_FMI=2", "identifier/export/c_fmu/fmi.c"),
        ("-DMODEL_FMI=3", "identifier/export/c_fmu/fmi.c"),
    ],
)
def test_other_uses_of_a_file_compile_too(compiler, option, file):
    answer = run(compiler, option, "@compile_flags.txt", "-Werror", "-fsyntax-only", file)
    assert (answer.returncode, answer.stderr) == (0, "")


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_a_warning_would_be_seen(compiler, tmp_path):
    file = tmp_path / "warns.c"
    text = (ROOT / "identifier/export/c/tireid.c").read_text()
    file.write_text(text + "float half(double x);\nfloat half(double x) { return x / 2; }\n")
    assert "conver" in compiled(compiler, file, 0).stderr


@pytest.mark.heavy
@pytest.mark.parametrize("single", [0, 1])
def test_cppcheck_has_nothing_to_say(single):
    flags = (ROOT / "compile_flags.txt").read_text().split()
    words = ["--std=c99", "--enable=warning,performance,portability", "--error-exitcode=1", "-q"]
    includes = [flag for flag in flags if flag.startswith("-I")]
    macros = [f"-DTIREID_SINGLE={single}", f"-DTIREID_MPC_SINGLE={single}"]
    answer = run("cppcheck", *words, *macros, *includes, *HERE)
    assert (answer.returncode, answer.stderr) == (0, "")


def test_it_is_formatted():
    files = [str(path) for folder in FOLDERS for path in sorted((ROOT / folder).glob("*.[ch]"))]
    answer = run("clang-format", "--dry-run", "--Werror", *files)
    assert answer.returncode == 0, answer.stderr[:2000]


def test_no_file_has_a_place_that_something_is_filled_in_at():
    for folder in FOLDERS:
        for path in (ROOT / folder).glob("*.[ch]"):
            assert not re.search(r"@\w+@", path.read_text(encoding="utf-8")), path


@pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")
def test_the_reference_is_what_the_generators_write_today():
    """`make reference` writes it anew; numbers may differ by what a machine's algebra rounds."""
    written = reference()
    assert set(written) == {path.name for path in FOLDER.glob("*.h")}
    for name, text in written.items():
        kept = (FOLDER / name).read_text(encoding="utf-8")
        assert NUMBER.sub("#", text) == NUMBER.sub("#", kept), name
        pairs = zip(NUMBER.findall(text), NUMBER.findall(kept), strict=True)
        for new, old in pairs:
            assert math.isclose(float(new), float(old), rel_tol=1e-6, abs_tol=1e-6), name
