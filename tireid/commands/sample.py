"""`tireid sample LOG.csv`: a drive to learn from, of the built-in plant, where there is no log."""

import argparse
from pathlib import Path
from typing import Any

from models.recordings import write_recording
from tireid.commands.options import add_force, add_seed, add_vehicle, read_vehicle, seed_of
from tireid.driving.learn import sample_recording
from tireid.output import require_free
from tireid.progress import say


def declare(new: Any) -> None:
    parser = new(
        description="Write the sensor signals of a simulated car on an open field, steered at "
        "random and ever harder until it slides, with the true axle forces: a log for tireid "
        "identify.",
    )
    parser.add_argument("log", type=Path, metavar="LOG", help="file to write, .csv or .csv.gz")
    add_vehicle(parser)
    parser.add_argument(
        "--car", type=Path, metavar="FILE", help="also write the car as TOML, for --vehicle"
    )
    add_seed(parser, "steering and noise")
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    if not options.log.name.lower().endswith((".csv", ".csv.gz")):
        raise ValueError(f"{options.log}: the name must end in .csv or .csv.gz")
    for path in filter(None, (options.log, options.car)):
        require_free(path, force=options.force)
    vehicle = read_vehicle(options)
    recording = sample_recording(vehicle, seed=seed_of(options))
    write_recording(recording, options.log)
    say(f"wrote {options.log}: {len(recording)} samples, {recording.duration:.1f} s")
    if options.car is not None:
        vehicle.to_toml(options.car, overwrite=options.force)
        say(f"wrote {options.car}: {vehicle.name}")
