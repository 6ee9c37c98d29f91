"""Forward speed at the center of gravity from wheel speeds: causal, without wheels that slip.

A wheel at (x, y) from the center of gravity, turned by δ, rolls at
    s = (v_x - r y) cos δ + (v_y + x r) sin δ,
where v_y is that of rear wheels without slip, v_y = l_r r + (v_x - r y) tan δ_r; so
    v_x = r y + (s - L r sin δ_f) / (cos δ_f + tan δ_r sin δ_f)   in front,
    v_x = r y + s cos δ_r                                         behind.
Wheels that are driven or braked are not trusted where they leave what the car can have done since
it was last known. Without slip all wheels agree. Where they do not, a car that speeds up is as slow
as its slowest wheel, one that brakes as fast as its fastest, and one that rolls out goes on as it
went.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array, blocks, large
from models.logs.log import RecordingError
from models.logs.signals import AXLES, WHEELS
from models.rules import require_within
from models.schema import Table
from models.vehicle import Vehicle

RADII = (0.01, 2.0)  # of a wheel [m], of model cars to dump trucks
LENGTHS = (0.05, 20.0)  # of a track and a wheelbase [m]
ACCELERATIONS = (0.5, 100.0)  # [m/s²]
DRIVEN: Mapping[str, tuple[str, ...]] = {
    "front": AXLES[0],
    "rear": AXLES[1],
    "all": WHEELS,
    "none": (),
}
SLIP, NOISE = 0.03, 0.05  # more than this share of the speed, and [m/s], is no usual slip
ALIKE = 0.01  # wheels that differ by this share, and NOISE, have no slip that tells them apart
WINDOW = 0.05  # [s], over which the acceleration of a wheel is taken
MEMORY = 0.15  # [s], over which that of the car is
BRAKED, ROLLS_OUT = -1.0, -0.3  # [m/s²]: below the first wheels are braked, above the other driven
UNSURE = 0.25  # of the largest acceleration: how far it may have changed while nothing is trusted
PATIENCE = 2.0  # [s]: after it wheels that all agree again are believed the sooner
SLOW = 1.0  # [m/s]: below it sensors of wheels show nothing


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

    Raises
    ------
    RecordingError
        For a number that no wheel, axle or car has, or another word.
    """

    radius: tuple[float, ...] = ()
    track: tuple[float, ...] = ()
    wheelbase: float | None = None
    driven: str = ""
    acceleration: float = 12.0

    def __post_init__(self) -> None:
        for name, sizes, words in (
            ("radius", (0, 1, 2, 4), "one number, one per axle or one per wheel"),
            ("track", (0, 1, 2), "one number or one per axle"),
        ):
            given = getattr(self, name)
            if len(given) not in sizes:
                raise RecordingError(f"wheels: {name} must be {words}, not {len(given)} numbers")
        for name, ends in (("radius", RADII), ("track", LENGTHS)):
            for one in getattr(self, name):
                require_within(RecordingError, *ends, **{f"wheels: {name}": one})
        if self.wheelbase is not None:
            require_within(RecordingError, *LENGTHS, **{"wheels: wheelbase": self.wheelbase})
        require_within(
            RecordingError, *ACCELERATIONS, **{"wheels: acceleration": self.acceleration}
        )
        if self.driven and self.driven not in DRIVEN:
            raise RecordingError(
                f"wheels: driven must be one of {', '.join(DRIVEN)}, not {self.driven!r}"
            )

    def radius_of(self, name: str) -> float | None:
        """Return the radius of a wheel [m], of `wheel` that of the rear axle; None where unknown.

        Parameters
        ----------
        name : of its signal.
        """
        if not self.radius:
            return None
        k = WHEELS.index(name) if name in WHEELS[:4] else 2
        if len(self.radius) == 4:
            one = self.radius[2:] if name not in WHEELS[:4] else self.radius[k : k + 1]
            return sum(one) / len(one)
        return self.radius[min(k // 2, len(self.radius) - 1)]

    def completed(self, vehicle: Vehicle) -> "Wheels":
        """Return it with what a car tells of it and nobody has told.

        Parameters
        ----------
        vehicle : that drove.
        """
        track, chassis = self.track, vehicle.chassis
        if not track and chassis is not None:
            track = (chassis.track_front, chassis.track_rear)
        wheelbase = vehicle.wheelbase if self.wheelbase is None else self.wheelbase
        return replace(self, track=track, wheelbase=wheelbase)

    def table(self) -> dict[str, Any]:
        """Return it as a document holds it: what differs from what holds where nothing is told."""
        told = {one.name: getattr(self, one.name) for one in fields(self)}
        plain = {one.name: one.default for one in fields(self)}
        changed = {name: value for name, value in told.items() if value != plain[name]}
        return {
            name: value[0] if isinstance(value, tuple) and len(value) == 1 else value
            for name, value in changed.items()
        }

    @classmethod
    def of_table(cls, table: Table) -> "Wheels":
        """Return it as a document says it.

        Parameters
        ----------
        table : as `table` returns it.

        Raises
        ------
        ValueError
            Of the table's class for a key or type that is not known; `RecordingError` for a value.
        """
        table.only(*(one.name for one in fields(cls)))
        given: dict[str, Any] = {}
        for name in ("radius", "track"):
            if name in table:
                several = table.array(name) if isinstance(table.value(name), list) else None
                if several is not None and several.ndim != 1:
                    table.refuse(name, "must be a number or a list of numbers")
                one = (table.number(name),) if several is None else tuple(map(float, several))
                given[name] = one
        for name in ("wheelbase", "acceleration"):
            if name in table:
                given[name] = table.number(name)
        if "driven" in table:
            given["driven"] = table.text("driven")
        return cls(**given)


class Rolled(NamedTuple):
    """Forward speed of a stretch [m/s], (n,), and what of it is not what all wheels say.

    gated, held : samples at which a wheel was left out, and at which all were.
    """

    v_x: Array
    gated: int
    held: int


class _Trust(NamedTuple):
    """What is carried from sample to sample: the speed, its change, and since when none is known.

    v [m/s]; a [m/s²]; held: time since a wheel was trusted [s]; known: the speed then [m/s].
    """

    v: float
    a: float
    held: float
    known: float


class _Rule(NamedTuple):
    """What holds for all samples.

    dt [s]; most: acceleration of a car, steady: of a wheel that may be trusted [m/s²]; free:
    whether each wheel is known not to be driven.
    """

    dt: float
    most: float
    steady: float
    free: tuple[bool, ...]


def rolled(
    speeds: Mapping[str, Array],
    r: Array,
    delta_f: Array,
    delta_r: Array,
    wheels: Wheels,
    dt: float,
) -> Rolled:
    """Return the forward speed at the center of gravity; no sample looks at a later one.

    Parameters
    ----------
    speeds : at which wheels roll [m/s], by names of `WHEELS`, each (n,); at least one.
    r : yaw rate [rad/s], (n,).
    delta_f, delta_r : angles of the road wheels [rad], (n,).
    wheels : their places, and which are driven.
    dt : sample time [s].

    Raises
    ------
    RecordingError
        Where one wheel of an axle stands alone and the track is not known.
    """
    names, most = _sources(speeds, wheels), wheels.acceleration
    n, v_x = r.size, large((r.size,))
    span = max(1, round(WINDOW / dt))
    rule = _Rule(
        dt=dt,
        most=most,
        steady=most + NOISE / (span * dt),
        free=tuple(
            bool(wheels.driven) and not set(group) & set(_pushed(wheels)) for group in names
        ),
    )
    gated = held = 0
    state: _Trust | None = None
    for part in blocks(n):
        early = slice(max(part.start - span, 0), part.stop)
        motion = r[early], delta_f[early], delta_r[early]
        of_part = {name: one[early] for name, one in speeds.items()}
        rows = np.column_stack([_brought(group, of_part, *motion, wheels) for group in names])
        before = rows[np.maximum(np.arange(len(rows)) - span, 0)]
        begin = part.start - early.start
        rates = (rows - before)[begin:] / (span * dt)
        rows = rows[begin:]
        if state is None:
            state = _begun(rows[0].tolist(), rule.free)
        found = []
        for row, rate in zip(rows.tolist(), rates.tolist(), strict=True):
            state = _step(state, row, rate, rule)
            found.append(state.v)
            held += state.held > 0.0
        v_x[part] = found
        agree = np.abs(rows - v_x[part, None]) <= NOISE + SLIP * np.abs(v_x[part, None])
        gated += int(np.count_nonzero(~agree.all(axis=1)))
    return Rolled(v_x, gated, held)


def _begun(row: Sequence[float], free: Sequence[bool]) -> _Trust:
    """Return the speed before the first sample: the middle one of wheels, if they can be free."""
    trusted = sorted(c for c, rolls in zip(row, free, strict=True) if rolls) or sorted(row)
    middle = trusted[(len(trusted) - 1) // 2]
    return _Trust(middle, 0.0, 0.0, middle)


def _step(state: _Trust, row: Sequence[float], rates: Sequence[float], rule: _Rule) -> _Trust:
    """Return the speed at the next sample.

    row : speed of the center of gravity by each wheel [m/s].
    rates : by which each changed lately [m/s²].
    """
    v, a, since, known = state
    dt, most = rule.dt, rule.most
    ahead = v + a * dt
    near, alike = (NOISE + share * abs(ahead) for share in (SLIP, ALIKE))
    doubt = UNSURE * most * since
    steady = [abs(rate) <= rule.steady for rate in rates]
    if max(row) - min(row) <= near and all(steady):
        doubt *= 1.0 + since / PATIENCE
    if max(abs(ahead), *map(abs, row)) < SLOW:
        doubt, steady = SLOW, [True] * len(row)
    likely = [k for k, c in enumerate(row) if steady[k] and abs(c - ahead) <= near + doubt]
    if not likely:
        if all((c - ahead) * a < 0.0 for c in row):
            return _Trust(v, 0.0, since + dt, known)  # what it went on by leads away from all
        return _Trust(ahead, a, since + dt, known)
    if a > BRAKED:  # driven wheels run ahead of the car, however little
        likely = [k for k in likely if rule.free[k]] or likely
    likely = [k for k in likely if abs(rates[k] - a) <= UNSURE * most] or likely
    speeds = [row[k] for k in likely]
    if a > ROLLS_OUT:
        best = min(speeds)
    elif a < BRAKED:
        best = max(speeds)
    else:
        best = min(speeds, key=lambda c: abs(c - ahead))
    kept = [k for k in likely if abs(row[k] - best) <= alike]
    reach = most * dt + doubt
    now = min(max(sum(row[k] for k in kept) / len(kept), ahead - reach), ahead + reach)
    passed = since + dt
    slope = (now - known) / passed
    if since > MEMORY:  # what was trusted before says little of how it goes on
        slope = sum(rates[k] for k in kept) / len(kept)
    slope = min(max(slope, -most), most)
    a += (1.0 - math.exp(-passed / MEMORY)) * (slope - a)
    return _Trust(now, a, 0.0, now)


def _pushed(wheels: Wheels) -> tuple[str, ...]:
    """Return the wheels that are driven; a lone encoder counts with the motor."""
    driven = DRIVEN[wheels.driven]
    return (*driven, WHEELS[4]) if driven else ()


def _sources(speeds: Mapping[str, Array], wheels: Wheels) -> list[tuple[str, ...]]:
    """Return the wheels, and the axles whose track is not known, that each tell the speed."""
    found: list[tuple[str, ...]] = [(WHEELS[4],)] if WHEELS[4] in speeds else []
    for axle in AXLES:
        there = tuple(name for name in axle if name in speeds)
        if wheels.track:
            found += [(name,) for name in there]
        elif len(there) == 2:
            found.append(there)
        elif there:
            raise RecordingError(
                f"{there[0]} is alone on its axle: tell its place by [wheels] track, in m"
            )
    return found


def _brought(
    group: Sequence[str],
    speeds: Mapping[str, Array],
    r: Array,
    delta_f: Array,
    delta_r: Array,
    wheels: Wheels,
) -> Array:
    """Return the forward speed of the center of gravity by a wheel or an axle, (n,)."""
    s: Array = np.mean([speeds[name] for name in group], axis=0)
    name = group[0]
    front = name in AXLES[0] or (name == WHEELS[4] and wheels.driven == "front")
    along = s * np.cos(delta_r)
    if front:
        sine, cosine = np.sin(delta_f), np.cos(delta_f)
        if wheels.wheelbase is None:
            along = s * cosine
        else:
            along = (s - wheels.wheelbase * r * sine) / (cosine + np.tan(delta_r) * sine)
    if len(group) > 1 or name == WHEELS[4]:
        return along
    track = wheels.track[0 if front else -1]
    side = 0.5 if name in (AXLES[0][0], AXLES[1][0]) else -0.5
    return along + side * track * r
