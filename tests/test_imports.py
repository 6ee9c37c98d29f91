"""Imports run one way, codegen <- models <- identifier <- mpc <- tireid; plots stay outside."""

import ast
from pathlib import Path

import pytest

from tests.sources import nodes_of

ROOT = Path(__file__).resolve().parents[1]
ORDER = ("codegen", "models", "identifier", "mpc", "tireid")
PLOTTING_ALLOWED = ("tireid", "examples", "benchmarks")


def imported(source: str) -> set[str]:
    """Modules that a file imports, and what it imports from them, by their full names."""
    names = set()
    for node in nodes_of(source):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def commands_imported(source: str) -> set[str]:
    """The modules of commands that a file imports."""
    return {name for name in imported(source) if name.split(".")[:2] == ["tireid", "commands"]}


def wrong_imports(package: str, source: str) -> set[str]:
    """What a file of `package` imports from the packages to its right, or to draw."""
    later = set(ORDER[ORDER.index(package) + 1 :])
    drawing = set() if package in PLOTTING_ALLOWED else {"matplotlib"}
    return {name.split(".")[0] for name in imported(source)} & (later | drawing)


@pytest.mark.parametrize("package", ORDER)
def test_imports_run_one_way(package):
    for path in (ROOT / package).rglob("*.py"):
        assert not wrong_imports(package, path.read_text(encoding="utf-8")), path


def test_the_rule_catches_a_planted_import():
    assert wrong_imports("models", "from identifier.paper.step import build_step") == {"identifier"}
    assert wrong_imports("codegen", "import models.vehicle as v") == {"models"}
    assert wrong_imports("identifier", "import matplotlib.pyplot") == {"matplotlib"}
    assert wrong_imports("tireid", "import matplotlib, identifier, models") == set()


def local_imports(source: str, homes: dict[str, str]) -> set[str]:
    """Paths of the files that a file imports."""
    found = set()
    for node in nodes_of(source):
        if isinstance(node, ast.Import):
            found |= {homes.get(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            room = f"{node.module}"
            found |= {homes.get(f"{room}.{a.name}", homes.get(room)) for a in node.names}
    return {home for home in found if home is not None}


def circles(texts: dict[str, str]) -> list[list[str]]:
    """Which files, text by path, import one another in a circle: Tarjan's components.

    Imports in functions and for type checkers count.
    """
    homes = {
        name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): name for name in texts
    }
    imports = {name: local_imports(text, homes) - {name} for name, text in texts.items()}
    number: dict[str, int] = {}
    least: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(name: str) -> None:
        number[name] = least[name] = len(number)
        stack.append(name)
        for other in imports[name]:
            if other not in number:
                visit(other)
            if other in stack:
                least[name] = min(least[name], least[other])
        if least[name] == number[name]:
            members = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(members) > 1:
                found.append(sorted(members))

    for name in imports:
        if name not in number:
            visit(name)
    return found


@pytest.mark.parametrize("package", ORDER)
def test_no_files_of_a_package_import_one_another_in_a_circle(package):
    paths = (ROOT / package).rglob("*.py")
    texts = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}
    assert not circles(texts)


def test_the_rule_catches_planted_circles_of_late_and_of_typed_imports():
    late = "def solve():\n    from m.c import solve"
    typed = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from m import a"
    tree = {"m/a.py": "import m.b", "m/b.py": late, "m/c.py": typed, "m/d.py": "from m.a import x"}
    assert circles(tree) == [["m/a.py", "m/b.py", "m/c.py"]]
    assert circles(tree | {"m/c.py": "import ast"}) == []
    through = {"m/__init__.py": "from m.a import x", "m/a.py": "from m import x"}
    assert circles(through) == [["m/__init__.py", "m/a.py"]]


def test_commands_call_the_interface_and_nothing_calls_the_commands():
    files = [path for package in (*ORDER, "examples") for path in (ROOT / package).rglob("*.py")]
    free = [path for path in files if path != ROOT / "tireid/cli.py"]
    for path in free:
        if path.parent != ROOT / "tireid/commands":
            assert not commands_imported(path.read_text(encoding="utf-8")), path


def test_the_rule_catches_an_interface_that_calls_a_command():
    for planted in (
        "from tireid.commands.drive import run",
        "from tireid.commands import drive",
        "from tireid import commands",
        "def late():\n    import tireid.commands.drive as d",
    ):
        assert commands_imported(planted), planted
    assert not commands_imported("from tireid import driving\nimport tireid.commandments")


def test_every_package_is_in_the_wheel():
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    packaged = project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert packaged == [name for name in ORDER if (ROOT / name).is_dir()]
