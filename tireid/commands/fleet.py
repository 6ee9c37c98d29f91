"""Thousands of logs in one command: learn each, merge them, watch for changed tires."""

import argparse
import os
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identifier.measured import as_printed
from identifier.tire_model import STIFFNESS
from models.extras import needs
from models.schema import require_few
from models.vehicle import Vehicle
from tireid.cluster import cluster
from tireid.commands import DONE, FAILS
from tireid.commands.options import (
    add_force,
    add_log_map,
    add_options,
    folder_of,
    given_map,
)
from tireid.fleet.learn import (
    LearnLog,
    find_logs,
    learn_fleet,
    on_a_cluster,
    on_this_machine,
    read_car,
)
from tireid.fleet.merge import BY, COLUMNS, merge, usable
from tireid.fleet.store import INDEX, LogRow, Store
from tireid.fleet.watch import ALARM, BASELINE, watch
from tireid.output import text_table, write_json
from tireid.progress import Progress, say, tell

_LISTED = 5  # logs with errors that are named


def add_parser(commands: Any) -> None:
    parser = commands.add_parser(
        "fleet",
        help=str(__doc__)[:-1].lower(),
        description="Identify thousands of logs into a store, a Parquet file for each log. From "
        f"it: one model of many logs, and the cars whose tires changed. "
        f"{needs('A store', 'libraries', 'fleet')}.",
    )
    tasks = parser.add_subparsers(dest="task", metavar="TASK", required=True)
    _add_learn(tasks)
    merging = tasks.add_parser(
        "merge",
        help="one model of the logs of each group",
        description="Add up the information of the logs, group by group; write a model of each "
        "group, as weights.json, and a table.",
    )
    _add_question(merging, "vehicle,tires", "tireid-fleet-merge")
    merging.set_defaults(run=_merge)
    watching = tasks.add_parser(
        "watch",
        help="the days on which a car's tires differ from its first days",
        description="Compare each day of a car with its first days: a chi-square of stiffness, "
        "front and rear, and friction. Exit code 1 where the last day of a car is an alarm.",
    )
    _add_question(watching, "vehicle", "tireid-fleet-watch")
    numbers = {
        "--baseline S": (BASELINE, "driving of a car that is its reference [s] (%(default)g)"),
        "--alarm P": (ALARM, "probability of a false alarm per car and day (%(default)g)"),
    }
    add_options(watching, float, numbers)
    watching.set_defaults(run=_watch)


def _add_learn(tasks: Any) -> None:
    parser = tasks.add_parser(
        "learn",
        help="identify logs that are not in the store yet",
        description="Identify each log separately and store, per log, the information matrix and "
        "vector of the tires and the verdict. A log that cannot be used becomes a row with its "
        "error. Run it again after it was stopped, or with more logs: only missing logs are "
        "identified. Several runs may write one store at a time.",
    )
    parser.add_argument(
        "logs", nargs="+", metavar="PATTERN", help="logs, quoted: 'logs/**/*.csv', s3://..."
    )
    text = "car as TOML; {name} in it stands for a tag: cars/{vehicle}.toml"
    parser.add_argument("--vehicle", required=True, metavar="FILE", help=text)
    parser.add_argument(
        "--out", required=True, metavar="STORE", help="folder or address of the store"
    )
    words = {
        "--tags PATTERN": (
            "",
            "what paths end with, as in '{vehicle}/{tires}/{date}-*.csv'; vehicle, tires and date "
            "(2026-03-31) are known by name, others are in the column tags",
        ),
        "--scheduler ADDRESS": "work on the Dask cluster of this scheduler, as in tcp://host:8786",
    }
    add_options(parser, str, words)
    flags = {
        "--again": "also identify logs whose row has an error",
        "--no-check": "accept logs that contradict physics",
    }
    add_options(parser, bool, flags)
    add_log_map(parser)
    add_options(parser, int, {"--jobs N": (os.cpu_count() or 1, "processes (%(default)s)")})
    parser.set_defaults(run=_learn)


def _add_question(parser: argparse.ArgumentParser, by: str, out: str) -> None:
    parser.add_argument("store", metavar="STORE", help="of fleet learn")
    text = f"what logs of a group have in common, of {', '.join(BY)} and tags (%(default)s)"
    add_options(parser, str, {"--by NAMES": (by, text)})
    add_options(parser, bool, {"--all": "also logs whose model the verdict rejects"})
    add_options(parser, Path, {"--out DIR": (Path(out), "(%(default)s)")})
    add_force(parser)


def _learn(options: argparse.Namespace) -> int:
    """Learn logs into a store; return 1 where a log could not be used."""
    jobs, log_map = options.jobs, given_map(options)
    if jobs < 1:
        raise ValueError(f"--jobs must be at least 1, it is {jobs}")
    require_few(ValueError, "--jobs", jobs, "processes", "processes")
    tasks, left = find_logs(options.logs, options.vehicle, options.tags)
    for log, why in list(left.items())[:_LISTED]:
        say(f"{log}: left out, {why}")
    if log_map.dbc:  # whoever reads a log may run in another folder
        log_map = replace(log_map, dbc=str(Path(log_map.dbc).absolute()))
    cars = {}
    for path in sorted({task.vehicle for task in tasks}):
        estimates = Vehicle.from_toml(path).estimates
        if estimates:
            say(f"{path}: {estimates}")
        cars[path] = read_car(path, log_map, check=not options.no_check)
    work = LearnLog(cars, log_map, not options.no_check)
    store = Store(options.out)
    store.require(begun=False)
    there: Any = cluster(options.scheduler) if options.scheduler else nullcontext()
    with there as elsewhere:
        progress = Progress("fleet learn", long=True)

        def done(ready: int) -> None:
            progress(ready / max(len(tasks), 1), f"{ready} of {len(tasks)} logs")

        spread = on_a_cluster(elsewhere) if options.scheduler else on_this_machine(jobs)
        learnt, files = learn_fleet(tasks, work, store, spread, done, again=options.again)
    columns = (*INDEX, "seconds", "valid")
    rows = [row for row in store.stream(columns) if row.file in files]
    errors = [row for row in rows if row.error]
    for row in errors[:_LISTED]:
        say(f"{row.name}: {row.error}")
    hours = sum(row.seconds or 0.0 for row in rows) / 3600.0
    refused = sum(row.valid is False for row in rows)
    tell(
        f"{len(tasks)} logs, {hours:.3g} h: {learnt} identified now, "
        f"{len(tasks) - learnt} before; {refused} not valid, {len(errors)} could not be used"
        + (f", see the column error of {options.out}" if errors else "")
    )
    say(f"wrote {options.out} in {progress.seconds:.0f} s")
    return FAILS if errors else DONE


def _used(options: argparse.Namespace) -> Callable[[], Iterator[LogRow]]:
    """Return what yields the rows of a store that can be used, having said how many those are."""
    store = Store(options.store)
    store.require(begun=True)
    files, columns = store.files(), (*INDEX, "driven", "valid")
    each = [usable(row, rejected=options.all) for row in store.stream(columns, files)]
    if not any(each):
        raise ValueError(
            f"{options.store}: none of {len(each)} logs can be used"
            + ("" if options.all else "; --all includes rejected ones")
        )
    say(f"{sum(each)} of {len(each)} logs")
    return lambda: (
        row for row in store.stream(COLUMNS, files) if usable(row, rejected=options.all)
    )


def _by(options: argparse.Namespace) -> list[str]:
    return [one for one in options.by.split(",") if one]


def _merge(options: argparse.Namespace) -> int:
    groups = merge(_used(options), _by(options))
    models, rows = [], [["group", "logs", "learning", "stiffness front, rear", "known to"]]
    with folder_of(options) as folder:
        for k, one in enumerate(groups):
            file, known = f"model-{k:04d}.json", np.degrees(one.model.known_slip)
            one.model.save(folder / file)
            models.append(
                {
                    **dict(one.key),
                    "file": file,
                    "logs": one.logs,
                    "learning_s": one.information.seconds,
                    "cornering_stiffness_N_rad": one.model.stiffness.tolist(),
                    "known_slip_rad": one.model.known_slip.tolist(),
                    "on_another_road": one.elsewhere,
                }
            )
            C = as_printed(n for n in one.model.estimates() if n.title == STIFFNESS)
            stiffness = f"{C[0].words}, {C[1].words} {C[0].unit}"
            minutes = f"{one.information.seconds / 60.0:.1f} min"
            slips = f"{known[0]:.1f}, {known[1]:.1f} deg"
            rows.append([one.name, str(one.logs), minutes, stiffness, slips])
        write_json(folder / "models.json", models)
    tell(text_table(rows, "<>>>>"))
    for one in groups:
        if one.elsewhere:
            say(f"{one.name}: {one.elsewhere} of {one.logs} logs are of another road than the rest")
    say(f"wrote {options.out}/")
    return DONE


def _watch(options: argparse.Namespace) -> int:
    """Say whose tires changed; return 1 where the last day of a car is an alarm."""
    rows, by = _used(options)(), _by(options)
    days, short = watch(rows, by, baseline=options.baseline, alarm=options.alarm)
    with folder_of(options) as folder:
        write_json(folder / "days.json", [day._asdict() for day in days])
    last = {day.car: day for day in days}
    lines = [day.line for day in days if day.alarm] or ["no change was noticed"]
    lines.append(f"{len(last)} cars, {len(days)} days")
    if short:
        lines[-1] += f"; {len(short)} cars have no day after their reference yet"
    tell(*lines)
    say(f"wrote {options.out}/")
    return FAILS if any(day.alarm for day in last.values()) else DONE
