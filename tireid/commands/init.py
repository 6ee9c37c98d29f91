"""`tireid init car.toml`: a vehicle file to fill in, with units and where to find each number."""

import argparse
import re
import sys
from pathlib import Path
from typing import Any

from models.files import write_atomically
from models.vehicle import vehicle_template
from tireid.commands.options import add_force, require_toml
from tireid.output import require_free
from tireid.progress import say

SOURCES = {"weighed": 0.01, "data-sheet": 0.04}  # of l_f and l_r, and their doubt [wheelbases]


def declare(new: Any) -> None:
    parser = new(
        description="Write a commented vehicle file: what is needed, its unit and where to find "
        "it; yaw inertia and cornering stiffnesses may be left out and are estimated then; "
        "[chassis], which only a simulated car needs, is there behind comment signs.",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="file to write, .toml")
    parser.add_argument(
        "--center-of-gravity",
        choices=tuple(SOURCES),
        help="whether the axles were weighed or l_f and l_r are of a data sheet; the error bars of "
        "each axle follow; asked for on a terminal",
    )
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    require_toml(options.file)
    require_free(options.file, force=options.force)
    source, text = options.center_of_gravity or _asked(), vehicle_template()
    if source is not None:
        line = f"center_of_gravity_sd = {SOURCES[source]:g}"
        text = re.sub(r"(?m)^# center_of_gravity_sd = [\d.]+", line, text)
    write_atomically(options.file, text)
    say(f"wrote {options.file}: replace its numbers by those of your car")


def _asked() -> str | None:
    """Return what the user answers; None where nobody is asked, or the answer is another."""
    if not sys.stdin.isatty():
        return None
    say(f"Are l_f and l_r {' or '.join(SOURCES)} numbers? Enter leaves it open.")
    answer = sys.stdin.readline().strip().lower()
    return next((one for one in SOURCES if answer and one.startswith(answer)), None)
