"""`tireid export DIR`: the identifier as clean C, and as FMU and ONNX."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from identifier.axle import AxleDesign
from identifier.axle.model import AxleModel
from identifier.defaults import default_design
from identifier.design_file import read_design
from identifier.export.figures import Cost, figures_text, measure, with_figures
from identifier.export.package import Package, build_package, readme
from identifier.method import CannotFreezeError, FrozenModel, Method
from identifier.methods import DEFAULT, METHODS, REFERENCE, make_method
from identifier.model_file import load_model
from identifier.network_model import NetworkModel
from models.vehicle import Vehicle, sedan
from tireid.output import output_folder
from tireid.progress import say

IDENTIFIER = "identifier"  # folder of the package where a tracker lies beside it


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "export",
        help="the identifier as clean C for a microcontroller, as FMU and ONNX for simulators",
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
    package = build_package(method, vehicle, start, name=options.name, single=options.single)
    with output_folder(options.folder, force=options.force) as folder:
        costs = measure(package)
        place = folder / IDENTIFIER if options.mpc else folder
        write_files(place, package, figures_text(costs), costs)
        told = _write_tracker(folder, package, options.single) if options.mpc else []
        if options.fmu:
            _write_fmus(folder, package)
        if options.onnx:
            _write_onnx(folder, method, vehicle, package, start)
    for cost in costs:
        kind = "float" if cost.single else "double"
        say(
            f"{cost.processor}, {kind}: {cost.replay.instructions} instructions a step, "
            f"{cost.flash} B flash, {cost.ram} B RAM, {cost.replay.stack} B stack"
        )
    for line in told:
        say(line)
    say(f"wrote {options.folder}/, hash {package.about['hash']}")


def write_files(folder: Path, package: Package, figures: str, costs: Sequence[Cost] = ()) -> None:
    """Write a package.

    Parameters
    ----------
    folder : an empty folder.
    package : the package.
    figures : what it costs, as Markdown.
    costs : what it costs, for the JSON file.
    """
    manifest = f"{package.folded.name}.json"
    texts = {**package.files, "README.md": readme(package, figures)}
    for path, text in {**texts, manifest: with_figures(texts[manifest], costs)}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")


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
    match start:
        case NetworkModel():
            return default_design(vehicle, network=start.network)
        case AxleModel():
            return AxleDesign.for_vehicle(vehicle)
        case None:
            return make_method(DEFAULT, vehicle)
        case _:
            raise ValueError(
                f"{options.weights} holds a {type(start).__name__}, from which no method can go "
                "on learning"
            )


def _write_tracker(folder: Path, package: Package, single: bool) -> list[str]:
    from tireid.export_mpc import write_tracker

    return write_tracker(folder, package, single=single)


def _write_fmus(folder: Path, package: Package) -> None:
    from identifier.export.fmu import export_fmu

    name = package.folded.name
    export_fmu(package.folded, folder / f"{name}_fmi2.fmu", 2)
    export_fmu(package.folded, folder / f"{name}_fmi3.fmu", 3)


def _write_onnx(
    folder: Path, method: Method, vehicle: Vehicle, package: Package, start: FrozenModel | None
) -> None:
    from identifier.export.onnx_export import export_onnx

    try:
        model = start or method.frozen(vehicle, package.folded.carry)
    except CannotFreezeError as error:
        raise ValueError(f"--onnx: {error}") from error
    export_onnx(model, folder / f"{package.folded.name}.onnx")
