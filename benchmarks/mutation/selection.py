"""Which tests may catch a fault: those that run its function, the quick ones first."""

import ast
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.mutation.faults import PACKAGES, TOP, Fault, function_at

NEAR = 15.0  # s, of the first round
WIDE = 120.0  # s, of the second
FIXTURES = 5.0  # s, at most, where a trace does not tell them from the test


class Selection(NamedTuple):
    """Tests by name, quick ones first: those that run the function, and those around them."""

    near: tuple[str, ...]
    wide: tuple[str, ...]


class Traced:
    """What every test runs and how long it takes, as `trace` found it.

    Parameters
    ----------
    root : of the tree.
    file : where the trace is kept, JSON.
    """

    def __init__(self, root: Path, file: Path) -> None:
        self.root, self.file = root, file
        kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
        self.digests: dict[str, str] = kept.get("digests", {})
        self.tests: dict[str, dict[str, Any]] = kept.get("tests", {})
        self.importers: dict[str, set[str]] | None = None
        self.openings: dict[str, float] = {}

    def state(self) -> str:
        """Return what changes when any test does."""
        return hashlib.sha256(json.dumps(self._present()).encode()).hexdigest()[:16]

    def outdated(self) -> list[str]:
        """Return the files of tests that are new or changed since they were traced."""
        return [
            name for name, digest in self._present().items() if self.digests.get(name) != digest
        ]

    def learn(self, files: Iterable[str], traced: Mapping[str, dict[str, Any]]) -> None:
        """Take over what was traced of some files of tests, forget those that are gone.

        Parameters
        ----------
        files : that were traced, from the root.
        traced : what each test does.
        """
        present, files = self._present(), set(files)
        kept = {
            name: entry
            for name, entry in self.tests.items()
            if _file(name) in present and _file(name) not in files
        }
        self.tests = {**kept, **traced}
        known = {name: digest for name, digest in self.digests.items() if name in present}
        self.digests = known | {name: present[name] for name in files}
        text = json.dumps({"digests": self.digests, "tests": self.tests})
        self.file.write_text(text, encoding="utf-8")

    def seconds(self, names: Iterable[str]) -> float:
        """Return how long tests take together, with the fixtures that they share [s].

        Parameters
        ----------
        names : of tests.
        """
        known = [name for name in names if name in self.tests]
        opened = sum(self._opening(file) for file in {_file(name) for name in known})
        return opened + sum(float(self.tests[name]["seconds"]) for name in known)

    def select(self, fault: Fault) -> Selection:
        """Return the tests that may catch a fault.

        Parameters
        ----------
        fault : planted in a file of the tree.
        """
        running = self._running(fault)
        mirror = _mirror(fault.file)
        near = self._within(running, NEAR, lambda name: not name.startswith(mirror))
        homes = {_file(name) for name in running}
        around = [name for name in self.tests if _file(name) in homes or name.startswith(mirror)]
        asked, runs = set(near), set(running)
        further = [name for name in (*running, *around) if name not in asked]
        # C is asked by whole packages of it, whose tests are slow and stand where it does.
        compiled = fault.file.endswith(".c")
        wide = self._within(
            further,
            WIDE,
            lambda name: not name.startswith(mirror) if compiled else name not in runs,
        )
        return Selection(near, wide)

    def _present(self) -> dict[str, str]:
        """Digests of the files of tests; what they share counts to each."""
        shared = b"".join(path.read_bytes() for path in self._files("conftest.py"))
        return {
            str(path.relative_to(self.root)): hashlib.sha256(path.read_bytes() + shared).hexdigest()
            for path in self._files("test_*.py")
        }

    def _files(self, pattern: str) -> list[Path]:
        return sorted((self.root / "tests").rglob(pattern))

    def _running(self, fault: Fault) -> list[str]:
        """Tests that run the function of a fault, or else what is nearest to it."""
        if fault.file.endswith(".c"):
            return self._running_files(self._readers(fault.file))
        path = self.root / fault.file
        function = function_at(str(path), fault.line(path.read_bytes()))
        if function != TOP:
            found = [
                name
                for name, entry in self._usable()
                if function in entry["runs"].get(fault.file, ())
            ]
            if found:
                return found
        return self._running_files([fault.file]) or self._running_files(self._importers(fault.file))

    def _running_files(self, files: Iterable[str]) -> list[str]:
        """Tests that call anything in one of some files."""
        wanted = set(files)
        return [
            name
            for name, entry in self._usable()
            if any(set(found) - {TOP} for file, found in entry["runs"].items() if file in wanted)
        ]

    def _usable(self) -> list[tuple[str, dict[str, Any]]]:
        """Tests that pass on the unharmed tree."""
        return [(name, entry) for name, entry in self.tests.items() if "outcome" not in entry]

    def _readers(self, file: str) -> list[str]:
        """Python files that stand beside a folder of C, or use what does."""
        beside = file.split("/c/")[0].split("/c_fmu/")[0]
        home = self.root / beside
        found = [str(path.relative_to(self.root)) for path in sorted(home.rglob("*.py"))]
        if beside == "mpc":
            found = [name for name in found if name.startswith(("mpc/realtime", "mpc/export"))]
        return found

    def _importers(self, file: str) -> set[str]:
        if self.importers is None:
            self.importers = {}
            for path in (p for name in PACKAGES for p in (self.root / name).rglob("*.py")):
                here = str(path.relative_to(self.root))
                for node in ast.walk(ast.parse(path.read_bytes())):
                    if isinstance(node, ast.ImportFrom) and node.module:
                        self.importers.setdefault(node.module, set()).add(here)
        module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        package = module.rpartition(".")[0]
        return self.importers.get(module, set()) or self.importers.get(package, set())

    def _within(
        self, names: Iterable[str], budget: float, later: Callable[[str], bool]
    ) -> tuple[str, ...]:
        """Tests as far as time reaches, quick ones first, those that are for later after others."""
        order = sorted(dict.fromkeys(names), key=lambda n: (later(n), self.tests[n]["seconds"], n))
        chosen: list[str] = []
        spent = 0.0
        opened = set[str]()
        for name in order:
            if "outcome" in self.tests[name]:
                continue
            cost = self.tests[name]["seconds"]
            if _file(name) not in opened:
                cost += self._opening(_file(name))
            if not chosen or spent + cost <= budget:
                spent += cost
                opened.add(_file(name))
                chosen.append(name)
        return tuple(chosen)

    def _opening(self, file: str) -> float:
        """What its shared fixtures may take: whichever test comes first waits for them."""
        if file not in self.openings:
            self.openings = {}
            for name, entry in self.tests.items():
                known = self.openings.get(_file(name), 0.0)
                slowest = entry.get("setup", min(entry["seconds"], FIXTURES))
                self.openings[_file(name)] = max(known, slowest)
        return self.openings[file]


def _file(test: str) -> str:
    return test.split("::")[0]


def _mirror(file: str) -> str:
    """Return the folder of tests that mirrors the folder of a file."""
    folder = str(Path(file).parent)
    for c in ("/c", "/c_fmu"):
        folder = folder.removesuffix(c)
    return f"tests/{folder}"
