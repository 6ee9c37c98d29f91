"""The commands of tireid, in the order in which a person meets them.

Each lies in a module of its name, `tireid.commands.NAME` with `add_parser` and `run`, which is
imported when the command is named: the list alone costs nothing.
"""

import importlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "demo": "demonstration on the built-in car, with a report",
        "sample": "an example log, driven by the built-in car",
        "init": "a commented vehicle file to fill in",
        "channels": "channels of a log, with unit, rate and probable signal; writes a log.toml",
        "doctor": "faults of a log or of its car's file, and a log.toml that repairs them",
        "plan": "the most informative steering within an area",
        "identify": "tire curves from a log, with error bars and a verdict",
        "predict": "axle forces of a drive by a stored model, and their error",
        "compare": "all methods on the same logs, side by side",
        "fleet": "thousands of logs: identify, merge, prior for the next car, watch for changes",
        "check": "certificate of a design: margins, bounds, advice; or a design from a bandwidth",
        "export": "C for a microcontroller, FMU and ONNX for simulators",
        "drive": "steer a car along a path at the limit of grip, on the identified tires",
        "paper": "Tables I and II of the paper and ours, over many seeds",
    }
)

# Exit codes: how a command ends, told to the shell.
DONE = 0
FAILS = 1  # a check that was asked for fails
BAD_INPUT = 2
NOT_VALID = 3  # an answer that is not to be trusted; --accept makes it 0
NOT_TOLD = 74  # EX_IOERR of sysexits.h: all was done, but standard output could not be written
INTERRUPTED = 130


def add_command(name: str, commands: Any) -> None:
    """Add one command with all its options to the parser."""
    importlib.import_module(f"tireid.commands.{name}").add_parser(commands)
