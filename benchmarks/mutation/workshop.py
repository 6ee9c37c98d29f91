"""A copy of the tree where faults are planted and tests are run; the checkout is never touched."""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from benchmarks.mutation.faults import Fault

PATIENCE = 3.0  # times what the tests take on the unharmed tree
START = 60.0  # s, to start Python on a busy machine
PASSED, NOT_FOUND = 0, 4
FAILURE = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.M)


class Answer(NamedTuple):
    """How a run of tests ended.

    caught : whether a test failed, or nothing ran to its end.   by : the test, or what happened.
    seconds : that it took.   text : what pytest printed.
    """

    caught: bool
    by: str
    seconds: float
    text: str


class Workshop:
    """A copy of a tree with a cache of compiled code of its own.

    Parameters
    ----------
    root : of the tree that is copied.
    folder : to copy it to; `shared` beside the tree, which some tests read, is linked.
    """

    def __init__(self, root: Path, folder: Path) -> None:
        self.tree, self.cache = folder / "tree", folder / "cache"
        shutil.rmtree(self.tree, ignore_errors=True)
        self.cache.mkdir(parents=True, exist_ok=True)
        for file in _tracked(root):
            target = self.tree / file
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / file, target)
        shared, link = root.parent / "shared", folder / "shared"
        if shared.is_dir() and not link.exists():
            link.symlink_to(shared.resolve())

    def trace(self, files: Iterable[str], out: Path) -> str:
        """Run files of tests on the unharmed tree, trace what they run, return what was printed.

        Parameters
        ----------
        files : of tests, from the root.
        out : file of the trace.
        """
        words = ["-p", "benchmarks.mutation.trace", *files]
        return self._pytest(words, self.cache, {"MUTATION_TRACE": str(out)}, None)[1]

    def run(self, tests: Sequence[str], expected: float, fault: Fault | None = None) -> Answer:
        """Run tests until one fails, on the tree with a fault in it.

        Parameters
        ----------
        tests : names, in the order to run.
        expected : time that they take on the unharmed tree [s].
        fault : planted meanwhile; None runs the unharmed tree.
        """
        start = time.perf_counter()
        with tempfile.TemporaryDirectory(dir=self.cache.parent) as scratch, self._planted(fault):
            names = Path(scratch) / "tests"
            cache = Path(scratch) / "cache"
            shutil.copytree(self.cache, cache, copy_function=os.link)  # a fault may spoil its own
            for known in (list(tests), _without_cases(tests)):
                names.write_text("\n".join(known), encoding="utf-8")
                code, text = self._pytest(
                    ["-x", "--tb=line", f"@{names}"], cache, {}, PATIENCE * expected + START
                )
                if code != NOT_FOUND:
                    break
        found = FAILURE.search(text)
        by = "time" if code is None else found.group(1) if found else f"pytest exit code {code}"
        return Answer(code != PASSED, by, time.perf_counter() - start, text)

    @contextmanager
    def _planted(self, fault: Fault | None) -> Iterator[None]:
        if fault is None:
            yield
            return
        path = self.tree / fault.file
        source, stat = path.read_bytes(), path.stat()
        path.write_bytes(fault.planted(source))
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns + 10_000_000_000))  # not the .pyc's
        try:
            yield
        finally:
            path.write_bytes(source)
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))

    def _pytest(
        self, words: list[str], cache: Path, environment: dict[str, str], limit: float | None
    ) -> tuple[int | None, str]:
        """Return the exit code, None where time ran out, and what was printed."""
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
        known = {**os.environ, **environment, "TIREID_CACHE": str(cache)}
        path = [str(self.tree), *filter(None, [os.environ.get("PYTHONPATH")])]
        known["PYTHONPATH"] = os.pathsep.join(path)
        known["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # two of three seconds to start
        known["PYTHONDONTWRITEBYTECODE"] = "1" if limit else ""
        with tempfile.TemporaryFile("w+") as printed:
            process = subprocess.Popen(
                command,
                cwd=self.tree,
                env=known,
                stdout=printed,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            try:
                code: int | None = process.wait(limit)
            except subprocess.TimeoutExpired:
                code = None
            finally:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()
            printed.seek(0)
            return code, printed.read()


def _without_cases(tests: Iterable[str]) -> list[str]:
    """Return tests with all their cases: a fault may give cases other names, which harms nobody."""
    return list(dict.fromkeys(name.split("[")[0] for name in tests))


def _tracked(root: Path) -> list[str]:
    """Return the files of a checkout: what git knows or would add, or else all but what is made."""
    words = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    answer = subprocess.run(words, cwd=root, capture_output=True, text=True, check=False)
    if answer.returncode == 0:
        found = [name for name in answer.stdout.split("\0") if name]
    else:
        made = {".venv", "out", "__pycache__", ".mypy_cache", ".ruff_cache", ".git"}
        paths = [path.relative_to(root) for path in root.rglob("*")]
        found = [str(path) for path in paths if not made & set(path.parts)]
    return [name for name in found if (root / name).is_file()]
