"""Forward speed at the center of gravity from wheel speeds: causal, without wheels that slip.

A wheel at (x, y) from the center of gravity, turned by δ, rolls at
    s = (v_x - r y) cos δ + (v_y + x r) sin δ,
where v_y is that of rear wheels without slip, v_y = l_r r + (v_x - r y) tan δ_r; so
    v_x = r y + (s - L r sin δ_f) / (cos δ_f + tan δ_r sin δ_f)   in front,
    v_x = r y + s cos δ_r                                         behind.
Wheels that are driven or braked are not trusted where they leave what the car can have done since
it was last known. Without slip all wheels agree. Where they do not, a car that speeds up is as slow
as its slowest wheel, one that brakes as fast as its fastest, and one that rolls out goes on as it
went. The step from sample to sample is compiled.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array, blocks, large
from models.logs.log import RecordingError
from models.logs.signals import AXLES, WHEELS
from models.recordings.wheels import DRIVEN, Wheels

SLIP = 0.03  # share of the speed; more, and `noise`, is no usual slip
NOISE = 0.05  # [m/s]
# share of the speed: wheels that differ by less, and `noise`, have no slip that tells them
# apart
ALIKE = 0.01
_WINDOW = 0.05  # [s], over which the acceleration of a wheel is taken
MEMORY = 0.15  # [s], over which that of the car is
BRAKED = -1.0  # [m/s²]: wheels are braked below
ROLLS_OUT = -0.3  # [m/s²]: wheels are driven above
UNSURE = 0.25  # of the largest acceleration: how far it may have changed while nothing is trusted
PATIENCE = 2.0  # [s]: after it wheels that all agree again are believed the sooner
SLOW = 1.0  # [m/s]: below it sensors of wheels show nothing


class _Rolled(NamedTuple):
    """Forward speed of a segment [m/s], (n,), and what of it is not what all wheels say.
    gated, untrusted : samples at which a wheel was left out, and at which all were.
    """

    v_x: Array
    gated: int
    untrusted: int


def rolled(
    speeds: Mapping[str, Array], r: Array, delta_f: Array, delta_r: Array, wheels: Wheels, dt: float
) -> _Rolled:
    """Return the forward speed at the center of gravity; no sample looks at a later one.
    speeds : at which wheels roll [m/s], by names of `WHEELS`, each (n,); at least one.
    r : yaw rate [rad/s], (n,).   delta_f, delta_r : angles of the road wheels [rad], (n,).
    dt : sample time [s].
    """
    names, most = _sources(speeds, wheels), wheels.acceleration
    v_x = large((r.size,))
    span = max(1, round(_WINDOW / dt))
    driven = DRIVEN[wheels.driven] if wheels.driven else WHEELS
    pushed = {*driven, WHEELS[4]} if driven else set()  # a lone encoder counts with the motor
    free = [not pushed & set(group) for group in names]
    rule = np.array([dt, most, most + NOISE / (span * dt)])
    scan, constants = _trust_scan(len(names)), {"rule": rule, "free": np.array(free, dtype=float)}
    gated = untrusted = 0
    trust: Array | None = None
    for part in blocks(r.size):
        early = slice(max(part.start - span, 0), part.stop)
        motion = r[early], delta_f[early], delta_r[early]
        of_part = {name: one[early] for name, one in speeds.items()}
        rows = np.column_stack([_brought(group, of_part, *motion, wheels) for group in names])
        before = rows[np.maximum(np.arange(len(rows)) - span, 0)]
        begin = part.start - early.start
        rates = (rows - before)[begin:] / (span * dt)
        rows = rows[begin:]
        if trust is None:  # the middle one of wheels, of those that are free if there are any
            known = sorted(rows[0][free]) or sorted(rows[0])
            middle = known[(len(known) - 1) // 2]
            trust = np.array([middle, 0.0, 0.0, middle])
        samples = {"row": rows, "rates": rates}
        record = scan(len(rows), {"trust": trust, **samples, **constants}, ports=("v", "untrusted"))
        trust = record["trust_final"]
        v_x[part] = record["v"].ravel()
        untrusted += int(np.count_nonzero(record["untrusted"] > 0.0))
        now = v_x[part, None]
        agree = np.abs(rows - now) <= NOISE + SLIP * np.abs(now)
        gated += int(np.count_nonzero(~agree.all(axis=1)))
    return _Rolled(v_x, gated, untrusted)


class _Trust(NamedTuple):
    """What is carried from sample to sample: the speed, its change, and since when none is known.

    v [m/s]; a [m/s²]; untrusted: time since a wheel was trusted [s]; known: the speed then [m/s].
    """

    v: ca.SX
    a: ca.SX
    untrusted: ca.SX
    known: ca.SX


def _trusted(trust: _Trust, c: ca.SX, rates: ca.SX, rule: ca.SX, free: ca.SX) -> _Trust:
    """Return the speed at the next sample.
    c : speed of the center of gravity by each wheel [m/s], (k,).
    rates : by which each changed lately [m/s²], (k,).
    rule : dt [s], and the largest accelerations of a car and of a trusted wheel [m/s²], (3,).
    free : of each wheel, whether it is known not to be driven, (k,).
    """
    v, a, since, known = trust
    dt, most, limit = ca.vertsplit(rule)
    ahead, passed = v + a * dt, since + dt
    near, alike = (NOISE + share * ca.fabs(ahead) for share in (SLIP, ALIKE))

    steady, away = ca.fabs(rates) <= limit, ca.fabs(c - ahead)
    agree = ca.logic_and(ca.mmax(c) - ca.mmin(c) <= near, ca.logic_all(steady))
    doubt = UNSURE * most * since
    doubt = ca.if_else(agree, doubt * (1.0 + since / PATIENCE), doubt)
    slow = ca.fmax(ca.fabs(ahead), ca.mmax(ca.fabs(c))) < SLOW
    doubt = ca.if_else(slow, SLOW, doubt)
    likely = ca.logic_and(ca.logic_or(slow, steady), away <= near + doubt)
    some = ca.logic_any(likely)

    # Nobody is trusted: it goes on as it went, unless that leads away from all wheels.
    astray = ca.logic_all((c - ahead) * a < 0.0)
    v_onward, a_onward = ca.if_else(astray, v, ahead), ca.if_else(astray, 0.0, a)

    # Driven wheels run ahead of the car, however little.
    likely = _rather(likely, free, ca.logic_not(a > BRAKED))
    likely = _rather(likely, ca.fabs(rates - a) <= UNSURE * most, ca.SX(0.0))
    nearest = _lowest(c, ca.logic_and(likely, away <= _lowest(away, likely)))
    slowing = ca.if_else(a < BRAKED, -_lowest(-c, likely), nearest)
    best = ca.if_else(a > ROLLS_OUT, _lowest(c, likely), slowing)
    kept = ca.logic_and(likely, ca.fabs(c - best) <= alike)
    reach = most * dt + doubt
    now = ca.fmin(ca.fmax(_mean(c, kept), ahead - reach), ahead + reach)
    # After a while, what was trusted before says little of how it goes on.
    slope = ca.if_else(since > MEMORY, _mean(rates, kept), (now - known) / passed)
    slope = ca.fmin(ca.fmax(slope, -most), most)
    a_now = a + (1.0 - ca.exp(-passed / MEMORY)) * (slope - a)
    return _Trust(
        ca.if_else(some, now, v_onward),
        ca.if_else(some, a_now, a_onward),
        ca.if_else(some, 0.0, passed),
        ca.if_else(some, now, known),
    )


def _rather(likely: ca.SX, those: ca.SX, unless: ca.SX) -> ca.SX:
    """Return those of the likely wheels (k,), where there are any of them, or else all."""
    both = ca.logic_and(likely, those)
    none = ca.logic_or(unless, ca.logic_not(ca.logic_any(both)))
    return ca.logic_or(both, ca.logic_and(none, likely))


def _lowest(c: ca.SX, among: ca.SX) -> ca.SX:
    """Return the lowest number of some, infinite where there is none."""
    return ca.mmin(ca.if_else(among, c, ca.inf))


def _mean(c: ca.SX, among: ca.SX) -> ca.SX:
    """Return the mean of some, not a number where there is none."""
    return ca.sum1(ca.if_else(among, c, 0.0)) / ca.sum1(among)


@cache
def _trust_scan(k: int) -> Scan:
    """Return the compiled loop over samples."""
    trust, row, rates = ca.SX.sym("trust", 4), ca.SX.sym("row", k), ca.SX.sym("rates", k)
    rule, free = ca.SX.sym("rule", 3), ca.SX.sym("free", k)
    after = _trusted(_Trust(*ca.vertsplit(trust)), row, rates, rule, free)
    step = ca.Function(
        f"rolled_{k}",
        [trust, row, rates, rule, free],
        [ca.vertcat(*after), after.v, after.untrusted],
        ["trust", "row", "rates", "rule", "free"],
        ["trust_next", "v", "untrusted"],
    )
    return Scan(step, carry=("trust",), over=("row", "rates"))


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
                f"{there[0]} is alone on its axle: give its place by [wheels] track, in m"
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
