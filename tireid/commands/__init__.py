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
        "demo": "the whole story on the built-in car, with a report",
        "sample": "a log to learn from, driven by the built-in car, where there is none",
        "init": "a commented vehicle file to fill in",
        "channels": "what a log holds, what its channels probably are, and a log.toml that says so",
        "doctor": "what is wrong with a log or with its car's file, and a log.toml that mends it",
        "plan": "what to drive next: the steering that teaches most in the space there is",
        "identify": "learn tire forces from a recording, freeze the weights and test them",
        "predict": "axle forces of a drive by a stored model, and their error",
        "compare": "learn, freeze and replay with every method, side by side",
        "fleet": "thousands of logs in one command: learn, merge, where the next car starts, watch",
        "check": "certificate of a design: margins, bounds, advice; or a design from a bandwidth",
        "export": "the identifier as clean C for a microcontroller, as FMU and ONNX for simulators",
        "drive": "steer a car along a path at the limit of grip, on the identified tires",
        "paper": "Tables I and II of the paper, beside ours, over many seeds",
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
