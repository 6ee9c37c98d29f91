"""`tireid emit MODEL`: a stored tire as other tools read it."""

import argparse
from pathlib import Path
from typing import Any

from tireid.commands import options as shared
from tireid.emitting import WANTED, emit
from tireid.output import text_table
from tireid.progress import say, tell


def declare(new: Any) -> None:
    parser = new(
        description=f"Write MODEL as other tools read it. Ask for one or more of {WANTED}; all are "
        "written, or none.",
    )
    parser.add_argument("model", type=Path, metavar="MODEL", help="weights.json, as identified")
    files = {
        "--tir FILE": "tire property files (PAC2002): car.tir gives car_front.tir and car_rear.tir",
        "--slipx DIR": "folder of a car of 1:10 for slipx 0.2.0",
        "--ggv FILE": "speed, largest a_x and a_y, for raceline planners; at the lower end of the "
        "band",
        "--steady FILE": "lateral acceleration of steady turning over steering angle and speed",
        "--out FILE": "with --understeer: also write it as CSV",
    }
    shared.add_options(parser, Path, files)
    text = "print the understeer gradient over speed and a_y, with its standard deviation"
    shared.add_options(parser, bool, {"--understeer": text})
    shared.add_force(parser)


def run(options: argparse.Namespace) -> None:
    if options.out is not None and not options.understeer:
        raise ValueError("--out goes with --understeer: the other options name their files")
    if not (options.understeer or options.tir or options.slipx or options.ggv or options.steady):
        raise ValueError(f"nothing is asked for: add one or more of {WANTED}")
    shared.stored_model(options.model)  # warns where it is not valid
    emitted = emit(
        options.model,
        tir=options.tir,
        slipx=options.slipx,
        ggv=options.ggv,
        steady=options.steady,
        understeer=options.understeer if options.out is None else options.out,
        overwrite=options.force,
    )
    if emitted.understeer is not None:
        tell(text_table([line.split(",") for line in emitted.understeer.csv.splitlines()], ">>>>"))
    for path in emitted.files:
        say(f"wrote {path}")
