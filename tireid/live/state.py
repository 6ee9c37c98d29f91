"""What is known of a car while it drives, at one instant, as it is sent on."""

import math
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array

LIVE, STORED = ORIGINS = ("live", "stored")
SLIP = np.linspace(0.0, 0.2, 41)  # [rad], at which curves are told


class Point(NamedTuple):
    """Means since the last state: slip, and axle force by the motion; front and rear each."""

    slip: tuple[float, float]
    force: tuple[float, float]


@dataclass(slots=True)
class Counts:
    """What became of the samples.

    Parameters
    ----------
    samples : that were taken.
    refused : that held no number, or one that no car reaches.
    lost : that are missing between two that came.
    doubled : of the time of the one before.
    late : of an earlier time than one before them.
    jumps : of the clock, at which the states began anew.
    unreadable : packets that could not be read.
    """

    samples: int = 0
    refused: int = 0
    lost: int = 0
    doubled: int = 0
    late: int = 0
    jumps: int = 0
    unreadable: int = 0


def _told(unit: str, meaning: str, kind: str = "number", size: int = 0) -> Any:
    """Return a field of a state, as the schema says it; size 2: front and rear; 41: of curves."""
    return field(metadata={"unit": unit, "meaning": meaning, "kind": kind, "size": size})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """What is known at one instant; arrays are of both axles, front first.

    None where a number is not known. Slip has the paper's sign: force rises with it.
    """

    t: float = _told("s", "time of the newest sample, by its own clock")
    age: float = _told("s", "of the newest sample")
    valid: bool = _told("-", "whether the tires of this drive may be trusted now", "boolean")
    reason: str = _told("-", "why not, in words; empty where they may", "string")
    origin: str = _told("-", "which tires are told: live, or stored ones", "string")
    alarm: str = _told("-", "what a driver should know at once; empty: nothing", "string")
    slip: Array = _told("rad", "slip angles of the curves", size=41)
    force: Array = _told("N", "axle force at these slips, a row an axle", size=82)
    force_sd: Array = _told("N", "its standard deviation", size=82)
    known_slip: Array = _told("rad", "slip up to which an axle is known", size=2)
    stiffness: Array = _told("N/rad", "cornering stiffness of an axle", size=2)
    stiffness_sd: Array = _told("N/rad", "its standard deviation", size=2)
    grip: Array = _told("static axle loads", "largest force of an axle", size=2)
    grip_sd: Array = _told("static axle loads", "its standard deviation", size=2)
    understeer: float = _told("rad s^2/m", "understeer gradient at small a_y")
    understeer_sd: float = _told("rad s^2/m", "its standard deviation")
    a_y_limit: float = _told("m/s^2", "lateral acceleration of steady turning at the limit")
    a_y_limit_sd: float = _told("m/s^2", "its standard deviation")
    friction: float | None = _told("-", "of the road, over that of the reference tires")
    friction_since: float | None = _told("s", "time at which it last changed")
    side_slip: float | None = _told("rad", "atan(v_y/v_x) at the center of gravity, left positive")
    side_slip_sd: float | None = _told("rad", "its standard deviation")
    steering_zero: float = _told("rad", "zero of the steering today, added to what is read")
    steering_zero_sd: float = _told("rad", "its standard deviation")
    v_y_bias: float | None = _told("m/s", "bias of v_y today, taken off what is read")
    v_y_bias_sd: float | None = _told("m/s", "its standard deviation")
    point: Point | None = _told("rad, N", "mean slip and force since the last state", "object")
    counts: Counts = _told("-", "what became of the samples", "object")

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words, ready for JSON; null where nothing is known."""
        return {one.name: _plain(getattr(self, one.name)) for one in fields(self)}

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Return the JSON schema (draft 2020-12) of `to_dict`; units stand in the descriptions."""
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": "tireid.State",
            "type": "object",
            "properties": {one.name: _property(one.metadata) for one in fields(cls)},
            "required": [one.name for one in fields(cls)],
        }


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        if np.isfinite(value).all():
            return value.tolist()
        return [_plain(one) for one in value.tolist()]
    if isinstance(value, list | tuple) and not hasattr(value, "_asdict"):
        return [_plain(one) for one in value]
    if isinstance(value, Point):
        return {name: _plain(both) for name, both in value._asdict().items()}
    if isinstance(value, Counts):
        return {one.name: getattr(value, one.name) for one in fields(value)}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _property(of: Any) -> dict[str, Any]:
    said = {"description": f"{of['meaning']} [{of['unit']}]"}
    if of["kind"] != "number":
        return {"type": [of["kind"], "null"] if of["kind"] == "object" else of["kind"], **said}
    number: dict[str, Any] = {"type": ["number", "null"]}
    row = {"type": "array", "items": number}
    if not of["size"]:
        return {**number, **said}
    if of["size"] == 2 * SLIP.size:
        return {"type": "array", "items": row, **said}
    return {**row, **said}
