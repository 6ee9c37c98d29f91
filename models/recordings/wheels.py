"""What wheels are, by which speed is made of theirs: radii, tracks, and which are driven.

How they roll is learnt where the speed over ground is logged beside them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.logs.clock import Raw
from models.logs.log import RecordingError
from models.logs.signals import AXLES, QUANTITIES, WHEELS, Signal, quantity_of
from models.logs.units import SPEED, is_given
from models.rules import require_within
from models.schema import Table, changed
from models.vehicle import Vehicle

_RADII = (0.01, 2.0)  # of a wheel [m], of model cars to dump trucks
_LENGTHS = (0.05, 20.0)  # of a track and a wheelbase [m]
_ACCELERATIONS = (0.5, 100.0)  # [m/s²]
_STRAIGHT = 0.05  # [rad/s], largest yaw rate
_EVEN = 0.5  # [m/s²], largest acceleration
_FAST = 0.3  # of the speed that 5 % of the samples exceed: slower ones do not count
_LONG_ENOUGH = 2.0  # [s] of such driving, at least
_AGREES = 0.02  # of the median: farther off, a wheel slips
_SPREAD = 0.05  # between quartiles, as a share of the median, beyond which nothing is learnt
_SPEEDS = (0.8, 1.25)  # speed over ground per speed of a wheel, of one that shows a speed
_MOST = 200_000  # samples that are looked at

DRIVEN: Mapping[str, tuple[str, ...]] = {
    "front": AXLES[0],
    "rear": AXLES[1],
    "all": WHEELS,
    "none": (),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Wheels:
    """What wheels are, by which v_x is made of their speeds; SI throughout.

    Parameters
    ----------
    radius : by which a wheel rolls [m]: one for all, one per axle, front and rear, or one per wheel
        in the order of `WHEELS`; empty where speeds are logged, or it is not known.
    track : between the wheels of an axle [m], one for both or front and rear; empty where it is not
        known: then wheels of an axle count as one, by their mean.
    wheelbase : L [m]; None where it is not known: then front wheels are taken to roll without slip.
    driven : "front", "rear", "all" or "none"; empty where it is not known.
    acceleration : the largest along the car, either way [m/s²].
    """

    radius: tuple[float, ...] = ()
    track: tuple[float, ...] = ()
    wheelbase: float | None = None
    driven: str = ""
    acceleration: float = 12.0

    def __post_init__(self) -> None:
        for name, sizes, words, ends in (
            ("radius", (0, 1, 2, 4), "one number, one per axle or one per wheel", _RADII),
            ("track", (0, 1, 2), "one number or one per axle", _LENGTHS),
        ):
            given = getattr(self, name)
            if len(given) not in sizes:
                raise RecordingError(f"wheels: {name} must be {words}, not {len(given)} numbers")
            for one in given:
                require_within(RecordingError, *ends, **{f"wheels: {name}": one})
        if self.wheelbase is not None:
            require_within(RecordingError, *_LENGTHS, **{"wheels: wheelbase": self.wheelbase})
        require_within(
            RecordingError, *_ACCELERATIONS, **{"wheels: acceleration": self.acceleration}
        )
        if self.driven and self.driven not in DRIVEN:
            raise RecordingError(
                f"wheels: driven must be one of {', '.join(DRIVEN)}, not {self.driven!r}"
            )

    def radius_of(self, name: str) -> float | None:
        """Return the radius of a wheel [m], of `wheel` that of the rear axle; None: unknown."""
        if not self.radius:
            return None
        k, size = WHEELS.index(name), len(self.radius)
        corners = [self.radius[corner * size // 4] for corner in range(4)]
        some = corners[k : k + 1] or corners[2:]
        return sum(some) / len(some)

    def completed(self, vehicle: Vehicle) -> "Wheels":
        """Return it, completed by what the vehicle declares."""
        track, chassis = self.track, vehicle.chassis
        if not track and chassis is not None:
            track = (chassis.track_front, chassis.track_rear)
        wheelbase = vehicle.wheelbase if self.wheelbase is None else self.wheelbase
        return replace(self, track=track, wheelbase=wheelbase)

    def table(self) -> dict[str, Any]:
        """Return it as a document holds it: what differs from the defaults."""
        return {
            name: value[0] if isinstance(value, tuple) and len(value) == 1 else value
            for name, value in changed(self).items()
        }

    @classmethod
    def of_table(cls, table: Table) -> "Wheels":
        """Return it as a document says it.   table : as `table` returns it."""
        several = ("radius", "track")
        rules = dict.fromkeys(several, "must be a number or a list of numbers")
        return cls(**table.record(cls, alone=several, rules=rules))


# How they roll, by the speed over ground.


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
        given = _identified_scale(t, v_x, r, at(name)) if name in parts else None
        if given is None:
            continue
        value, seconds = given
        shown = quantity_of(name, units[name]) if is_given(units[name]) else ""
        speed = shown in ("", SPEED) and _SPEEDS[0] <= value <= _SPEEDS[1]
        if speed or (shown != SPEED and _RADII[0] <= value <= _RADII[1]):
            found[name] = Scale(value, not speed, seconds)
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
