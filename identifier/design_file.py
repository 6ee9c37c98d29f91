"""A design as a TOML file: design.toml, read strictly and written with its units."""

import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from identifier.design import Design
from identifier.driving import Driving
from identifier.gains import Gains
from identifier.network import Network

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
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise DesignFileError(f"{path}: cannot be read as TOML: {error}") from None
    try:
        gains = _record(data.pop("gains", {}), Gains, "gains.")
        network = _record(data.pop("network", {}), Network, "network.")
        stored = data.pop("driving", None)
        driving = None if stored is None else Driving(**_record(stored, Driving, "driving."))
        values = _record(data, Design, "", skip=TABLES)
        return Design(gains=Gains(**gains), network=Network(**network), driving=driving, **values)
    except ValueError as error:
        raise DesignFileError(f"{path}: {error}") from None


def _record(table: Any, cls: type, where: str, skip: tuple[str, ...] = ()) -> dict[str, Any]:
    """Check the keys and types of a table against a dataclass; lists become tuples."""
    if not isinstance(table, Mapping):
        raise DesignFileError(f"{where.rstrip('.')} must be a table")
    known = {field.name: field for field in fields(cls) if field.name not in skip}
    for key in table:
        if key not in known:
            raise DesignFileError(f"{where}{key} is unknown, known are {', '.join(known)}")
    for key, field in known.items():
        if key not in table and field.default is MISSING and field.default_factory is MISSING:
            raise DesignFileError(f"{where}{key} is missing")
    return {key: _value(table[key], f"{where}{key}", known[key].type) for key in table}


def _value(value: Any, name: str, kind: Any) -> Any:
    if isinstance(value, list):
        return tuple(_value(item, name, None) for item in value)
    wants_text = kind in (str, "str")
    if kind is not None and wants_text != isinstance(value, str):
        raise DesignFileError(f"{name} must be {'a text' if wants_text else 'a number'}: {value!r}")
    if isinstance(value, bool) or (kind in (int, "int") and not isinstance(value, int)):
        raise DesignFileError(f"{name} must be a whole number: {value!r}")
    return float(value) if kind in (float, "float") else value


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
