"""The commands of tireid, in the order in which a person meets them.

Each lies in a module of its name, `tireid.commands.NAME`, which is imported when the command is
named: the list alone costs nothing. There `declare` makes its parser, and `run` runs it. An
installed distribution adds commands by entry points of the group `tireid.commands`: a name and a
module with `add_parser`, whose docstring begins with one line of help. Fleets come in that way.
"""

import ast
from collections.abc import Mapping
from functools import partial
from importlib import import_module
from importlib.abc import InspectLoader
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from typing import Any, cast

from codegen.plugins import installed

COMMANDS: Mapping[str, str] = {
    "demo": "demonstration on the built-in car, with a report",
    "sample": "an example log, driven by the built-in car",
    "init": "a commented vehicle file to fill in",
    "channels": "channels of a log, with unit, rate and probable signal; writes a log.toml",
    "doctor": "faults of a log or of its car's file, and a log.toml that repairs them",
    "plan": "maneuvers ranked by what they tell of the tires",
    "identify": "tire curves from a log, with error bars and a verdict",
    "live": "tires, side slip and alarm while the car drives: a page, Foxglove, MCAP",
    "predict": "axle forces of another drive by stored tire curves, and their error",
    "compare": "all methods on the same logs, side by side",
    "check": "what is proven of an identifier: limits, margins, bounds; or its gains, designed",
    "export": "C for a microcontroller, FMU and ONNX for simulators",
    "emit": "a stored tire as other tools read it: .tir, g-g-v, slipx, understeer gradient",
    "drive": "steer a car along a path at the limit of grip, on the identified tires",
    "lap": "how fast identified tires let their car go along a path: speed, lap time, limits",
    "paper": "Tables I and II of the paper (Hong and Choi) beside ours, over many seeds",
}

GROUP = "tireid.commands"  # of entry points

# Exit codes: how a command ends, for the shell.
DONE = 0
FAILS = 1  # a check that was asked for fails
BAD_INPUT = 2
NOT_VALID = 3  # an answer that is not to be trusted; --accept makes it 0
NOT_TOLD = 74  # EX_IOERR of sysexits.h: all was done, but standard output could not be written
INTERRUPTED = 130


def added() -> list[str]:
    return [name for name in installed(GROUP) if name not in COMMANDS]


def summary(name: str) -> str:
    """Return a line on an installed command, of its module's docstring; the module is not run."""
    module = installed(GROUP)[name].module
    try:
        source = cast(InspectLoader, cast(ModuleSpec, find_spec(module)).loader).get_source(module)
        text = ast.get_docstring(ast.parse(source or "")) or ""
    except Exception as error:  # of another's code
        text = f"cannot be imported: {' '.join(str(error).split())}"
    return text.partition("\n")[0].rstrip(".").lower()


def add_command(name: str, commands: Any) -> None:
    """Add one command with all its options to the parser.

    Raises
    ------
    ValueError
        Where a distribution's command cannot be imported.
    """
    if name in COMMANDS:
        module = import_module(f"tireid.commands.{name}")
        module.declare(partial(commands.add_parser, name, help=COMMANDS[name]))
        commands.choices[name].set_defaults(run=module.run)
        return
    point = installed(GROUP)[name]
    try:
        add_parser = point.load().add_parser
    except Exception as error:  # of another's code
        reason = " ".join(str(error).split())
        raise ValueError(f"command {name} ({point.value}) cannot be imported: {reason}") from error
    add_parser(commands)
