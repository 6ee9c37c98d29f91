"""Imports run one way, codegen <- models <- identifier <- mpc <- tireid; plots stay outside."""

import ast
import re
from graphlib import CycleError, TopologicalSorter

import pytest

from tests.sources import ROOT, nodes_of, texts_of

ORDER = ("codegen", "models", "identifier", "mpc", "tireid")
PLOTTING_ALLOWED = ("tireid", "examples", "benchmarks")


def imported(source):
    """Modules that a file imports, and what it imports from them, by their full names."""
    names = set()
    for node in nodes_of(source):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def commands_imported(source):
    """The modules of commands that a file imports."""
    return {name for name in imported(source) if name.split(".")[:2] == ["tireid", "commands"]}


def wrong_imports(package, source):
    """What a file of `package` imports from the packages to its right, or to draw."""
    later = set(ORDER[ORDER.index(package) + 1 :])
    drawing = set() if package in PLOTTING_ALLOWED else {"matplotlib"}
    return {name.split(".")[0] for name in imported(source)} & (later | drawing)


@pytest.mark.parametrize("package", ORDER)
def test_imports_run_one_way(package):
    for path, text in texts_of(package).items():
        assert not wrong_imports(package, text), path


def test_the_rule_catches_a_planted_import():
    assert wrong_imports("models", "from identifier.paper.step import build_step") == {"identifier"}
    assert wrong_imports("codegen", "import models.vehicle as v") == {"models"}
    assert wrong_imports("identifier", "import matplotlib.pyplot") == {"matplotlib"}
    assert wrong_imports("tireid", "import matplotlib, identifier, models") == set()


def circle(arrows):
    """Files of which each leads to the next in a circle, if there is one."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return set(error.args[1])
    return set()


def circle_of(sources):
    """Files that import one another in a circle; imports in functions and for types count."""
    home = {re.sub(r"(/__init__)?\.py$", "", name).replace("/", "."): name for name in sources}
    arrows = {}
    for name, source in sources.items():
        found = (home.get(one, home.get(one.rpartition(".")[0], name)) for one in imported(source))
        arrows[name] = {*found} - {name}
    return circle(arrows)


@pytest.mark.parametrize("package", ORDER)
def test_no_files_of_a_package_import_one_another_in_a_circle(package):
    assert not circle_of(texts_of(package))


def test_the_rule_catches_planted_circles_of_late_and_of_typed_imports():
    late = "def solve():\n    from m.c import solve"
    typed = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from m import a"
    tree = {"m/a.py": "import m.b", "m/b.py": late, "m/c.py": typed, "m/d.py": "from m.a import x"}
    assert circle_of(tree) == {"m/a.py", "m/b.py", "m/c.py"}
    assert not circle_of(tree | {"m/c.py": "import ast"})
    through = {"m/__init__.py": "from m.a import x", "m/a.py": "from m import x"}
    assert circle_of(through) == {"m/__init__.py", "m/a.py"}


def c_files_in_a_circle(texts):
    """C files that call one another's functions in a circle, if there is one."""
    code = {name: re.sub(r"/\*.*?\*/", "", text, flags=re.S) for name, text in texts.items()}
    opened = re.compile(r"^(?!static)[\w *]+?(\w+)\([^;{]*\)\s*\{", re.M)
    own = {name: {*opened.findall(text)} - {"main"} for name, text in code.items()}
    calls = {name: {*re.findall(r"(\w+)\(", text)} - own[name] for name, text in code.items()}
    return circle({name: [one for one in code if calls[name] & own[one]] for name in code})


@pytest.mark.parametrize("package", ORDER)
def test_no_c_files_of_a_folder_call_one_another_in_a_circle(package):
    for folder in {path.parent for path in (ROOT / package).rglob("*.c")}:
        texts = {path.name: path.read_text(encoding="utf-8") for path in folder.glob("*.c")}
        assert not c_files_in_a_circle(texts), folder


def test_the_rule_catches_a_planted_circle_of_c_files():
    folder = ROOT / "mpc/c"
    texts = {path.name: path.read_text(encoding="utf-8") for path in folder.glob("*.c")}
    qp, caution = "tireid_mpc_qp.c", "tireid_mpc_caution.c"
    texts[qp] = texts[qp].replace("begin(work, ", "tireid_mpc_tighten(work, ", 1)
    assert c_files_in_a_circle(texts) == set()  # one way
    texts[caution] += "static void back(void)\n{\n    tireid_mpc_qp(0, 0, 0);\n}\n"
    assert c_files_in_a_circle(texts) == {qp, caution}


def test_commands_call_the_interface_and_nothing_calls_the_commands():
    for folder in (*ORDER, "examples"):
        for path, text in texts_of(folder).items():
            if path != "tireid/cli.py" and path.rpartition("/")[0] != "tireid/commands":
                assert not commands_imported(text), path


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
