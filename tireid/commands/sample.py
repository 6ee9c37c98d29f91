"""`tireid sample LOG.csv`: a drive to learn from, of the built-in plant, where there is no log."""

import argparse
from pathlib import Path
from typing import Any

from models.recordings import write_recording
from models.vehicle import Vehicle, sedan
from tireid.commands import COMMANDS
from tireid.driving import sample_recording
from tireid.output import OutputError
from tireid.progress import say


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "sample",
        help=COMMANDS["sample"],
        description="Write what the sensors of a simulated car see on an open field, steered at "
        "random and ever harder until it slides, with the true axle forces: a log for tireid "
        "identify.",
    )
    parser.add_argument("log", type=Path, metavar="LOG", help="file to write, .csv or .csv.gz")
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE", help="car as TOML with [chassis] (the sedan)"
    )
    parser.add_argument(
        "--car", type=Path, metavar="FILE", help="also write the car as TOML, for --vehicle"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of steering and noise (0)"
    )
    parser.add_argument("--force", action="store_true", help="replace the files if they exist")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run the command.

    Parameters
    ----------
    options : parsed arguments.
    """
    if options.seed < 0:
        raise ValueError(f"--seed must not be negative, it is {options.seed}")
    if not options.log.name.lower().endswith((".csv", ".csv.gz")):
        raise ValueError(f"{options.log}: the name must end in .csv or .csv.gz")
    for path in filter(None, (options.log, options.car)):
        if path.exists() and not options.force:
            raise OutputError(f"{path} exists: --force replaces it")
    vehicle = sedan() if options.vehicle is None else Vehicle.from_toml(options.vehicle)
    recording = sample_recording(vehicle, seed=options.seed)
    write_recording(recording, options.log)
    say(f"wrote {options.log}: {len(recording)} samples, {recording.duration:.1f} s")
    if options.car is not None:
        vehicle.to_toml(options.car, overwrite=options.force)
        say(f"wrote {options.car}: {vehicle.name}")
