"""The step of the inertial identifier: one casadi.Function that is simulation, test and C source.

An extended Kalman filter of everything at once: what moves and what is learnt, whose errors are
correlated, so that v_y is corrected by what the curves are found to be and the other way round.
Its covariance is that of what moves and of steps along the directions of `motion.Learnt`.
Carried: motion (8,), W (2, n), own (2,) the compliances, sensors (5,) and UD the factors of the
covariance of what is learnt, motion_UD those of what moves; gate as of the axle identifier; body
(2,), heard (10,), running (2,), excitation (2, 9).
Sampled: x = [v_y, r], of which v_y is read where it is asked for; u, v_x, a_y, NaN where there is
none.
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
KEPT = ("UD", "motion_UD", "gate", "body", "heard", "running", "excitation")
OUTPUTS = ("axle_force", "v_y", "v_y_sd", "side_slip_observable")
LOAD = "static axle loads"
LEFT, FIRST_CHANGE = 7, 8  # of what is carried of a measured v_y: innovation that waits, changes
SAME = 0.01  # of the square of a change, up to which the next one is none: a number that settles
MOST_WAITING = 4  # numbers of a channel that wait for its turn
MOST_COUNTED = 1000  # samples
TAKEN = 0.5  # of a flag, above which it is set
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
        "g; rad per g; rad; rad/s; m/s",
        "bias of a_y, roll of the body, zero of the steering, bias of r, bias of a measured v_y",
        learnt=True,
    ),
    Port(
        "UD",
        "-; -; -; g; rad per g; rad/s; m/s",
        "covariance U D U' of ln grip and ln stiffness of both curves, a factor of both "
        "compliances and sensors, where they are learnt: D, and U above it, by rows",
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
        "heard",
        "rad/s, m/s^2; squares; -; rad/s, m/s^2",
        "newest r and a_y, those before, variances of their noise, how many numbers wait, "
        "and the innovation of those",
    ),
    Port(
        "heard_v_y",
        "m/s; (m/s)^2; -; m/s",
        "newest measured v_y and its innovation, variance of its noise, samples since the filter "
        "began and numbers that were new, 1 where the last sample took one, changes of v_y in the "
        "last samples, newest first",
    ),
    Port(
        "running",
        "-",
        "1 while the filter runs; mean square of the missed force over its deviation",
    ),
    Port(
        "excitation",
        "rad; s",
        "largest slip, then time of learning above each edge, per axle",
        learnt=True,
        rule=NOT_NEGATIVE,
    ),
)


def carry_of(delay: int | None) -> tuple[str, ...]:
    """Return the names of what a step carries.

    Parameters
    ----------
    delay : of a measured v_y, as `build_step` takes it.
    """
    return ("motion", *LEARNT, *KEPT, *(() if delay is None else ("heard_v_y",)))


class LearntLimits(NamedTuple):
    """Of compliance [m], bias [g], roll [rad per g], steering [rad], gyro [rad/s] and bias of v_y
    [m/s].
    """

    compliance: Any
    bias: Any
    roll: Any
    steering: Any
    gyro: Any
    v_y_bias: Any


class Noise(NamedTuple):
    """What r and a_y tell of themselves, and which of them comes first.

    first : 1 where that is r, 0 where it is a_y.   counts : 1 where it has a number.
    turns : 1 where a channel has its turn (2,).   share : 1 over the numbers that waited for it,
    (2,) [-]: of errors that one in a row repeats of another, the sum counts.
    fresh : 1 where a number is new, (2,).   left : innovations of those that wait (2,).
    variance : of noise [rad²/s², m²/s⁴], (2,).   heard : next state (8,), without those.
    """

    first: Any
    counts: Any
    turns: list[Any]
    share: list[Any]
    fresh: list[Any]
    left: list[Any]
    variance: list[Any]
    heard: Any

    def reading(
        self, h: Any, innovation: list[Any], R: list[Any], lateral: "Reading | None"
    ) -> "Reading":
        """Return that of v_y where it counts, else that of the channel that comes first.

        Parameters
        ----------
        lateral : of v_y, None where there is none.
        """
        of_r, of_a_y = zip(innovation, R, [self.counts] * 2, strict=True)
        rest = [ca.if_else(self.first, a, b) for a, b in zip(of_r, of_a_y, strict=True)]
        row = sum(as_factor(turn) * h[i, :] for i, turn in enumerate(self.turns))
        if lateral is None:
            return Reading(row, *rest)
        rest = [ca.if_else(lateral.counts, a, b) for a, b in zip(lateral[1:], rest, strict=True)]
        return Reading(row + as_factor(lateral.counts) * lateral.h, *rest)


class Reading(NamedTuple):
    """One number that is measured: its gradient h (1, q), innovation, variance of its error, and 1
    where there is one.
    """

    h: Any
    innovation: Any
    R: Any
    counts: Any


class Change(NamedTuple):
    """Of v_y in the step [m/s], and its gradient in z (1, q)."""

    v_y: Any
    gradient: Any


def build_step(
    steps: tuple[int, ...], delay: int | None, *, tires: bool = True, pressed: bool = False
) -> ca.Function:
    """Return the step; every number stays an input of it.

    Parameters
    ----------
    steps : doublings between the units.
    delay : samples by which a measured v_y is late; None does not look at it.
    tires : whether it learns all of the tires, as of `motion.Learnt`.
    pressed : whether the load of the axles changes with speed; adds the input `downforce` (2,).
    """
    n = len(steps) + 1
    learnt = Learnt(tires, delay is not None)
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
    sizes = {"body": 2, "heard": 10, "running": 3}
    if delay is not None:
        sizes["heard_v_y"] = heard_size(delay)
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
    now = Sample(larger(gated.v_x, slowest), gated.delta)
    before = Sample(larger(last.v_x, slowest), ca.vertcat(last.delta_f, last.delta_r))
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
    lateral, heard_v_y = None, []
    if delay is not None:
        difference = ahead.moving[0] - z[0]
        change = Change(difference, ca.jacobian(difference, z) @ into)
        lateral, heard_v_y = _lateral(
            ports, (trust, possible), delay, ahead_z, gated, goes_on, change
        )
        factors = _unsure_of_v_y(factors, trust, ca.logic_and(goes_on, _is_good(gated)))
    noise = _noise(ports, trust, gated, goes_on, ca.SX(0) if lateral is None else lateral.counts)
    step, factors, heard = _corrected(
        (car, laws, trust),
        ahead,
        ahead_z,
        into,
        factors,
        (noise, lateral),
        now,
        scales,
        steps,
        load,
    )
    if lateral is not None:
        left = lateral.innovation - ca.dot(lateral.h.T, step)
        heard_v_y.insert(LEFT, ca.if_else(lateral.counts, 0, left))
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
    told = unknowns(ca.vertcat(*kept), n)
    tilt = ca.if_else(
        goes_on, ca.vertcat(ahead.tilt, ahead.tilt_rate), ca.vertcat(gated.v_x * told.r, 0)
    )
    curves = curve(told.slip, told.W, scales, steps).under(load(now.v_x))
    force = curves.force * cosine(now.delta) + told.error
    variance = larger(entry(factors, 0, 0), 0)
    doubt = ports["doubt"][0] + ports["doubt"][1] * ca.fabs(curves.force[1])
    variance = variance + (now.v_x * doubt / curves.carcass_slope[1]) ** 2
    size_of_slip = larger(ca.fabs(told.slip), ca.fabs(ahead.alpha))
    next_state = {
        "motion": ca.vertcat(*kept[:MOVING]),
        "W": told.W,
        "own": told.compliance,
        "sensors": ca.vertcat(*kept[-len(SENSORS) :]),
        "UD": ca.horzcat(*after[moving:]),
        "motion_UD": ca.horzcat(*after[:moving]),
        "gate": gated.state,
        "body": tilt,
        "heard": heard,
        **({} if delay is None else {"heard_v_y": ca.vertcat(*heard_v_y)}),
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
    carry = carry_of(delay)
    return ca.Function(
        "_".join(name),
        list(ports.values()),
        [
            *(ca.densify(next_state[name]) for name in carry),
            ca.if_else(gated.on, force * car.load, 0),
            ca.if_else(gated.on, told.v_y, 0),
            ca.sqrt(variance),
            ca.logic_and(runs, variance < trust.observable * now.v_x**2),
        ],
        list(ports),
        [*(f"{name}_next" for name in carry), *OUTPUTS],
        {"cse": True},
    )


def _noise(
    ports: dict[str, Any], trust: TrustNumbers, gated: Gate, goes_on: Any, taken: Any
) -> Noise:
    """Return what is new of r and a_y, and how noisy they are.

    A sensor that is slower than the log repeats its number, or settles to it in two steps where a
    filter stands between: that is no news. Second differences of news show noise and next to
    nothing of a car: their mean square is six variances.
    One channel is taken at a sample, that of which more numbers wait: a second update would cost as
    much as the first and tell what the next sample does. Both wait where v_y is `taken`.
    """
    heard, a_y = ports["heard"], ports["a_y"]
    there = ca.logic_and(a_y == a_y, ca.fabs(a_y) < trust.surge)  # NaN is not NaN
    newest = [gated.r, ca.if_else(there, a_y, heard[1])]
    fresh, waiting, variance, state = [], [], [], []
    for i, y in enumerate(newest):
        old = heard[4 + i]
        differs = (y - heard[i]) ** 2 > SAME * (heard[i] - heard[2 + i]) ** 2
        news = ca.logic_and(ca.logic_and(differs, goes_on), _is_good(gated))
        second = y - 2 * heard[i] + heard[2 + i]
        shows = smaller(second**2 / 6, MOST_NOISE * old + LEAST)
        variance.append(ca.if_else(news, old + trust.noise_gain * (shows - old), old))
        fresh.append(news)
        waiting.append(goes_on * smaller(heard[6 + i] + news, MOST_WAITING))
        before = ca.if_else(news, heard[i], heard[2 + i])
        holds = ca.logic_and(goes_on, ca.logic_not(news))
        state.append((ca.if_else(holds, heard[i], y), ca.if_else(goes_on, before, y)))
    now, before = zip(*state, strict=True)
    of_r, of_a_y = waiting
    first, free = of_r >= of_a_y, ca.logic_not(taken)
    turns = [ca.logic_and(free, first), ca.logic_and(free, ca.logic_not(first))]
    left = [ca.if_else(turn, 0, one) for turn, one in zip(turns, waiting, strict=True)]
    share = [1 / larger(one, 1) for one in waiting]
    counts = ca.logic_and(ca.if_else(first, of_r, of_a_y) > 0, _is_good(gated))
    waits = ca.vertcat(*now, *before, *variance, *left)
    return Noise(first, counts, turns, share, fresh, [heard[8], heard[9]], variance, waits)


def _missed(trust: TrustNumbers, ahead: Predicted) -> Any:
    """Return the standard deviation of what curves miss of a force (2,) [static axle loads]."""
    return trust.error + trust.relative_error * ca.fabs(ahead.curve.force)


def _process_noise(trust: TrustNumbers, ahead: Predicted) -> list[Any]:
    """Return what a step adds to the variances of what moves, None where nothing."""
    e_f, e_r = ca.vertsplit(_missed(trust, ahead) ** 2 * trust.renewed)
    return [None, trust.r_walk, None, None, e_f, e_r, trust.bank_walk]


def _corrected(
    told: tuple[Car, Laws, TrustNumbers],
    ahead: Predicted,
    z: Any,
    into: Any,
    factors: Factors,
    heard: tuple[Noise, Reading | None],
    now: Sample,
    scales: Any,
    steps: tuple[int, ...],
    load: Load,
) -> tuple[Any, Factors, Any]:
    """Return by how much v_y, r or a_y corrects, the factors, and what is carried of the last two.

    Innovations of what waits are kept: its turn comes at a next sample, where its number may be a
    new one, or none.
    """
    (car, laws, trust), (noise, lateral) = told, heard
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
        ca.if_else(fresh, noise.heard[i] - y[i], left)
        for i, (fresh, left) in enumerate(zip(noise.fresh, noise.left, strict=True))
    ]
    R = [e * share + R for e, share, R in zip(error, noise.share, noise.variance, strict=True)]
    read = noise.reading(H, nu, R, lateral)
    step, factors = measured(
        factors,
        read.h,
        innovation=read.innovation,
        R=read.R,
        clip=trust.clip,
        counts=read.counts,
    )
    moved = ca.vertcat(*step)
    left = [
        ca.if_else(turn, 0, one - ca.dot(H[i, :].T, moved))
        for i, (turn, one) in enumerate(zip(noise.turns, nu, strict=True))
    ]
    return moved, factors, ca.vertcat(noise.heard, *left)


def heard_size(delay: int) -> int:
    """Return how many numbers are carried of a measured v_y."""
    return FIRST_CHANGE + max(delay - 1, 0)


def _is_good(gated: Gate) -> Any:
    """Return whether the gate goes on with this sample, and not with one before."""
    return gated.state[GateState._fields.index("bad")] == 0


def _lateral(
    ports: dict[str, Any],
    told: tuple[TrustNumbers, GateNumbers],
    late: int,
    z: Any,
    gated: Gate,
    goes_on: Any,
    change: Change,
) -> tuple[Reading, list[Any]]:
    """Return a measured v_y as a reading, and what is carried of it.

    Where it is late, it shows v_y of now less its changes since, as they were predicted: what is
    unsure of them is taken for as large as that of the newest one. Differences of innovations
    show the noise, from one number to the next. One that follows another at once is not taken: it
    is the turn of r and a_y.
    """
    trust, possible = told
    last, newest, old, age, count, took, waits, left, *changes = ca.vertsplit(ports["heard_v_y"])
    changes = [ca.if_else(goes_on, change.v_y, 0), *changes]
    y, learns = ports["x"][0], ca.logic_and(goes_on, _is_good(gated))
    y = ca.if_else(ca.logic_and(_is_good(gated), possible.possible_v_y(gated.v_x, y)), y, last)
    fresh = ca.logic_and(learns, ca.logic_and(y != last, age + 1 >= late))
    waiting = goes_on * ca.logic_or(fresh, waits > TAKEN)
    taken = ca.logic_and(ca.logic_and(learns, waiting), took < TAKEN)
    innovation = y - (z[0] - sum(changes[:late])) - z[-1]
    share = ca.if_else(ca.logic_and(fresh, waits > TAKEN), 0.5, 1)
    known = smaller(count + 2, 1 / trust.noise_gain)
    shows = smaller((innovation - newest) ** 2 / 2, MOST_NOISE * old + LEAST)
    variance = ca.if_else(fresh, old + (shows - old) / known, old)
    h = -late * change.gradient if late else ca.SX(1, change.gradient.numel())
    h[0] += 1
    h[-1] += 1
    R = (trust.v_y_error + variance) * share + (trust.lateness * change.v_y / ports["dt"]) ** 2
    heard = [
        y,
        ca.if_else(fresh, innovation, newest),
        variance,
        goes_on * smaller(age + 1, MOST_COUNTED),
        smaller(count + fresh, MOST_COUNTED),
        taken,
        ca.logic_and(waiting, ca.logic_not(taken)),
        *changes[: max(late - 1, 0)],
    ]
    mean = ca.if_else(fresh, left + share * (innovation - left), left)
    return Reading(h, mean, R, taken), heard


def _unsure_of_v_y(factors: Factors, trust: TrustNumbers, learns: Any) -> Factors:
    """Return the factors where the bias of a measured v_y may have changed in the step."""
    U, D = factors
    unsure = smaller(D[-1] + learns * trust.v_y_walk, larger(D[-1], trust.v_y_bias))
    return Factors(U, [*D[:-1], unsure])


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
