"""`tireid compare LOG [LOG ...] --vehicle FILE --out DIR`: methods side by side, fairly tuned."""

import argparse
import importlib
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from identifier.compare.study import run_comparison
from identifier.compare.work import Map, source_digest
from identifier.defaults import paper_identifier
from identifier.method import Method
from identifier.methods import METHODS
from identifier.own_network import FrozenMethod
from models.recordings import Recording
from models.schema import require_few
from models.vehicle import Vehicle, sedan
from tireid.commands import COMMANDS
from tireid.commands.compare_results import comparison_text, pair_tables, write_comparison
from tireid.commands.demo_story import plant_recordings
from tireid.commands.options import add_network_arguments, network_model, read_log
from tireid.output import output_folder
from tireid.progress import Stopwatch, say, tell

# Work spread over a Dask cluster: the same functions, on as many machines as have workers.
#
# Every worker must have this very version of tireid, which is checked. Results come in any order. A
# worker that is lost is made good for by the scheduler.

PATIENCE = 30.0  # s that the scheduler and the first worker may take to answer
_ONE_AT_A_TIME = threading.Lock()  # CasADi's graphs must not be built by two threads of a worker


class ClusterError(OSError):
    """The cluster cannot be reached or cannot be used; one line that names its address."""


@contextmanager
def cluster(address: str) -> Iterator[Map]:
    """Yield a `map` whose work is done by the workers of a Dask scheduler; its order is any.

    Parameters
    ----------
    address : of the scheduler, as in "tcp://host:8786".

    Raises
    ------
    ClusterError
        Where the scheduler or a worker does not answer, or a worker has another version of tireid.
    ImportError
        Where Dask is not installed; the message names the extra.
    """
    try:
        dask: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise ImportError("--scheduler needs Dask: pip install 'tireid[cluster]'") from error
    try:
        client = dask.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"{address}: no Dask scheduler answers there") from error
    try:
        _require_workers(client, address)
        yield partial(_map, dask, client)
    finally:
        client.close()


def _require_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise ClusterError(f"{address}: the scheduler has no workers") from error
    try:
        versions = client.run(source_digest)
    except Exception as error:
        raise ClusterError(f"{address}: a worker cannot load tireid: {error}") from error
    other = sorted(worker for worker, digest in versions.items() if digest != source_digest())
    if other:
        raise ClusterError(f"{address}: worker {other[0]} has another version of tireid")


def _map(dask: Any, client: Any, work: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
    shared = client.scatter(work, broadcast=True, hash=False)  # once to each worker
    futures = [client.submit(_work_alone, shared, item, pure=False) for item in items]
    try:
        for future in dask.as_completed(futures, loop=client.loop):
            yield future.result()
            future.release()
    finally:
        client.cancel(futures)


def _work_alone(work: Callable[[Any], Any], item: Any) -> Any:
    with _ONE_AT_A_TIME:
        return work(item)


FEW_PAIRS = 4  # of recordings learnt on and replayed, all of which are printed


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "compare",
        help=COMMANDS["compare"],
        description="Learn on each recording, freeze at its end and replay on all of them, with "
        "every method; write compare.json, compare.csv, tables.txt and figures. Recordings need "
        "the true forces. Without a LOG the plant of the car drives slaloms, a step steer and a "
        "lane change with noisy sensors.",
        epilog=f"methods: {', '.join(METHODS)}",
    )
    parser.add_argument("logs", nargs="*", metavar="LOG[:RUN]", help="recordings with true forces")
    parser.add_argument("--vehicle", type=Path, metavar="FILE", help="car as TOML (the sedan)")
    parser.add_argument("--plant", action="store_true", help="drive the plant of the car as well")
    parser.add_argument(
        "--methods", nargs="+", action="extend", metavar="NAME", help="these only (all)"
    )
    parser.add_argument(
        "--sweep", type=int, default=0, metavar="N", help="try N random designs of each method"
    )
    parser.add_argument(
        "--floor",
        type=int,
        default=3,
        metavar="N",
        help="starts of each fit to the true forces (%(default)s; 0: none)",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        metavar="N",
        help="of sensor noise, sweep, floors, and the weights of networks; %(default)s",
    )
    parser.add_argument(
        "--workers",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (%(default)s)",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="do the sweep on the Dask cluster of this scheduler, as in tcp://host:8786",
    )
    parser.add_argument(
        "--columns",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME=COLUMN",
        help="as in tireid identify",
    )
    parser.add_argument(
        "--no-check", action="store_true", help="accept a log that contradicts physics"
    )
    add_network_arguments(parser, "compare with this network, which learns nothing")
    parser.add_argument(
        "--out", type=Path, default=Path("tireid-compare"), metavar="DIR", help="%(default)s"
    )
    parser.add_argument("--force", action="store_true", help="replace the folder if it exists")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run the command.

    Parameters
    ----------
    options : parsed arguments.
    """
    for name, least in (("sweep", 0), ("floor", 0), ("seed", 0), ("workers", 1)):
        if getattr(options, name) < least:
            raise ValueError(f"--{name} must be at least {least}, it is {getattr(options, name)}")
    for name, limit in (("sweep", "runs"), ("floor", "runs"), ("workers", "processes")):
        require_few(ValueError, f"--{name}", getattr(options, name), limit, limit)
    names = list(dict.fromkeys(options.methods or METHODS))
    unknown = [name for name in names if name not in METHODS]
    if unknown:
        raise ValueError(f"--methods {unknown[0]} is none of {', '.join(METHODS)}")
    if options.scheduler and not options.sweep:
        raise ValueError("--scheduler does sweeps only: say how many designs with --sweep N")
    if options.logs and options.vehicle is None:
        raise ValueError("--vehicle FILE is needed with a LOG: the car that drove it")
    watch = Stopwatch()
    there = cluster(options.scheduler) if options.scheduler else nullcontext()
    vehicle = sedan() if options.vehicle is None else Vehicle.from_toml(options.vehicle)
    others = _network(options, vehicle)
    with output_folder(options.out, force=options.force) as folder, there as elsewhere:
        comparison = run_comparison(
            names,
            vehicle,
            _recordings(options, vehicle),
            seed=options.seed,
            designs=options.sweep,
            starts=options.floor,
            workers=options.workers,
            progress=say,
            elsewhere=elsewhere,
            others=others,
        )
        write_comparison(folder, comparison)
        told = [comparison_text(comparison)]
        if len(comparison.names) ** 2 <= FEW_PAIRS:
            told.append(pair_tables(comparison))
    tell("\n".join(told))
    say(f"wrote {options.out}/ in {watch.seconds:.0f} s")


def _network(options: argparse.Namespace, vehicle: Vehicle) -> dict[str, Method]:
    """Return the network of --network as a method by the name of its file."""
    model = network_model(options, vehicle, paper_identifier(vehicle).min_speed)
    return {} if model is None else {options.network.name: FrozenMethod(model=model)}


def _recordings(options: argparse.Namespace, vehicle: Vehicle) -> list[Recording]:
    recordings = [
        read_log(log, vehicle, columns=options.columns, check=not options.no_check)
        for log in options.logs
    ]
    if options.plant or not options.logs:
        say(f"driving the plant of {vehicle.name} with noisy sensors")
        recordings += plant_recordings(vehicle, np.random.default_rng(options.seed))
    return recordings
