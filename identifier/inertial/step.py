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
from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.car import Car, axle_port, larger, named_port, smaller, within
from identifier.axle.covariance import Factors, entry, factors_of, row_of, triangle
from identifier.axle.curve import EDGES, curve, excited
from identifier.axle.gate import Gate, GateNumbers, GateState, gate
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
    predicted,
    shown,
    slip_angle,
    static_load,
    turning,
    unknowns,
)
from identifier.setup import AXLE_FORCE, FACTORS, NOT_NEGATIVE, Port
from models.vehicle import GRAVITY, load_ratio

OVER = ("x", "u", "v_x", "a_y")
LEARNT = ("W", "own", "sensors")
KEPT = ("UD", "motion_UD", "gate", "body", "readings", "running", "excitation")
CARRY = ("motion", *LEARNT, *KEPT)
OUTPUTS = ("axle_force", "v_y", "v_y_sd", "side_slip_observable")
LOAD = "static axle loads"
SAME = 0.01  # of the square of a change, up to which the next one is none: a number that settles
MOST_WAITING = 4  # numbers of a channel that wait for its turn
MOST_SLIDING = 0.7  # |v_y|/v_x from which the filter begins anew
MOST_NOISE = 9.0  # of the noise that is held for true, what one sample may show
MOST_MISSED = 25.0  # one outlier alone is no alarm
STIFFNESS = 2.0  # static loads/rad, the least that a corner is begun with
DOUBTED = 0.7  # of the slip that a corner is begun with
LAG_OF_A_X = 0.2  # s, of the washout that shows a_x
LEAST = 1e-12  # variance that is divided by

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
    Port(
        "gate",
        "SI",
        "last good v_x, v_y, r, delta_f, delta_r; on; time of steady learning; bad and stuck "
        "samples in a row",
    ),
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
    Port(
        "excitation",
        "rad; s",
        "largest slip, then time of learning above each edge, per axle",
        learnt=True,
        rule=NOT_NEGATIVE,
    ),
)


class LearntLimits(NamedTuple):
    """Of compliance [m], bias [g], roll [rad per g], steering [rad] and gyro [rad/s]."""

    compliance: Any
    bias: Any
    roll: Any
    steering: Any
    gyro: Any


class Noise(NamedTuple):
    """What r and a_y tell of themselves, and which of them comes first.

    first : 1 where that is r, 0 where it is a_y.   counts : 1 where it has a number.
    turns : 1 where a channel has its turn (2,).   share : 1 over the numbers that waited for it,
    (2,) [-]: of errors that one in a row repeats of another, the sum counts.
    fresh : 1 where a number is new, (2,).   left : innovations of those that wait (2,).
    variance : of noise [rad²/s², m²/s⁴], (2,).   readings : next state (8,), without those.
    """

    first: Any
    counts: Any
    turns: list[Any]
    share: list[Any]
    fresh: list[Any]
    left: list[Any]
    variance: list[Any]
    readings: Any


def build_step(steps: tuple[int, ...], *, tires: bool = True, pressed: bool = False) -> ca.Function:
    """Return the step; every number stays an input of it.

    Parameters
    ----------
    steps : doublings between the units.
    tires : whether it learns all of the tires, as of `motion.Learnt`.
    pressed : whether the load of the axles changes with speed; adds the input `downforce` (2,).
    """
    n = len(steps) + 1
    learnt = Learnt(tires)
    q = MOVING + len(learnt.names)
    ports: dict[str, Any] = {
        "motion": ca.SX.sym("motion", MOVING),
        "W": ca.SX.sym("W", 2, n),
        "own": ca.SX.sym("own", 2),
        "sensors": ca.SX.sym("sensors", len(SENSORS)),
        "UD": ca.SX.sym("UD", 1, len(triangle(q - MOVING))),
        "motion_UD": ca.SX.sym("motion_UD", 1, len(triangle(q)) - len(triangle(q - MOVING))),
    }
    ports["gate"], last = named_port(GateState, "gate")
    sizes = {"body": 2, "readings": 10, "running": 3}
    ports |= {name: ca.SX.sym(name, k) for name, k in sizes.items()}
    ports["excitation"] = ca.SX.sym("excitation", 2, 1 + len(EDGES))
    ports |= {name: ca.SX.sym(name, k) for name, k in (("x", 2), ("u", 2), ("v_x", 1), ("a_y", 1))}
    ports["dt"] = dt = ca.SX.sym("dt")
    ports["car"], car = axle_port(Car, "car")
    ports["scales"] = scales = ca.SX.sym("scales", 1, n)
    ports["plausibility"], possible = named_port(GateNumbers, "plausibility")
    ports["laws"], laws = named_port(Laws, "laws")
    ports["trust"], trust = named_port(TrustNumbers, "trust")
    ports["learning_speed"] = slowest = ca.SX.sym("learning_speed")
    ports["limits"], limits = named_port(LearntLimits, "limits")
    ports["bounds"], bounds = named_port(BoundNumbers, "bounds")
    ports["rising"] = ca.SX.sym("rising", n)
    ports["curves"] = ca.SX.sym("curves", len(CURVES), n)
    ports["compliance"] = ca.SX.sym("compliance", 2)
    ports["doubt"] = ca.SX.sym("doubt", 2)
    into = learnt.into(n, ports["curves"], ports["compliance"])
    load: Load = static_load
    if pressed:
        ports["downforce"] = ca.SX.sym("downforce", 2)
        load = partial(load_ratio, ports["downforce"])
    if not tires:
        ports["along"], along = named_port(Along, "along")

    seen = ca.vertcat(0, ports["x"][1])  # a missing v_y speaks against no sample
    gated = gate(possible, dt, last, seen, ports["u"], ports["v_x"])
    runs = ca.logic_and(gated.on, gated.v_x >= slowest)
    goes_on = ca.logic_and(runs, ports["running"][0] > 0.5)
    slow = ca.if_else(gated.first, gated.v_x, ports["running"][2])
    a_x = (gated.v_x - slow) * (1 / LAG_OF_A_X) - ports["motion"][0] * gated.r
    if not tires:
        load = partial(along.moved, load, a_x)
    z = ca.vertcat(
        ports["motion"], ports["W"][0, :].T, ports["W"][1, :].T, ports["own"], ports["sensors"]
    )
    turned = ca.vertcat(1 + laws.steering_gain, 1)
    gated = gated._replace(delta=turned * gated.delta)
    now = Sample(larger(gated.v_x, slowest), gated.delta)
    before = Sample(larger(last.v_x, slowest), turned * ca.vertcat(last.delta_f, last.delta_r))
    ahead = predicted(
        car,
        laws,
        dt,
        unknowns(z, n),
        (ports["body"][0], ports["body"][1]),
        before,
        now,
        scales,
        steps,
        load,
    )
    factors = factors_of([*ca.horzsplit(ports["motion_UD"]), *ca.horzsplit(ports["UD"])], q)
    way, moving = ahead.by_way
    by_z = way.gradient(z, moving)
    F = ca.horzcat(by_z[:, : z.numel()] @ into, by_z[:, z.numel() :])
    for i in (-MOVING - 4, -MOVING - 3, *range(2 - MOVING, 0)):  # v_y and r on the way, the others
        F[i, :] *= goes_on  # a filter that begins anew knows of no dependence
    factors = propagated(factors, F, _process_noise(trust, ahead))
    ahead_z = ca.vertcat(ahead.moving, z[MOVING:])
    noise = _noise(ports, trust, gated, goes_on)
    step, factors, readings = _corrected(
        (car, laws, trust),
        ahead,
        ahead_z,
        into,
        factors,
        noise,
        now,
        scales,
        steps,
        load,
    )
    corrected = ca.vertsplit(ahead_z + into @ step)
    missed = smaller((ca.vertcat(*corrected[4:6]) / _missed(trust, ahead)) ** 2, MOST_MISSED)
    fast = ports["running"][1]
    fast = fast + trust.alarm_gain * ((missed[0] + missed[1]) / 2 - fast)
    alarm = goes_on * gated.learns * within(fast * trust.per_alarm - 1, 0, 1)
    factors = _loosened(factors, learnt, alarm * trust.inflation)
    corrected = _bounded(ports, corrected, bounds, limits, learnt)

    sane = ca.fabs(corrected[0]) < MOST_SLIDING * now.v_x  # else it begins anew, a sample later
    begun, unsure = _afresh(ports, trust, car, gated, now, load)
    a_kept = smaller(dt * (1 / LAG_OF_A_X), 1)
    kept = [
        *(ca.if_else(goes_on, a, b) for a, b in zip(corrected[:MOVING], begun, strict=True)),
        *corrected[MOVING:],  # which are not moved unless the filter goes on
    ]
    variances = (ca.if_else(goes_on, a, b) for a, b in zip(factors.D, unsure, strict=False))
    factors = Factors(factors.U, [*variances, *factors.D[MOVING:]])
    after = row_of(factors)
    moving = ports["motion_UD"].numel()
    given = unknowns(ca.vertcat(*kept), n)
    tilt = ca.if_else(
        goes_on, ca.vertcat(ahead.tilt, ahead.tilt_rate), ca.vertcat(gated.v_x * given.r, 0)
    )
    curves = curve(given.slip, given.W, scales, steps).under(load(now.v_x))
    force = curves.force * cosine(now.delta) + given.error
    variance = larger(entry(factors, 0, 0), 0)
    doubt = ports["doubt"][0] + ports["doubt"][1] * ca.fabs(curves.force[1])
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
        "readings": readings,
        "running": ca.vertcat(
            ca.logic_and(runs, sane),
            ca.if_else(goes_on, fast, 0),
            slow + a_kept * (gated.v_x - slow),
        ),
        "excitation": excited(
            ports["excitation"],
            size_of_slip,
            dt=dt,
            samples=10,
            learns=ca.logic_and(goes_on, gated.learns) * ca.SX.ones(2),
        ),
    }
    name = ["inertial_step", *map(str, steps), *["held"] * (not tires), *["pressed"] * pressed]
    return ca.Function(
        "_".join(name),
        list(ports.values()),
        [
            *(ca.densify(next_state[name]) for name in CARRY),
            ca.if_else(gated.on, force * car.load, 0),
            ca.if_else(gated.on, given.v_y, 0),
            ca.sqrt(variance),
            ca.logic_and(runs, variance < trust.observable * now.v_x**2),
        ],
        list(ports),
        [*(f"{name}_next" for name in CARRY), *OUTPUTS],
        {"cse": True},
    )


def _noise(ports: dict[str, Any], trust: TrustNumbers, gated: Gate, goes_on: Any) -> Noise:
    """Return what is new of r and a_y, and how noisy they are.

    A sensor that is slower than the log repeats its number, or settles to it in two steps where a
    filter stands between: that is no news. Second differences of news show noise and next to
    nothing of a car: their mean square is six variances.
    One channel is taken at a sample, that of which more numbers wait: a second update would cost as
    much as the first and tell what the next sample does.
    """
    readings, a_y = ports["readings"], ports["a_y"]
    there = ca.logic_and(a_y == a_y, ca.fabs(a_y) < trust.surge)  # NaN is not NaN
    newest = [gated.r, ca.if_else(there, a_y, readings[1])]
    fresh, waiting, variance, state = [], [], [], []
    for i, y in enumerate(newest):
        old = readings[4 + i]
        differs = (y - readings[i]) ** 2 > SAME * (readings[i] - readings[2 + i]) ** 2
        news = ca.logic_and(ca.logic_and(differs, goes_on), _is_good(gated))
        second = y - 2 * readings[i] + readings[2 + i]
        shows = smaller(second**2 / 6, MOST_NOISE * old + LEAST)
        variance.append(ca.if_else(news, old + trust.noise_gain * (shows - old), old))
        fresh.append(news)
        waiting.append(goes_on * smaller(readings[6 + i] + news, MOST_WAITING))
        before = ca.if_else(news, readings[i], readings[2 + i])
        holds = ca.logic_and(goes_on, ca.logic_not(news))
        state.append((ca.if_else(holds, readings[i], y), ca.if_else(goes_on, before, y)))
    now, before = zip(*state, strict=True)
    of_r, of_a_y = waiting
    first = of_r >= of_a_y
    turns = [first, ca.logic_not(first)]
    left = [ca.if_else(turn, 0, one) for turn, one in zip(turns, waiting, strict=True)]
    share = [1 / larger(one, 1) for one in waiting]
    counts = ca.logic_and(ca.if_else(first, of_r, of_a_y) > 0, _is_good(gated))
    waits = ca.vertcat(*now, *before, *variance, *left)
    return Noise(first, counts, turns, share, fresh, [readings[8], readings[9]], variance, waits)


def _missed(trust: TrustNumbers, ahead: Predicted) -> Any:
    """Return the standard deviation of what curves miss of a force (2,) [static axle loads]."""
    return trust.error + trust.relative_error * ca.fabs(ahead.curve.force)


def _process_noise(trust: TrustNumbers, ahead: Predicted) -> list[Any]:
    """Return what a step adds to the variances of what moves, None where nothing."""
    e_f, e_r = ca.vertsplit(_missed(trust, ahead) ** 2 * trust.renewed)
    return [None, trust.r_walk, None, None, e_f, e_r, trust.bank_walk]


def _corrected(
    given: tuple[Car, Laws, TrustNumbers],
    ahead: Predicted,
    z: Any,
    into: Any,
    factors: Factors,
    noise: Noise,
    now: Sample,
    scales: Any,
    steps: tuple[int, ...],
    load: Load,
) -> tuple[Any, Factors, Any]:
    """Return by how much r or a_y corrects, the factors, and what is carried of both.

    Innovations of what waits are kept: its turn comes at a next sample, where its number may be a
    new one, or none.
    """
    car, laws, trust = given
    n = len(steps) + 1
    symbol = ca.SX.sym("z", z.numel())
    tilt = ca.SX.sym("tilt")
    named, way = unknowns(symbol, n), Way()
    at = curve_by(way, named, scales, steps).under(load(now.v_x))
    expected = shown(car, laws, named, tilt, now, at)
    y = ca.vertcat(expected.r, expected.a_y)
    numbers = way.valued([y, ca.jacobian(y, symbol), ca.dot(turning(car), at.force)])
    y, H, turn = ca.substitute(numbers, [symbol, tilt], [z, ahead.tilt])
    H = H @ into
    late = (turn, GRAVITY * ca.dot(car.share, ahead.force_rate))
    y[1] -= laws.late * late[1]
    floors = (trust.r_error, trust.a_y_error + trust.a_y_share * ahead.tilt**2)
    error = [floor + (trust.lateness * one) ** 2 for floor, one in zip(floors, late, strict=True)]
    nu = [
        ca.if_else(fresh, noise.readings[i] - y[i], left)
        for i, (fresh, left) in enumerate(zip(noise.fresh, noise.left, strict=True))
    ]
    R = [e * share + R for e, share, R in zip(error, noise.share, noise.variance, strict=True)]
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
    return moved, factors, ca.vertcat(noise.readings, *left)


def _is_good(gated: Gate) -> Any:
    """Return whether the gate goes on with this sample, and not with one before."""
    return gated.state[GateState._fields.index("bad")] == 0


def _loosened(factors: Factors, learnt: Learnt, amount: Any) -> Factors:
    """Return the factors where the road may be another one: the grip of both curves may change."""
    U, D = factors
    grip = [i for i, name in enumerate(learnt.names, start=MOVING) if name.startswith("grip")]
    return Factors(U, [d + amount if i in grip else d for i, d in enumerate(D)])


def _bounded(
    ports: dict[str, Any],
    z: list[Any],
    bounds: BoundNumbers,
    limits: LearntLimits,
    learnt: Learnt,
) -> list[Any]:
    """Return z with what is learnt within its bounds."""
    kept, n = list(z), ports["W"].shape[1]
    slope = ca.vertsplit(ports["rising"])
    for first in (MOVING, MOVING + n):
        kept[first : first + n] = towards_center(bounds, z[first : first + n], slope)
    at = MOVING + 2 * n
    if learnt.tires:
        for i in (at, at + 1):
            kept[i] = within(z[i], 0, limits.compliance)
    for i, (name, most) in enumerate(zip(SENSORS, limits[1:], strict=True), start=at + 2):
        if name in learnt.names:
            kept[i] = within(z[i], 0 if name == "roll" else -most, most)
    return kept


def _afresh(
    ports: dict[str, Any],
    trust: TrustNumbers,
    car: Car,
    gated: Gate,
    now: Sample,
    load: Load,
) -> tuple[list[Any], list[Any]]:
    """Return what moves, and its variances, of a filter that begins: in a steady corner."""
    sensors = ports["sensors"]
    zero, bias = (sensors[SENSORS.index(name)] for name in ("steering", "gyro"))
    r = gated.r - bias
    stiffness = ca.dot(ports["W"][1, :], ports["scales"]) * load(now.v_x)[1]
    stiffness = larger(stiffness, STIFFNESS)
    lean = smaller(ca.fabs(gated.v_x * r) / GRAVITY, 1) / stiffness * ca.sign(r)
    v_y = gated.v_x * (gated.delta[1] - lean) - car.arm[1] * r
    alpha = slip_angle(now, v_y + car.arm * r, zero)
    unsure = trust.v_y + (DOUBTED * gated.v_x * lean) ** 2
    slip = unsure / now.v_x**2
    missed = trust.error**2
    D = [unsure, trust.r, slip, slip, missed, missed, trust.bank]
    return [v_y, r, *ca.vertsplit(alpha), *[ca.SX(0)] * 3], D
