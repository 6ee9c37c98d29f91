"""How much files may hold and commands may ask for, as the environment raises or lowers it."""

import math
import os
from dataclasses import dataclass, fields

from codegen.errors import TireidError

VARIABLE = "TIREID_LIMITS"


class LimitError(TireidError, ValueError):
    """The limits that the environment asks for are none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InputLimits:
    """How much may be asked for. `TIREID_LIMITS="samples=1e9 megabytes=4e4"` raises limits.
    megabytes : of a log, unpacked; it is read piece by piece: 10 h at 1 kHz of 20 columns fit.
    path : samples of a path, rows of way-points.
    document : megabytes of a JSON, ONNX or tire file, or of way-points.
    values : numbers, texts, tables and lists in a JSON or TOML file.
    hidden : units of a network, whose code is compiled: 100 take ten seconds, 300 minutes.
    runs : designs, starts, seeds or random drives that one command is asked for.
    """

    megabytes: float = 16000.0
    samples: float = 1e8
    path: float = 4e5
    columns: float = 1e4
    block: float = 1000.0
    document: float = 32.0
    toml: float = 0.1
    line: float = 4000.0
    depth: float = 32.0
    values: float = 2e6
    hidden: float = 128.0
    hours: float = 1.0
    runs: float = 1e5
    processes: float = 256.0


def limits() -> InputLimits:
    """Return the limits, as the environment raises or lowers them."""
    known = [field.name for field in fields(InputLimits)]
    given: dict[str, float] = {}
    for word in os.environ.get(VARIABLE, "").replace(",", " ").split():
        name, _, number = word.partition("=")
        try:
            given[name] = float(number)
        except ValueError:
            given[name] = math.nan
        if name not in known or not given[name] > 0.0:
            from codegen.escape import displayed  # with all of that package: help does not need it

            raise LimitError(
                f"{VARIABLE} must hold NAME=NUMBER of {', '.join(known)}, not {displayed(word)}"
            )
    return InputLimits(**given)
