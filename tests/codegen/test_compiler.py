"""What happens where the compiler is missing or refuses."""

import pytest

from codegen import CompilationError, build_library, find_compiler
from codegen import compiler as compiler_module


@pytest.fixture
def fresh_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
    return tmp_path


def test_refused_source_leaves_nothing_behind(fresh_cache):
    with pytest.raises(CompilationError, match="broken"):
        build_library("int broken(void) { return ; oops }", "broken")
    assert list(fresh_cache.iterdir()) == []


def test_a_missing_compiler_is_said_in_one_line(monkeypatch, fresh_cache, caplog):
    monkeypatch.setattr(compiler_module.shutil, "which", lambda _: None)
    find_compiler.cache_clear()
    try:
        with caplog.at_level("WARNING", logger="tireid"):
            assert build_library("int f(void) { return 0; }", "f") is None
            assert build_library("int g(void) { return 0; }", "g") is None
    finally:
        find_compiler.cache_clear()
    assert len(caplog.messages) == 1
    assert "no C compiler" in caplog.messages[0]
    assert list(fresh_cache.iterdir()) == []


def test_the_name_of_a_library_follows_its_content(fresh_cache):
    one = build_library("int f(void) { return 1; }", "f")
    two = build_library("int f(void) { return 2; }", "f")
    assert one != two
    assert build_library("int f(void) { return 1; }", "f") == one
