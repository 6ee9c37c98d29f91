"""Lateral motion of a car from its signals, one sample a step, with slopes over the parameters.

Signals, after the sensors' errors are taken out:
v_y = v_y,m(t + τ) - b - β v_x - x_s r,   δ = (1 + g) δ_m(t + τ_δ) + δ0,
r = (1 + g_r) r_m(t + τ_r) - b_r,   v_x = (1 + g_x) v_x,m;  behind a low pass x = x_m + T x_m'.
Slip, i = f, r:   α_i = δ_i - atan((v_y ± l_i r)/v_x) + k_i (-ρ'/(ω² v_x)),
sway:   ρ'' = ω² (a - ρ) - 2 ζ ω ρ',   a = g Σ share_i φ_i.
Relaxation:   x_i' = (v_x/σ_i)(α_i - x_i),   σ_i = s_i max(φ_i'(x_i), 0.02 C_i) + 0.001 L, solved
exactly for α linear over a step.
Curve on a road of m times the friction:   φ(x) = m φ_0(x/m),
φ_0 = μ sin(c atan u) + Σ q_j tanh(x/a_j),   u = B x - E (B x - atan B x),   B = C/(c μ)
(Pacejka, Tyre and Vehicle Dynamics, 4.3, and what it misses).
Load and ellipse, f = (a_x + d v_x²)/g, d of the drag:   λ_i = max(1 ∓ (h L/l_o) f + κ_i v_x², 0.2),
G_i = sqrt(max(1 - (c_i f)², 0.05)).
Force over the static load:   F_i = λ_i G_i φ_i(x_i) cos δ_i.
Balance of an axle (`axle.car`):   ξ_i' + v_x r/g - F_i - bank = 0. Missed, through a filter of
time 1/κ and without a derivative:   z' = (what is missed) - κ z,   e = κ z.

Slopes run along by the chain rule from stage to stage (forward differentiation): each stage has
few inputs, so that no stage but the last knows all parameters.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import casadi as ca

from codegen import Scan
from codegen.compiler import FLAGS
from identifier.axle.car import step_function, symbols
from identifier.axle.gate import GateState, Plausibility, gate
from identifier.axle.slip import SHORTEST
from identifier.motion.parameters import INDEX, NAMES, SLIPS
from models.vehicle import GRAVITY, LIGHTEST

LEAST_GRIP = 0.05  # of G²: what an axle that uses all of its grip lengthwise keeps sideways
LEAST_SLOPE = 0.02  # of C: the carcass does not stretch further
DAMPING = 0.3  # ζ of the sway
# Slopes over all parameters are thousands of lines: to optimize them further takes the compiler
# longer than they run.
QUICK = tuple("-O1" if flag == "-O2" else flag for flag in FLAGS)
RATE = 4.0  # κ [1/s]: what is missed is a mean over a quarter of a second

Columns = tuple[str, ...]
SIGNALS = ("v_x", "v_y", "r", "delta_f", "delta_r", "a_x", "bank", "road", "on")
RATES = ("v_y_rate", "r_rate", "delta_rate")  # of late signals, by which a delay is estimated
SENSED = ("v_x", "v_y", "r", "delta_f", *RATES)
SENSORS = (
    "v_x_factor", "v_y_bias", "v_y_angle", "v_y_lever", "v_y_delay", "v_y_lag",
    "r_bias", "r_gain", "r_delay", "r_lag",
    "steering_zero", "steering_gain", "steering_delay", "steering_lag",
)  # fmt: skip
CARRIED = (
    "x_f", "x_r", "alpha_f", "alpha_r", "slope_f", "slope_r", "force_f", "force_r",
    "rho", "rate", "z_f", "z_r", "xi_f", "xi_r", "u_f", "u_r",
)  # fmt: skip


class CarNumbers(NamedTuple):
    """l_f, l_r [m], I_z/(m g) [s²], ω of the sway [rad/s], κ of the downforce (2) [s²/m²], d of
    the drag [1/m].
    """

    l_f: Any
    l_r: Any
    inertia: Any
    omega: Any
    press_f: Any
    press_r: Any
    drag: Any


class _Dual(NamedTuple):
    """A value and its slopes over the parameters, (1, n)."""

    value: Any
    slopes: Any


class _Stage:
    """Equations from a few inputs to a few outputs, differentiated once.
    outputs : expressions of them, and of symbols without slopes.
    """

    def __init__(self, inputs: list[Any], outputs: list[Any]) -> None:
        x, y = ca.vertcat(*inputs), ca.vertcat(*outputs)
        names = {one.name() for one in inputs}
        self._free = ca.vertcat(*(one for one in ca.symvar(y) if one.name() not in names))
        self._function = ca.Function("stage", [x, self._free], [y, ca.jacobian(y, x)])

    def __call__(self, inputs: list[_Dual]) -> list[_Dual]:
        """Return the outputs and their slopes."""
        value, J = self._function(ca.vertcat(*(one.value for one in inputs)), self._free)
        slopes = ca.mtimes(J, ca.vertcat(*(one.slopes for one in inputs)))
        return [_Dual(value[i], slopes[i, :]) for i in range(value.shape[0])]


@cache
def motion_scan(columns: Columns = ()) -> Scan:
    """Return the model as a compiled loop.

    Its ports: `state` (16,) and `tangent` are carried, `signals` (9,) and `rates` (3,) have a row
    a sample, `parameters` (p,), `car` (7,) and `dt` are constant; `force` (2,) [static loads],
    `missed` e (2,) [static loads], `slip` (2,) [rad] and, where slopes are asked for,
    `missed_slopes` (2, n) come out.
    columns : names of the parameters over which slopes are asked for, (n,).
    """
    n = len(columns)
    ports, s = symbols(
        state=len(CARRIED),
        was_on=1,
        signals=len(SIGNALS),
        rates=len(RATES),
        parameters=len(NAMES),
        car=CarNumbers,
        dt=1,
    )
    old = _by_name(CARRIED, s.state)
    duals = {
        name: _Dual(value, _unit(name, columns))
        for name, value in _by_name(NAMES, s.parameters).items()
    }
    fixed = _constant((*SIGNALS, *RATES), ca.vertsplit(ca.vertcat(s.signals, s.rates)), n)
    on = fixed["on"].value
    first = 1 - s.was_on * on
    pattern = {name: ca.Sparsity(1, n) for name in CARRIED}
    while True:  # which parameters each state can depend on
        tangents = {name: ca.SX.sym(f"t_{name}", pattern[name]) for name in CARRIED}
        before = {name: _Dual(old[name], tangents[name]) for name in CARRIED}
        after, out = _step(before, fixed, duals, s.car, s.dt, first)
        grown = {
            name: pattern[name] + ca.sparsify(after[name].slopes).sparsity() for name in CARRIED
        }
        if all(grown[name].nnz() == pattern[name].nnz() for name in CARRIED):
            break
        pattern = grown
    outputs = {
        "state_next": ca.vertcat(*(ca.if_else(on > 0, after[name].value, 0) for name in CARRIED)),
        "was_on_next": on,
        **{
            port: on * ca.vertcat(*(axis.value for axis in out[name]))
            for port, name in (("force", "F"), ("missed", "e"), ("slip", "x"))
        },
    }
    carry: tuple[str, ...] = ("state", "was_on")
    if n:
        kept = ca.vertcat(*(ca.vec(tangents[name].nz[:]) for name in CARRIED))
        ports["tangent"] = ca.SX.sym("tangent", kept.numel())
        outputs["tangent_next"] = ca.vertcat(
            *(on * ca.vec(ca.project(after[name].slopes, pattern[name]).nz[:]) for name in CARRIED)
        )
        outputs["missed_slopes"] = on * ca.vertcat(*(ca.densify(one.slopes) for one in out["e"]))
        exchanged = ca.substitute(list(outputs.values()), [kept], [ports["tangent"]])
        outputs = dict(zip(outputs, exchanged, strict=True))
        carry = (*carry, "tangent")
    dense = [ca.densify(one) for one in outputs.values()]
    step = ca.Function(f"motion_{n}", list(ports.values()), dense, list(ports), list(outputs))
    return Scan(step, carry=carry, over=("signals", "rates"), flags=QUICK)


def _by_name(names: tuple[str, ...], vector: Any) -> dict[str, Any]:
    return dict(zip(names, ca.vertsplit(vector), strict=True))


def _constant(names: tuple[str, ...], values: Sequence[Any], n: int) -> dict[str, _Dual]:
    """Return values that depend on none of n parameters, by name."""
    return {name: _Dual(value, ca.SX(1, n)) for name, value in zip(names, values, strict=True)}


def _unit(name: str, columns: Columns) -> Any:
    """Return the slopes of a parameter over the columns: one at its own, (1, n)."""
    slopes = ca.SX(1, len(columns))
    if name in columns:
        slopes[0, columns.index(name)] = 1
    return slopes


def _step(
    before: dict[str, _Dual],
    signals: dict[str, _Dual],
    p: dict[str, _Dual],
    car: CarNumbers,
    dt: Any,
    first: Any,
) -> tuple[dict[str, _Dual], dict[str, tuple[_Dual, _Dual]]]:
    """Return the state after a sample, and F, e, x of both axles."""
    after: dict[str, _Dual] = {}
    L = car.l_f + car.l_r
    v_x, v_y, r, delta = _sensors(signals, p)
    after["rate"], after["rho"], sway = _sway(before, p, car, dt, first, v_x, r)
    out: dict[str, tuple[_Dual, _Dual]] = {}
    found = [
        _axle(
            axle,
            before,
            signals,
            p,
            car,
            dt,
            first,
            v_x=v_x,
            v_y=v_y,
            r=r,
            delta=delta if axle == "f" else signals["delta_r"],
            sway=sway,
            after=after,
            L=L,
        )
        for axle in "fr"
    ]
    for k, name in enumerate(("F", "e", "x")):
        out[name] = (found[0][k], found[1][k])
    return after, out


def true_signals(signals: Sequence[Any], p: Sequence[Any]) -> tuple[Any, Any, Any, Any]:
    """Return v_x, v_y, r and δ_f without the sensors' errors, as numbers or as symbols.
    p : parameters, those of `SENSORS`.
    """
    v_x, v_y, r, delta, v_y_rate, r_rate, delta_rate = signals
    (factor, b, beta, x_s, late_v, lag_v, b_r, gain_r, late_r, lag_r,
     zero, gain, late, lag) = p  # fmt: skip
    true_v_x = v_x * (1 + factor)
    true_r = (1 + gain_r) * (r + (late_r + lag_r) * r_rate) - b_r
    true_v_y = v_y + (late_v + lag_v) * v_y_rate - b - beta * true_v_x - x_s * true_r
    true_delta = (1 + gain) * (delta + (late + lag) * delta_rate) + zero
    return true_v_x, true_v_y, true_r, true_delta


def _sensors(signals: dict[str, _Dual], p: dict[str, _Dual]) -> tuple[_Dual, _Dual, _Dual, _Dual]:
    """Return v_x, v_y, r and δ_f without the sensors' errors."""
    logged, errors = ([ca.SX.sym(name) for name in names] for names in (SENSED, SENSORS))
    stage = _Stage([*logged, *errors], list(true_signals(logged, errors)))
    found = stage([signals[name] for name in SENSED] + [p[name] for name in SENSORS])
    return found[0], found[1], found[2], found[3]


def _sway(
    before: dict[str, _Dual],
    p: dict[str, _Dual],
    car: CarNumbers,
    dt: Any,
    first: Any,
    v_x: _Dual,
    r: _Dual,
) -> tuple[_Dual, _Dual, _Dual]:
    """Return ρ', ρ and -ρ'/(ω² v_x), semi-implicit in ρ' (as `axle.slip.sway`)."""
    names = ("rho", "rate", "force_f", "force_r", "slope_f", "slope_r")
    rho, rate, f_f, f_r, C_f, C_r = (ca.SX.sym(name) for name in names)
    k_f, k_r, ln_sway, shift, speed, yaw = (
        ca.SX.sym(n) for n in ("k_f", "k_r", "w", "shift", "speed", "yaw")
    )
    L = car.l_f + car.l_r
    front, rear = (car.l_r + shift) / L, (car.l_f - shift) / L
    omega = car.omega * ca.exp(ln_sway)
    a = GRAVITY * (front * f_f + rear * f_r)
    eased = 1 + dt * GRAVITY * (front * C_f * k_f + rear * C_r * k_r) / speed
    moved = (rate * eased + dt * omega**2 * (a - rho)) / (eased + dt * 2 * DAMPING * omega)
    moved = ca.if_else(first > 0, 0, moved)
    place = ca.if_else(first > 0, speed * yaw, rho + dt * moved)
    inputs = [rho, rate, f_f, f_r, C_f, C_r, k_f, k_r, ln_sway, shift, speed, yaw]
    outputs = [moved, place, -moved / (omega**2 * speed)]
    of = ("sway_share_f", "sway_share_r", "ln_sway", "cg_shift")
    found = _Stage(inputs, outputs)(
        [before[name] for name in names] + [p[name] for name in of] + [v_x, r]
    )
    return found[0], found[1], found[2]


def curve_symbols() -> tuple[list[Any], Any, Any, Any]:
    """Return the numbers of a curve, a slip, and there φ and dφ/dx, as CasADi symbols.

    The numbers are ln C, ln μ, c, E, q (4) and ln m, (9,); forces in static axle loads.
    """
    numbers = [ca.SX.sym(n) for n in ("lnC", "lnmu", "c", "E", "q0", "q1", "q2", "q3", "lnm")]
    ln_C, ln_mu, c, E, *q, ln_m = numbers
    x = ca.SX.sym("x")
    m = ca.exp(ln_m)
    y = x / m
    mu = ca.exp(ln_mu)
    B = ca.exp(ln_C) / (c * mu)
    u = B * y - E * (B * y - ca.atan(B * y))
    at = c * ca.atan(u)
    du = B * (1 - E * (B * y) ** 2 / (1 + (B * y) ** 2))
    T = [ca.tanh(y / slip) for slip in SLIPS]
    phi = mu * ca.sin(at) + sum(weight * t for weight, t in zip(q, T, strict=True))
    slope = mu * c * ca.cos(at) / (1 + u * u) * du + sum(
        weight * (1 - t * t) / slip for weight, t, slip in zip(q, T, SLIPS, strict=True)
    )
    return numbers, x, m * phi, slope


@cache
def curve_index(axle: str) -> list[int]:
    """Return where the numbers of `curve_symbols` of an axle stand among the parameters, (9,)."""
    names = [f"{name}_{axle}" for name in ("ln_stiffness", "ln_grip", "shape", "curvature")]
    names += [f"residual{j}_{axle}" for j in range(len(SLIPS))]
    return [INDEX[name] for name in (*names, "ln_road")]


@cache
def curve_function() -> ca.Function:
    """Return (numbers (9,), slip) -> φ, dφ/dx, ∂φ/∂numbers (9,)."""
    numbers, x, phi, slope = curve_symbols()
    vector = ca.vertcat(*numbers)
    gradient = ca.densify(ca.jacobian(phi, vector)).T
    return ca.Function("curve", [vector, x], [phi, slope, gradient])


def _axle(
    axle: str,
    before: dict[str, _Dual],
    signals: dict[str, _Dual],
    p: dict[str, _Dual],
    car: CarNumbers,
    dt: Any,
    first: Any,
    *,
    v_x: _Dual,
    v_y: _Dual,
    r: _Dual,
    delta: _Dual,
    sway: _Dual,
    after: dict[str, _Dual],
    L: Any,
) -> tuple[_Dual, _Dual, _Dual]:
    """Return F, e and x of an axle; its states after the sample go into `after`."""
    front = axle == "f"
    # Slip.
    d, vy, vx, yaw, k, s, shift = (ca.SX.sym(n) for n in ("d", "vy", "vx", "r", "k", "s", "cg"))
    arm = (car.l_f - shift) if front else -(car.l_r + shift)
    (alpha,) = _Stage([d, vy, vx, yaw, k, s, shift], [d - ca.atan((vy + arm * yaw) / vx) + k * s])(
        [delta, v_y, v_x, r, p[f"sway_share_{axle}"], sway, p["cg_shift"]]
    )
    # Relaxation: the exact step of a first-order lag for α linear over it.
    x0, a0, a1, C, give = (ca.SX.sym(n) for n in ("x", "a0", "a1", "C", "s"))
    sigma = give * C + SHORTEST * L
    h = vx * dt / sigma
    e = ca.exp(-h)
    x1 = e * x0 + (1 - e) * a0 + (1 - (1 - e) / h) * (a1 - a0)
    (x,) = _Stage([x0, a0, a1, C, give, vx], [ca.if_else(first > 0, a1, x1)])(
        [
            before[f"x_{axle}"],
            before[f"alpha_{axle}"],
            alpha,
            before[f"slope_{axle}"],
            p[f"compliance_{axle}"],
            v_x,
        ]
    )
    after[f"x_{axle}"], after[f"alpha_{axle}"] = x, alpha
    # Curve.
    numbers, at, phi, slope = curve_symbols()
    road = p["ln_road"]
    ln_m = _Dual(road.value + signals["road"].value, road.slopes)
    floor = LEAST_SLOPE * ca.exp(numbers[0])
    names = ("ln_stiffness", "ln_grip", "shape", "curvature")
    given = [p[f"{name}_{axle}"] for name in names]
    given += [p[f"residual{j}_{axle}"] for j in range(len(SLIPS))]
    curve = _Stage([*numbers, at], [phi, ca.fmax(slope, floor)])
    value, after[f"slope_{axle}"] = curve([*given, ln_m, x])
    # Load and ellipse.
    phi0, height, brake, drive, cg, down, felt, speed = (
        ca.SX.sym(n) for n in ("phi", "h", "b", "d", "cg", "down", "a_x", "v")
    )
    f = (felt + car.drag * speed**2) / GRAVITY
    other = (car.l_r + cg) if front else (car.l_f - cg)
    shifted = (-height if front else height) * L / other * f
    press = car.press_f if front else car.press_r
    load = 1 + shifted + (press + down) * speed**2
    load = ca.if_else(load > LIGHTEST, load, LIGHTEST)
    use = ca.if_else(f > 0, drive, brake) * f
    left = ca.sqrt(ca.fmax(1 - use**2, LEAST_GRIP))
    (force,) = _Stage([phi0, height, brake, drive, cg, down, felt, speed], [phi0 * load * left])(
        [
            value,
            p["load_transfer"],
            p[f"braking_{axle}"],
            p[f"driving_{axle}"],
            p["cg_shift"],
            p[f"downforce_{axle}"],
            signals["a_x"],
            v_x,
        ]
    )
    after[f"force_{axle}"] = force
    # What the balance misses.
    z0, xi0, u0, F0, angle, ln_I, push = (
        ca.SX.sym(n) for n in ("z", "xi", "u", "F", "d", "I", "bank")
    )
    J = car.inertia * ca.exp(ln_I) / (other if front else -other)
    across = F0 * ca.cos(angle)
    xi = vy / GRAVITY + J * yaw
    u = across - vx * yaw / GRAVITY + push
    fall = ca.exp(-RATE * dt)
    mean = (1 - fall) / (RATE * dt)
    z = fall * z0 + mean * (xi - xi0) - (u + u0) / 2 * dt * mean
    z = ca.if_else(first > 0, 0, z)
    bank = _Dual(signals["bank"].value / GRAVITY + p["bank"].value, p["bank"].slopes)
    balance = _Stage(
        [z0, xi0, u0, F0, angle, ln_I, push, vx, vy, yaw, cg], [z, xi, u, across, RATE * z]
    )
    found = balance(
        [
            before[f"z_{axle}"],
            before[f"xi_{axle}"],
            before[f"u_{axle}"],
            force,
            delta,
            p["ln_inertia"],
            bank,
            v_x,
            v_y,
            r,
            p["cg_shift"],
        ]
    )
    after[f"z_{axle}"], after[f"xi_{axle}"], after[f"u_{axle}"] = found[0], found[1], found[2]
    return found[3], found[4], x


# The same, sample by sample in a car: no smoothing, a gate before it, a_x from v_x alone.

LAG_OF_A_X = 0.2  # [s] of the washout that tells a_x
REPLAYED = (*CARRIED[:10], "v_x_slow")
REPLAY_CARRY, REPLAY_OVER = ("gate", "motion"), ("x", "u", "v_x")


@cache
def _replay_step() -> ca.Function:
    """Return the model as a step: axle_force [N], lagged slip and the larger slip [rad], (2,)."""
    ports, s = symbols(
        gate=GateState,
        motion=len(REPLAYED),
        x=2,
        u=2,
        v_x=1,
        parameters=len(NAMES),
        dt=1,
        car=CarNumbers,
        plausibility=Plausibility,
        loads=2,
    )
    old = _by_name(REPLAYED, s.motion)
    g = gate(s.plausibility, s.dt, s.gate, s.x, s.u, s.v_x)
    slow = ca.if_else(g.first > 0, g.v_x, old["v_x_slow"])
    a_x = (g.v_x - slow) / LAG_OF_A_X - g.v_y * g.r
    following = g.v_x + (slow - g.v_x) * ca.exp(-s.dt / LAG_OF_A_X)
    values = [g.v_x, g.v_y, g.r, g.delta[0], g.delta[1], a_x, 0, 0, g.on]
    fixed = _constant((*SIGNALS, *RATES), [*values, 0, 0, 0], 0)
    duals = _constant(NAMES, ca.vertsplit(s.parameters), 0)
    before = _constant(CARRIED, [old.get(name, 0) for name in CARRIED], 0)
    after, out = _step(before, fixed, duals, s.car, s.dt, g.first)
    slip = ca.vertcat(*(axis.value for axis in out["x"]))
    alpha = ca.vertcat(after["alpha_f"].value, after["alpha_r"].value)
    motion = [ca.if_else(g.on, after[name].value, 0) for name in CARRIED[:10]]
    force = s.loads * ca.vertcat(*(axis.value for axis in out["F"]))
    return step_function(
        "motion_replay",
        ports,
        {"gate": g.state, "motion": ca.vertcat(*motion, following)},
        {
            "axle_force": ca.if_else(g.on, force, 0),
            "lagged_slip": ca.if_else(g.on, slip, 0),
            "slip_size": ca.if_else(g.on, ca.fmax(ca.fabs(slip), ca.fabs(alpha)), 0),
        },
    )


@cache
def replay_scan() -> Scan:
    """Return `_replay_step` as a compiled loop."""
    return Scan(_replay_step(), carry=REPLAY_CARRY, over=REPLAY_OVER)
