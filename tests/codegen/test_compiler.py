"""What happens where the compiler or its cache is missing, refuses, or is damaged."""

import ctypes
import logging
import math
import os
import platform
import shutil
import stat
import subprocess
from pathlib import Path

import pytest

from codegen import CompilationError, build_library, cache_folder, find_compiler, load_library
from codegen import compiler as compiler_module

ONE = "int one(void) { return 1; }"


@pytest.fixture
def ask_again():
    """Forget the compiler and its version before and after."""
    for function in (find_compiler, compiler_module._version):
        function.cache_clear()
    yield
    for function in (find_compiler, compiler_module._version):
        function.cache_clear()


def test_refused_source_leaves_nothing_behind(cache):
    with pytest.raises(CompilationError, match="broken"):
        build_library("int broken(void) { return ; oops }", "broken")
    assert list(cache.iterdir()) == []


def test_a_missing_compiler_is_said_in_one_line(monkeypatch, cache, caplog, ask_again):
    monkeypatch.setattr(compiler_module.shutil, "which", lambda _: None)
    with caplog.at_level("WARNING", logger="tireid"):
        assert build_library("int f(void) { return 0; }", "f") is None
        assert load_library("int g(void) { return 0; }", "g") is None
    assert len(caplog.messages) == 1
    assert "no C compiler" in caplog.messages[0]
    assert list(cache.iterdir()) == []


def test_a_compiler_of_several_words_is_run_with_all_of_them(monkeypatch, cache, ask_again):
    monkeypatch.setenv("CC", "env TIREID_TEST=1 gcc")
    assert find_compiler() == (shutil.which("env"), "TIREID_TEST=1", "gcc")
    assert load_library(ONE, "one").one() == 1


def test_words_of_the_compiler_are_in_the_name_and_cannot_delete_guards(
    monkeypatch, cache, ask_again
):
    plain = build_library(NAN_GUARD, "guarded")
    for words in ("gcc -ffast-math", "gcc -Ofast", "gcc -ffinite-math-only"):
        monkeypatch.setenv("CC", words)
        find_compiler.cache_clear()
        assert build_library(NAN_GUARD, "guarded").stem.split(".")[0] != plain.stem.split(".")[0]
        require_nan_guards_to_work()
    monkeypatch.delenv("CC")
    find_compiler.cache_clear()
    assert build_library(NAN_GUARD, "guarded") == plain


def test_the_name_of_a_library_follows_content_flags_and_compiler(monkeypatch, cache):
    before, content = build_library(ONE, "one"), build_library(f"{ONE}\n", "one")
    with monkeypatch.context() as other:
        other.setattr(compiler_module, "FLAGS", (*compiler_module.FLAGS, "-O1"))
        flags = build_library(ONE, "one")
    with monkeypatch.context() as other:
        other.setattr(compiler_module, "_version", lambda _: "another compiler 1.0")
        version = build_library(ONE, "one")
    assert len({before, content, flags, version}) == 4
    assert build_library(ONE, "one") == before


def test_the_environment_may_ask_for_another_level_of_optimization(monkeypatch, cache):
    monkeypatch.delenv("TIREID_OPTIMIZE", raising=False)
    usual = build_library(ONE, "one")
    levels, run = [], subprocess.run

    def listen(words, **options):
        levels.extend(word for word in words if word.startswith("-O"))
        return run(words, **options)

    monkeypatch.setattr(subprocess, "run", listen)
    monkeypatch.setenv("TIREID_OPTIMIZE", "0")
    found = {build_library(ONE, "one"), build_library(ONE, "one", ("-O3", "-fPIC", "-shared"))}
    assert levels == ["-O0", "-O0"]
    assert len(found | {usual}) == 3
    monkeypatch.setenv("TIREID_OPTIMIZE", "1,0")
    long = f"{ONE}/* {'long' * compiler_module.LONG} */\n"
    found |= {build_library(ONE, "one"), build_library(long, "one")}
    assert levels == ["-O0", "-O0", "-O1", "-O0"]
    assert len(found | {usual}) == 5


@pytest.mark.parametrize("asked", ["fast", "4", "1,", "2,1,0", "1,fast"])
def test_a_level_that_there_is_not_is_refused(monkeypatch, cache, asked):
    monkeypatch.setenv("TIREID_OPTIMIZE", asked)
    with pytest.raises(CompilationError, match="TIREID_OPTIMIZE must be one of 0, 1, 2, 3"):
        build_library(ONE, "one")


def test_a_library_appears_whole_or_not_at_all(monkeypatch, cache):
    """The cache when the compiler has just ended: its file must have another name."""
    found, run = [], subprocess.run

    def look(*arguments, **options):
        answer = run(*arguments, **options)
        found.append((answer.returncode, list(cache.glob("*.so"))))
        return answer

    monkeypatch.setattr(compiler_module.subprocess, "run", look)
    library = build_library(ONE, "one")
    assert found[-1] == (0, []) and list(cache.iterdir()) == [library]


@pytest.mark.sweep("0.0", "0.5", "0.9545*", "0.0909*")
@pytest.mark.parametrize("share", [i / 22 for i in range(22)])
def test_a_library_that_was_cut_short_is_built_anew(cache, caplog, share):
    """What is damaged is said and never loaded: a process that maps it may crash."""
    library = build_library(ONE, "one")
    whole = library.read_bytes()
    library.write_bytes(whole[: int(share * len(whole))])
    with caplog.at_level("INFO", logger="tireid"):
        assert load_library(ONE, "one").one() == 1
    assert "is damaged: building it anew" in " ".join(caplog.messages)
    assert list(cache.iterdir()) == [library]
    assert library.read_bytes() == whole


def warned(caplog):
    """Warnings alone: what else is told depends on who asked for it before."""
    return [one.getMessage() for one in caplog.records if one.levelno >= logging.WARNING]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs owners of files")
@pytest.mark.parametrize("mode", [0o777, 0o775, 0o722])
def test_a_folder_that_others_can_write_is_not_used(cache, caplog, mode):
    trap = build_library("int one(void) { return 666; }", "one")
    trap.rename(build_library(ONE, "one"))
    cache.chmod(mode)
    assert load_library(ONE, "one").one() == 1
    assert cache_folder() != cache
    assert [m for m in warned(caplog) if "can be written by other users" in m] == warned(caplog)
    assert len(warned(caplog)) == 1


def others_can_write(library, _):
    library.chmod(0o666)


def belongs_to_another(library, _):
    if os.getuid() != 0:
        pytest.skip("needs to be root")
    os.chown(library, 65534, 65534)


def is_a_link(library, elsewhere):
    library.rename(elsewhere / "trap.so")
    library.symlink_to(elsewhere / "trap.so")


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs owners of files")
@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        (others_can_write, "is not loaded, but built anew"),
        (belongs_to_another, "belongs to another user"),
        (is_a_link, "is a link"),
    ],
)
def test_a_library_that_may_be_of_another_is_not_loaded(
    cache, tmp_path_factory, caplog, spoilt, said
):
    library = build_library(ONE, "one")
    spoilt(library, tmp_path_factory.mktemp("elsewhere"))
    with caplog.at_level("INFO", logger="tireid"):
        assert load_library(ONE, "one").one() == 1
    assert said in warned(caplog)[0]
    assert not library.is_symlink()
    found = library.stat()
    assert (found.st_uid, stat.S_IMODE(found.st_mode)) == (os.getuid(), 0o600)


def test_a_new_cache_is_for_this_user_only(monkeypatch, tmp_path):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path / "deep" / "cache"))
    before = os.umask(0)
    try:
        library = build_library(ONE, "one")
    finally:
        os.umask(before)
    assert [stat.S_IMODE(p.stat().st_mode) for p in (library.parent, library)] == [0o700, 0o600]


NAN_GUARD = "double guarded(double x) { return x != x ? -1.0 : x; }"


def require_nan_guards_to_work():
    guarded = load_library(NAN_GUARD, "guarded").guarded
    guarded.argtypes, guarded.restype = [ctypes.c_double], ctypes.c_double
    assert guarded(math.nan) == -1.0


def test_flags_keep_guards_against_nan(monkeypatch, cache):
    # not -ffast-math: loading what it links would flush denormals of the whole process
    require_nan_guards_to_work()
    monkeypatch.setattr(compiler_module, "FLAGS", (*compiler_module.FLAGS, "-ffinite-math-only"))
    with pytest.raises(AssertionError):
        require_nan_guards_to_work()


MULTIPLY_ADD = "double f(double a, double b, double c) { return a * b + c; }"


def require_two_roundings():
    """a b + c rounded twice, as on a machine without a fused instruction."""
    f = load_library(MULTIPLY_ADD, "f").f
    f.argtypes, f.restype = [ctypes.c_double] * 3, ctypes.c_double
    a = 1.0 + 2.0**-30
    assert f(a, a, -(a * a)) == 0.0


CPU = Path("/proc/cpuinfo")


@pytest.mark.skipif(
    platform.machine() != "x86_64" or not CPU.exists() or "fma" not in CPU.read_text().split(),
    reason="needs an x86-64 processor that can fuse multiplication and addition",
)
def test_flags_give_the_same_bits_where_the_machine_could_fuse(monkeypatch, cache):
    monkeypatch.delenv("TIREID_OPTIMIZE", raising=False)  # a lower level fuses nothing
    flags = compiler_module.FLAGS
    monkeypatch.setattr(compiler_module, "FLAGS", (*flags, "-mfma"))
    require_two_roundings()
    monkeypatch.setattr(compiler_module, "FLAGS", (*flags, "-mfma", "-ffp-contract=fast"))
    with pytest.raises(AssertionError):
        require_two_roundings()
