"""What the sensors of a car can show at all: beyond it, and NaN, is no number of a sensor."""

from collections.abc import Mapping

LARGEST: Mapping[str, float] = {
    "X": 1e7,  # m: maps count up to the distance from the equator to a pole
    "Y": 1e7,
    "psi": 1e4,  # rad, turns counted
    "v_x": 300.0,  # m/s
    "v_y": 300.0,
    "r": 10.0,  # rad/s
    "delta": 2.0,  # rad
    "a_y": 500.0,  # m/s²: a crash
}


def is_shown(channel: str, value: float) -> bool:
    """Return whether a channel shows a number.

    Parameters
    ----------
    channel : one of `LARGEST`.
    value : in its SI unit.
    """
    return abs(value) <= LARGEST[channel]
