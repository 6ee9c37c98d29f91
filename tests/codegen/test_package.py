"""The machinery of exports: words renamed once, generated headers, and names of cars as such."""

import subprocess

import pytest

from codegen import find_compiler
from codegen.escape import c_comment
from codegen.package import (
    PackageNameError,
    c_files,
    check_name,
    cmake,
    defines,
    header,
    in_comment,
    one_file,
    precision,
    renamed,
)
from codegen.template import Words

HOSTILE = '*/ #error "x" /* @name@ tireid_step ??/\n"\\\u2028 //'
NEEDS_COMPILER = pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")


def test_only_the_beginnings_of_words_are_renamed():
    text = '#include "tireid.h"\nTIREID_OK tireid_step my_tireid_x tireid tireidx atireid.h TIREID'
    assert renamed(text, {"tireid": "left"}) == (
        '#include "left.h"\nLEFT_OK left_step my_tireid_x tireid tireidx atireid.h TIREID'
    )
    assert renamed("test_tireid.c", {"tireid": "left"}) == "test_left.c"


def test_files_get_the_name_that_their_text_gets(tmp_path):
    (tmp_path / "tireid_mpc.h").write_text("TIREID_MPC_H")
    assert c_files(tmp_path, {"tireid_mpc.h": "include"}, {"tireid_mpc": "far"}) == {
        "include/far.h": "FAR_H"
    }
    assert list(c_files(tmp_path, {"tireid_mpc.h": "."}, {"tireid_mpc": "far"})) == ["far.h"]


NONE = ["Upper", "1st", "with-dash", "", "a" * 32, "a\n", "x y", "@a@", "null", "jac", "a__b"]


@pytest.mark.parametrize("name", NONE)
def test_a_name_that_is_none_of_c_is_refused(name):
    with pytest.raises(PackageNameError, match="name must be"):
        check_name(name)
    check_name("a" * 31)
    check_name("a" * 31 + "_mpc", "_mpc")


def compiled(text, folder):
    (folder / "one.c").write_text(text, encoding="utf-8")
    words = ["-std=c99", "-trigraphs", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-c", "one.c"]
    return subprocess.run(
        [*find_compiler(), *words], cwd=folder, capture_output=True, text=True, check=False
    )


@NEEDS_COMPILER
def test_words_from_data_stay_words_in_a_generated_header(tmp_path):
    def text(words):
        parts = [precision("a", single=True), defines("a", {"N": ("2U", "numbers")})]
        used = "a_real two(void);\na_real two(void) { return (a_real)A_N; }\n"
        return header("a_config.h", f"{words}: numbers.\n\nOurs.", parts) + used

    good = text(in_comment(Words(HOSTILE)))
    assert "tireid_step" in good and "@name@" in good  # as they were said: nothing is filled in
    answer = compiled(good, tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")
    assert compiled(text(HOSTILE), tmp_path).returncode != 0  # what the escape keeps out
    assert in_comment(Words(HOSTILE)) == c_comment(HOSTILE)


def test_words_from_data_stay_in_their_comment_of_the_build_file():
    about = {"title": Words("x\nmessage(FATAL_ERROR y) @sources@"), "name": "a", "NAME": "A"}
    about["single_option"] = "OFF"
    text = cmake(["src/b.c", "src/a.c", "src/a.h", "tests/t.c"], about, flags=["-O3"], so_that="z")
    lines = text["CMakeLists.txt"].splitlines()
    assert lines[0].startswith("# x\\nmessage(FATAL_ERROR y) @sources@:")
    at = lines.index("add_library(a STATIC")
    assert lines[at + 1 : at + 3] == ["  src/a.c", "  src/b.c)"]


@NEEDS_COMPILER
def test_macros_of_one_file_do_not_reach_the_next(tmp_path):
    head = header("h.h", "x", ["#define ONE 1\n"])
    files = [head, '#include "h.h"\n#define N ONE\nint a(void);\nint a(void) { return N; }\n']
    files.append("#define N 3\nint b(void);\nint b(void) { return N + ONE + TWO; }\n")
    answer = compiled(one_file(files, defines={"TWO": 2}), tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")
