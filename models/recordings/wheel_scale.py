"""How wheels roll, learnt where the speed over ground is logged beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.logs.clock import Raw
from models.logs.log import RecordingError
from models.logs.signals import QUANTITIES, WHEELS, Signal, quantity_of
from models.logs.units import SPEED, is_given
from models.recordings.wheels import RADII, Wheels

_STRAIGHT = 0.05  # [rad/s], largest yaw rate
_EVEN = 0.5  # [m/s²], largest acceleration
_FAST = 0.3  # of the speed that 5 % of the samples exceed: slower ones do not count
_LONG_ENOUGH = 2.0  # [s] of such driving, at least
_AGREES = 0.02  # of the median: farther off, a wheel slips
_SPREAD = 0.05  # between quartiles, as a share of the median, beyond which nothing is learnt
_SPEEDS = (0.8, 1.25)  # speed over ground per speed of a wheel, of one that shows a speed
_MOST = 200_000  # samples that are looked at


class Scale(NamedTuple):
    """Speed over ground per what a wheel shows.
    value : radius [m] of one that shows turns, factor [-] of one that shows a speed.
    """

    value: float
    turns: bool
    seconds: float


def wheel_factor(what: str, name: str, unit: str, wheels: Wheels) -> float:
    """Return what a wheel in SI, turns or a speed, is multiplied by to be a speed.

    Where no unit is written, a radius that is given says that the numbers are turns.
    """
    radius = wheels.radius_of(name)
    if not is_given(unit):
        return 1.0 if radius is None else radius
    if quantity_of(name, unit) == SPEED:
        return 1.0
    if radius is None:
        raise RecordingError(
            f"{what} is in {unit.strip()}, a rate of turns: give the radius of the wheels, in m, "
            "by [wheels] radius in a log.toml (--log FILE)"
        )
    return radius


def identified_scales(
    parts: Mapping[str, Sequence[Raw]], signals: Mapping[str, Signal], units: Mapping[str, str]
) -> dict[str, Scale]:
    """Return the scale of each wheel that v_x tells, by name.
    parts : by signal its channels in SI; v_x, wheels, and r where it is there.
    """
    t = parts["v_x"][0].t
    t = t[:: -(-t.size // _MOST)]

    def at(name: str) -> Array:
        one_clock = [np.interp(t, one.t, one.values) for one in parts[name]]
        return signals[name].value(one_clock, QUANTITIES[name])

    v_x, r = at("v_x"), at("r") if "r" in parts else np.zeros(t.size)
    found = {}
    for name in WHEELS:
        if name not in parts:
            continue
        given = _identified_scale(t, v_x, r, at(name))
        if given is None:
            continue
        value, seconds = given
        unit, (low, high) = units[name], _SPEEDS
        speed = low <= value <= high and (not is_given(unit) or quantity_of(name, unit) == SPEED)
        turns = not speed and (not is_given(unit) or quantity_of(name, unit) != SPEED)
        if speed or (turns and RADII[0] <= value <= RADII[1]):
            found[name] = Scale(value, turns, seconds)
    return found


def _identified_scale(t: Array, v_x: Array, r: Array, wheel: Array) -> tuple[float, float] | None:
    """Return the speed over ground per what a wheel shows, and the seconds that tell it.

    None where straight and even driving is too short, or does not agree on one number.
    t : time [s], (n,), rising.   v_x : speed over ground [m/s], (n,).   r : yaw rate [rad/s], (n,).
    wheel : what the wheel shows [rad/s or m/s], (n,).
    """
    step = float(np.median(np.diff(t)))
    half = max(1, round(0.25 / step))
    k = np.arange(t.size)
    low, high = np.maximum(k - half, 0), np.minimum(k + half, t.size - 1)
    even: NDArray[np.bool_] = np.abs(v_x[high] - v_x[low]) <= _EVEN * (t[high] - t[low])
    fast = np.abs(v_x) > _FAST * float(np.percentile(np.abs(v_x), 95))
    kept = even & fast & (np.abs(r) <= _STRAIGHT) & np.isfinite(wheel) & (wheel != 0.0)
    if np.count_nonzero(kept) * step < _LONG_ENOUGH:
        return None
    v, w = v_x[kept], wheel[kept]
    quarter, middle, other = np.percentile(v / w, [25, 50, 75])
    if abs(other - quarter) > _SPREAD * abs(middle):
        return None
    rolls = np.abs(v / w - middle) <= _AGREES * abs(middle)
    v, w = v[rolls], w[rolls]
    seconds = float(w.size * step)
    return (float(v @ w) / float(w @ w), seconds) if seconds >= _LONG_ENOUGH else None


def scale_text(scales: Mapping[str, Scale]) -> str:
    """Return in words what v_x says of wheels; empty where it says nothing."""
    if not scales:
        return ""
    given = ", ".join(
        f"{name} {one.value:.4g} m" if one.turns else f"{name} {one.value:.4g} times its speed"
        for name, one in scales.items()
    )
    seconds = min(one.seconds for one in scales.values())
    return f"wheels roll by vx, over {seconds:.0f} s of straight driving: {given}"


def with_scales(
    wheels: Wheels, signals: Mapping[str, Signal], scales: Mapping[str, Scale]
) -> tuple[Wheels, dict[str, Signal]]:
    """Return what a log.toml says of wheels by what was learnt: radii, and factors of speeds."""
    found = dict(signals)
    for name, one in scales.items():
        if not one.turns:
            found[name] = replace(found[name], factor=found[name].factor * one.value)
    radii = {name: one.value for name, one in scales.items() if one.turns}
    if not radii:
        return wheels, found
    mean = sum(radii.values()) / len(radii)
    corners = tuple(radii.get(name, wheels.radius_of(name) or mean) for name in WHEELS[:4])
    one_for_all = set(radii) == {WHEELS[-1]}
    return replace(wheels, radius=(mean,) if one_for_all else corners), found
