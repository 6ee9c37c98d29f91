"""What a benchmark measured: numbers by key beside their targets, printed, and recorded.

A number that README or docs quote is recorded here first: `Targets("mpc_worth")` collects under the
name of the script, `finish` writes benchmarks/results/mpc_worth.json where it is asked to, with a
hash of the code that it measured, and the documents name script and key. A missed target is
printed, recorded, and an exit code of 1.
"""

import json
import platform
import sys
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.fingerprint import fingerprint

RESULTS = Path(__file__).resolve().parent / "results"
MISSED = 1


@dataclass(slots=True)
class Targets:
    """What was measured and what was to be reached.

    Parameters
    ----------
    script : name of the benchmark, without its ending.
    values : by key; what documents may quote, at full precision.
    units : by key.
    limits : by key, what a target asks for, and whether it was reached.
    missed : labels of the targets that were not reached so far.
    met : how many were reached.
    """

    script: str = ""
    values: dict[str, float | int | str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    limits: dict[str, tuple[float, bool]] = field(default_factory=dict)
    missed: list[str] = field(default_factory=list)
    met: int = 0

    def record(self, key: str, value: float | int | str, unit: str = "") -> None:
        """Keep a number that has no target of its own.

        Parameters
        ----------
        key : words joined by slashes, `course/97/0.5/axle/rms`.
        value : at full precision.
        unit : of it.

        Raises
        ------
        ValueError
            Where the key is taken: two numbers of one name are one number too many.
        """
        if key in self.values:
            raise ValueError(f"{self.script}: the key {key!r} is recorded twice")
        self.values[key], self.units[key] = value, unit

    def at_most(
        self, label: str, value: float, limit: float, unit: str = "%", key: str = ""
    ) -> None:
        """Print a value beside the largest that is good.

        Parameters
        ----------
        label : what it is.
        value : measured.
        limit : largest that is good.
        unit : of both.
        key : under which it is recorded too; none where empty.
        """
        self._judge(label, value, "<=", limit, unit, key, value <= limit)

    def at_least(
        self, label: str, value: float, limit: float, unit: str = "%", key: str = ""
    ) -> None:
        """Print a value beside the smallest that is good.

        Parameters
        ----------
        label : what it is.
        value : measured.
        limit : smallest that is good.
        unit : of both.
        key : under which it is recorded too; none where empty.
        """
        self._judge(label, value, ">=", limit, unit, key, value >= limit)

    def _judge(
        self, label: str, value: float, side: str, limit: float, unit: str, key: str, good: bool
    ) -> None:
        if good:
            self.met += 1
        else:
            self.missed.append(label)
        if key:
            self.record(key, value, unit)
            self.limits[key] = float(limit), bool(good)
        verdict = "ok" if good else "MISSED"
        print(f"  {label:66} {value:8.2f} {unit:3} target {side} {limit:g} {unit}  {verdict}")

    def finish(self, *, keep: bool) -> int:
        """Say how many targets were met; return the exit code, 1 where one was missed.

        Parameters
        ----------
        keep : write the numbers to benchmarks/results, for the documents to quote: only a run
            with the defaults of the script may.
        """
        if keep:
            RESULTS.mkdir(exist_ok=True)
            path = RESULTS / f"{self.script}.json"
            text = {
                "script": f"benchmarks/{self.script}.py",
                "machine": f"{platform.machine()}, Python {platform.python_version()}",
                "code": fingerprint(self.script),
                "missed": self.missed,
                "met": self.met,
                "units": self.units,
                "targets": {
                    key: {"limit": limit, "met": good} for key, (limit, good) in self.limits.items()
                },
                "values": self.values,
            }
            path.write_text(json.dumps(text, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
            print(f"wrote {path}")
        names = f": {'; '.join(self.missed)}" if self.missed else ""
        print(f"{self.script}: {self.met} targets met, {len(self.missed)} missed{names}")
        return MISSED if self.missed else 0


def keeps(argv: list[str] = sys.argv) -> bool:
    """Return whether the words of the command ask to record, taking `--record` out of them.

    Parameters
    ----------
    argv : words of the command.
    """
    if "--record" in argv:
        argv.remove("--record")
        return True
    return False


def show(label: str, text: str) -> None:
    """Print a value that has no target of its own.

    Parameters
    ----------
    label : what it is.
    text : the value.
    """
    print(f"  {label:66} {text}")
