"""Tables of README.md and docs that hold measured numbers: `make numbers` writes them whole.

A document has a table where it says so:

    <!-- table estimate -->
    <!-- end -->

What stands between is written anew: the table that `tables` of benchmarks/estimate.py makes of the
record in benchmarks/results, and a line that says when and by which command it was recorded, what
targets it missed, and whether the code has changed since. `<!-- table doctor/gross -->` is one of
several tables of a script; `summary` and `paper` are made here, of several records and of what a
test computes again. `--check` writes nothing, and returns 1 where a document differs.
"""

import argparse
import json
import re
import sys
import textwrap
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.fingerprint import fingerprint
from benchmarks.targets import RESULTS, Table, Values
from tireid.commands.paper import printed_values, row_labels

ROOT = Path(__file__).resolve().parents[1]
PLACE = re.compile(r"^<!-- table ([\w/]+) -->\n(.*?)^<!-- end -->$", re.M | re.S)
WIDTH = 110
Record = Mapping[str, Any]


def records() -> dict[str, Record]:
    """Return what every benchmark recorded, by script."""
    paths = sorted(RESULTS.glob("*.json"))
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in paths}


def written(text: str, known: Mapping[str, Record]) -> str:
    """Return a document with all of its tables as they should be.

    Parameters
    ----------
    text : Markdown.
    known : records by script.

    Raises
    ------
    KeyError
        Where a script has no such table, or its record lacks a number of it.
    """
    return PLACE.sub(
        lambda at: f"<!-- table {at[1]} -->\n\n{_block(at[1], known)}\n\n<!-- end -->", text
    )


def _block(name: str, known: Mapping[str, Record]) -> str:
    """Return what stands between the markers of a table."""
    if name == "paper":
        return _grid(paper())
    scripts = SUMMARY if name == "summary" else (name.partition("/")[0],)
    missing = [script for script in scripts if script not in known]
    if missing:
        return f"Not recorded yet: `python -m benchmarks.run_all --record --only {missing[0]}`."
    if name == "summary":
        table = summary({script: known[script]["values"] for script in scripts})
    else:
        table = _tables(scripts[0])(known[scripts[0]]["values"])[name]
    notes = [_state(script, known[script]) for script in scripts]
    missed = [one for script in scripts for one in known[script]["missed"]]
    if name == "summary":
        count = sum(known[script]["met"] for script in scripts) + len(missed)
        notes.append(f"Targets missed: {len(missed)} of {count}.")
    elif name in scripts and missed:
        notes.append(f"Targets missed: {'; '.join(missed)}.")
    return f"{_grid(table)}\n\n{textwrap.fill(' '.join(notes), WIDTH, break_on_hyphens=False)}"


def _grid(table: Table) -> str:
    lines = [table.header, ["---"] * len(table.header), *table.rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in lines)


@cache
def _tables(script: str) -> Callable[[Values], dict[str, Table]]:
    tables: Callable[[Values], dict[str, Table]] = import_module(f"benchmarks.{script}").tables
    return tables


_code = cache(fingerprint)


def _state(script: str, record: Record) -> str:
    """Say when and how a record was made, and whether it is of today's code."""
    older = "" if record["code"] == _code(script) else "; **the code has changed since**"
    return f"`{script}.py`, {record['date']}{older}."


# The table of README.md takes rows of several records.

SUMMARY = ("estimate", "without_v_y", "mpc_worth")


def summary(values: Mapping[str, Values]) -> Table:
    """Return the table of README.md: the default beside the best method that is not tireid's own.

    Parameters
    ----------
    values : of the records of `SUMMARY`.
    """
    estimate, slip, worth = (values[script] for script in SUMMARY)
    rows = []
    for place, what, how in (
        ("full", "Tires of 24 random cars, good sensors: mean force error on other drives", "mean"),
        ("carmaker", "CarMaker sedan, one run identified, the other predicted: mean", "mean"),
        ("ferrari", "Real race car, 100 s identified, the rest predicted: median of 12", "median"),
    ):
        others = {
            key.split("/")[1]: float(value)
            for key, value in estimate.items()
            if re.fullmatch(rf"{place}/\w+/{how}", key) and key.split("/")[1] not in OWN
        }
        least = min(others, key=others.__getitem__)
        ours = float(estimate[f"{place}/fit/{how}"])
        rows.append([what, f"{ours:.1f} %", f"{others[least]:.1f} %, `{least}`"])
    error = {name: float(slip[f"cars/all/{name}/rms"]) for name in ("inertial", "joint_ekf")}
    what = f"Side slip without a sensor of v_y, {slip['cars']} random cars: median"
    rows.append([what, f"{error['inertial']:.2f}°", f"{error['joint_ekf']:.2f}°, `joint_ekf`"])
    rms = {name: float(worth[f"iso-3888-2/97/1.0/{name}/rms"]) for name in ("axle", "paper")}
    what = "Path deviation in ISO 3888-2 at 97 % of the grip: rms, median of 10 drives"
    lost = 10 - int(worth["iso-3888-2/97/1.0/paper/completed"])
    best = f"{rms['paper']:.1f} cm, the paper's network, {lost} of 10 lost"
    rows.append([what, f"{rms['axle']:.1f} cm", best])
    return Table(("task", "tireid", "best alternative"), rows)


OWN = ("fit", "axle", "inertial")
TABLES_OF_PAPER = ROOT / "tests" / "tireid" / "expected_tables.json"


def paper() -> Table:
    """Return Tables I and II of `tireid paper`, medians over the seeds, beside the printed ones."""
    head = ("instantaneous", "(paper)", "integral", "(paper)", "instantaneous at η/λ")
    rows = []
    for maneuver, laws in json.loads(TABLES_OF_PAPER.read_text(encoding="utf-8")).items():
        printed = printed_values(maneuver)
        for measure, what in row_labels(maneuver).items():
            cells = []
            for law in ("instantaneous", "integral"):
                cells += [laws[law][measure]["median"], printed[law].get(measure)]
            cells.append(laws["instantaneous_scaled"][measure]["median"])
            texts = ["" if one is None else f"{one:.2f}" for one in cells]
            rows.append([f"{maneuver.replace('_', ' ')}, {what}", *texts])
    return Table(("RMSE [kN]", *head), rows)


def documents() -> list[Path]:
    """Return README.md and every Markdown file below docs."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def main(argv: list[str] | None = None) -> int:
    """Write the tables; return 1 where `--check` finds one that differs.

    Parameters
    ----------
    argv : words of the command.
    """
    parser = argparse.ArgumentParser(description="Write the tables of README.md and docs.")
    parser.add_argument("--check", action="store_true", help="write nothing")
    check, known, differing = parser.parse_args(argv).check, records(), 0
    for path in documents():
        old = path.read_text(encoding="utf-8")
        new = written(old, known)
        if new == old:
            continue
        differing += 1
        print(f"{path.relative_to(ROOT)}: {'differs' if check else 'written'}")
        if not check:
            path.write_text(new, encoding="utf-8")
    older = [script for script, record in known.items() if record["code"] != _code(script)]
    print(f"{len(older)} of {len(known)} records are older than the code:", *older)
    return 1 if check and differing else 0


if __name__ == "__main__":
    sys.exit(main())
