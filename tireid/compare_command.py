"""`tireid compare LOG [LOG ...] --vehicle FILE --out DIR`: methods side by side, fairly tuned."""

import argparse
import os
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from identifier.defaults import default_design
from identifier.frozen_method import FrozenMethod
from identifier.method import Method
from identifier.methods import METHODS
from models.doors import require_few
from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from tireid.cluster import cluster
from tireid.commands import COMMANDS
from tireid.compare_results import comparison_text, write_comparison
from tireid.compare_study import run_comparison
from tireid.compare_table import pair_tables
from tireid.inputs import read_log
from tireid.network_option import add_network_arguments, network_model
from tireid.output import output_folder
from tireid.plant_drives import plant_recordings
from tireid.progress import Stopwatch, say, tell

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
    model = network_model(options, vehicle, default_design(vehicle).min_speed)
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
