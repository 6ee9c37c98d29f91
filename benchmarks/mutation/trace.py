"""A pytest plugin that keeps, for every test, which functions it runs and how long it takes.

`pytest -p benchmarks.mutation.trace` writes `$MUTATION_TRACE`, a JSON object by test:
{"seconds": s, "setup": s, "runs": {file: [function, ...]}}, and "outcome": "failed" where it
failed. Functions are qualified names; `<module>` stands for what runs when a file is imported.
"""

import json
import os
import time
from collections import defaultdict
from pathlib import Path

import coverage
import pytest

from benchmarks.mutation.faults import PACKAGES, function_at


class Trace:
    """Coverage by test, as pytest runs them."""

    def __init__(self, root: Path, out: Path) -> None:
        self.root, self.out = root, out
        self.tests: dict[str, dict[str, object]] = {}
        self.setup: dict[str, float] = {}
        self.failed: set[str] = set()
        self.coverage = coverage.Coverage(
            data_file=None, source=[str(root / name) for name in PACKAGES], config_file=False
        )
        self.coverage.set_option("run:disable_warnings", ["no-data-collected"])
        self.coverage.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> object:
        """Time a test and name its context after it."""
        self.coverage.switch_context(item.nodeid)
        start = time.perf_counter()
        answer = yield
        self.tests[item.nodeid] = {
            "seconds": time.perf_counter() - start,
            "setup": self.setup.get(item.nodeid, 0.0),
        }
        if item.nodeid in self.failed:
            self.tests[item.nodeid]["outcome"] = "failed"
        return answer

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep how long its fixtures took, and whether it failed."""
        if report.when == "setup":
            self.setup[report.nodeid] = report.duration
        if report.failed:
            self.failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Write the map."""
        self.coverage.stop()
        runs: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
        data = self.coverage.get_data()
        for path in data.measured_files():
            name = str(Path(path).relative_to(self.root))
            for line, contexts in data.contexts_by_lineno(path).items():
                function = function_at(path, line)
                for context in contexts:
                    runs[context][name].add(function)
        for test, entry in self.tests.items():
            entry["runs"] = {name: sorted(found) for name, found in sorted(runs[test].items())}
        self.out.write_text(json.dumps(self.tests, indent=0), encoding="utf-8")


def pytest_configure(config: pytest.Config) -> None:
    """Begin to trace before any file of the packages is imported."""
    out = os.environ.get("MUTATION_TRACE")
    if out:
        config.pluginmanager.register(Trace(config.rootpath, Path(out)), "mutation-trace")
