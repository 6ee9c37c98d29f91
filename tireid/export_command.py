"""`tireid export DIR`: the identifier as clean C, and as FMU and ONNX."""

import argparse
from pathlib import Path
from typing import Any

from identifier.design_file import read_design
from identifier.method import FrozenModel, Method
from identifier.methods import DEFAULT, METHODS, REFERENCE, continuing, make_method
from identifier.model_file import load_model
from models.vehicle import Vehicle, sedan
from tireid.commands import COMMANDS
from tireid.exporting import export_method
from tireid.progress import say


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "export",
        help=COMMANDS["export"],
        description="Write a C99 package to DIR: library, example, self-test, CMakeLists.txt, "
        "README with its cost on Arm processors where the tools are there, and a JSON file of all "
        "that went in.",
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder to write")
    parser.add_argument("--vehicle", type=Path, metavar="FILE", help="car as TOML (the sedan)")
    parser.add_argument(
        "--law", choices=METHODS, metavar="NAME", help=f"{', '.join(METHODS)} (default: {DEFAULT})"
    )
    parser.add_argument(
        "--paper", action="store_true", help=f"the paper's network and law: --law {REFERENCE}"
    )
    parser.add_argument(
        "--design", type=Path, metavar="FILE", help="design.toml, in place of --law"
    )
    parser.add_argument(
        "--weights", type=Path, metavar="FILE", help="begin with these, from tireid identify"
    )
    parser.add_argument("--name", default="tireid", help="prefix of every symbol (%(default)s)")
    parser.add_argument("--single", action="store_true", help="float unless the build says double")
    parser.add_argument("--fmu", action="store_true", help="also FMUs 2.0 and 3.0, Co-Simulation")
    parser.add_argument("--onnx", action="store_true", help="also the model, frozen, as ONNX")
    parser.add_argument(
        "--mpc", action="store_true", help="also a tracker that steers by what is learnt"
    )
    parser.add_argument("--force", action="store_true", help="replace the folder if it exists")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run the command.

    Parameters
    ----------
    options : parsed arguments.
    """
    start = None if options.weights is None else load_model(options.weights)
    vehicle = _vehicle(options.vehicle, start)
    method = _method(options, vehicle, start)
    exported = export_method(
        method,
        vehicle,
        start,
        options.folder,
        name=options.name,
        single=options.single,
        fmu=options.fmu,
        onnx=options.onnx,
        mpc=options.mpc,
        overwrite=options.force,
    )
    for line in str(exported).splitlines():
        say(line)


def _vehicle(path: Path | None, start: FrozenModel | None) -> Vehicle:
    if path is not None:
        return Vehicle.from_toml(path)
    return sedan() if start is None else start.vehicle


def _method(options: argparse.Namespace, vehicle: Vehicle, start: FrozenModel | None) -> Method:
    law = REFERENCE if options.paper else options.law
    if options.paper and (options.law or options.design):
        raise ValueError("--paper names the law already: give no --law or --design with it")
    if options.design is not None:
        if law is not None:
            raise ValueError(f"--law is for the default design: it stands in {options.design}")
        return read_design(options.design)
    if law is not None:
        return make_method(law, vehicle)
    return make_method(DEFAULT, vehicle) if start is None else continuing(start, vehicle)
