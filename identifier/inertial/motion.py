"""The car between two samples, and what its sensors should show: all that the filter predicts.

z = [v_y, r, x_f, x_r, e_f, e_r, p; w_f, w_r, s_f, s_r, b, ρ, δ₀, b_r]: what moves, then the tires
and the sensors. v_y [m/s], r [rad/s]; x lagged slip [rad]; e what the curves miss of a force
[static axle loads]; p sine of the bank, positive where it falls to the left; w weights of the
units, n each, s compliances [m]; b bias of the accelerometer [g], ρ roll of the body [rad per g],
δ₀ zero of the steering [rad], b_r bias of the gyro [rad/s]. What is learnt of these are steps along
a few directions (`Learnt`).

f = λ φ(x) cos δ + e,   dx/dt = v_x/σ (α - x),   σ = s λ C(x),   λ = 1 + κ v_x² where the car has
downforce (its own κ, of `Vehicle`), else 1,
α = δ + δ₀ - atan((v_y ± l r)/v_x) - k ä'/(ω² v_x), the last by the sway of the body, k given,
dv_y/dt = g Σ share f - v_x r + g p,   dr/dt = (l_f F_f - l_r F_r)/I_z.
Shown: r + b_r  and  a_y = g Σ share f + ρ ä + g b + x_s dr/dt - y_s r²: ä [m/s²] is what the body
rolls by, driven by the same forces, x_s and y_s where the accelerometer sits. A bank is in the
equation of v_y and not in a_y: an accelerometer feels what tires push.
Everything is taken at the middle of the step: where forces and v_x r are half a sample apart, their
difference is no v_y.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.car import Car
from identifier.axle.curve import Curve, hidden_units, of_units
from identifier.axle.slip import SHORTEST
from identifier.motion.model import LEAST_GRIP
from models.vehicle import GRAVITY, LIGHTEST

MOVING = 7  # entries of z before those that are learnt
_FIRST_COS = 24  # of the series of cos δ, 2e-5 off at 0.5 rad

SENSORS = ("bias", "roll", "steering", "gyro")  # the last of these


class _Unknowns(NamedTuple):
    """z by name: symbols or expressions; slip, error and compliance (2,), W (2, n)."""

    v_y: Any
    r: Any
    slip: Any
    error: Any
    bank: Any
    W: Any
    compliance: Any
    bias: Any
    roll: Any
    steering: Any
    gyro: Any


def _size(n: int) -> int:
    """Return how many entries z has for n units."""
    return MOVING + 2 * n + 2 + len(SENSORS)


class Learnt(NamedTuple):
    """What is learnt of z beside what moves, in this order: steps along directions.
    tires : along both directions of each curve, that of its stiffness and that of its grip, one
        factor of both compliances, and the zero of the steering; else along that of the grip alone.
    """

    tires: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all of it."""
        return (
            *((*CURVES, "compliance", "steering") if self.tires else ("grip",)),
            *("bias", "roll", "gyro"),
        )

    def into(self, n: int, curves: Any, compliance: Any) -> Any:
        """Return what a step of what moves and of each of these moves of z, sparse.
        n : number of units.
        curves : change of the weights by one of ln grip and of ln stiffness, (4, n): front and rear
            of the first, then of the second.
        compliance : of both axles that one of its factor adds, (2,).
        """
        E = ca.SX(_size(n), MOVING + len(self.names))
        E[:MOVING, :MOVING] = ca.SX.eye(MOVING)
        rest = MOVING + 2 * n
        for column, name in enumerate(self.names, start=MOVING):
            for k, curve in enumerate(CURVES):
                if curve == name or (name == "grip" and k < 2):
                    first = MOVING + k % 2 * n
                    E[first : first + n, column] = curves[k, :].T
            if name == "compliance":
                E[rest : rest + 2, column] = compliance
            elif name in SENSORS:
                E[rest + 2 + SENSORS.index(name), column] = 1
        return E


CURVES = ("grip_f", "grip_r", "stiffness_f", "stiffness_r")


def unknowns(z: Any, n: int) -> _Unknowns:
    """Return z by name.
    z : as above.   n : number of units.
    """
    m, k = MOVING, MOVING + 2 * n
    return _Unknowns(
        v_y=z[0],
        r=z[1],
        slip=z[2:4],
        error=z[4:6],
        bank=z[6],
        W=ca.vertcat(z[m : m + n].T, z[m + n : k].T),
        compliance=z[k : k + 2],
        bias=z[k + 2],
        roll=z[k + 3],
        steering=z[k + 4],
        gyro=z[k + 5],
    )


Load = Callable[[Any], Any]  # v_x [m/s] -> λ, loads of the axles over the static ones (2,) [-]


def static_load(v_x: Any) -> Any:
    """Return the loads of a car without downforce, 1 (2,): factors of which CasADi makes
    nothing.
    """
    del v_x
    return ca.SX.ones(2)


class Along(NamedTuple):
    """How a_x changes lateral forces: load that g moves to each axle [-]; what braking and power
    take of the friction circle [1/g], each of both axles; drag over the mass [1/m].
    """

    load_f: Any
    load_r: Any
    brake_f: Any
    brake_r: Any
    drive_f: Any
    drive_r: Any
    drag: Any

    def moved(self, load: Load, a_x: Any, v_x: Any) -> Any:
        """Return what forces are multiplied with (2,) [-].
        load : without a_x.   a_x : [m/s²].
        """
        f = (a_x + self.drag * v_x**2) * (1 / GRAVITY)
        drives = f > 0
        pairs = ((self.brake_f, self.drive_f), (self.brake_r, self.drive_r))
        use = ca.vertcat(*(f * ca.if_else(drives, drive, brake) for brake, drive in pairs))
        left = ca.sqrt(ca.fmax(1 - use * use, LEAST_GRIP))
        return ca.fmax(load(v_x) + f * ca.vertcat(self.load_f, self.load_r), LIGHTEST) * left


class Sample(NamedTuple):
    """v_x [m/s] and δ (2,) [rad] at a sample."""

    v_x: Any
    delta: Any


class Laws(NamedTuple):
    """What the motion obeys beside the car: decay of e and of the bank over a step [-];
    stiffness and damping of the roll [1/s²], [1/s]; share of its rate that
    moves the contact patches, over the stiffness [s²]; place of the accelerometer before and left
    of the center of gravity [m]; by how much a_y is late [s]; share by which δ_f reads too little.
    """

    forgets: Any
    bank: Any
    roll_stiffness: Any
    roll_damping: Any
    sway: Any
    ahead: Any
    aside: Any
    late: Any
    steering_gain: Any


class Way:
    """How a step leads to what moves: by numbers on the way, of each its expression.

    Numbers that are `constant` have no gradient: what a step moves them by is of second order.
    """

    def __init__(self) -> None:
        self._symbols: list[Any] = []
        self._values: list[Any] = []
        self._on_the_way: list[tuple[Any, Any]] = []

    def constant(self, value: Any) -> Any:
        """Return a number of which the gradient is left out, as a symbol."""
        symbol = ca.SX.sym("constant", *value.shape)
        self._symbols.append(symbol)
        self._values.append(value)
        return symbol

    def by(self, value: Any) -> Any:
        """Return a number that others go on from, as a symbol."""
        symbol = self.constant(value)
        self._on_the_way.append((symbol, value))
        return symbol

    def linear(self, value: Any, slope: Any, x: Any) -> Any:
        """Return a number with a gradient that is known, and not that of how it is computed.
        value, slope : f(x) and f'(x), of any shape.
        """
        return self.constant(value) + self.constant(slope) * (x - self.constant(x))

    def valued(self, expressions: list[Any]) -> list[Any]:
        """Return expressions with the numbers on the way put in."""
        for symbol, value in zip(reversed(self._symbols), reversed(self._values), strict=True):
            expressions = ca.substitute(expressions, [symbol], [value])
        return expressions

    def gradient(self, z: Any, moving: Any) -> Any:
        """Return F by its way, as `identifier.inertial.gaussian.propagated` takes it.
        z : symbols (q,).   moving : what moves (7,), an expression of z and of symbols on the way.
        """
        symbols, values = zip(*self._on_the_way, strict=True)
        numbers = ca.vertcat(*values, moving)
        return self.valued([ca.jacobian(numbers, ca.vertcat(z, *symbols))])[0]


class Predicted(NamedTuple):
    """After a step: what moves (7,) of z, the slip α (2,) [rad] and the rolling body.
    by_way : how the step leads to `moving`, and that as an expression of the numbers on the way.
    tilt, tilt_rate : ä [m/s²] and its rate [m/s³].   curve : at the slip before the step.
    force_rate : of the lagged slip times the slope of the curve [1/s], (2,).
    """

    moving: Any
    by_way: tuple[Way, Any]
    alpha: Any
    tilt: Any
    tilt_rate: Any
    curve: Curve
    force_rate: Any


def turning(car: Car) -> Any:
    """Return what forces give of dr/dt [rad/s² per load], (2,)."""
    wheelbase = car.arm[0] - car.arm[1]
    return ca.fabs(car.arm) / (wheelbase * car.inertia)


def cosine(delta: Any) -> Any:
    """Return cos δ, without a call.
    delta : steering [rad].
    """
    return 1 - delta**2 / 2 + delta**4 / _FIRST_COS


def slip_angle(at: Sample, sideways: Any, steering: Any) -> Any:
    """Return α [rad], (2,).
    at : speed and steering.   sideways : v_y of the axles, v_y ± l r [m/s], (2,).
    steering : δ₀ [rad].
    """
    return at.delta + ca.vertcat(steering, 0) - ca.atan(sideways * (1 / at.v_x))


def predicted(
    car: Car,
    laws: Laws,
    dt: Any,
    z: _Unknowns,
    tilt: tuple[Any, Any],
    before: Sample,
    now: Sample,
    scales: Any,
    steps: tuple[int, ...],
    load: Load = static_load,
) -> Predicted:
    """Return the state a step later, linearly implicit in v_y and r: stable for any stiff tire.

    Slip is exact for α linear over the step (first-order hold), forces and motion meet in the
    middle of it.
    dt : sampling interval [s].   z : before the step.
    scales : 1/α_j of the units [1/rad], (1, n).   steps : doublings between the units.
    """
    way = Way()
    v_x = (before.v_x + now.v_x) / 2
    at = curve_by(way, z, scales, steps).under(load(v_x))
    wheelbase = car.arm[0] - car.arm[1]
    steep = way.constant(at.carcass_slope <= at.slope)
    carcass = steep * at.slope + (1 - steep) * way.constant(at.carcass_slope)
    sigma = way.by(z.compliance * carcass + SHORTEST * wheelbase)
    length = v_x * dt * (1 / sigma)
    e = ca.exp(-length)
    mean = (1 - e) * (1 / length)
    sway = -laws.sway * tilt[1] * (1 / v_x)
    sideways = way.by(z.v_y + car.arm * z.r)
    was = slip_angle(before, sideways, z.steering) + sway
    stays = slip_angle(now, sideways, z.steering) + sway  # where v_y and r stay as they are
    slip = e * z.slip + (mean - e) * was + (1 - mean) * stays
    cos_delta = cosine(now.delta)
    slope = way.constant(at.slope)
    force = way.by((at.force + slope * (slip - z.slip) / 2) * cos_delta + z.error)
    arm, turn = car.arm, turning(car)
    push = GRAVITY * car.share
    # Force per change of v_y.
    pull = way.constant(slope * cos_delta * (1 - mean) * (dt / (2 * v_x)))
    a = ca.dot(push, force) - v_x * z.r + GRAVITY * z.bank
    b = ca.dot(turn, force)
    m11, m12 = 1 + ca.dot(push, pull), ca.dot(push * arm, pull) + dt * v_x / 2
    m21, m22 = ca.dot(turn, pull), 1 + ca.dot(turn * arm, pull)
    per = dt / (m11 * m22 - m12 * m21)
    v_y = way.by(z.v_y + (m22 * a - m12 * b) * per)
    r = way.by(z.r + (m11 * b - m21 * a) * per)
    alpha = slip_angle(now, way.by(v_y + car.arm * r), z.steering) + sway
    slip = e * z.slip + (mean - e) * was + (1 - mean) * alpha
    rolling, rate = tilt
    rate = (rate + dt * laws.roll_stiffness * (ca.dot(push, force) - rolling)) / (
        1 + dt * laws.roll_damping + dt**2 * laws.roll_stiffness
    )
    moving = ca.vertcat(v_y, r, slip, laws.forgets * z.error, laws.bank * z.bank)
    force_rate = at.slope * (slip - z.slip) / dt
    numbers = [moving, alpha, rolling + dt * rate, rate, force_rate]
    moved, alpha, tilting, rate, force_rate = way.valued(numbers)
    before_it = Curve(*way.valued(list(at)))
    return Predicted(moved, (way, moving), alpha, tilting, rate, before_it, force_rate)


def curve_by(way: Way, z: _Unknowns, scales: Any, steps: tuple[int, ...]) -> Curve:
    """Return the curves at the lagged slip under static loads, tanh with the gradient it tells.
    z : slip and weights.   scales : 1/α_j of the units [1/rad], (1, n).
    steps : doublings between the units.
    """
    T = hidden_units(z.slip, scales, steps)
    inverse = ca.repmat(scales, 2, 1)
    slip = ca.repmat(z.slip, 1, scales.numel())
    return of_units(way.linear(T, (1 - T * T) * inverse, slip), z.W, scales)


class _Expected(NamedTuple):
    """What gyro and accelerometer should show [rad/s], [m/s²]; forces (2,) [static axle loads]."""

    r: Any
    a_y: Any
    force: Any


def expected_signals(
    car: Car, laws: Laws, z: _Unknowns, tilt: Any, now: Sample, at: Curve
) -> _Expected:
    """Return what the sensors should show of a state.
    tilt : ä of the rolling body [m/s²].   at : curves at the lagged slip.
    """
    force = at.force * cosine(now.delta) + z.error
    a_y = GRAVITY * (ca.dot(car.share, force) + z.bias) + z.roll * tilt
    a_y += laws.ahead * ca.dot(turning(car), force) - laws.aside * z.r**2
    return _Expected(z.r + z.gyro, a_y, force)
