"""`tireid export DIR`: the identifier as clean C, and as FMU and ONNX."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from identifier.export.package import Package
from identifier.method import Method
from identifier.methods import DEFAULT, METHODS, REFERENCE, continuing, load_model, make_method
from identifier.paper.design import read_design
from identifier.tire_model import TireModel
from models.vehicle import Vehicle, sedan
from mpc.export.package import mpc_readme
from mpc.export.pair import build_pair
from mpc.export.processor import measure_mpc, mpc_figures_text, time_here, with_mpc_figures
from mpc.realtime import NoCompilerError
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


def _vehicle(path: Path | None, start: TireModel | None) -> Vehicle:
    if path is not None:
        return Vehicle.from_toml(path)
    return sedan() if start is None else start.vehicle


def _method(options: argparse.Namespace, vehicle: Vehicle, start: TireModel | None) -> Method:
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


# `tireid export DIR --mpc`: the tracker beside the identifier, and a car driven by both.

TRACKER = "mpc"  # folder of the package; that of the identifier is `identifier`


def write_tracker(folder: Path, package: Package, *, single: bool) -> list[str]:
    """Write the tracker and what joins it with the identifier; return what to say about it.

    Parameters
    ----------
    folder : where the identifier lies in a folder of that name.
    package : of the identifier.
    single : whether float is the default precision.

    Raises
    ------
    ValueError
        Where what the method learns cannot be handed over, or there is no C compiler.
    """
    try:
        pair = build_pair(package, single=single)
    except NoCompilerError as error:
        raise ValueError(f"--mpc: {error}") from error
    tracker = pair.tracker
    costs, times = measure_mpc(tracker), time_here(tracker)
    manifest = f"{tracker.name}.json"
    texts = {**tracker.files, "README.md": mpc_readme(tracker, mpc_figures_text(costs, times))}
    texts[manifest] = with_mpc_figures(texts[manifest], costs)
    _write(folder, pair.files)
    _write(folder / TRACKER, texts)
    return [
        *(
            f"{cost.processor}, {'float' if cost.single else 'double'}: {tracker.name} takes "
            f"{cost.replay.instructions} instructions a step, {cost.flash} B flash, "
            f"{cost.replay.state + cost.replay.params + cost.replay.work} B RAM, "
            f"{cost.replay.stack} B stack"
            for cost in costs
        ),
        f"this machine: {tracker.name} takes {times.median:.0f} us a step, hash "
        f"{tracker.about['hash']}",
    ]


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
