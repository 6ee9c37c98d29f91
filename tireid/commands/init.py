"""`tireid init car.toml`: a vehicle file to fill in, with units and where to find each number."""

import argparse
from pathlib import Path
from typing import Any

from models.files import write_atomically
from models.vehicle import vehicle_template
from tireid.commands.options import add_force, require_toml
from tireid.output import require_free
from tireid.progress import say


def declare(new: Any) -> None:
    parser = new(
        description="Write a commented vehicle file: what is needed, its unit and where to find "
        "it; yaw inertia and cornering stiffnesses may be left out and are estimated then; "
        "[chassis], which only a simulated car needs, is there behind comment signs.",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="file to write, .toml")
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    require_toml(options.file)
    require_free(options.file, force=options.force)
    write_atomically(options.file, vehicle_template())
    say(f"wrote {options.file}: replace its numbers by those of your car")
