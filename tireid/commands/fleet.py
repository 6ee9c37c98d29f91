"""Thousands of logs in one command: learn, merge, prior for the next car, watch."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from identifier.tire_model import STIFFNESS
from models.extras import needs
from models.files import resolved
from models.vehicle import Vehicle
from tireid.cluster import cluster
from tireid.commands import DONE, FAILS
from tireid.commands.options import (
    add_force,
    add_jobs,
    add_log_map,
    add_options,
    given_map,
    jobs_of,
    stored_model,
)
from tireid.exchange import ClaimedError, claim
from tireid.fleet.chosen import CHOSEN as FLEET_CHOSEN
from tireid.fleet.learn import Telling, find_logs, learn_fleet, on_a_cluster, on_this_machine
from tireid.fleet.merge import BY, COLUMNS, Merged, fleet_prior, merge, usable
from tireid.fleet.store import LogRow, Store, StoreError
from tireid.fleet.watch import Watching, watch
from tireid.output import output_folder, require_free, text_table, write_json
from tireid.progress import Progress, Stopwatch, say, tell

_SHOWN = 5  # logs with errors that are named
_SUMMED = ("log", "run", "error", "valid", "seconds")  # columns of a row


def add_parser(commands: Any) -> None:
    parser = commands.add_parser(
        "fleet",
        help=str(__doc__)[:-1].lower(),
        description="Identify thousands of logs into a store, a Parquet dataset with a row for "
        "each log. From it: one model of many logs, a prior for the next car, cars whose tires "
        f"changed. {needs('A store', 'libraries', 'fleet')}.",
    )
    tasks = parser.add_subparsers(dest="task", metavar="TASK", required=True)
    _add_learn(tasks)
    for name, question in _QUESTIONS.items():
        task = tasks.add_parser(name, help=question.help, description=question.text)
        _add_question(task, question.by, question.out)
        if name in ("watch", "report"):
            _add_watching(task)
        if name == "prior":
            car: dict[str, Any] = {"type": Path, "required": True, "metavar": "FILE"}
            task.add_argument("--vehicle", help="the next car, as TOML", **car)
        task.set_defaults(run=question.run)


def _add_learn(tasks: Any) -> None:
    parser = tasks.add_parser(
        "learn",
        help="identify logs that are not in the store yet",
        description="Identify each log separately and store, per log, the frozen model, its "
        "information matrix and vector of the tires, the verdict and how it was driven. A log "
        "that cannot be used becomes a row with its error. Run it again after it was stopped, "
        "or with more logs: only missing logs are identified.",
    )
    parser.add_argument(
        "logs", nargs="+", metavar="PATTERN", help="logs, quoted: 'logs/**/*.csv', s3://..."
    )
    text = "car as TOML; {name} in it stands for a tag: cars/{vehicle}.toml"
    parser.add_argument("--vehicle", required=True, metavar="FILE", help=text)
    parser.add_argument(
        "--out", required=True, metavar="STORE", help="folder or address of the store"
    )
    words: dict[str, Any] = {
        "--tags PATTERN": (
            "",
            "what paths end with, as in '{vehicle}/{tires}/{date}-*.csv'; vehicle, tires and date "
            "(2026-03-31) are known by name, others are in the column tags",
        ),
        "--root DIR": (
            "",
            "name logs as they lie under this folder or address, not by their absolute paths",
        ),
        "--scheduler ADDRESS": "work on the Dask cluster of this scheduler, as in tcp://host:8786",
    }
    add_options(parser, str, words)
    add_options(parser, Path, {"--weights FILE": "fit or prior to begin with"})
    judging: dict[str, Any] = {"choices": ("motion", "none"), "default": "motion"}
    text = "verdict of each log: does the model reproduce its motion, or none (%(default)s)"
    parser.add_argument("--judge", help=text, **judging)
    text = "longest piece of a log in one row [s] (%(default)g)"
    add_options(parser, float, {"--part S": (FLEET_CHOSEN.part, text)})
    flags = {
        "--again": "also identify logs whose row has an error",
        "--replace": "remove earlier rows of these logs from the store: another car "
        "or other options, or another content of the same file",
        "--no-check": "accept logs that contradict physics",
    }
    add_options(parser, bool, flags)
    add_log_map(parser)
    add_jobs(parser)
    parser.set_defaults(run=_learn)


def _add_question(parser: argparse.ArgumentParser, by: str, out: str) -> None:
    parser.add_argument("store", metavar="STORE", help="of fleet learn")
    where = "rows that count, by a condition on their columns: \"a_y_most > 4 and tires = 'x'\""
    text = f"what logs of a group have in common, of {', '.join(BY)} and tags (%(default)s)"
    add_options(parser, str, {"--where SQL": ("", where), "--by NAMES": (by, text)})
    add_options(parser, bool, {"--all": "also logs whose model the verdict rejects"})
    metavar = "FILE" if out.endswith(".json") else "DIR"
    add_options(parser, Path, {f"--out {metavar}": (Path(out), "(%(default)s)")})
    add_force(parser)


def _add_watching(parser: argparse.ArgumentParser) -> None:
    usual = Watching()
    numbers = {
        "--false-alarms X": (usual.false_alarms, "accepted false alarms in 1000 h of learning"),
        "--baseline X": (usual.baseline, "learning of a car that is its baseline [s]"),
        "--stiffness X": (usual.stiffness, "change of stiffness that is looked for, of ln C"),
        "--friction X": (usual.friction, "change of friction that is looked for, of ln mu"),
    }
    table = {word: (value, f"{text} (%(default)g)") for word, (value, text) in numbers.items()}
    add_options(parser, float, table)


def _watching(options: argparse.Namespace) -> Watching:
    return Watching(**{one.name: getattr(options, one.name) for one in fields(Watching)})


@contextmanager
def _claimed(store: str) -> Iterator[None]:
    """Hold a store that lies in a folder, so that no other run sorts its rows meanwhile."""
    if "://" in store:
        yield
        return
    folder = resolved(store)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        try:
            stack.enter_context(claim(folder.parent / f".{folder.name}-claim"))
        except ClaimedError as error:
            raise StoreError(error.refusal(f"learns into {store}")) from None
        yield


def _learn(options: argparse.Namespace) -> int:
    """Learn logs into a store; return 1 where a log could not be used."""
    clock, jobs = Stopwatch(), jobs_of(options)
    tasks, left = find_logs(options.logs, options.vehicle, options.tags, options.root)
    for log, why in list(left.items())[:_SHOWN]:
        say(f"{log}: left out, {why}")
    telling = Telling(
        log_map=given_map(options),
        start=stored_model(options.weights),
        judging=options.judge,
        check=not options.no_check,
        part=options.part,
    )
    for car in sorted({task.vehicle for task in tasks}):  # before thousands of rows say it
        vehicle = Vehicle.from_toml(car)
        if vehicle.estimates:
            say(f"{car}: {vehicle.estimates}")
    store = Store(options.out)
    store.require_ours()
    there: Any = cluster(options.scheduler) if options.scheduler else nullcontext()
    with _claimed(options.out), there as elsewhere, Progress("fleet learn", long=True) as progress:

        def done(ready: int, of: int) -> None:
            progress(ready / max(of, 1), f"{ready} of {of} logs")

        spread = on_a_cluster(elsewhere) if options.scheduler else on_this_machine(jobs)
        became = learn_fleet(
            tasks, telling, store, spread, again=options.again, replacing=options.replace, done=done
        )
    wanted = {task.log for task in tasks} | {name for _, name in became.copies}
    rows = [row for row in store.stream(_SUMMED) if row.log in wanted]
    errors = [row for row in rows if row.error]
    for row in errors[:_SHOWN]:
        say(f"{row.name}: {row.error}")
    for log, name in became.copies[:_SHOWN]:
        say(f"{log}: is in the store as {name}, of the same content")
    if became.others:
        count, first = len(became.others), became.others[0].name
        say(
            f"{first}: removed from the store, as were {count - 1} others"
            if options.replace
            else f"{first} and {count - 1} others are in the store with another car, other "
            "options or another content: fleet learn --replace removes them"
        )
    hours = sum(row.seconds or 0.0 for row in rows) / 3600.0
    refused = sum(row.valid is False for row in rows)
    tell(
        f"{became.of} logs, {hours:.3g} h: {became.learnt} identified now, "
        f"{became.of - became.learnt} before; {refused} not valid, {len(errors)} could not be used"
        + (f", see the column error of {options.out}" if errors else "")
    )
    say(f"wrote {options.out} in {clock.seconds:.0f} s")
    return FAILS if errors else DONE


class _Used:
    """The rows of a store that --where takes and that can be used, counted as they are read."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options, self.store, self.warned = options, Store(options.store), False
        self.by = [one for one in options.by.split(",") if one]
        self.store.require()

    def rows(self) -> Iterator[LogRow]:
        used = of = 0
        for row in self.store.stream(COLUMNS, where=self.options.where):
            of += 1
            if usable(row, refused=self.options.all):
                used += 1
                yield row
        if not used:
            raise ValueError(
                f"{self.options.store}: none of {of} logs can be used"
                + ("" if self.options.all else "; --all includes rejected ones")
            )
        if not self.warned:
            say(f"{used} of {of} logs")
        self.warned = True

    @property
    def groups(self) -> list[Merged]:
        return merge(self.rows, self.by)


def _watch(options: argparse.Namespace) -> int:
    """Say whose tires changed; return 1 where a change lasts."""
    from tireid.reports.fleet import write_watch_report  # draws, which learning does not

    watching, used = _watching(options), _Used(options)
    watched = watch(used.rows(), used.by, watching)
    with output_folder(options.out, force=options.force) as folder:
        write_json(folder / "alarms.json", [alarm.to_dict() for alarm in watched.alarms])
        write_watch_report(folder, options.store, watched, command=options.words)
    lines = [alarm.line for alarm in watched.alarms] or ["no change was noticed"]
    short = f"; {len(watched.short)} are not beyond their baseline yet" if watched.short else ""
    tell("\n".join([*lines, f"{len(watched.seen)} cars, {watched.hours:.3g} h{short}"]))
    say(f"wrote {options.out}/")
    return FAILS if any(not alarm.ended for alarm in watched.alarms) else DONE


def _report(options: argparse.Namespace) -> int:
    from tireid.reports import fleet as page

    watching, used = _watching(options), _Used(options)
    groups = used.groups
    watched = watch(used.rows(), used.by, watching)
    rows = used.store.rows(page.COLUMNS, where=options.where)
    with output_folder(options.out, force=options.force) as folder:
        page.write_fleet_report(folder, options.store, rows, groups, watched, command=options.words)
    tell(_table(groups))
    say(f"wrote {options.out}/")
    return DONE


def _merge(options: argparse.Namespace) -> int:
    groups = _Used(options).groups
    with output_folder(options.out, force=options.force) as folder:
        table = []
        for k, one in enumerate(groups):
            file = f"model-{k:04d}.json"
            one.model.save(folder / file)
            C = one.model.stiffness
            table.append(
                {
                    **dict(one.key),
                    "file": file,
                    "logs": one.logs,
                    "learning_s": one.information.seconds,
                    "cornering_stiffness_N_rad": C.tolist(),
                    "known_slip_rad": one.model.known_slip.tolist(),
                    "on_another_road": one.elsewhere,
                }
            )
        write_json(folder / "models.json", table)
    tell(_table(groups))
    for one in groups:
        if one.elsewhere:
            say(f"{one.name}: {one.elsewhere} of {one.logs} logs are of another road than the rest")
    say(f"wrote {options.out}/")
    return DONE


def _table(groups: list[Merged]) -> str:
    rows = [["group", "logs", "learning", "stiffness front, rear", "known to"]]
    for one in groups:
        known = one.model.known_slip * 57.29578
        C = [number.words for number in one.model.estimates() if number.title == STIFFNESS]
        rows.append(
            [
                one.name,
                str(one.logs),
                f"{one.information.seconds / 60.0:.1f} min",
                f"{C[0]}, {C[1]} kN/rad",
                f"{known[0]:.1f}, {known[1]:.1f} deg",
            ]
        )
    return text_table(rows, "<>>>>")


def _prior(options: argparse.Namespace) -> int:
    require_free(options.out, force=options.force)
    vehicle = Vehicle.from_toml(options.vehicle)
    prior = fleet_prior(_Used(options).groups)
    model = prior.model(vehicle)
    model.save(options.out)
    tell(f"where {vehicle.name} starts, from {prior.cars} cars:\n{model.summary()}")
    say(f"wrote {options.out}: tireid identify LOG --weights {options.out}")
    return DONE


class _Question(NamedTuple):
    """A task that asks a store: its help, what it groups by, what it writes, and who answers."""

    help: str
    text: str
    by: str
    out: str
    run: Callable[[argparse.Namespace], int]


_QUESTIONS = {
    "merge": _Question(
        "one model of the logs of each group",
        "Add up the information of the logs, group by group; write a model of each group, as "
        "weights.json, and a table.",
        "vehicle,tires",
        "tireid-fleet-merge",
        _merge,
    ),
    "prior": _Question(
        "prior for the next car",
        "Estimate the mean and the spread of a store's cars, and write a prior to begin with: "
        "tireid identify --weights FILE.",
        "vehicle,tires",
        "prior.json",
        _prior,
    ),
    "watch": _Question(
        "whose tires changed, when, and the likely cause",
        "Compare each car's later logs with its first ones, its baseline, and report changes of "
        "stiffness and friction: wear, other tires, a wet road. Exit code 1 where one lasts. Logs "
        "are ordered by their date.",
        "vehicle",
        "tireid-fleet-watch",
        _watch,
    ),
    "report": _Question(
        "a report on the store, with figures",
        "Write report.html: merged models, how stiffness went log by log, what changed, and which "
        "logs were left out.",
        "vehicle",
        "tireid-fleet",
        _report,
    ),
}
