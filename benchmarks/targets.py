"""What a benchmark measured: numbers by key beside their targets, printed, and recorded.

`Targets("mpc_worth")` collects under the name of the script; with `--record` it writes
benchmarks/results/mpc_worth.json, with the date, a hash of the code that it measured, and the
script's `canary`: a cheap case that a test computes again. The script's `tables` make the tables of
the documents of it. A missed target is printed, recorded, and an exit code of 1.
"""

import argparse
import json
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from benchmarks.fingerprint import fingerprint

RESULTS = Path(__file__).resolve().parent / "results"
MISSED = 1
Value = float | int | str
Values = Mapping[str, Value]


class Table(NamedTuple):
    """A table of a document: the header says units and how many cars; cells as they are printed."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(slots=True)
class Targets:
    """What was measured and what was to be reached.

    Parameters
    ----------
    script : name of the benchmark, without its ending.
    values : by key, at full precision.
    missed : labels of the targets that were not reached so far.
    met : how many were reached.
    """

    script: str
    values: dict[str, Value] = field(default_factory=dict)
    missed: list[str] = field(default_factory=list)
    met: int = 0

    def record(self, key: str, value: Value) -> None:
        """Keep a number.

        Parameters
        ----------
        key : words joined by slashes, `course/97/0.5/axle/rms`.
        value : at full precision.

        Raises
        ------
        ValueError
            Where the key is taken: two numbers of one name are one number too many.
        """
        if key in self.values:
            raise ValueError(f"{self.script}: the key {key!r} is recorded twice")
        self.values[key] = value

    def at_most(
        self, label: str, value: float, limit: float, unit: str = "%", key: str = ""
    ) -> None:
        """Print a value beside the largest that is good; record it too where it has a key."""
        self._judge(label, value, f"<= {limit:g} {unit}", unit, key, value <= limit)

    def at_least(
        self, label: str, value: float, limit: float, unit: str = "%", key: str = ""
    ) -> None:
        """Print a value beside the smallest that is good; record it too where it has a key."""
        self._judge(label, value, f">= {limit:g} {unit}", unit, key, value >= limit)

    def _judge(self, label: str, value: float, limit: str, unit: str, key: str, good: bool) -> None:
        if key:
            self.record(key, value)
        if good:
            self.met += 1
        else:
            self.missed.append(f"{label} ({limit.strip(' -')})")
        verdict = "ok" if good else "MISSED"
        print(f"  {label:66} {value:8.2f} {unit:3} target {limit}  {verdict}", flush=True)

    def finish(self, canary: Callable[[], Values], *, keep: bool) -> int:
        """Say how many targets were met; return the exit code, 1 where one was missed.

        Parameters
        ----------
        canary : returns numbers of a cheap case, none of them near zero or a time.
        keep : write the record.
        """
        if keep:
            path = RESULTS / f"{self.script}.json"
            text = {
                "script": f"benchmarks/{self.script}.py",
                "date": datetime.now(UTC).date().isoformat(),
                "machine": f"{platform.machine()}, Python {platform.python_version()}",
                "code": fingerprint(self.script),
                "missed": self.missed,
                "met": self.met,
                "canary": dict(canary()),
                "values": self.values,
            }
            path.write_text(json.dumps(text, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
            print(f"wrote {path}")
        names = f": {'; '.join(self.missed)}" if self.missed else ""
        print(f"{self.script}: {self.met} targets met, {len(self.missed)} missed{names}")
        return MISSED if self.missed else 0


def parse(script: str, doc: str | None, parts: Sequence[str] = ()) -> argparse.Namespace:
    """Return the words of a benchmark's command: `quick`, `record`, and `only` where it has parts.

    Parameters
    ----------
    script : its name.
    doc : its docstring.
    parts : that `--only` chooses from; what is left out is not recorded.
    """
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks.{script}", description=(doc or "").partition("\n")[0]
    )
    parser.add_argument("--quick", action="store_true", help="a few cases, to see that it runs")
    parser.add_argument("--record", action="store_true", help="write benchmarks/results")
    if parts:
        parser.add_argument("--only", nargs="+", choices=parts, default=parts, metavar="PART")
    options = parser.parse_args()
    if options.record and (options.quick or len(getattr(options, "only", parts)) < len(parts)):
        parser.error("only all of the cases are recorded")
    return options


def show(label: str, text: str) -> None:
    """Print a value that has no target of its own."""
    print(f"  {label:66} {text}", flush=True)
