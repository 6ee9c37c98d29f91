"""What a fresh machine need not have: tests that ask for it are known, and it can be hidden."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.optional_tools import LIST, is_optional, path_without, unlisted

ROOT = Path(__file__).resolve().parents[1]
PLANTED = """
import shutil
import subprocess

def test_looks_for_one():
    assert shutil.which("no-such-tool") is None and shutil.which("/nowhere/clang++") is None

def test_runs_one():
    try:
        subprocess.run(["arm-none-eabi-gcc", "--version"], capture_output=True)
    except FileNotFoundError:
        pass

def test_runs_one_in_a_shell():
    subprocess.run("cmake --version", shell=True, capture_output=True)

def test_needs_python_and_gcc():
    subprocess.run(["gcc", "--version"], capture_output=True, check=True)
"""


TOOLS = (
    "/usr/bin/arm-none-eabi-size", "qemu-system-arm", "x86_64-w64-mingw32-gcc", "clang-14",
    "clang-format", "cmake", "ctest", "cppcheck", "g++", "/usr/bin/chromium",
)  # fmt: skip


@pytest.mark.parametrize("command", TOOLS)
def test_optional_is_what_the_readme_does_not_ask_for(command):
    assert is_optional(command)
    assert unlisted("tests/test_new.py", ["gcc", command]) == (
        f"tests/test_new.py asks for {Path(command).name}: name it in tests/optional_tools.txt"
    )
    assert unlisted(LIST.read_text().split()[0], [command]) is None


def test_python_gcc_and_make_are_not_optional():
    assert not any(map(is_optional, ["python3", "/usr/bin/gcc", "gcc-12", "make", "cc", "sh"]))


def test_a_new_file_that_asks_for_a_tool_fails_until_it_is_listed(tmp_path):
    file = tmp_path / "test_new.py"
    file.write_text(PLANTED)
    words = ["-q", "-p", "tests.conftest", "-p", "no:cacheprovider", "-c", "pyproject.toml"]
    command = [sys.executable, "-m", "pytest", *words, f"--rootdir={tmp_path}", str(file)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert "3 failed, 1 passed" in ran.stdout, ran.stdout + ran.stderr
    for tool in ("clang++", "arm-none-eabi-gcc", "cmake"):
        assert f"test_new.py asks for {tool}: name it in tests/optional_tools.txt" in ran.stdout


def test_every_file_of_the_list_is_there_once():
    names = LIST.read_text().splitlines()
    assert names == sorted(set(names))
    assert all((ROOT / name).is_file() for name in names)


def test_a_path_without_the_tools_still_finds_all_else(tmp_path):
    for name in ("first/cmake", "first/python3", "first/clang-14", "second/gcc"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    path = path_without(f"{tmp_path}/first:{tmp_path}/second:{tmp_path}/none", scratch)
    first, second, none = map(Path, path.split(":"))
    assert [file.name for file in first.iterdir()] == ["python3"]
    assert (first / "python3").read_text() == "first/python3"
    assert (second, none) == (tmp_path / "second", tmp_path / "none")


def test_a_command_is_run_without_the_tools_and_its_answer_is_handed_on():
    script = "command -v sh && ! command -v cmake && ! command -v clang && exit 3"
    command = [sys.executable, "-m", "tests.optional_tools", "sh", "-c", script]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert (ran.returncode, ran.stdout.count("\n")) == (3, 1), ran.stderr
