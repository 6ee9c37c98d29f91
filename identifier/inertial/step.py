"""The step of the inertial identifier: one casadi.Function that is simulation, test and C source.

An extended Kalman filter of everything at once: what moves and what is learnt, whose errors are
correlated, so that v_y is corrected by what the curves are found to be and the other way round.
Its covariance is that of what moves and of steps along the directions of `motion.Learnt`.
Carried: motion (7,), W (2, n), own (2,) the compliances, sensors (4,) and UD the factors of the
covariance of what is learnt, motion_UD those of what moves; gate as of the axle identifier; body
(2,), readings (10,), running (3,), excitation (2, 9).
Sampled: x = [v_y, r], of which v_y is not read; u, v_x, a_y, NaN where there is none.
"""

from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.car import Car, larger, smaller, step_function, symbols, within
from identifier.axle.covariance import Factors, entry, factors_of, row_of, triangle
from identifier.axle.curve import EDGES, EXCITATION, curve, excited
from identifier.axle.gate import GATE_PORT, Gate, GateState, Plausibility, gate
from identifier.axle.learning import BoundNumbers, towards_center
from identifier.inertial.beliefs import TrustNumbers
from identifier.inertial.gaussian import as_factor, measured, propagated
from identifier.inertial.motion import (
    CURVES,
    MOVING,
    SENSORS,
    Along,
    Laws,
    Learnt,
    Load,
    Predicted,
    Sample,
    Way,
    cosine,
    curve_by,
    expected_signals,
    predicted,
    slip_angle,
    static_load,
    turning,
    unknowns,
)
from identifier.setup import AXLE_FORCE, FACTORS, Port
from models.vehicle import GRAVITY, load_ratio

_SAME = 0.01  # of the square of a change, up to which the next one is none: a number that settles
_MOST_WAITING = 4  # numbers of a channel that wait for its turn
_MOST_SLIDING = 0.7  # |v_y|/v_x from which the filter begins anew
_MOST_NOISE = 9.0  # of the noise that is held for true, what one sample may show
_LARGEST_SQUARE = 25.0  # one outlier alone is no alarm
_STIFFNESS = 2.0  # static loads/rad, the least that a corner is begun with
_DOUBTED = 0.7  # of the slip that a corner is begun with
_LAG_OF_A_X = 0.2  # s, of the washout that shows a_x
_LEAST = 1e-12  # variance that is divided by

OVER = ("x", "u", "v_x", "a_y")
LOAD = "static axle loads"

PORTS = (
    AXLE_FORCE,
    Port("v_y", "m/s", "lateral velocity at the center of gravity, positive to the left"),
    Port("v_y_sd", "m/s", "standard deviation of v_y"),
    Port("side_slip_observable", "-", "1 where side slip is known well enough now, else 0"),
    Port(
        "motion",
        "m/s; rad/s; rad; static axle loads; -",
        "v_y, r, lagged slip and missed force front and rear, sine of the bank",
    ),
    Port("W", LOAD, "weights of the units, rows front and rear", learnt=True),
    Port("own", "m per load", "compliance, front and rear", learnt=True),
    Port(
        "sensors",
        "g; rad per g; rad; rad/s",
        "bias of a_y, roll of the body, zero of the steering, bias of r",
        learnt=True,
    ),
    Port(
        "UD",
        "-; -; -; rad; g; rad per g; rad/s",
        "covariance U D U' of ln grip and ln stiffness of both curves, a factor of both "
        "compliances and sensors, where they are estimated: D, and U above it, by rows",
        learnt=True,
        rule=FACTORS,
    ),
    Port("motion_UD", "of motion", "the rows of D and U that belong to motion, which stand first"),
    GATE_PORT,
    Port("body", "m/s^2; m/s^3", "motion of the rolling body and its rate"),
    Port(
        "readings",
        "rad/s, m/s^2; squares; -; rad/s, m/s^2",
        "newest r and a_y, those before, variances of their noise, how many numbers wait, "
        "and the innovation of those",
    ),
    Port(
        "running",
        "-; -; m/s",
        "1 while the filter runs; mean square of the missed force over its deviation; slow mean "
        "of v_x, by which a_x is found",
    ),
    EXCITATION,
)
OUTPUTS = tuple(port.name for port in PORTS[:4])
CARRY = tuple(port.name for port in PORTS[4:])


class LearntLimits(NamedTuple):
    """Of compliance [m], bias [g], roll [rad per g], steering [rad] and gyro [rad/s]."""

    compliance: Any
    bias: Any
    roll: Any
    steering: Any
    gyro: Any


class _BodyState(NamedTuple):
    """ä of the rolling body [m/s²] and its rate [m/s³]."""

    tilt: Any
    rate: Any


class _Readings(NamedTuple):
    """Of r and a_y, (2,) each: the newest number and the one before [rad/s], [m/s²]; variance of
    the noise; how many numbers wait for their turn [-], and the innovation of these.
    """

    newest: Any
    before: Any
    variance: Any
    waiting: Any
    left: Any


class _RunningState(NamedTuple):
    """1 while the filter runs; mean square of the missed force over its deviation [-]; slow mean of
    v_x [m/s].
    """

    on: Any
    force_error: Any
    v_x: Any


class _Noise(NamedTuple):
    """What r and a_y tell of themselves, and which of them comes first.
    first : 1 where that is r, 0 where it is a_y.   counts : 1 where it has a number.
    turns : 1 where a channel has its turn (2,).   share : 1 over the numbers that waited for it,
    (2,) [-]: of errors that one in a row repeats of another, the sum counts.
    fresh : 1 where a number is new, (2,).   variance : of its noise before [rad²/s², m²/s⁴], (2,).
    readings : next state, but for the innovations.
    """

    first: Any
    counts: Any
    turns: list[Any]
    share: list[Any]
    fresh: list[Any]
    readings: _Readings


def build_step(steps: tuple[int, ...], *, tires: bool = True, pressed: bool = False) -> ca.Function:
    """Return the step; every number stays an input of it.
    steps : doublings between the units.
    tires : whether it learns all of the tires, as of `motion.Learnt`.
    pressed : whether the load of the axles changes with speed; adds the input `downforce` (2,).
    """
    n = len(steps) + 1
    learnt = Learnt(tires)
    q, k = MOVING + len(learnt.names), len(learnt.names)
    ports, s = symbols(
        motion=MOVING,
        W=(2, n),
        own=2,
        sensors=len(SENSORS),
        UD=(1, len(triangle(k))),
        motion_UD=(1, len(triangle(q)) - len(triangle(k))),
        gate=GateState,
        body=_BodyState,
        readings=2 * len(_Readings._fields),
        running=_RunningState,
        excitation=(2, 1 + len(EDGES)),
        x=2,
        u=2,
        v_x=1,
        a_y=1,
        dt=1,
        car=(2, Car),
        scales=(1, n),
        plausibility=Plausibility,
        laws=Laws,
        trust=TrustNumbers,
        learning_speed=1,
        limits=LearntLimits,
        bounds=BoundNumbers,
        rising=n,
        curves=(len(CURVES), n),
        compliance=2,
        doubt=2,
        **({"downforce": 2} if pressed else {}),
        **({} if tires else {"along": Along}),
    )
    car, laws, trust, dt, slowest = s.car, s.laws, s.trust, s.dt, s.learning_speed
    into = learnt.into(n, s.curves, s.compliance)
    load = partial(load_ratio, s.downforce) if pressed else static_load
    seen = ca.vertcat(0, s.x[1])  # a missing v_y speaks against no sample
    gated = gate(s.plausibility, dt, s.gate, seen, s.u, s.v_x)
    runs = ca.logic_and(gated.on, gated.v_x >= slowest)
    goes_on = ca.logic_and(runs, s.running.on > 0.5)
    slow = ca.if_else(gated.first, gated.v_x, s.running.v_x)
    a_x = (gated.v_x - slow) * (1 / _LAG_OF_A_X) - s.motion[0] * gated.r
    if not tires:
        load = partial(s.along.moved, load, a_x)
    z = ca.vertcat(s.motion, s.W[0, :].T, s.W[1, :].T, s.own, s.sensors)
    turned = ca.vertcat(1 + laws.steering_gain, 1)
    gated = gated._replace(delta=turned * gated.delta)
    now = Sample(larger(gated.v_x, slowest), gated.delta)
    last = ca.vertcat(s.gate.delta_f, s.gate.delta_r)
    before = Sample(larger(s.gate.v_x, slowest), turned * last)
    named = unknowns(z, n)
    ahead = predicted(car, laws, dt, named, tuple(s.body), before, now, s.scales, steps, load)
    factors = factors_of([*ca.horzsplit(s.motion_UD), *ca.horzsplit(s.UD)], q)
    way, moving = ahead.by_way
    by_z = way.gradient(z, moving)
    F = ca.horzcat(by_z[:, : z.numel()] @ into, by_z[:, z.numel() :])
    # v_y and r on the way, the others
    for i in (-MOVING - 4, -MOVING - 3, *range(2 - MOVING, 0)):
        F[i, :] *= goes_on  # a filter that begins anew knows of no dependence
    added = ca.vertsplit(_force_deviation(trust, ahead) ** 2 * trust.renewed)
    factors = propagated(factors, F, [None, trust.r_walk, None, None, *added, trust.bank_walk])
    ahead_z = ca.vertcat(ahead.moving, z[MOVING:])
    noise = _noise(s, gated, goes_on)
    step, factors, left = _corrected(s, ahead, ahead_z, into, factors, noise, now, steps, load)
    corrected = ca.vertsplit(ahead_z + into @ step)
    shares = ca.vertcat(*corrected[4:6]) / _force_deviation(trust, ahead)
    squares = smaller(shares**2, _LARGEST_SQUARE)
    fast = s.running.force_error
    fast = fast + trust.alarm_gain * ((squares[0] + squares[1]) / 2 - fast)
    alarm = goes_on * gated.learns * within(fast * trust.per_alarm - 1, 0, 1)
    more = alarm * trust.inflation  # on another road the grip of both curves may change
    grip = [i for i, name in enumerate(learnt.names, start=MOVING) if name.startswith("grip")]
    factors = Factors(factors.U, [d + more if i in grip else d for i, d in enumerate(factors.D)])
    corrected = _bounded(s, corrected, learnt)

    # Else it begins anew, a sample later.
    sane = ca.fabs(corrected[0]) < _MOST_SLIDING * now.v_x
    begun, unsure = _afresh(s, gated, now, load)
    a_kept = smaller(dt * (1 / _LAG_OF_A_X), 1)
    kept = [
        *(ca.if_else(goes_on, a, b) for a, b in zip(corrected[:MOVING], begun, strict=True)),
        *corrected[MOVING:],  # which are not moved unless the filter goes on
    ]
    variances = (ca.if_else(goes_on, a, b) for a, b in zip(factors.D, unsure, strict=False))
    factors = Factors(factors.U, [*variances, *factors.D[MOVING:]])
    after = row_of(factors)
    moving = s.motion_UD.numel()
    given = unknowns(ca.vertcat(*kept), n)
    tilt = ca.if_else(
        goes_on, ca.vertcat(ahead.tilt, ahead.tilt_rate), ca.vertcat(gated.v_x * given.r, 0)
    )
    curves = curve(given.slip, given.W, s.scales, steps).under(load(now.v_x))
    force = curves.force * cosine(now.delta) + given.error
    variance = larger(entry(factors, 0, 0), 0)
    doubt = s.doubt[0] + s.doubt[1] * ca.fabs(curves.force[1])
    variance = variance + (now.v_x * doubt / curves.carcass_slope[1]) ** 2
    size_of_slip = larger(ca.fabs(given.slip), ca.fabs(ahead.alpha))
    next_state = {
        "motion": ca.vertcat(*kept[:MOVING]),
        "W": given.W,
        "own": given.compliance,
        "sensors": ca.vertcat(*kept[-len(SENSORS) :]),
        "UD": ca.horzcat(*after[moving:]),
        "motion_UD": ca.horzcat(*after[:moving]),
        "gate": gated.state,
        "body": tilt,
        "readings": ca.vertcat(*noise.readings[:-1], left),
        "running": ca.vertcat(
            ca.logic_and(runs, sane),
            ca.if_else(goes_on, fast, 0),
            slow + a_kept * (gated.v_x - slow),
        ),
        "excitation": excited(
            s.excitation,
            size_of_slip,
            dt=dt,
            samples=10,
            learns=ca.logic_and(goes_on, gated.learns) * ca.SX.ones(2),
        ),
    }
    outputs = (
        ca.if_else(gated.on, force * car.load, 0),
        ca.if_else(gated.on, given.v_y, 0),
        ca.sqrt(variance),
        ca.logic_and(runs, variance < trust.observable * now.v_x**2),
    )
    name = ["inertial_step", *map(str, steps), *["held"] * (not tires), *["pressed"] * pressed]
    return step_function(
        "_".join(name),
        ports,
        {port: ca.densify(next_state[port]) for port in CARRY},
        dict(zip(OUTPUTS, outputs, strict=True)),
    )


def _noise(s: SimpleNamespace, gated: Gate, goes_on: Any) -> _Noise:
    """Return what is new of r and a_y, and how noisy they are.

    A sensor that is slower than the log repeats its number, or settles to it in two steps where a
    filter stands between: that is no news. Second differences of news show noise and next to
    nothing of a car: their mean square is six variances.
    One channel is taken at a sample, that of which more numbers wait: a second update would cost as
    much as the first and tell what the next sample does.
    """
    a_y, trust, last = s.a_y, s.trust, _Readings(*ca.vertsplit(s.readings, 2))
    there = ca.logic_and(a_y == a_y, ca.fabs(a_y) < trust.surge)  # NaN is not NaN
    readings = [gated.r, ca.if_else(there, a_y, last.newest[1])]
    fresh, waiting, variance, state = [], [], [], []
    for y, newest, old, noise, waits, _ in zip(readings, *map(ca.vertsplit, last), strict=True):
        differs = (y - newest) ** 2 > _SAME * (newest - old) ** 2
        news = ca.logic_and(ca.logic_and(differs, goes_on), _is_good(gated))
        second = y - 2 * newest + old
        shows = smaller(second**2 / 6, _MOST_NOISE * noise + _LEAST)
        variance.append(ca.if_else(news, noise + trust.noise_gain * (shows - noise), noise))
        fresh.append(news)
        waiting.append(goes_on * smaller(waits + news, _MOST_WAITING))
        before = ca.if_else(news, newest, old)
        holds = ca.logic_and(goes_on, ca.logic_not(news))
        state.append((ca.if_else(holds, newest, y), ca.if_else(goes_on, before, y)))
    of_r, of_a_y = waiting
    first = of_r >= of_a_y
    turns = [first, ca.logic_not(first)]
    rest = [ca.if_else(turn, 0, one) for turn, one in zip(turns, waiting, strict=True)]
    share = [1 / larger(one, 1) for one in waiting]
    counts = ca.logic_and(ca.if_else(first, of_r, of_a_y) > 0, _is_good(gated))
    newest, before = zip(*state, strict=True)
    columns = [ca.vertcat(*one) for one in (newest, before, variance, rest)]
    following = _Readings(*columns, *[last.left])
    return _Noise(first, counts, turns, share, fresh, following)


def _force_deviation(trust: TrustNumbers, ahead: Predicted) -> Any:
    """Return the standard deviation of what curves miss of a force (2,) [static axle loads]."""
    return trust.error + trust.relative_error * ca.fabs(ahead.curve.force)


def _corrected(
    s: SimpleNamespace,
    ahead: Predicted,
    z: Any,
    into: Any,
    factors: Factors,
    noise: _Noise,
    now: Sample,
    steps: tuple[int, ...],
    load: Load,
) -> tuple[Any, Factors, Any]:
    """Return by how much r or a_y corrects, the factors, and innovations that wait.

    Innovations of what waits are kept: its turn comes at a next sample, where its number may be a
    new one, or none.
    """
    car, laws, trust = s.car, s.laws, s.trust
    readings, n = noise.readings, len(steps) + 1
    symbol = ca.SX.sym("z", z.numel())
    tilt = ca.SX.sym("tilt")
    named, way = unknowns(symbol, n), Way()
    at = curve_by(way, named, s.scales, steps).under(load(now.v_x))
    expected = expected_signals(car, laws, named, tilt, now, at)
    y = ca.vertcat(expected.r, expected.a_y)
    numbers = way.valued([y, ca.jacobian(y, symbol), ca.dot(turning(car), at.force)])
    y, H, turn = ca.substitute(numbers, [symbol, tilt], [z, ahead.tilt])
    H = H @ into
    late = (turn, GRAVITY * ca.dot(car.share, ahead.force_rate))
    y[1] -= laws.late * late[1]
    floors = (trust.r_error, trust.a_y_error + trust.a_y_share * ahead.tilt**2)
    error = [floor + (trust.lateness * one) ** 2 for floor, one in zip(floors, late, strict=True)]
    nu = [
        ca.if_else(fresh, readings.newest[i] - y[i], readings.left[i])
        for i, fresh in enumerate(noise.fresh)
    ]
    variance = ca.vertsplit(readings.variance)
    R = [e * share + R for e, share, R in zip(error, noise.share, variance, strict=True)]
    nu_now, R_now = (ca.if_else(noise.first, *pair) for pair in (nu, R))
    h = sum(as_factor(turn) * H[i, :] for i, turn in enumerate(noise.turns))
    step, factors = measured(
        factors, h, innovation=nu_now, R=R_now, clip=trust.clip, counts=noise.counts
    )
    moved = ca.vertcat(*step)
    left = [
        ca.if_else(turn, 0, one - ca.dot(H[i, :].T, moved))
        for i, (turn, one) in enumerate(zip(noise.turns, nu, strict=True))
    ]
    return moved, factors, ca.vertcat(*left)


def _is_good(gated: Gate) -> Any:
    """Return whether the gate goes on with this sample, and not with one before."""
    return gated.state[GateState._fields.index("bad")] == 0


def _bounded(s: SimpleNamespace, z: list[Any], learnt: Learnt) -> list[Any]:
    """Return z with what is learnt within its bounds."""
    kept, n, limits = list(z), s.W.shape[1], s.limits
    for first in (MOVING, MOVING + n):
        kept[first : first + n] = towards_center(
            s.bounds, z[first : first + n], ca.vertsplit(s.rising)
        )
    at = MOVING + 2 * n
    if learnt.tires:
        for i in (at, at + 1):
            kept[i] = within(z[i], 0, limits.compliance)
    for i, (name, most) in enumerate(zip(SENSORS, limits[1:], strict=True), start=at + 2):
        if name in learnt.names:
            kept[i] = within(z[i], 0 if name == "roll" else -most, most)
    return kept


def _afresh(
    s: SimpleNamespace, gated: Gate, now: Sample, load: Load
) -> tuple[list[Any], list[Any]]:
    """Return what moves, and its variances, of a filter that begins: in a steady corner."""
    car, trust = s.car, s.trust
    zero, bias = (s.sensors[SENSORS.index(name)] for name in ("steering", "gyro"))
    r = gated.r - bias
    stiffness = ca.dot(s.W[1, :], s.scales) * load(now.v_x)[1]
    stiffness = larger(stiffness, _STIFFNESS)
    lean = smaller(ca.fabs(gated.v_x * r) / GRAVITY, 1) / stiffness * ca.sign(r)
    v_y = gated.v_x * (gated.delta[1] - lean) - car.arm[1] * r
    alpha = slip_angle(now, v_y + car.arm * r, zero)
    unsure = trust.v_y + (_DOUBTED * gated.v_x * lean) ** 2
    slip = unsure / now.v_x**2
    variance = trust.error**2
    D = [unsure, trust.r, slip, slip, variance, variance, trust.bank]
    return [v_y, r, *ca.vertsplit(alpha), *[ca.SX(0)] * 3], D
