"""Which reading of a log makes it the motion of the declared car: units, signs, wheel angles, size.

What may be wrong grossly is a short list of changes; each is tried, alone and then together, and
that reading is taken which leaves least unexplained, where every change must earn its place. Two
readings that leave the same are alike, and the confidence says so.

φ = F/F_z [static axle loads], α [rad] its slip angle, rows front and rear. φ follows from v_x, v_y
and r without any tire, and α from these, the steering and the lengths of the car: so whatever the
tires are, φ must be a curve of α that rises and saturates, c α / sqrt(1 + (c α/μ)^2) + const. A
reading of the log (its units, its signs, the size of the car) is as good as little is left of φ;
with an accelerometer also of a_y = dv_y/dt + v_x r. Means over windows are compared, so that
nothing is differentiated, and shares of each equation's own variance, so that no unit favors
itself.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.doctor.pieces import SLOWEST, driven_windows, looked_at, usual_speed
from models.recordings import Recording
from models.recordings.samples import white_noise
from models.vehicle import GRAVITY, Vehicle

# consistency
_FEWEST_WINDOWS = 20  # windows: fewer say nothing
_MOST_WINDOWS = 500  # windows: of more that many are taken all over the log
# Ratio of a curve to the next. Curves that are tried lie on one grid of c and μ, so that many
# have the same c/μ: to saturate them, which costs most, is done once for each of these.
_FINENESS = 100.0 ** (1.0 / 27.0)
_STIFFNESSES = 28  # c of that grid
_FRICTIONS = 15  # μ of that grid
# per square of the logarithm of c over the declared one: a stiffness that is twice that costs
# as much as 14 % of what is left unexplained
_DISBELIEF = 0.3
_FAST = 6.0  # sqrt(g L), 30 m/s for a sedan; what is faster costs as much per square of a logarithm
_EXACT = 0.003  # share of the variance of φ, below which less that is left says nothing more
_CLEAR = 2.5  # times its noise that a channel must swing for its unit to be identified
_ROLLING = (0.85, 1.25)  # slope of a_y on dv_y/dt + v_x r, with the roll of the body
_GAIN = 1.1  # that a change must earn: less than it is left by a third in a sum of logarithms
_FREEDOM = 0.5  # that a change must earn beside, whose factor is free
_DEEPER = math.log(0.15)  # left of each equation, above which more changes are tried together
_KEPT = 8  # readings that are taken further
_JUDGED = 10  # of the best, by laws that need no vehicle
_MOST_CHANGES = 4  # changes at once
_SAME_STEERING = math.log(2.5)  # of ln of a steering factor, within which nothing is gross
_SAME_SIZE = math.log(2.2)  # of ln of the size of a car, within which nothing is gross
_SAME_INERTIA = math.log(2.0)  # of ln of its yaw inertia, within which nothing is gross
_FINER = 5  # golden sections, of an arm
_FINEST = 12  # golden sections, of a steering angle
_ALIKE_FACTORS = math.log(1.15)  # factors that say the same
_AS_GOOD = 0.5  # of cost: by so much a wrong sign may be worse than one with a factor
_STEEPNESS = 3.0  # of the confidence over what the next best reading leaves more
_ALONE = 2.8  # price of a v_y in another unit than v_x
_UNUSUAL = 2.0  # price of a v_y that is an angle in deg

STIFFNESS = _FINENESS ** np.arange(_STIFFNESSES)  # c [1/rad], 1 to 100
FRICTION = 0.3 * _FINENESS ** np.arange(_FRICTIONS)[:, None]  # μ [-], 0.3 to 3.3
# c/μ [1/rad], and which of them is that of μ and c.
RATIOS = _FINENESS ** np.arange(1 - _FRICTIONS, _STIFFNESSES)[:, None] / 0.3
_RATIO_OF = np.arange(_STIFFNESSES) - np.arange(_FRICTIONS)[:, None] + _FRICTIONS - 1


class Reading(NamedTuple):
    """What logged values must be multiplied by to be SI and ISO, and the size of the car.

    sideslip: v_y is the sideslip angle, its factor makes it rad.   size: lengths of the car over
    the declared ones, and so the root of its yaw inertia over its mass.   inertia: yaw inertia over
    what it then is.   arm: how far ahead of the center of gravity v_y is measured [m].
    """

    v_x: float = 1.0
    v_y: float = 1.0
    r: float = 1.0
    delta: float = 1.0
    a_y: float = 1.0
    sideslip: bool = False
    size: float = 1.0
    inertia: float = 1.0
    arm: float = 0.0


class Motion(NamedTuple):
    """Means of a log as it is written over the windows in which the car drives, each (m,).

    v_y, delta_f, delta_r, v_x_r = v_x r, turn = r/v_x, sideslip = v_y/v_x; rates of change v_y_dot,
    r_dot, and that of v_x v_y; a_y or None; speed: 95th percentile of |v_x|, one number; hidden:
    channels whose swings do not stand out of their noise.
    """

    v_y: Array
    delta_f: Array
    delta_r: Array
    v_x_r: Array
    turn: Array
    sideslip: Array
    v_y_dot: Array
    r_dot: Array
    v_x_v_y_dot: Array
    a_y: Array | None
    speed: float
    hidden: frozenset[str] = frozenset()

    @classmethod
    def of(cls, recording: Recording) -> "Motion | None":
        """Return that of a recording, None where too little of it is driven."""
        pieces = looked_at(recording)
        speed = usual_speed(pieces)
        if speed == 0.0:
            return None
        rows = np.concatenate([_rows(one, SLOWEST * speed) for one in pieces], axis=1)
        m = rows.shape[1]
        if m < _FEWEST_WINDOWS:
            return None
        *means, a_y = (
            rows
            if m <= _MOST_WINDOWS
            else rows[:, np.linspace(0, m - 1, _MOST_WINDOWS).astype(int)]
        )
        felt = None if recording.a_y is None else a_y
        return cls._make((*means, felt, speed, _hidden(pieces, SLOWEST * speed)))


def _rows(recording: Recording, fast: float) -> Array:
    """Return means and rates in the order of `Motion`, and means of a_y, a column each window."""
    v_x, v_y, r, a_y = recording.v_x, recording.needed("v_y"), recording.r, recording.a_y
    windows = driven_windows(recording, fast)
    over = np.where(np.abs(v_x) < fast, fast, v_x)
    signals = np.column_stack([v_y, recording.u, v_x * r, r / over, v_y / over])
    rates = windows.rate(np.column_stack([v_y, r, v_x * v_y]))
    felt = windows.mean(np.zeros_like(r) if a_y is None else a_y)
    return np.vstack([windows.mean(signals).T, rates.T, felt])


def _hidden(pieces: tuple[Recording, ...], fast: float) -> frozenset[str]:
    """Return the channels whose means over driven windows swing little more than their noise."""
    found = set()
    for name in ("v_y", "r", "delta_f", "a_y"):
        if getattr(pieces[0], name) is None:
            continue
        means = [driven_windows(one, fast).mean(getattr(one, name)) for one in pieces]
        noise = float(np.median([white_noise(getattr(one, name)) for one in pieces]))
        if float(np.std(np.concatenate(means))) < _CLEAR * noise:
            found.add(name)
    return frozenset(found)


class _AxleMotion(NamedTuple):
    """φ and α, rows front and rear (2, m); dv_y/dt + v_x r [m/s^2] (m,)."""

    force: Array
    slip: Array
    acceleration: Array


def unexplained(motion: Motion, vehicle: Vehicle, reading: Reading) -> float:
    """Return what a reading leaves unexplained: the sum of the logarithms of each equation's
    share.
    """
    one = forces_and_slips(motion, vehicle, reading)
    return front_leaves(one, vehicle) + but_front_leaves(one, motion, vehicle, reading)


def front_leaves(one: _AxleMotion, vehicle: Vehicle) -> float:
    """Return what is left of the front axle, the only equation that the steering is in."""
    declared = vehicle.cornering_stiffness_front / vehicle.axle_loads[0]
    return _curve_leaves(one.force[0], one.slip[0], declared)


def but_front_leaves(one: _AxleMotion, motion: Motion, vehicle: Vehicle, reading: Reading) -> float:
    """Return what is left of all other equations."""
    froude = abs(reading.v_x) * motion.speed / (math.sqrt(reading.size) * vehicle.froude_speed)
    declared = vehicle.cornering_stiffness_rear / vehicle.axle_loads[1]
    total = max(math.log(froude / _FAST), 0.0) ** 2
    total += _curve_leaves(one.force[1], one.slip[1], declared)
    if motion.a_y is not None:
        pair = (reading.a_y * motion.a_y, one.acceleration)
        measured, moved = (signal - signal.mean() for signal in pair)
        slope = float(np.clip(measured @ moved / (moved @ moved + 1e-12), *_ROLLING))
        left = float(np.sum((measured - slope * moved) ** 2))
        total += math.log(min(left / (float(measured @ measured) + 1e-12), 1.0) + _EXACT)
    return total


def forces_and_slips(motion: Motion, vehicle: Vehicle, reading: Reading) -> _AxleMotion:
    """Return forces over loads and slip angles of the axles as a reading has them."""
    k_x, k_y, k_r = reading.v_x, reading.v_y, reading.r
    l_f, l_r = reading.size * vehicle.l_f, reading.size * vehicle.l_r
    inertia = reading.inertia * reading.size**2 * vehicle.yaw_inertia / vehicle.mass  # [m^2]
    if reading.sideslip:
        v_y_dot, sideslip = k_y * k_x * motion.v_x_v_y_dot, k_y * motion.v_y
    else:
        v_y_dot, sideslip = k_y * motion.v_y_dot, k_y / k_x * motion.sideslip
    turn = k_r / k_x * motion.turn
    v_y_dot, sideslip = v_y_dot - reading.arm * k_r * motion.r_dot, sideslip - reading.arm * turn
    acceleration = v_y_dot + k_x * k_r * motion.v_x_r
    yaw = inertia * k_r * motion.r_dot
    force = np.stack([acceleration + yaw / l_r, acceleration - yaw / l_f]) / GRAVITY
    front = reading.delta * motion.delta_f - sideslip - l_f * turn
    rear = motion.delta_r - sideslip + l_r * turn
    return _AxleMotion(force, np.stack([front, rear]), acceleration)


def _curve_leaves(force: Array, slip: Array, declared: float) -> float:
    disbelief = _DISBELIEF * np.log(STIFFNESS / declared) ** 2
    force = force - force.mean()
    size = float(force @ force) + 1e-12
    bent = RATIOS * slip
    bent /= np.sqrt(1.0 + bent * bent)
    bent -= bent.mean(axis=1, keepdims=True)
    along, power = bent @ force, np.einsum("ij,ij->i", bent, bent)
    left = size - 2.0 * FRICTION * along[_RATIO_OF] + FRICTION**2 * power[_RATIO_OF]
    return float(np.min(np.log(np.clip(left / size, 0.0, 1.0) + _EXACT) + disbelief))


# What may be wrong, alone and together.

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
            abs(math.log(abs(a / b))) < _ALIKE_FACTORS and a * b > 0.0 for (_, a), (_, b) in pairs
        )
        return what == (other.code, other.channels, other.unit) and near


def _changed(code: str, unit: str, factor: float, *channels: str, price: float = 0.0) -> Change:
    factors = tuple((name.removesuffix("_f"), factor) for name in channels)
    return Change(code=code, channels=channels, unit=unit, factors=factors, price=price)


def _unit(unit: str, factor: float, *channels: str) -> Change:
    alone = _ALONE if channels == ("v_y",) else 0.0
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
        for unit, one, price in (("rad", 1.0, 0.0), ("deg", DEGREE, _UNUSUAL))
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
        prices = sum(_GAIN + change.price for change in self.changes)
        return self.left + prices + _FREEDOM * free


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
        return 1.0 / (1.0 + math.exp(-_STEEPNESS * (self.other.cost - self.best.cost)))


def read(
    motion: Motion, vehicle: Vehicle, admissible: Callable[[tuple[Change, ...]], bool]
) -> Read:
    """Return how a log is best read as the motion of a car.
    admissible : whether the log breaks no law with some changes; of the best readings those that
        do are left out, unless all do.
    """
    changes = CHANGES + (_ON_ACCELEROMETER if motion.a_y is not None else ())
    changes = tuple(one for one in changes if one.shows_in(motion))
    as_declared = _Explanation(
        changes=(), reading=Reading(), left=unexplained(motion, vehicle, Reading())
    )
    tried, best = [as_declared], as_declared
    equations = 2 if motion.a_y is None else 3
    beam = [as_declared]
    for _ in range(_MOST_CHANGES):
        longer = [new for one in beam for new in _longer(one, changes, motion, vehicle)]
        tried += longer
        before, best = best, min(tried, key=lambda one: one.cost)
        if best is before and (len(beam) > 1 or best.left < equations * _DEEPER):
            break
        good = best is not before and best.left < equations * _DEEPER
        beam = [best] if good else sorted(longer, key=lambda one: one.cost)[:_KEPT]
    ranked = sorted(tried, key=lambda one: (one.cost, len(one.changes)))
    if ranked[0] is as_declared and len(ranked) > _JUDGED and admissible(()):
        return Read(best=as_declared, other=ranked[-1])  # whatever laws the others break
    lawful = [one for one in ranked[:_JUDGED] if admissible(one.changes)]
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
    nearly = best.cost + _AS_GOOD
    best = next((one for one in others if one.changes == turned and one.cost < nearly), best)
    others = [one for one in others if one.cost >= best.cost]
    other = next(
        (
            one
            for one in others
            if not all(any(change.is_like(an) for an in one.gross) for change in best.gross)
        ),
        ranked[-1],
    )
    return Read(best=best, other=other)


def _longer(
    one: _Explanation, changes: Sequence[Change], motion: Motion, vehicle: Vehicle
) -> list[_Explanation]:
    taken = frozenset[str]().union(*(change.fields for change in one.changes))
    free = [change for change in changes if not change.fields & taken]
    if "delta ratio" not in taken:
        free += _steerings(one, motion, vehicle)
    if "size size" not in taken and not one.changes:
        free += _scaled("other_car", "size", SIZES, _SAME_SIZE, motion, vehicle)
    if "inertia size" not in taken:
        free += _scaled("yaw_inertia", "inertia", _INERTIAS, _SAME_INERTIA, motion, vehicle, one)
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
    best, step = min(tried, key=lambda one: tried[one]), math.log(STEERING[1] / STEERING[0])
    finer = _least(lambda by: left(best * math.exp(by)), -step, step, _FINEST)
    factor = best * math.exp(finer)
    if factor > 0.0 and abs(math.log(factor)) < _SAME_STEERING:
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
    share = _least(left, share - step, share + step, _FINER)
    return [Change(code=ARM, channels=("v_y",), arm=share * length)]


def _least(left: Callable[[float], float], low: float, high: float, sections: int) -> float:
    """Return where between two numbers least is left, by golden sections."""
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    for _ in range(sections):
        span = golden * (high - low)
        a, b = high - span, low + span
        low, high = (low, b) if left(a) < left(b) else (a, high)
    return 0.5 * (low + high)
