"""Which reading of a log makes it the motion of the declared car: units, signs, wheel angles, size.

What may be wrong grossly is a short list of changes; each is tried, alone and then together, and
that reading is taken which leaves least unexplained, where every change must earn its place. Two
readings that leave the same are alike, and the confidence says so.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from codegen.arrays import Array
from identifier.doctor.chosen import CHOSEN
from identifier.doctor.consistency import (
    Motion,
    Reading,
    but_front_leaves,
    forces_and_slips,
    front_leaves,
    unexplained,
)
from models.vehicle import GRAVITY, Vehicle

DEGREE, MILLI = math.pi / 180.0, 1e-3
_KMH, _MPH, _KNOT = 1.0 / 3.6, 0.44704, 1852.0 / 3600.0
ARM = "velocity_sensor_x"  # a size and no gross fault, tried beside: it may explain a log as well
FREE = ("steering", "other_car", "yaw_inertia", ARM)
STEERING = np.geomspace(1.0 / 2500.0, 4.0, 48)  # factors of the steering angle that are tried
SIZES = np.geomspace(1.0 / 32.0, 32.0, 41)
_INERTIAS = np.geomspace(1.0 / 16.0, 16.0, 17)
_ARMS = np.linspace(-1.0, 1.0, 17)  # wheelbases


_PRICES = {"mph": 0.3, "knots": 0.3, "mm/s": 0.3}  # of units that few loggers use


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One thing that may be wrong with a log, or with the declaration of its car.
    code : for machines: "unit", "sign", "sideslip", or one of `FREE`.
    channels : concerned; none where it is the car.
    unit : in which they are logged, "" where that is right.
    factors : by field of a `Reading`, what takes it out.
    arm : how far ahead of the center of gravity v_y is measured [m].
    price : that it must earn beside that of every change, where it is less usual.
    """

    code: str
    channels: tuple[str, ...] = ()
    unit: str = ""
    factors: tuple[tuple[str, float], ...] = ()
    sideslip: bool = False
    arm: float = 0.0
    price: float = 0.0

    @property
    def fields(self) -> frozenset[str]:
        """The fields of a reading that it changes, with what it does to them.

        Two changes of one thing exclude one another; a steering wheel may well be in degrees.
        """
        kind = {"sign": "sign", "steering": "ratio"}.get(self.code, "size")
        return frozenset(f"{name} {kind}" for name, _ in self.factors)

    @property
    def by_channel(self) -> dict[str, float]:
        """What each channel is multiplied by."""
        pairs = zip(self.channels, self.factors, strict=True)
        return {name: factor for name, (_, factor) in pairs}

    @property
    def parts(self) -> "tuple[Change, ...]":
        """The same, channel by channel."""
        return tuple(
            replace(self, channels=(name,), factors=(factor,))
            for name, factor in zip(self.channels, self.factors, strict=True)
        )

    @property
    def turned(self) -> "Change":
        """Of a steering angle that is turned and scaled the sign alone; else the same."""
        if self.code == "steering" and self.factors[0][1] < 0.0:
            return _sign(*self.channels)
        return self

    def shows_in(self, motion: Motion) -> bool:
        """Return whether a log can tell it: what is hidden in noise has no unit of its own."""
        return self.code not in ("unit", "sideslip") or not motion.hidden >= {*self.channels}

    def on(self, reading: Reading) -> Reading:
        factors = {name: getattr(reading, name) * factor for name, factor in self.factors}
        sideslip, arm = reading.sideslip or self.sideslip, reading.arm + self.arm
        return reading._replace(**factors, sideslip=sideslip, arm=arm)

    def is_like(self, other: "Change") -> bool:
        """Return whether both say the same, be it by a factor that is a little another one."""
        if {self.code, other.code} == {"sign", "steering"}:
            return self.channels == other.channels and self.turned == other.turned
        what = (self.code, self.channels, self.unit)
        pairs = zip(self.factors, other.factors, strict=False)
        near = all(
            abs(math.log(abs(a / b))) < CHOSEN.alike_factors and a * b > 0.0
            for (_, a), (_, b) in pairs
        )
        return what == (other.code, other.channels, other.unit) and near


def _changed(code: str, unit: str, factor: float, *channels: str, price: float = 0.0) -> Change:
    factors = tuple((name.removesuffix("_f"), factor) for name in channels)
    return Change(code=code, channels=channels, unit=unit, factors=factors, price=price)


def _unit(unit: str, factor: float, *channels: str) -> Change:
    alone = CHOSEN.alone if channels == ("v_y",) else 0.0
    return _changed("unit", unit, factor, *channels, price=_PRICES.get(unit, 0.0) + alone)


def _sign(*channels: str) -> Change:
    return _changed("sign", "", -1.0, *channels)


SPEEDS = {"km/h": _KMH, "mph": _MPH, "knots": _KNOT, "mm/s": MILLI}
CHANGES = (
    *(_unit(unit, factor, "v_x", "v_y") for unit, factor in SPEEDS.items()),
    *(_unit(unit, factor, "v_x") for unit, factor in SPEEDS.items()),
    *(_unit(unit, factor, "v_y") for unit, factor in SPEEDS.items()),
    _unit("deg/s", DEGREE, "r"),
    _unit("deg", DEGREE, "r", "delta_f"),
    *(
        Change(
            code="sideslip", channels=("v_y",), unit=unit, factors=(("v_y", one),), sideslip=True,
            price=price,
        )
        for unit, one, price in (("rad", 1.0, 0.0), ("deg", DEGREE, CHOSEN.unusual))
    ),
    _unit("deg", DEGREE, "delta_f"),
    *(_sign(name) for name in ("v_y", "r", "v_x", "delta_f")),
    _sign("v_x", "v_y"),
)  # fmt: skip
_ON_ACCELEROMETER = (_unit("g", GRAVITY, "a_y"), _sign("a_y"), _sign("v_y", "a_y"))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Explanation:
    """A reading of a log, the changes that make it, and what it leaves.
    left : what it leaves unexplained, as `unexplained` returns it.
    """

    changes: tuple[Change, ...]
    reading: Reading
    left: float

    @property
    def gross(self) -> tuple[Change, ...]:
        """The changes that are gross faults: all but the place of a sensor."""
        return tuple(change for change in self.changes if change.code != ARM)

    @property
    def cost(self) -> float:
        """What it leaves and what its changes cost; a number that is free costs more."""
        free = sum(change.code in FREE for change in self.changes)
        prices = sum(CHOSEN.gain + change.price for change in self.changes)
        return self.left + prices + CHOSEN.freedom * free


@dataclass(frozen=True, slots=True, kw_only=True)
class Read:
    """How a log is best read, and what else it could be.
    without : the same with the velocity sensor where it should be, if elsewhere it makes a reading
        the best that nothing gross is in; None else.
    """

    best: _Explanation
    other: _Explanation
    without: "Read | None" = None

    @property
    def confidence(self) -> float:
        """From a half, where the next best reading is as good, to 1."""
        return 1.0 / (1.0 + math.exp(-CHOSEN.steepness * (self.other.cost - self.best.cost)))


def read(motion: Motion, vehicle: Vehicle, possible: Callable[[tuple[Change, ...]], bool]) -> Read:
    """Return how a log is best read as the motion of a car.
    possible : whether the log breaks no law with some changes; of the best readings those that do
        are left out, unless all do.
    """
    changes = CHANGES + (_ON_ACCELEROMETER if motion.a_y is not None else ())
    changes = tuple(one for one in changes if one.shows_in(motion))
    as_declared = _Explanation(
        changes=(), reading=Reading(), left=unexplained(motion, vehicle, Reading())
    )
    tried, best = [as_declared], as_declared
    equations = 2 if motion.a_y is None else 3
    beam = [as_declared]
    for _ in range(CHOSEN.most_changes):
        longer = [new for one in beam for new in _longer(one, changes, motion, vehicle)]
        tried += longer
        before, best = best, min(tried, key=lambda one: one.cost)
        if best is before and (len(beam) > 1 or best.left < equations * CHOSEN.deeper):
            break
        good = best is not before and best.left < equations * CHOSEN.deeper
        beam = [best] if good else sorted(longer, key=lambda one: one.cost)[: CHOSEN.kept]
    ranked = sorted(tried, key=lambda one: (one.cost, len(one.changes)))
    lawful = [one for one in ranked[: CHOSEN.judged] if possible(one.changes)]
    ranked = lawful + [one for one in ranked if one not in lawful]
    found = _chosen(ranked)
    in_place = _chosen([one for one in ranked if one.gross == one.changes])
    if found.best.gross or not (found.best.changes and in_place.best.gross):
        return found
    return replace(found, without=in_place)


def _chosen(ranked: list[_Explanation]) -> Read:
    """Return the first of some explanations, and the next that means something else."""
    best, *others = ranked
    turned = tuple(change.turned for change in best.changes)  # which claims less
    nearly = best.cost + CHOSEN.as_good
    best = next((one for one in others if one.changes == turned and one.cost < nearly), best)
    others = [one for one in others if one.cost >= best.cost]
    other = next((one for one in others if _means_else(one, best)), ranked[-1])
    return Read(best=best, other=other)


def _means_else(one: _Explanation, best: _Explanation) -> bool:
    """Whether an explanation lacks a gross fault of the best one, or has another in its place."""
    return not all(any(change.is_like(other) for other in one.gross) for change in best.gross)


def _longer(
    one: _Explanation, changes: Sequence[Change], motion: Motion, vehicle: Vehicle
) -> list[_Explanation]:
    taken = frozenset[str]().union(*(change.fields for change in one.changes))
    free = [change for change in changes if not change.fields & taken]
    if "delta ratio" not in taken:
        free += _steerings(one, motion, vehicle)
    if "size size" not in taken and not one.changes:
        free += _scaled("other_car", "size", SIZES, CHOSEN.same_size, motion, vehicle)
    if "inertia size" not in taken:
        free += _scaled(
            "yaw_inertia", "inertia", _INERTIAS, CHOSEN.same_inertia, motion, vehicle, one
        )
    if not any(change.code == ARM for change in one.changes):
        free += _arms(one, motion, vehicle)
    longer = []
    for change in free:
        reading = change.on(one.reading)
        left = unexplained(motion, vehicle, reading)
        longer.append(_Explanation(changes=(*one.changes, change), reading=reading, left=left))
    return longer


def _steerings(one: _Explanation, motion: Motion, vehicle: Vehicle) -> list[Change]:
    """Return the factor of the steering angle that leaves least, where it is a gross one."""
    given = one.reading.delta
    as_it_is = forces_and_slips(motion, vehicle, one.reading._replace(delta=0.0))
    rest = but_front_leaves(as_it_is, motion, vehicle, one.reading)

    def left(factor: float) -> float:
        steering = given * factor * motion.delta_f
        front = as_it_is.slip + np.stack([steering, 0.0 * steering])
        return rest + front_leaves(as_it_is._replace(slip=front), vehicle)

    tried = {float(factor): left(float(factor)) for factor in (*STEERING, *-STEERING)}
    factor = _refined(min(tried, key=lambda one: tried[one]), left)
    if factor > 0.0 and abs(math.log(factor)) < CHOSEN.same_steering:
        return []
    return [Change(code="steering", channels=("delta_f",), factors=(("delta", factor),))]


def _scaled(
    code: str,
    name: str,
    sizes: Array,
    same: float,
    motion: Motion,
    vehicle: Vehicle,
    one: _Explanation | None = None,
) -> list[Change]:
    """Return the factor of a number of the car that leaves least, where it is a gross one."""
    before = Reading() if one is None else one.reading

    def left(size: float) -> float:
        given = before._replace(**{name: size})  # type: ignore[arg-type]  # name is of a number
        return unexplained(motion, vehicle, given)

    size = min(map(float, sizes), key=left)
    if abs(math.log(size)) < same:
        return []
    return [Change(code=code, factors=((name, size),))]


def _arms(one: _Explanation, motion: Motion, vehicle: Vehicle) -> list[Change]:
    """Return the place of the velocity sensor, within a wheelbase, that leaves least."""
    length = one.reading.size * vehicle.wheelbase

    def left(share: float) -> float:
        return unexplained(motion, vehicle, one.reading._replace(arm=share * length))

    share = min(map(float, _ARMS), key=left)
    if share == 0.0:
        return []
    step = float(_ARMS[1] - _ARMS[0])
    share = _least(left, share - step, share + step, CHOSEN.finer)
    return [Change(code=ARM, channels=("v_y",), arm=share * length)]


def _refined(factor: float, left: Callable[[float], float]) -> float:
    step = math.log(STEERING[1] / STEERING[0])
    finer = _least(lambda by: left(factor * math.exp(by)), -step, step, CHOSEN.finest)
    return factor * math.exp(finer)


def _least(left: Callable[[float], float], low: float, high: float, sections: int) -> float:
    """Return where between two numbers least is left, by golden sections."""
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    for _ in range(sections):
        span = golden * (high - low)
        a, b = high - span, low + span
        low, high = (low, b) if left(a) < left(b) else (a, high)
    return 0.5 * (low + high)
