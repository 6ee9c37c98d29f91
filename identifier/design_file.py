"""A design as a TOML file: design.toml, read strictly and written with its units."""

import json
import math
from dataclasses import fields
from pathlib import Path
from typing import Any

from identifier.design import Design
from identifier.driving import Driving
from identifier.gains import Gains
from identifier.network import Network
from models.doors import Table, read_toml

COMMENTS = {
    "law": "integral | instantaneous | pi_lead",
    "input_source": "the state that the network reads: measured | estimated",
    "integrator": "euler | rk4",
    "dt": "s",
    "force_unit": "N, the unit U of forces in the gains",
    "min_speed": "m/s, below it learning rests",
    "seed": "of the initial weights",
    "A_d": "1/s, by rows, Hurwitz",
    "forgetting": "1/s, lambda",
    "eta_W": "1/s^4 (instantaneous: 1/s^3)",
    "eta_V": "1/(U^2 s^4) (instantaneous: 1/(U^2 s^3))",
    "rho_W": "1/(U s^2)",
    "rho_V": "1/(U s^2)",
    "W_max": "U, projection of W (inf: none)",
    "V_max": "projection of V (inf: none)",
    "W_free": "U, dead zone of the leakage of W (0: all of W leaks, the paper's)",
    "V_free": "dead zone of the leakage of V (0: all of V leaks, the paper's)",
    "lead": "s, tau of pi_lead",
    "hidden": "units",
    "inputs": "what the network reads",
    "scale": "divisors of the inputs, SI",
    "v_x": "m/s, give or take 5 %",
    "slip": "rad, largest slip angle of an axle",
    "friction": "largest of the road",
    "bandwidth": "Hz, highest frequency of the steering",
    "noise_v_x": "m/s, largest error of the sensor",
    "noise_v_y": "m/s, largest error of the sensor",
    "noise_r": "rad/s, largest error of the sensor",
    "noise_delta": "rad, largest error of the sensor",
}


class DesignFileError(ValueError):
    """A file does not hold a design; the message names file, key and rule."""


def read_design(path: Path) -> Design:
    """Read a design.

    Parameters
    ----------
    path : TOML with the keys of `Design`, and tables [gains], [network] and, where the conditions
        of driving are declared, [driving].

    Raises
    ------
    DesignFileError
        One line with file, key and rule.
    """
    try:
        data = read_toml(path, DesignFileError)
    except OSError as error:
        raise DesignFileError(f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    inner = {name: data.pop(name, None) for name in TABLES}
    gains, network, driving = (
        None if part is None else Table(part, f"{path}: ", DesignFileError, f"{name}.").record(cls)
        for (name, part), cls in zip(inner.items(), (Gains, Network, Driving), strict=True)
    )
    values = Table(data, f"{path}: ", DesignFileError).record(Design, skip=TABLES)
    if gains is None:
        raise DesignFileError(f"{path}: the table [gains] is missing")
    try:
        return Design(
            gains=Gains(**gains),
            network=Network(**(network or {})),
            driving=None if driving is None else Driving(**driving),
            **values,
        )
    except ValueError as error:
        raise DesignFileError(f"{path}: {error}") from None


def design_text(design: Design) -> str:
    """Return a design as TOML that `read_design` reads back exactly.

    Parameters
    ----------
    design : the design.
    """
    lines = [_line(design, field.name) for field in fields(Design) if field.name not in TABLES]
    for name in TABLES:
        record = getattr(design, name)
        if record is None:
            continue
        lines += ["", f"[{name}]", *(_line(record, field.name) for field in fields(record))]
    return "\n".join(lines) + "\n"


TABLES = ("gains", "network", "driving")


def _line(record: Any, name: str) -> str:
    return f"{name} = {_toml(getattr(record, name))}  # {COMMENTS[name]}"


def _toml(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(item) for item in value)}]"
    if isinstance(value, float):
        return "inf" if math.isinf(value) else repr(float(value))
    return json.dumps(value)
