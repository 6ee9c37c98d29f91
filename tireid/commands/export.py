"""`tireid export`: the identifier as clean C, and as FMU and ONNX."""

import argparse
from typing import Any

from identifier.method import Method
from identifier.methods import LIVE, WITHOUT_V_Y, continuing
from identifier.tire_model import TireModel, load_model
from models.rules import require_within
from models.vehicle import Vehicle
from tireid.commands import COMMANDS
from tireid.commands import options as shared
from tireid.exporting import export
from tireid.progress import say
from tireid.verdicts import warn_of_stored


def add_parser(commands: Any) -> None:
    parser = commands.add_parser(
        "export",
        help=COMMANDS["export"],
        description="Write a C99 package: library, example, self-test, CMakeLists.txt, "
        "README with its cost on Arm processors where the tools are there, and a JSON file of all "
        "that went in.",
    )
    shared.add_vehicle(parser)
    shared.add_method(parser, LIVE)
    shared.add_weights(parser, "begin with it, as identified")
    parser.add_argument("--name", default="tireid", help="prefix of every symbol (%(default)s)")
    parser.add_argument("--single", action="store_true", help="float unless the build says double")
    parser.add_argument(
        "--with-a-y",
        action="store_true",
        help="a_y of an accelerometer is an input too, of a method that can go without it",
    )
    parser.add_argument(
        "--band",
        action="store_true",
        help="half the width of the 90 %% band around each force is an output too",
    )
    parser.add_argument("--fmu", action="store_true", help="also FMUs 2.0 and 3.0, Co-Simulation")
    parser.add_argument("--onnx", action="store_true", help="also the model, frozen, as ONNX")
    parser.add_argument(
        "--mpc", action="store_true", help="also a tracker that steers by what is learnt"
    )
    parser.add_argument(
        "--caution",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="of what is not known of the tires that the tracker of --mpc fears, from 0 to 1; a "
        "number of its parameters (%(default)g)",
    )
    shared.add_output(parser, "export")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    require_within(ValueError, 0.0, 1.0, **{"--caution": options.caution})
    if options.caution and not options.mpc:
        raise ValueError("--caution goes with --mpc: it is of the tracker")
    start = None if options.weights is None else load_model(options.weights)
    if options.weights is not None:
        warn_of_stored(options.weights)
    vehicle = _vehicle(options, start)
    method = _method(options, vehicle, start)
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


def _vehicle(options: argparse.Namespace, start: TireModel | None) -> Vehicle:
    if start is None or options.vehicle is not None:
        return shared.read_vehicle(options)
    shared.say_estimates(start.vehicle, options.weights)
    return start.vehicle


def _method(options: argparse.Namespace, vehicle: Vehicle, start: TireModel | None) -> Method:
    """Return the method that is asked for; else the one that goes on from the model."""
    v_y = options.method != WITHOUT_V_Y
    if start is None or (v_y and shared.method_is_given(options)):
        return shared.chosen_method(options, vehicle, online=True).method
    return continuing(start, vehicle, v_y=v_y)
