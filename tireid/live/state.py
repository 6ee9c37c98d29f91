"""What is known of a car while it drives, at one instant, as it is sent on."""

import math
from dataclasses import asdict, dataclass
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np

from codegen.arrays import Array

LIVE, STORED = "live", "stored"  # whose numbers a state gives
SLIPS, REACH = 41, 0.2  # of the curves: points, and how far they reach at least [rad]


class Point(NamedTuple):
    """Mean slip [rad] and axle force by the motion [N], front and rear (2,), since a state."""

    slip: Array
    force: Array


@dataclass(slots=True)
class Counts:
    """What became of samples, and of packets that could not be read."""

    samples: Annotated[int, "that were taken"] = 0
    refused: Annotated[int, "that held no number, or one that no car reaches"] = 0
    lost: Annotated[int, "that are missing between two that came"] = 0
    doubled: Annotated[int, "of the time of the one before"] = 0
    late: Annotated[int, "of an earlier time than one before them"] = 0
    jumps: Annotated[int, "of the clock, at which the states began anew"] = 0
    unreadable: Annotated[int, "packets that hold no sample"] = 0


Number = float | None  # None where it is not known


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """What is known at one instant; rows are axles, front first; slip has the paper's sign."""

    t: Annotated[float, "time of the newest sample, by its clock [s]"]
    age: Annotated[float, "of the newest sample [s]"]
    valid: Annotated[bool, "whether the tires of this drive may be trusted now"]
    reason: Annotated[str, "why not; empty where they may"]
    origin: Annotated[str, "which tires are given: live, or stored"]
    alarm: Annotated[str, "what the driver should know at once; empty: nothing"]
    slip: Annotated[Array, "slip angles of the curves (41,) [rad]"]
    force: Annotated[Array, "axle forces at these (2, 41) [N]"]
    force_sd: Annotated[Array, "their standard deviations (2, 41) [N]"]
    known_slip: Annotated[Array, "slip up to which an axle is known (2,) [rad]"]
    stiffness: Annotated[Array, "cornering stiffness (2,) [N/rad]"]
    stiffness_sd: Annotated[Array, "its standard deviation (2,) [N/rad]"]
    grip: Annotated[Array, "largest force (2,) [static axle loads]"]
    grip_sd: Annotated[Array, "its standard deviation (2,) [static axle loads]"]
    understeer: Annotated[float, "understeer gradient at small a_y [rad s²/m]"]
    understeer_sd: Annotated[float, "its standard deviation [rad s²/m]"]
    a_y_limit: Annotated[float, "largest a_y of steady turning [m/s²]"]
    a_y_limit_sd: Annotated[float, "its standard deviation [m/s²]"]
    friction: Annotated[Number, "of the road, over that of the reference tires [-]"]
    friction_since: Annotated[Number, "time of its last change [s]"]
    side_slip: Annotated[Number, "atan2(v_y, v_x) at the center of gravity [rad]"]
    side_slip_sd: Annotated[Number, "its standard deviation [rad]"]
    steering_zero: Annotated[float, "today, added to what the steering reads [rad]"]
    steering_zero_sd: Annotated[float, "its standard deviation [rad]"]
    v_y_bias: Annotated[Number, "today, taken off what v_y reads [m/s]"]
    v_y_bias_sd: Annotated[Number, "its standard deviation [m/s]"]
    point: Annotated[Point | None, "mean slip [rad] and force [N] since the last state"]
    counts: Annotated[Counts, "what became of the samples"]

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words, ready for JSON; None where nothing is known."""
        return {name: _plain(getattr(self, name)) for name in self.__slots__}

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Return the JSON schema of `to_dict`, draft 2020-12; units are in the descriptions."""
        return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_schema(cls)}


def _plain(value: Any) -> Any:
    if isinstance(value, Counts):
        return asdict(value)
    if isinstance(value, Point):
        return {name: _plain(both) for name, both in value._asdict().items()}
    if isinstance(value, np.ndarray):
        if np.isfinite(value).all():
            return value.tolist()
        value = value.tolist()
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _schema(of: type) -> dict[str, Any]:
    """Return the schema of a dataclass whose fields say what they are."""
    fields = get_type_hints(of, include_extras=True)
    properties = {}
    for name, (kind, meaning) in ((name, get_args(one)) for name, one in fields.items()):
        number: dict[str, Any] = {"type": ["number", "null"]}
        row = {"type": "array", "items": number}
        pair = {"type": ["object", "null"], "properties": {"slip": row, "force": row}}
        given = {
            float: number, Number: number, bool: {"type": "boolean"},
            int: {"type": "integer"}, str: {"type": "string"}, Point | None: pair,
            Array: {"type": "array", "items": row} if "(2, 41)" in meaning else row,
        }  # fmt: skip
        known = _schema(kind) if kind is Counts else given[kind]
        properties[name] = {**known, "description": meaning}
    return {
        "title": of.__name__,
        "type": "object",
        "properties": properties,
        "required": list(properties),
    }
