"""What docs/house.py counts, by hand on small trees; the committed table is of this tree."""

import ast
import importlib.util
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SPEC = importlib.util.spec_from_file_location("house", ROOT / "docs" / "house.py")
house = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(house)
KEPT = json.loads((ROOT / house.KEPT).read_text(encoding="utf-8"))

TIRES = '''"""Tires."""
Array = list


class Linear:
    def force(self): ...


class Road: ...
'''
USER = """from models.tires import Array, Linear, Road
import models.tires

def told(tire, Array=Array):
    if isinstance(tire, int | Linear) or isinstance(tire, Road):
        return 1
    match tire:
        case Linear():
            return 2
    return type(tire) is Linear or Linear is type(tire)
"""


def modules(**texts):
    """Parsed files, a__b for a/b.py."""
    return {f"{name.replace('__', '/')}.py": ast.parse(text) for name, text in texts.items()}


def test_switches_are_questions_about_classes_that_push_not_about_others():
    assert house.type_switches(modules(models__tires=TIRES, mpc__user=USER)) == 3
    assert house.type_switches(modules(models__tires=TIRES.replace("force", "x"), u=USER)) == 0


def test_files_that_one_other_imports_are_found_through_packages():
    tree = modules(models__tires=TIRES, mpc__user=USER, models____init__="from models import tires")
    assert house.imported_once(tree) == 0  # by mpc/user.py and models/__init__.py
    tree = modules(models__tires=TIRES, mpc__user=USER, models____init__="import numpy")
    assert house.imported_once(tree) == 1
    tree = modules(a="import b, a", b="from c import x", c="from d.e import y", d__e="")
    assert house.imported_once(tree) == 3


def test_a_definition_is_no_import_and_no_argument():
    assert house.defines(ast.parse(TIRES), "Array")
    assert not house.defines(ast.parse(USER), "Array")


def test_constants_are_numbers_and_public_names_have_no_underscore():
    text = "A, B = 1.0, -2\n_C: tuple[float, ...] = (0.1, 3)\nD = 'x'\nE = True\nF = f(1)\n"
    module = ast.parse(text + "def g(): ...\nclass _H:\n    i = 3\n")
    assert house.constants(module) == ["A", "B", "_C"]
    assert house.public_names(module) == ["g", "A", "B", "D", "E", "F"]


@pytest.mark.parametrize(
    ("lines", "other", "found"),
    [
        (5, "  {}\n", 0),  # too few
        (6, "  {}\n", 1),
        (9, "\t{}\n\n", 1),  # four windows, one run
        (9, "{};\n", 0),
    ],
)
def test_pairs_are_runs_of_lines_that_stand_twice(lines, other, found):
    names = [f"line {k}" for k in range(lines)]
    one = "".join(f"{name}\n" for name in ("a", *names, "b"))
    two = "".join(other.format(name) for name in ("c", *names, "d"))
    assert len(house.pairs({"one.py": one, "two.py": two})) == found
    assert len(house.pairs({"both.py": one + two})) == found


def test_what_stands_everywhere_is_no_pair_and_a_run_does_not_pair_with_itself():
    text = "".join(f"line {k}\n" for k in range(6))
    assert len(house.pairs({f"{k}.py": text for k in range(house.COMMON)})) == 28
    assert house.pairs({f"{k}.py": text for k in range(house.COMMON + 1)}) == []
    assert house.pairs({"same.py": "line\n" * 8}) == []


def test_a_tree_is_counted(tmp_path):
    for name in house.PACKAGES:
        (tmp_path / name).mkdir()
    (tmp_path / "models" / "tires.py").write_text(TIRES)
    (tmp_path / "mpc" / "user.py").write_text(USER)
    (tmp_path / "mpc" / "name.c").write_text("int @name@_x = @size@; /* a@b.c */\n")
    (tmp_path / "README.md").write_text("# Four words, in all\n")
    (tmp_path / "other.py").write_text(USER)
    assert house.counts(tmp_path) == {
        "files": 2,
        "lines": 19,
        "imported_once": 1,
        "circles": 0,
        "constants": 0,
        "public_names": 4,
        "type_switches": 3,
        "arrays": 1,
        "pairs": 0,
        "placeholders": 2,
        "readme_words": 5,
    }


def test_the_table_of_the_page_is_what_was_kept():
    page = (ROOT / house.PAGE).read_text(encoding="utf-8")
    assert house.written(page, KEPT) == page
    other = KEPT | {"now": KEPT["now"] | {"files": KEPT["now"]["files"] + 1}}
    assert house.written(page, other) != page


@pytest.mark.heavy
def test_the_table_is_of_this_tree_but_for_small_changes():
    now = house.counts(ROOT)
    far = {
        key: (KEPT["now"][key], value)
        for key, value in now.items()
        if abs(value - KEPT["now"][key]) > max(10, 0.1 * KEPT["now"][key])
    }
    assert not far, f"`python docs/house.py --write` counts anew: {far}"


def test_a_command_that_fails_stops_with_what_it_said(tmp_path):
    with pytest.raises(SystemExit, match=r"git archive .* ended with 128:\nfatal: not a valid"):
        house.archived("no-such-revision", tmp_path)


@pytest.mark.heavy
def test_imports_are_timed_against_an_empty_python(tmp_path, monkeypatch):
    monkeypatch.setattr(house, "STARTS", 3)
    (tmp_path / "tireid").mkdir()
    (tmp_path / "tireid" / "__init__.py").write_text("import time; time.sleep(0.2)\n")
    (tmp_path / "tireid" / "cli.py").write_text("def main(words): time = 0\n")
    told = house.starts(tmp_path)
    assert 150.0 < told["import_ms"] < 2000.0 and 150.0 < told["help_ms"] < 2000.0
