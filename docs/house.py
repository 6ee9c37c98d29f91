"""The house, counted: how the code is cut into files, once and now.

    python docs/house.py                            print the table
    python docs/house.py --write                    keep it in house.json and architecture.md
    python docs/house.py --time --write             measure what imports take, too
    python docs/house.py --time-tests now --write   `make test` in a fresh clone of HEAD: minutes

Counted are the packages that are installed, without tests, examples and benchmarks: `before` at a
commit, `now` in the working tree. What is timed and not measured anew is taken from house.json.
"""

import argparse
import ast
import io
import json
import os
import re
import resource
import subprocess
import sys
import tarfile
import tempfile
import textwrap
import time
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KEPT, PAGE = Path("docs/house.json"), Path("docs/architecture.md")
BEGIN, END = "<!-- house: python docs/house.py --write -->", "<!-- end of house -->"
BEFORE = "f3147a0f49e3f90f87857517fb76cc2d3b3ce4d6"
PACKAGES = ("codegen", "models", "identifier", "mpc", "tireid")
SHARED = 6  # lines that make two places a pair
COMMON = 8  # places that share them at most: what stands everywhere is idiom
STARTS = 15  # of a Python; the quickest counts, since other programs only add
# What a class defines that is a method, or a model of forces.
ANSWERS = {
    *("setup", "frozen", "axle_force", "lateral_force", "force"),
    *("predict", "replay", "slip", "stiffness"),
}
ROWS = {
    "files": "Python files",
    "lines": "lines of Python",
    "imported_once": "Python files that one other imports",
    "circles": "circles of files that import one another",
    "constants": "numbers that are constants of a module",
    "public_names": "public names at the top of modules",
    "type_switches": "type switches on methods and models",
    "arrays": "definitions of `Array`",
    "pairs": "pairs of places that share six or more lines",
    "placeholders": "placeholders in C",
    "readme_words": "words of README",
    "import_ms": "ms of `import tireid`",
    "help_ms": "ms of `tireid --help`",
    "test_s": "s of `make test`",
    "test_cpu_s": "s of processor time of it",
}
Tree = Mapping[str, str]  # text of each source file, by its path from the root
Place = tuple[str, int]  # file, and the number of a line that is not blank, from 0
Counts = dict[str, int | float]


def counts(root: Path) -> Counts:
    """Return what is counted of a tree, by the keys of `ROWS`.

    Parameters
    ----------
    root : of the checkout.
    """
    paths = [path for name in PACKAGES for path in sorted((root / name).rglob("*"))]
    tree = {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for path in paths
        if path.suffix in (".py", ".c", ".h")
    }
    python = {name: text for name, text in tree.items() if name.endswith(".py")}
    parsed = {name: ast.parse(text) for name, text in python.items()}
    c = [text for name, text in tree.items() if name not in python]
    return {
        "files": len(python),
        "lines": sum(text.count("\n") for text in python.values()),
        "imported_once": imported_once(parsed),
        "circles": len(circles(parsed)),
        "constants": sum(len(constants(module)) for module in parsed.values()),
        "public_names": sum(len(public_names(module)) for module in parsed.values()),
        "type_switches": type_switches(parsed),
        "arrays": sum(defines(module, "Array") for module in parsed.values()),
        "pairs": len(pairs(tree)),
        "placeholders": sum(len(re.findall(r"@\w+@", text)) for text in c),
        "readme_words": len((root / "README.md").read_text(encoding="utf-8").split()),
    }


def imported_once(parsed: Mapping[str, ast.Module]) -> int:
    """Return how many files are imported by exactly one other.

    Parameters
    ----------
    parsed : by path.
    """
    homes = {
        name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): name
        for name in parsed
    }
    importers: Counter[str] = Counter()
    for name, module in parsed.items():
        importers.update(_imported(module, homes) - {name})
    return sum(count == 1 for count in importers.values())


def _assigned(statement: ast.stmt) -> tuple[list[str], ast.expr | None]:
    """Return the names that a statement gives a value, and the value."""
    if isinstance(statement, ast.AnnAssign):
        targets: list[ast.expr] = [statement.target]
        value = statement.value
    elif isinstance(statement, ast.Assign):
        targets, value = statement.targets, statement.value
    else:
        return [], None
    inner = [e for one in targets for e in (one.elts if isinstance(one, ast.Tuple) else [one])]
    return [one.id for one in inner if isinstance(one, ast.Name)], value


def _is_number(value: ast.expr | None) -> bool:
    match value:
        case ast.Constant():
            return isinstance(value.value, int | float) and not isinstance(value.value, bool)
        case ast.UnaryOp():
            return _is_number(value.operand)
        case ast.BinOp():
            return _is_number(value.left) and _is_number(value.right)
        case ast.Tuple() | ast.List():
            return bool(value.elts) and all(map(_is_number, value.elts))
    return False


def constants(module: ast.Module) -> list[str]:
    """Return the names at the top of a module that stand for numbers, or tuples of numbers."""
    assigned = map(_assigned, module.body)
    return [name for names, value in assigned if _is_number(value) for name in names]


def public_names(module: ast.Module) -> list[str]:
    """Return the names of functions, classes and values of a module without an underscore."""
    defined = [one.name for one in module.body if isinstance(one, ast.FunctionDef | ast.ClassDef)]
    given = [name for one in module.body for name in _assigned(one)[0]]
    return [name for name in (*defined, *given) if not name.startswith("_")]


def circles(parsed: Mapping[str, ast.Module]) -> list[list[str]]:
    """Return which files of a package import one another in a circle: Tarjan's components.

    Imports in functions and for type checkers count.

    Parameters
    ----------
    parsed : by path.
    """
    homes = {
        name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): name
        for name in parsed
    }
    imports = {name: _imported(module, homes) - {name} for name, module in parsed.items()}
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


def _imported(module: ast.Module, homes: Mapping[str, str]) -> set[str]:
    """Paths of the files that a file imports."""
    found = set()
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            found |= {homes.get(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            room = f"{node.module}"
            found |= {homes.get(f"{room}.{a.name}", homes.get(room)) for a in node.names}
    return {home for home in found if home is not None}


def type_switches(parsed: Mapping[str, ast.Module]) -> int:
    """Return how often code asks of what class a method or a model is.

    Counted are `isinstance`, `case Class()` and comparisons of `type(...)` that name a class which
    defines one of `ANSWERS`.

    Parameters
    ----------
    parsed : by path.
    """
    nodes = [node for module in parsed.values() for node in ast.walk(module)]
    classes = {
        node.name
        for node in nodes
        if isinstance(node, ast.ClassDef)
        and any(isinstance(item, ast.FunctionDef) and item.name in ANSWERS for item in node.body)
    }
    return sum(bool(_asked(node) & classes) for node in nodes)


def _asked(node: ast.AST) -> set[str]:
    """Names of the classes that a node asks for."""
    match node:
        case ast.Call(func=ast.Name("isinstance"), args=[_, wanted]):
            pass
        case ast.MatchClass(cls=wanted):
            pass
        case ast.Compare(left=ast.Call(func=ast.Name("type")), comparators=[wanted, *_]):
            pass
        case _:
            return set()
    return {name for part in ast.walk(wanted) for name in _names(part)}


def _names(node: ast.AST) -> set[str]:
    match node:
        case ast.Name(name) | ast.Attribute(attr=name):
            return {name}
    return set()


def defines(module: ast.Module, name: str) -> bool:
    """Return whether a file gives a name a value, rather than importing it.

    Parameters
    ----------
    module : parsed.
    name : of its top level.
    """
    given = [node.targets for node in module.body if isinstance(node, ast.Assign)]
    return any(name in _names(target) for targets in given for target in targets)


def pairs(tree: Tree) -> list[tuple[Place, Place]]:
    """Return where two places begin that share six or more lines, each run of lines once.

    Lines are compared without indentation, blank ones do not count.

    Parameters
    ----------
    tree : text by path.
    """
    windows: defaultdict[tuple[str, ...], list[Place]] = defaultdict(list)
    for name, text in tree.items():
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        for k in range(len(lines) - SHARED + 1):
            windows[tuple(lines[k : k + SHARED])].append((name, k))
    alike = {
        (one, other)
        for places in windows.values()
        if len(places) <= COMMON
        for one, other in combinations(places, 2)
        if one[0] != other[0] or other[1] - one[1] >= SHARED
    }
    return sorted(
        (one, other)
        for one, other in alike
        if ((one[0], one[1] - 1), (other[0], other[1] - 1)) not in alike
    )


def archived(revision: str, folder: Path) -> Path:
    """Return a folder with the files of a revision.

    Parameters
    ----------
    revision : as git names it.
    folder : to make it in.
    """
    tar = _run(["git", "archive", "--format=tar", revision], ROOT)
    with tarfile.open(fileobj=io.BytesIO(tar)) as files:
        files.extractall(folder, filter="data")
    return folder


def starts(root: Path) -> Counts:
    """Return how long it takes to import tireid and to print its help, without starting Python.

    Parameters
    ----------
    root : of the checkout; its own packages are imported, with those of this Python.
    """
    help_words = "import sys; from tireid.cli import main; sys.exit(main(['--help']))"
    empty = _quickest_ms("pass", root)
    return {
        "import_ms": max(0.0, _quickest_ms("import tireid", root) - empty),
        "help_ms": max(0.0, _quickest_ms(help_words, root) - empty),
    }


def _quickest_ms(code: str, root: Path) -> float:
    took = []
    for _ in range(STARTS):
        began = time.perf_counter()
        _run([sys.executable, "-c", code], root)
        took.append(1e3 * (time.perf_counter() - began))
    return min(took)


def tested(revision: str, folder: Path) -> Counts:
    """Return how long `make test` takes in a fresh clone, installed but with nothing compiled.

    Parameters
    ----------
    revision : as git names it.
    folder : to clone to; what lies in `shared` beside the checkout is linked, tests read it.
    """
    tree = folder / "tree"
    _run(["git", "clone", "--quiet", "--no-checkout", str(ROOT), str(tree)], folder)
    _run(["git", "checkout", "--quiet", revision], tree)
    if (ROOT.parent / "shared").is_dir():
        (folder / "shared").symlink_to((ROOT.parent / "shared").resolve())
    environment = {**os.environ, "TIREID_CACHE": str(folder / "cache")}
    _run(["make", ".venv/.test"], tree, environment)
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    _run(["make", "test"], tree, environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"test_s": time.perf_counter() - began, "test_cpu_s": cpu}


def _run(words: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None) -> bytes:
    """Run a command in a folder; return what it printed, or stop with it where it fails."""
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, check=False)
    if done.returncode:
        last = (done.stdout + done.stderr).decode(errors="replace")[-3000:]
        raise SystemExit(f"{' '.join(words)} ended with {done.returncode}:\n{last}")
    return done.stdout


def table(kept: Mapping[str, Counts]) -> str:
    """Return the table as Markdown, with the source of each number in a comment.

    Parameters
    ----------
    kept : counts, by `before` and `now`.
    """
    lines = [f"| what | before (`{BEFORE[:7]}`) | now |", "|---|---|---|"]
    sources = []
    for key, words in ROWS.items():
        cells = [shown(kept[when][key]) if key in kept[when] else "" for when in kept]
        lines.append(f"| {words} | {' | '.join(cells)} |")
        sources += [f"{when}/{key}" for when in kept if key in kept[when]]
    comment = textwrap.fill(f"<!-- numbers house: {' '.join(sources)} -->", 100)
    return "\n".join([*lines, comment])


def shown(value: float) -> str:
    """Return a number as documents print it: 985, 1234, 37 850.

    Parameters
    ----------
    value : rounded to a whole number.
    """
    text = f"{value:.0f}"
    return text if len(text) <= 4 else f"{int(text):,}".replace(",", " ")


def written(page: str, kept: Mapping[str, Counts]) -> str:
    """Return a page with the table between its markers.

    Parameters
    ----------
    page : Markdown.
    kept : counts, by `before` and `now`.
    """
    head, rest = page.split(BEGIN)
    return f"{head}{BEGIN}\n\n{table(kept)}\n\n{END}{rest.split(END)[1]}"


def main(argv: Sequence[str] | None = None) -> int:
    """Count, and write where it is asked for.

    Parameters
    ----------
    argv : words of the command; None takes those of the process.
    """
    parser = argparse.ArgumentParser(description="The house, counted: before and now.")
    parser.add_argument("--write", action="store_true", help="keep numbers and table in docs")
    parser.add_argument("--time", action="store_true", help="measure imports, too")
    parser.add_argument(
        "--time-tests",
        choices=("before", "now"),
        action="append",
        default=[],
        help="measure `make test` in a fresh clone: minutes; `now` is HEAD",
    )
    options = parser.parse_args(argv)
    kept: dict[str, Counts] = {"before": {}, "now": {}}
    if (ROOT / KEPT).exists():
        kept |= json.loads((ROOT / KEPT).read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for when, root in (("before", archived(BEFORE, folder)), ("now", ROOT)):
            kept[when] |= counts(root) | (starts(root) if options.time else {})
    for when in options.time_tests:
        with tempfile.TemporaryDirectory() as name:
            kept[when] |= tested(BEFORE if when == "before" else "HEAD", Path(name))
    print(table(kept))
    if options.write:
        text = json.dumps(kept, indent=1) + "\n"
        (ROOT / KEPT).write_text(text, encoding="utf-8")
        page = written((ROOT / PAGE).read_text(encoding="utf-8"), kept)
        (ROOT / PAGE).write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
