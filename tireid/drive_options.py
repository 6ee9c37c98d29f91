"""Words of `tireid drive` that are more than a name: how fast, and where the road is slippery."""

import math
import re
from typing import NamedTuple

from models.faults import SIZED, FaultError, SensorFault
from mpc.loop import CarSensors, FaultySensors

PERCENT, METERS, KILOMETERS = "%", "m/s", "km/h"
PLAIN = 1.5  # a number without a unit up to here is a share of the grip


class SpeedWish(NamedTuple):
    """How fast to drive: a share of the grip, or a speed [m/s]; one of them is None."""

    share: float | None
    speed: float | None


def parse_speed(text: str) -> SpeedWish:
    """Return what --speed says.

    Parameters
    ----------
    text : 90% or 0.9 of the grip, 17m/s or 60km/h.

    Raises
    ------
    ValueError
        Where it is none of these, or not a speed for a car.
    """
    found = re.fullmatch(r"\s*([-+.\deE]+?)\s*(%|m/s|km/h)?\s*", text)
    try:
        value = float(found[1]) if found else math.nan
    except ValueError:
        value = math.nan
    unit = found[2] if found else None
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"--speed wants a share of the grip or a speed (90%, 17m/s), not {text!r}")
    if unit is None and value > PLAIN:
        raise ValueError(f"--speed {text} has no unit: write {text}%, {text}m/s or {text}km/h")
    if unit in (METERS, KILOMETERS):
        speed = value / (3.6 if unit == KILOMETERS else 1.0)
        if not 3.0 <= speed <= 100.0:
            raise ValueError(f"--speed must be 3 to 100 m/s, it is {speed:.3g} m/s")
        return SpeedWish(None, speed)
    share = value / (100.0 if unit == PERCENT else 1.0)
    if not 0.05 <= share <= PLAIN:
        raise ValueError(f"--speed must be 5 to 150 % of the grip, it is {100.0 * share:.3g} %")
    return SpeedWish(share, None)


def parse_drop(text: str) -> tuple[float, float]:
    """Return the place [m] and the friction from there on [-] of --mu-drop S:MU.

    Parameters
    ----------
    text : such as 60:0.5.

    Raises
    ------
    ValueError
        Where it is not such a pair, or the numbers are not those of a road.
    """
    place, colon, friction = text.partition(":")
    try:
        s, mu = float(place), float(friction)
    except ValueError:
        s = mu = math.nan
    if not colon or math.isnan(s) or math.isnan(mu):
        raise ValueError(f"--mu-drop wants S:MU, arc length [m] and friction, not {text!r}")
    if not (math.isfinite(s) and s >= 0.0):
        raise ValueError(f"--mu-drop: the place must not be negative, it is {s:g} m")
    return s, require_friction("--mu-drop", mu)


def parse_fault(text: str) -> SensorFault:
    """Return what --fault says of a sensor.

    Parameters
    ----------
    text : CHANNEL:KIND:START:DURATION[:SIZE], such as v_y:biased:3:inf:0.5.

    Raises
    ------
    ValueError
        Where it is not of that form, or not a fault that a sensor of the loop can have.
    """
    words = text.split(":")
    try:
        channel, kind, *numbers = words
        start, duration, *size = map(float, numbers)
        (most,) = size or [0.0]
    except ValueError:
        raise ValueError(
            f"--fault wants CHANNEL:KIND:START:DURATION[:SIZE], times in s, not {text!r}"
        ) from None
    if kind in SIZED and not size:
        raise ValueError(f"--fault {text}: {kind} needs a size")
    try:
        fault = SensorFault(channel=channel, kind=kind, start=start, duration=duration, size=most)
        FaultySensors(CarSensors(), [fault])  # refuses what is no channel
    except FaultError as error:
        raise ValueError(f"--fault {text}: {error}") from None
    return fault


def require_friction(word: str, mu: float) -> float:
    """Return a friction over that of the tire's measurement, if a road can have it.

    Parameters
    ----------
    word : that it was given by.
    mu : the friction [-].

    Raises
    ------
    ValueError
        Where no road has it.
    """
    if not 0.05 <= mu <= 1.5:
        raise ValueError(f"{word}: friction must be 0.05 to 1.5, it is {mu:g}")
    return mu
