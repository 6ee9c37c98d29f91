"""A fleet: speed, merging, priors, what the watch finds, and a cluster that loses a worker.

    python -m benchmarks.fleet [--only speed hours store merge prior watch cluster] [--record]

speed    500 logs of 60 s, CSV, by `tireid fleet learn`: everyday drives, each some times over, with
         as many empty lines behind as make them different.
hours    ten hours of one log, Parquet, the same drives over and over.
store    100 000 rows that differ, of 50 cars: `tireid fleet merge` and what it holds, beside what
         it holds of 1000.
merge    random cars of four classes, six drives each: the model of their rows, each learnt alone,
         against the fit of all of them at once: error of frozen forces on drives never seen.
prior    cars of one kind on tires that differ by a tenth: error of frozen forces on another drive
         after a second of corners, with the fleet's prior and without.
watch    500 cars for two hours after their baseline. Each is one of `DRIVEN` random cars, whose
         baseline is driven; its later minutes are drawn from others that were driven, with
         sensors that fail for one to five minutes; a fifth of the cars lose a tenth of stiffness
         at one axle or both. Tires of a car that did not change are a false alarm.
cluster  two workers of Dask, one killed in the middle.
"""

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.everyday_drives import KINDS, everyday_drive
from benchmarks.local_cluster import free_port, start
from benchmarks.random_cars import CLASSES, FIRST_SEED, LEAD, RandomCar, random_car, random_drive
from benchmarks.targets import Targets, keeps, show
from identifier.estimate.fit import fit
from identifier.tire_model import TireModel
from models.faults import SensorFault
from models.plant import PlantError
from models.recordings import LogMap, Recording, write_recording
from models.tires import DugoffTire, FialaTire, MagicFormula, Tire
from tireid.cluster import cluster
from tireid.fleet.learn import Telling, find_logs, learn_fleet, learnt, on_a_cluster
from tireid.fleet.merge import fleet_prior, merge
from tireid.fleet.store import LogRow, Store
from tireid.fleet.watch import Watch, Watching, watch

PARTS = ("speed", "hours", "store", "merge", "prior", "watch", "cluster")
LOGS, MINUTE = 500, 60.0
HOURS = 10
ROWS, FEW, ROW_CARS = 100_000, 1000, 50
DISTINCT = 20  # drives that logs are made of
DRIVEN = 24  # cars of the watched fleet that are driven
CARS, AFTER = 500, 120  # cars, minutes of each after its baseline
BASELINE, LATER, SOFTER, FAULTY = 20, 20, 12, 6  # minutes that are driven of a car
LOSES = 5  # one of so many cars loses stiffness,
LOSS = 0.9
FAULTS = 0.02  # share of minutes in which a sensor begins to fail
LONGEST_FAULT = 5  # min


@contextmanager
def in_folder() -> Iterator[Path]:
    """Yield a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="tireid-fleet-") as folder:
        yield Path(folder)


def drives_of(car: RandomCar, count: int, rng: np.random.Generator) -> list[Recording]:
    """Return logs of a car's everyday drives, a minute each.

    Parameters
    ----------
    car : that drives.
    count : how many.
    rng : source of drives and noise.
    """
    found: list[Recording] = []
    for k in range(10 * count):
        if len(found) == count:
            break
        with suppress(PlantError):
            found.append(everyday_drive(car, KINDS[k % 2], rng).log(rng))
    if len(found) < count:
        raise PlantError(f"a {car.kind} has no everyday drives")
    return found


# How long it takes, and what it holds.


class Spent(NamedTuple):
    """Seconds, seconds of processor time, and the most that all processes hold [GB]."""

    seconds: float
    processor: float
    held: float


def run_learn(logs: str, folder: Path, jobs: int) -> Spent:
    """Run the command over logs; return what it took.

    Parameters
    ----------
    logs : pattern.
    folder : with car.toml; the store goes there.
    jobs : processes.
    """
    words = ["fleet", "learn", logs, "--vehicle", str(folder / "car.toml")]
    words += ["--out", str(folder / "store"), "--jobs", str(jobs)]
    return run_command(words)


def run_command(words: Sequence[str]) -> Spent:
    """Run `tireid`; return what it took.

    Parameters
    ----------
    words : behind its name.
    """
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    command = subprocess.Popen([sys.executable, "-m", "tireid", *words], start_new_session=True)
    most = [0.0]
    over = threading.Event()

    def look() -> None:
        while not over.wait(0.2):
            most[0] = max(most[0], held(command.pid))

    thread = threading.Thread(target=look)
    thread.start()
    code = command.wait()
    over.set()
    thread.join()
    if code != 0:
        raise RuntimeError(f"tireid {' '.join(words)} ended with {code}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(time.perf_counter() - began, processor, most[0])


def held(session: int) -> float:
    """Return the memory that all processes of a session hold of their own [GB].

    Parameters
    ----------
    session : its number.
    """
    total_kB = 0
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError, IndexError):
            pid = int(entry.name)
            if os.getsid(pid) != session:
                continue
            status = (entry / "status").read_text(encoding="utf-8")
            total_kB += int(status.split("RssAnon:")[1].split()[0])
    return total_kB / 1e6


def speed(targets: Targets, jobs: int, count: int) -> None:
    """Time the command over logs of a minute.

    Parameters
    ----------
    targets : where numbers go.
    jobs : processes.
    count : logs.
    """
    with in_folder() as folder:
        rng = np.random.default_rng(FIRST_SEED)
        car = random_car("sedan", rng)
        car.told.to_toml(folder / "car.toml")
        (folder / "logs").mkdir()
        texts = []
        for log in drives_of(car, DISTINCT, rng):
            texts.append(write_recording(log, folder / "one.csv").read_bytes())
        for k in range(count):
            (folder / "logs" / f"{k:05d}.csv").write_bytes(
                texts[k % DISTINCT] + b"\n" * (k // DISTINCT)
            )
        spent = run_learn(str(folder / "logs" / "*.csv"), folder, jobs)
    show("processor time", f"{spent.processor:.1f} s")
    targets.at_most(f"{count} logs of 60 s, CSV", spent.seconds, 60.0, "s", "speed/seconds")
    targets.record("speed/processor", spent.processor, "s")
    targets.record("speed/logs", count)
    targets.record("speed/held", spent.held, "GB")


def hours(targets: Targets, count: int) -> None:
    """Measure what the command takes for one long log, Parquet.

    Parameters
    ----------
    targets : where numbers go.
    count : its hours.
    """
    import pyarrow
    import pyarrow.parquet

    with in_folder() as folder:
        rng = np.random.default_rng(FIRST_SEED + 1)
        car = random_car("sedan", rng)
        car.told.to_toml(folder / "car.toml")
        drives = drives_of(car, DISTINCT, rng)
        names = {"vx": "v_x", "vy": "v_y", "r": "r", "delta_f": "delta_f", "ay": "a_y"}
        columns = {
            column: np.concatenate([getattr(one, name) for one in drives] * (3 * count))
            for column, name in names.items()
        }
        columns["t"] = 0.01 * np.arange(columns["r"].size)
        path = folder / "long.parquet"
        pyarrow.parquet.write_table(pyarrow.table(columns), path)
        spent = run_learn(str(path), folder, 1)
    name = f"a log of {count} h"
    targets.at_most(f"{name}, processor time", spent.processor, 60.0, "s", "hours/processor")
    targets.at_most(f"{name}, held", 1000.0 * spent.held, 500.0, "MB", "hours/held")
    targets.record("hours/driven", count)


def stored(targets: Targets, count: int) -> None:
    """Measure what merging a store takes and holds.

    Parameters
    ----------
    targets : where numbers go.
    count : rows.
    """
    rng = np.random.default_rng(FIRST_SEED)
    car = random_car("sedan", rng)
    row = row_of(drives_of(car, 1, rng)[0], car, "", 0)
    spent = {}
    with in_folder() as folder:
        for name, number in (("few", FEW), ("all", count)):
            store = Store(str(folder / name))
            for first in range(0, number, FEW):
                store.keep([_altered(row, k, rng) for k in range(first, first + FEW)])
            store.settle()
            words = ["fleet", "merge", str(folder / name), "--by", "vehicle"]
            spent[name] = run_command([*words, "--all", "--out", str(folder / f"{name}-merged")])
    grown = 1000.0 * (spent["all"].held - spent["few"].held)
    targets.at_most(
        f"merge of {count} rows, beyond that of {FEW}", grown, 200.0, "MB", "store/grown"
    )
    targets.record("store/held", 1000.0 * spent["all"].held, "MB")
    targets.record("store/seconds", spent["all"].seconds, "s")
    targets.record("store/rows", count)


def _altered(row: LogRow, k: int, rng: np.random.Generator) -> LogRow:
    """A row of another log: its numbers a little others, so that they take their room on disk."""
    factor = 1.0 + 0.01 * rng.standard_normal()
    name = f"car-{k % ROW_CARS:02d}"
    matrix, vector = factor * np.asarray(row.matrix), factor * np.asarray(row.vector)
    return replace(
        row,
        log=f"/logs/{name}/{k:06d}.csv",
        content=hashlib.blake2b(str(k).encode(), digest_size=16).hexdigest(),
        vehicle=name,
        matrix=matrix.tolist(),
        vector=vector.tolist(),
        model=row.model + rng.bytes(1000).hex(),
    )


# Merging and priors.


def missed(model: TireModel, drives: Sequence[Recording]) -> float:
    """Return the share of the rms force that a frozen model misses on drives [-], both axles.

    Parameters
    ----------
    model : the frozen model.
    drives : without noise, with true forces.
    """
    shares = []
    for one in drives:
        force = one.axle_force
        assert force is not None
        late = one.t > one.t[-1] - 29.0
        away = (model.predict(one) - force)[late]
        shares.append(np.sqrt((away**2).mean(axis=0) / (force[late] ** 2).mean(axis=0)))
    return float(np.mean(shares))


def merging(targets: Targets, cars: int) -> None:
    """Compare parts that are added with drives that are learnt at once.

    Parameters
    ----------
    targets : where numbers go.
    cars : of each class.
    """
    rows = []
    for k in range(4 * cars):
        rng = np.random.default_rng([FIRST_SEED + k, 3])
        car = random_car(list(CLASSES)[k % 4], rng)
        with suppress(PlantError):
            logs = [random_drive(car, rng).log(rng) for _ in range(6)]
            asked = [random_drive(car, rng).exact for _ in range(2)]
            each = [row_of(one, car, "car", i) for i, one in enumerate(logs)]
            (together,) = merge(lambda each=each: iter(each), [])  # type: ignore[misc]
            models = [together.model, fit(logs, car.told).model, *(one.frozen for one in each)]
            parts, whole, *alone = (missed(one, asked) for one in models)
            rows.append([parts, whole, float(np.median(alone))])
    parts_error, whole_error, alone_error = 100.0 * np.mean(rows, axis=0)
    ratio = 100.0 * (parts_error / whole_error - 1.0)
    targets.at_most("error of merged over fitted at once", ratio, 10.0, "%", "merge/over_at_once")
    targets.record("merge/merged_error", parts_error, "%")
    targets.record("merge/at_once_error", whole_error, "%")
    targets.record("merge/alone_error", alone_error, "%")
    targets.record("merge/cars", len(rows))


def on_other_tires(
    car: RandomCar, stiffness: tuple[float, float], friction: float = 1.0
) -> RandomCar:
    """Return a car on tires of other stiffness, front and rear, and friction.

    Parameters
    ----------
    stiffness : over what it was, front and rear.
    friction : over what it was.
    """
    tires: list[Tire] = []
    for tire, factor in zip(car.tires, stiffness, strict=True):
        if isinstance(tire, MagicFormula):
            c = tire.coefficients
            changed = replace(c, LKY=c.LKY * factor, LMUY=c.LMUY * friction)
            tires.append(replace(tire, coefficients=changed))
        else:
            assert isinstance(tire, FialaTire | DugoffTire)
            tires.append(
                replace(tire, C_alpha=tire.C_alpha * factor, friction=tire.friction * friction)
            )
    mu = (car.friction[0] * friction, car.friction[1] * friction)
    return replace(car, tires=(tires[0], tires[1]), friction=mu)


def row_of(log: Recording, car: RandomCar, name: str, k: int) -> LogRow:
    """Return the row of a log, as `tireid fleet learn` makes it.

    Parameters
    ----------
    log : of the car.
    car : that drove.
    name : of the car.
    k : number of the log, a minute apart.
    """
    date = np.datetime_as_string(np.datetime64("2026-01-01T00:00") + np.timedelta64(k, "m"))
    row = LogRow(log=f"{name}-{k:04d}", vehicle=name, date=str(date))
    return learnt(row, log, car.told, Telling(log_map=LogMap()))


CORNERS = 1.0  # s of corners that the next car has driven


def priors(targets: Targets, fleets: int) -> None:
    """Compare what the next car of a kind knows of its tires at once, afresh and from the fleet.

    Parameters
    ----------
    targets : where numbers go.
    fleets : kinds of car.
    """
    errors: list[tuple[float, float]] = []
    for k in range(fleets):
        rng = np.random.default_rng([FIRST_SEED + k, 4])
        kind = random_car(["compact", "sedan"][k % 2], rng)
        with suppress(PlantError):
            rows = []
            for number in range(8):
                car = _of_kind(kind, rng)
                logs = [random_drive(car, rng).log(rng) for _ in range(3)]
                rows += [row_of(one, car, f"{number}", i) for i, one in enumerate(logs)]
            groups = merge(lambda rows=rows: iter(rows), ["vehicle"])  # type: ignore[misc]
            prior = fleet_prior(groups).model(kind.told)
            for _ in range(3):
                car = _of_kind(kind, rng)
                log, other = random_drive(car, rng).log(rng), random_drive(car, rng).exact
                short = log[float(log.t[0]) : float(log.t[0]) + LEAD + CORNERS]
                known = [fit([short], car.told, p).model for p in (None, prior.as_prior(car.told))]
                errors.append((missed(known[0], [other]), missed(known[1], [other])))
    afresh, begun = 100.0 * np.median(errors, axis=0)
    show("error after a second of corners", f"{afresh:.1f} % afresh, {begun:.1f} % from the fleet")
    targets.record("prior/afresh", float(afresh), "%")
    targets.record("prior/fleet", float(begun), "%")
    targets.record("prior/cars", len(errors))
    targets.at_least("prior: times less error", float(afresh / begun), 1.5, "x", "prior/ratio")


def _of_kind(kind: RandomCar, rng: np.random.Generator) -> RandomCar:
    """A car of a kind, its tires by a tenth or so others."""
    stiffness = np.exp(0.1 * rng.standard_normal(2))
    friction = float(np.exp(0.05 * rng.standard_normal()))
    return on_other_tires(kind, (float(stiffness[0]), float(stiffness[1])), friction)


# Watching.

FAILS = ("biased", "drifting", "noisy", "spiking", "scaled")
SIZES = {"v_x": 1.0, "v_y": 0.3, "r": 0.03, "delta_f": 0.02}  # SI, of a sedan


def driven_car(seed: int) -> dict[str, list[LogRow]]:
    """Return minutes that a random car was driven: its baseline, later, softer tires, faults.

    Parameters
    ----------
    seed : of the car.
    """
    for attempt in range(20):
        rng = np.random.default_rng([seed, attempt, 5])
        car = random_car(["compact", "sedan", "race"][seed % 3], rng)
        factors = [(LOSS, 1.0), (1.0, LOSS), (LOSS, LOSS)][int(rng.integers(3))]
        with suppress(PlantError):
            same = drives_of(car, BASELINE + LATER + FAULTY, rng)
            soft = drives_of(on_other_tires(car, factors), SOFTER, rng)
            good, faulty = same[:-FAULTY], [_failing(one, rng) for one in same[-FAULTY:]]
            name = f"car-{seed}"

            def rows(
                logs: Sequence[Recording], car: RandomCar = car, name: str = name
            ) -> list[LogRow]:
                return [row_of(one, car, name, k) for k, one in enumerate(logs)]

            return {
                "baseline": rows(good[:BASELINE]),
                "later": rows(good[BASELINE:]),
                "softer": rows(soft),
                "faulty": rows(faulty),
            }
    raise PlantError(f"no car of seed {seed} drives")


def _failing(log: Recording, rng: np.random.Generator) -> Recording:
    """A log in which a sensor fails for some of the time or throughout."""
    kind, channel = str(rng.choice(FAILS)), str(rng.choice(list(SIZES)))
    size = SIZES[channel] * rng.uniform(0.2, 1.0)
    size = rng.uniform(0.8, 1.25) if kind == "scaled" else size
    begin = float(rng.uniform(0.0, 40.0))
    fault = SensorFault(
        channel=channel, kind=kind, size=size, start=begin, seed=int(rng.integers(1 << 30))
    )
    return fault.apply(log)


def watching(targets: Targets, driven: int, jobs: int) -> None:
    """Count what the watch finds of a fleet, and what it finds that is not there.

    Parameters
    ----------
    targets : where numbers go.
    driven : cars that are driven.
    jobs : processes.
    """
    from identifier.compare.work import spread

    with spread(jobs) as spread_map:
        cars = list(spread_map(driven_car, range(FIRST_SEED, FIRST_SEED + driven)))
    rows, loses = drawn_fleet(cars, np.random.default_rng(FIRST_SEED))
    used = [row for row in rows if not row.error and row.valid is not False]
    watched = watch(used, ["vehicle"], Watching())
    found, false = found_and_false(watched, loses)
    within = sum(minutes <= 30.0 for minutes in found.values())
    targets.at_least(
        "cars that lost a tenth, found within 30 min", 100.0 * within / len(loses), 100.0, "%",
        "watch/found",
    )  # fmt: skip
    rate = 1000.0 * false / watched.hours
    targets.at_most("false alarms in 1000 h of learning", rate, 1.0, "", "watch/false_alarms")
    targets.record("watch/hours", watched.hours, "h")
    targets.record("watch/cars", CARS)
    targets.record("watch/driven", driven)
    targets.record("watch/lose", len(loses))
    targets.record("watch/false", false)
    targets.record("watch/refused", len(rows) - len(used))
    if found:
        middle, last = float(np.median(list(found.values()))), max(found.values())
        show("found after, median and worst", f"{middle:.0f}, {last:.0f} min")
        targets.record("watch/median_minutes", middle, "min")
        targets.record("watch/worst_minutes", last, "min")


def drawn_fleet(
    cars: Sequence[dict[str, list[LogRow]]], rng: np.random.Generator
) -> tuple[list[LogRow], dict[str, int]]:
    """Return the rows of a fleet, and which minute its cars lose stiffness in, by car.

    Parameters
    ----------
    cars : of `driven_car`.
    rng : source of chance.
    """
    rows: list[LogRow] = []
    loses: dict[str, int] = {}
    for k in range(CARS):
        name, minutes = f"car-{k:03d}", cars[k % len(cars)]
        drawn = list(minutes["baseline"])
        change = int(rng.integers(20, 80)) if k % LOSES == 0 else AFTER
        if change < AFTER:
            loses[name] = BASELINE + change
        failing = 0
        for minute in range(AFTER):
            if failing == 0 and rng.uniform() < FAULTS:
                failing = int(rng.integers(1, LONGEST_FAULT, endpoint=True))
            pool = minutes["faulty" if failing else "softer" if minute >= change else "later"]
            failing = max(failing - 1, 0)
            drawn.append(pool[int(rng.integers(len(pool)))])
        rows += [_renamed(one, name, i) for i, one in enumerate(drawn)]
    return rows, loses


def found_and_false(watched: Watch, loses: Mapping[str, int]) -> tuple[dict[str, float], int]:
    """Return after how many minutes a loss was found, by car, and how many alarms are false.

    Parameters
    ----------
    watched : what was seen.
    loses : minute in which cars lose stiffness.
    """
    found: dict[str, float] = {}
    false = 0
    for alarm in watched.alarms:
        at, begins = int(alarm.log[-4:]), loses.get(alarm.car, BASELINE + AFTER)
        if alarm.car in loses and at >= begins and alarm.change[alarm.statistic] < 0.0:
            found.setdefault(alarm.car, float(at - begins + 1))
        else:
            false += 1
    return found, false


def _renamed(row: LogRow, name: str, k: int) -> LogRow:
    date = np.datetime_as_string(np.datetime64("2026-01-01T00:00") + np.timedelta64(k, "m"))
    return replace(row, log=f"{name}-{k:04d}", vehicle=name, date=str(date))


# A cluster that loses a worker.


def losing_a_worker(targets: Targets, count: int) -> None:
    """Compare the store of a cluster, one worker of which is killed, with that of this machine.

    Parameters
    ----------
    targets : where numbers go.
    count : logs.
    """
    with in_folder() as folder:
        rng = np.random.default_rng(FIRST_SEED)
        car = random_car("sedan", rng)
        car.told.to_toml(folder / "car.toml")
        (folder / "logs").mkdir()
        for k, log in enumerate(drives_of(car, count, rng)):
            write_recording(log, folder / "logs" / f"{k:04d}.csv")
        tasks, _ = find_logs([str(folder / "logs" / "*.csv")], str(folder / "car.toml"))
        telling = Telling(log_map=LogMap())
        here, there = Store(str(folder / "here")), Store(str(folder / "there"))
        learn_fleet(tasks, telling, here, map)
        port = free_port()
        address = f"tcp://127.0.0.1:{port}"
        scheduler = start("scheduler", ["--host", "127.0.0.1", "--port", str(port)], folder)
        words = [address, "--nthreads", "1", "--no-nanny"]
        workers = [start("worker", words, folder) for _ in range(2)]
        killed: list[int] = []

        def kill_one(ready: int, of: int) -> None:
            if ready >= of / 3 and not killed:
                killed.append(ready)
                workers[0].kill()

        try:
            with cluster(address) as elsewhere:
                learn_fleet(tasks, telling, there, on_a_cluster(elsewhere), done=kill_one)
        finally:
            for process in (*workers, scheduler):
                process.kill()
                process.wait(timeout=20)
        same = _digest(folder / "here") == _digest(folder / "there")
    targets.at_least("a worker killed: same bytes", float(same), 1.0, "", "cluster/same_bytes")
    targets.record("cluster/killed_after", killed[0] if killed else -1)
    targets.record("cluster/logs", count)


def _digest(folder: Path) -> str:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    told = [(str(path.relative_to(folder)), path.read_bytes().hex()) for path in files]
    return hashlib.sha256(json.dumps(told).encode()).hexdigest()


def main(argv: Sequence[str] | None = None) -> int:
    """Measure what the words ask for; return 1 where a target is missed."""
    keep = keeps()
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fleet")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--logs", type=int, default=LOGS)
    parser.add_argument("--hours", type=int, default=HOURS)
    parser.add_argument("--rows", type=int, default=ROWS)
    parser.add_argument("--cars", type=int, default=DRIVEN)
    options = parser.parse_args(argv)
    targets = Targets("fleet")
    if "speed" in options.only:
        speed(targets, options.jobs, options.logs)
    if "hours" in options.only:
        hours(targets, options.hours)
    if "store" in options.only:
        stored(targets, options.rows)
    if "merge" in options.only:
        merging(targets, max(options.cars // 4, 1))
    if "prior" in options.only:
        priors(targets, max(options.cars // 5, 1))
    if "watch" in options.only:
        watching(targets, options.cars, options.jobs)
    if "cluster" in options.only:
        losing_a_worker(targets, 24)
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main())
