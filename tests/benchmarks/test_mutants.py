"""The mutation run: what it plants, that it plants the same again, that it sees what tests miss."""

import subprocess
import tomllib
from collections import Counter
from itertools import chain
from pathlib import Path

import pytest

from benchmarks.mutants import PLANTED, plant, written_fault
from benchmarks.mutation.c_faults import c_faults, changes_tokens, tokens
from benchmarks.mutation.draw import changes, draw, package_of, strata
from benchmarks.mutation.faults import Fault
from benchmarks.mutation.python_faults import changes_bytecode, python_faults
from benchmarks.mutation.selection import Traced
from benchmarks.mutation.workshop import Workshop

ROOT = Path(__file__).resolve().parents[2]
TOY = '''"""A toy: 1 + 1 == 3."""

def area(width: float, height: float = 1.0) -> float:
    """Return 2 * width."""
    if not width > 0.0:
        raise ValueError(f"width must be positive, it is {width - 1}")
    return width * height


def unloved(x):
    return x + 2
'''
TOY_TEST = """
from models.toy import area, unloved

def test_area():
    assert area(2.0, 3.0) == 6.0

def test_unloved_is_called():
    unloved(1)
"""


def planted(source: str, file: str = "toy.py") -> dict[str, list[str]]:
    """Every changed text, by kind."""
    text = source.encode()
    rules = python_faults if file.endswith(".py") else c_faults
    found: dict[str, list[str]] = {}
    for fault in rules(file, text):
        found.setdefault(fault.kind, []).append(fault.planted(text).decode())
    return found


@pytest.mark.parametrize(
    ("source", "kind", "faulty"),
    [
        ("a < b", "comparison", "a >= b"),
        ("(a) < (3)", "comparison", "(a) <= (3)"),
        ("a - b", "arithmetic", "a + b"),
        ("x = k * dt", "dropped factor", "x = k"),
        ("x = (a + b) * c", "dropped factor", "x = (a + b)"),
        ("a + b", "dropped term", "b"),
        ("x = 2.0", "number", "x = 3.0"),
        ("x = 2.0", "sign", "x = -2.0"),
        ("f(a, b)", "swapped arguments", "f(b, a)"),
        ("x[0]", "index", "x[1]"),
        ("x[1:n]", "slice", "x[1:n - 1]"),
        ("f(a, b=1, c=2)", "forgotten keyword", "f(a, c=2)"),
        ("not a", "logic", "a"),
        ("a and (b or c)", "logic", "a or (b or c)"),
        ("a and b", "dropped condition", "(a)"),
        ("np.fmin(a, b)", "near function", "np.fmax(a, b)"),
        ("p.l_f - p.l_r", "front and rear", "p.l_f - p.l_f"),
        ("front = rear", "front and rear", "front = front"),
        ("if a:\n    raise ValueError(b - c)", "forgotten check", "if a:\n    pass"),
        ("x.append(1)", "forgotten statement", "pass"),
        ("x += dt", "arithmetic", "x -= dt"),
        ("a if b else c", "condition fixed", "(c)"),
        ("µ = 1\nx = ä - b", "arithmetic", "µ = 1\nx = ä + b"),
    ],
)
def test_a_rule_plants_its_fault(source, kind, faulty):
    assert faulty in planted(source)[kind]


@pytest.mark.parametrize(
    "source",
    [
        '"""Two + two."""',
        "x: float",
        "raise ValueError(a - b)\n",
        "log.info('%d', a - b)",
        'parser.add_parser("run", help="a" "b")',
        "import front, rear",
        'text = f"{a - b:.3f}"',
        "import matplotlib\naxes.plot(t, y, linewidth=2.0, alpha=0.5)\naxes.set_ylim(-2 * a, a)",
    ],
)
def test_what_cannot_change_behavior_is_left_alone(source):
    assert set(planted(source)) <= {"forgotten check", "swapped arguments", "forgotten statement"}
    for faulty in chain(*planted(source).values()):
        assert "a + b" not in faulty and "3.0" not in faulty and "0.75" not in faulty


@pytest.mark.parametrize(
    "call",
    ["max(a, b)", "min(a, b, c)", "np.minimum(a, b)", "ca.fmax(a, b)", "math.hypot(a, b)"],
)
def test_arguments_are_not_swapped_where_their_order_is_nothing(call):
    assert "swapped arguments" not in planted(call)
    (inner,) = planted(call.replace("a,", "f(a, d),"))["swapped arguments"]
    assert inner == call.replace("a,", "f(d, a),"), "a call inside is swapped all the same"


@pytest.mark.parametrize(
    "call", ["f(a, b)", "np.max(a, b)", "max(a, b, key=f)", "larger(a, b)", "np.arctan2(a, b)"]
)
def test_arguments_are_swapped_where_their_order_matters(call):
    assert planted(call)["swapped arguments"] == [call.replace("a, b", "b, a")]


def test_a_fault_that_compiles_to_the_same_is_none():
    assert not changes_bytecode(b"x = 1 + 1  # two", b"x = (1 + 1)")
    assert not changes_bytecode(b"x = 1", b"x = = 1"), "does not compile: caught by nobody's merit"
    assert changes_bytecode(b"x = 1", b"x = 1.0")
    assert changes_bytecode(b"def f():\n    return 1", b"def f():\n    return 2")


C = """/* a + b, x[0] */
#include "toy.h"
#define N 4U
static const double gain = 2.0; // a < b
void step(double *x, int n)
{
    int i;
    for (i = 0; i < n; i++) {
        x[0] += TIREID_C(0.5) * -x[1];
    }
    if (!done && (n == 1)) {
        write("a + b");
    }
}
"""


def test_comments_texts_and_preprocessor_lines_of_c_are_no_tokens():
    words = [token.text for token in tokens(C.encode())]
    assert "include" not in words and "N" not in words and "a" not in words
    assert '"a + b"' in words and "TIREID_C" in words
    kept = ("/* a + b, x[0] */", '#include "toy.h"', "#define N 4U", "// a < b", '"a + b"')
    for faulty in chain(*planted(C, "toy.c").values()):
        assert faulty.count("a + b") >= 1
        assert all(text in faulty for text in kept if text != '"a + b"')


@pytest.mark.parametrize(
    ("kind", "faulty"),
    [
        ("comparison", "i >= n"),
        ("comparison", "i <= n"),
        ("comparison", "n != 1"),
        ("logic", "!done || (n"),
        ("logic", "if (done"),
        ("arithmetic", "x[0] -= TIREID_C"),
        ("arithmetic", "(0.5) / -x"),
        ("sign", "* x[1]"),
        ("number", "gain = 3.0;"),
        ("number", "TIREID_C(0.75)"),
        ("index", "* -x[0]"),
        ("forgotten statement", "i++) {\n        ;\n    }"),
        ("forgotten statement", "1)) {\n        ;\n    }"),
    ],
)
def test_a_rule_plants_its_fault_in_c(kind, faulty):
    assert any(faulty in text for text in planted(C, "toy.c")[kind])


def test_c_that_reads_the_same_is_no_fault():
    assert not changes_tokens(b"x = 1; /* one */", b"x  =  1;")
    assert changes_tokens(b"x = 1;", b"x = 2;")


@pytest.mark.heavy
def test_drawing_is_deterministic_and_covers_every_package_and_its_c():
    faults = draw(ROOT, seed=7, count=60)
    again = draw(ROOT, seed=7, count=60)
    assert faults == again != draw(ROOT, seed=8, count=60)
    assert len(set(faults)) == 60
    assert sum(fault.file.endswith(".c") for fault in faults) >= 2
    assert all(changes(ROOT, fault) for fault in faults)
    files = strata(ROOT)
    sizes = {name: sum(map(lines_of, some)) for name, some in files.items()}
    drawn = Counter(package_of(fault.file) for fault in faults)
    for name, size in sizes.items():
        assert abs(drawn[name] - 60 * size / sum(sizes.values())) < 1.0, name


def lines_of(file: str) -> int:
    return len((ROOT / file).read_bytes().splitlines())


def test_every_fault_that_was_written_down_follows_the_code():
    entries = tomllib.loads(PLANTED.read_text(encoding="utf-8"))["fault"]
    assert len({written_fault(entry).kind for entry in entries}) == len(entries)


def test_every_test_that_is_named_beside_a_fault_is_there():
    entries = tomllib.loads(PLANTED.read_text(encoding="utf-8"))["fault"]
    for named in {name for entry in entries for name in entry["tests"]}:
        file, _, test = named.partition("::")
        source = (ROOT / file).read_text(encoding="utf-8")
        assert not test or f"\ndef {test.partition('[')[0]}(" in source, named


def test_a_fault_that_was_written_down_must_match_its_file_once(tmp_path):
    (tmp_path / "toy.py").write_text("a = 1\nb = 1\n")
    entry = {"name": "b", "file": "toy.py", "old": "b = 1", "new": "b = 2"}
    fault = written_fault(entry, tmp_path)
    assert fault.planted((tmp_path / "toy.py").read_bytes()) == b"a = 1\nb = 2\n"
    for old in ("= 1", "c = 1"):
        with pytest.raises(ValueError, match="must hold the old text once"):
            written_fault({**entry, "old": old}, tmp_path)


@pytest.fixture(name="toy")
def a_toy_tree(tmp_path):
    """A tree with one module and two tests, of which one looks at nothing."""
    root = tmp_path / "project"
    for name, text in (
        ("models/__init__.py", ""),
        ("models/toy.py", TOY),
        ("tests/test_toy.py", TOY_TEST),
        ("pyproject.toml", "[tool.pytest.ini_options]\n"),
        (".gitignore", "__pycache__/\n"),
    ):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    traced = Traced(root, tmp_path / "trace.json")
    runs = {"models/toy.py": ["area"]}, {"models/toy.py": ["unloved"]}
    names = ("test_area", "test_unloved_is_called")
    traced.learn(
        ["tests/test_toy.py"],
        {
            f"tests/test_toy.py::{name}": {"seconds": 0.1, "runs": run}
            for name, run in zip(names, runs, strict=True)
        },
    )
    return root, Workshop(root, tmp_path / "worker"), traced


def fault_at(root: Path, old: str, new: str) -> Fault:
    return written_fault({"name": "toy", "file": "models/toy.py", "old": old, "new": new}, root)


@pytest.mark.heavy
def test_a_fault_is_caught_where_a_test_looks_and_survives_where_none_does(toy):
    root, shop, traced = toy
    caught, asked = plant(shop, traced, fault_at(root, "width * height", "width + height"), 0)
    assert caught.caught and caught.by == "tests/test_toy.py::test_area" and asked == 1
    for circle in (0, 1):
        survived, asked = plant(shop, traced, fault_at(root, "x + 2", "x - 2"), circle)
        assert not survived.caught and asked == 1
    assert not shop.run(traced.tests, 1.0).caught, "the tree is whole again"
    assert (root / "models" / "toy.py").read_text() == TOY, "the checkout was not touched"


@pytest.mark.heavy
def test_a_fault_that_never_ends_is_caught_by_time(toy, monkeypatch):
    root, shop, traced = toy
    monkeypatch.setattr("benchmarks.mutation.workshop.START", 3.0)
    endless = fault_at(root, "return width * height", "while True: pass")
    caught, _ = plant(shop, traced, endless, 0)
    assert caught.caught and caught.by == "time"


def test_tests_that_run_the_function_are_asked_first_and_failing_ones_never(toy):
    root, _, traced = toy
    fault = fault_at(root, "width * height", "width + height")
    assert traced.select(fault).near == ("tests/test_toy.py::test_area",)
    assert traced.select(fault).wide == ("tests/test_toy.py::test_unloved_is_called",)
    traced.tests["tests/test_toy.py::test_area"]["outcome"] = "failed"
    assert "tests/test_toy.py::test_area" not in sum(traced.select(fault), ())


def test_a_changed_file_of_tests_is_traced_again(toy):
    root, _, traced = toy
    assert traced.outdated() == []
    (root / "tests" / "test_toy.py").write_text(TOY_TEST + "\n")
    (root / "tests" / "test_new.py").write_text("")
    assert traced.outdated() == ["tests/test_new.py", "tests/test_toy.py"]
