"""`tireid export`: the identifier as clean C, and as FMU and ONNX."""

import argparse
from typing import Any

from identifier.methods import LIVE, WITHOUT_V_Y, continuing
from models.rules import require_within
from tireid.commands import options as shared
from tireid.exporting import export
from tireid.progress import say


def declare(new: Any) -> None:
    parser = new(
        description="Write a C99 package: library, example, self-test, CMakeLists.txt, "
        "README with its cost on Arm processors where the tools are there, and a JSON file of all "
        "that went in.",
    )
    shared.add_vehicle(parser)
    shared.add_method(parser, LIVE)
    shared.add_weights(parser, "begin with it, as identified")
    shared.add_day(parser)
    parser.add_argument("--name", default="tireid", help="prefix of every symbol (%(default)s)")
    flags = {
        "--single": "float unless the build says double",
        "--with-a-y": "a_y of an accelerometer is an input too, of a method that can go without it",
        "--band": "half the width of the 90 %% band around each force is an output too",
        "--fmu": "also FMUs 2.0 and 3.0, Co-Simulation",
        "--onnx": "also the model, frozen, as ONNX",
        "--mpc": "also a tracker that steers by the identified tires",
    }
    shared.add_options(parser, bool, flags)
    text = (
        "share of the tires' uncertainty that the tracker of --mpc plans for, from 0 to 1; a "
        "number of its parameters (%(default)g)"
    )
    shared.add_options(parser, float, {"--caution SHARE": (0.0, text)})
    shared.add_output(parser, "export")


def run(options: argparse.Namespace) -> None:
    require_within(ValueError, 0.0, 1.0, **{"--caution": options.caution})
    if options.caution and not options.mpc:
        raise ValueError("--caution goes with --mpc: it is of the tracker")
    start = shared.model_of_day(options)
    vehicle = shared.read_vehicle(options, start)
    v_y = options.method != WITHOUT_V_Y
    if start is None or (v_y and shared.method_is_given(options)):
        _, method = shared.chosen_method(options, vehicle, online=True)
    else:  # the one that goes on from the model
        method = continuing(start, vehicle, v_y=v_y)
    exported = export(
        method,
        options.out,
        start=start,
        vehicle=vehicle,
        name=options.name,
        single=options.single,
        with_a_y=options.with_a_y,
        band=options.band,
        fmu=options.fmu,
        onnx=options.onnx,
        mpc=options.mpc,
        caution=options.caution,
        overwrite=options.force,
    )
    for line in str(exported).splitlines():
        say(line)
