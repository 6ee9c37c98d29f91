"""Lateral motion of a car from its signals, one sample a step, with slopes over the parameters.

Signals, after the sensors' errors are taken out:
v_y = v_y,m(t + τ) - b - β v_x - x_s r,   δ = (1 + g) δ_m(t + τ_δ) + δ0,
r = (1 + g_r) r_m(t + τ_r) - b_r,   v_x = (1 + g_x) v_x,m;  behind a low pass x = x_m + T x_m'.
Slip, i = f, r:   α_i = δ_i - atan((v_y ± l_i r)/v_x) + k_i (-ρ'/(ω² v_x)),
in front what is beyond the play p of the steering:  α + (sqrt((α-p)² + ε²) - sqrt((α+p)² + ε²))/2,
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

Slopes run along by the chain rule from stage to stage (forward differentiation, `codegen.slopes`).
"""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import casadi as ca

from codegen import Scan
from codegen.compiler import FLAGS
from codegen.scan import FACTORS
from codegen.slopes import Dual, Program, Tape
from identifier.axle.car import step_function, symbols
from identifier.axle.gate import GateState, Plausibility, gate
from identifier.axle.slip import SHORTEST, beyond_play
from identifier.motion.parameters import NAMES, SLIPS, curve_names
from models.vehicle import GRAVITY, LIGHTEST

LEAST_GRIP = 0.05  # of G²: what an axle that uses all of its grip lengthwise keeps sideways
_LEAST_SLOPE = 0.02  # of C: the carcass does not stretch further
DAMPING = 0.3  # ζ of the sway
RATE = 4.0  # κ [1/s]: what is missed is a mean over a quarter of a second
_LAG_OF_A_X = 0.2  # [s] of the washout that tells a_x

# Rows of slopes are loops over columns, several of which a processor computes at once.
_SIMD = tuple("-O3" if flag == "-O2" else flag for flag in FLAGS)

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


@cache
def motion_scan(columns: Columns = ()) -> Scan:
    """Return the model as a compiled loop.

    Its ports: `state` (16,) and `tangent` are carried, `signals` (9,) and `rates` (3,) have a row
    a sample, `parameters` (p,), `car` (7,) and `dt` are constant; `force` (2,) [static loads],
    `residual` e (2,) [static loads], `slip` (2,) [rad] and, where slopes are asked for,
    `slopes` (2, n) of the residual come out.
    columns : names of the parameters over which slopes are asked for, (n,).
    """
    step, program = _motion_step(bool(columns))
    of = [NAMES.index(name) for name in columns]
    slopes = None if program is None else (program, of)
    carry, over = ("state", "was_on"), ("signals", "rates")
    return Scan(step, carry=carry, over=over, flags=_SIMD, slopes=slopes)


@cache
def _motion_step(sloped: bool) -> tuple[ca.Function, Program | None]:
    """Return the model as a step, and how its slopes run along where they do."""
    ports, s = symbols(
        state=len(CARRIED),
        was_on=1,
        signals=len(SIGNALS),
        rates=len(RATES),
        parameters=len(NAMES),
        car=CarNumbers,
        dt=1,
    )
    tape, old, p = Tape(len(NAMES)), ca.vertsplit(s.state), ca.vertsplit(s.parameters)
    before, duals = _constant(tape, CARRIED, old), _constant(tape, NAMES, p)
    if sloped:
        before = {name: tape.state(k, old[k]) for k, name in enumerate(CARRIED)}
        duals = {name: tape.parameter(k, p[k]) for k, name in enumerate(NAMES)}
    fixed = _constant(tape, (*SIGNALS, *RATES), ca.vertsplit(ca.vertcat(s.signals, s.rates)))
    on = fixed["on"].value
    after, out = _step(_At(tape, before, fixed, duals, s.car, s.dt, 1 - s.was_on * on))
    outputs = {
        "state_next": ca.vertcat(*(ca.if_else(on > 0, after[name].value, 0) for name in CARRIED)),
        "was_on_next": on,
        **{
            port: on * ca.vertcat(*(axis.value for axis in out[name]))
            for port, name in (("force", "F"), ("residual", "e"), ("slip", "x"))
        },
    }
    program = None
    if sloped:
        factors, program = tape.finished([after[name] for name in CARRIED], out["e"])
        outputs[FACTORS] = ca.vertcat(on, factors)
    name = "motion_slopes" if sloped else "motion"
    dense = ca.cse([ca.densify(one) for one in outputs.values()])
    return ca.Function(name, list(ports.values()), dense, list(ports), list(outputs)), program


def _by_name(names: tuple[str, ...], vector: Any) -> dict[str, Any]:
    return dict(zip(names, ca.vertsplit(vector), strict=True))


def _constant(tape: Tape, names: tuple[str, ...], values: Sequence[Any]) -> dict[str, Dual]:
    """Return values that depend on no parameter, by name."""
    return {name: tape.constant(value) for name, value in zip(names, values, strict=True)}


class _At(NamedTuple):
    """A sample: states before it, signals and parameters by name, numbers of the car, dt [s], and
    whether nothing is known of the sample before.
    """

    tape: Tape
    before: dict[str, Dual]
    signals: dict[str, Dual]
    p: dict[str, Dual]
    car: CarNumbers
    dt: Any
    first: Any


def _step(at: _At) -> tuple[dict[str, Dual], dict[str, tuple[Dual, Dual]]]:
    """Return the state after a sample, and F, e, x of both axles."""
    v_x, v_y, r, delta = _sensors(at)
    after, sway = _sway(at, v_x, r)
    found: dict[str, list[Dual]] = {"F": [], "e": [], "x": []}
    for axle, angle in (("f", delta), ("r", at.signals["delta_r"])):
        slips, x = _slip(axle, at, v_x, v_y, r, angle, sway)
        after |= slips
        forces, force = _force(axle, at, v_x, x)
        after |= forces
        balance, across, e = _residual(axle, at, v_x, v_y, r, angle, force)
        after |= balance
        for name, one in zip(found, (across, e, x), strict=True):
            found[name].append(one)
    return after, {name: (front, rear) for name, (front, rear) in found.items()}


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


def _sensors(at: _At) -> list[Dual]:
    """Return v_x, v_y, r and δ_f without the sensors' errors."""

    def true(*given: Any) -> tuple[Any, ...]:
        return true_signals(given[: len(SENSED)], given[len(SENSED) :])

    logged, errors = (at.signals[name] for name in SENSED), (at.p[name] for name in SENSORS)
    return at.tape.staged(true, *logged, *errors)


def _sway(at: _At, v_x: Dual, r: Dual) -> tuple[dict[str, Dual], Dual]:
    """Return ρ' and ρ, and -ρ'/(ω² v_x), semi-implicit in ρ' (as `axle.slip.sway`)."""
    car, dt, first = at.car, at.dt, at.first

    def equations(
        rho: Any, rate: Any, f_f: Any, f_r: Any, C_f: Any, C_r: Any, k_f: Any, k_r: Any,
        ln_sway: Any, shift: Any, speed: Any,
    ) -> list[Any]:  # fmt: skip
        L = car.l_f + car.l_r
        front, rear = (car.l_r + shift) / L, (car.l_f - shift) / L
        omega = car.omega * ca.exp(ln_sway)
        a = GRAVITY * (front * f_f + rear * f_r)
        eased = 1 + dt * GRAVITY * (front * C_f * k_f + rear * C_r * k_r) / speed
        moved = (rate * eased + dt * omega**2 * (a - rho)) / (eased + dt * 2 * DAMPING * omega)
        return [ca.if_else(first > 0, 0, moved)]

    def place(rho: Any, moved: Any, speed: Any, yaw: Any) -> list[Any]:
        return [ca.if_else(first > 0, speed * yaw, rho + dt * moved)]

    def slip(moved: Any, ln_sway: Any, speed: Any) -> list[Any]:
        return [-moved / ((car.omega * ca.exp(ln_sway)) ** 2 * speed)]

    names = ("rho", "rate", "force_f", "force_r", "slope_f", "slope_r")
    of = ("sway_share_f", "sway_share_r", "ln_sway", "cg_shift")
    inputs = [*(at.before[name] for name in names), *(at.p[name] for name in of), v_x]
    (rate,) = at.tape.staged(equations, *inputs)
    (rho,) = at.tape.staged(place, at.before["rho"], rate, v_x, r)
    (away,) = at.tape.staged(slip, rate, at.p["ln_sway"], v_x)
    return {"rate": rate, "rho": rho}, away


def _curve(ln_C: Any, ln_mu: Any, c: Any, E: Any, *others: Any) -> tuple[Any, Any]:
    """Return φ and dφ/dx.   others : q (4), ln m, and the slip x."""
    *q, ln_m, x = others
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
    return m * phi, slope


def carcass_curve(*numbers: Any) -> tuple[Any, Any]:
    """Return φ and its slope as far as the carcass stretches.   numbers : as of `_curve`."""
    phi, slope = _curve(*numbers)
    return phi, ca.fmax(slope, _LEAST_SLOPE * ca.exp(numbers[0]))


def pushed_names(axle: str) -> list[str]:
    """Return the parameters of `load_and_ellipse` of an axle."""
    of_axle = f"braking_{axle}", f"driving_{axle}"
    return ["load_transfer", *of_axle, "cg_shift", f"downforce_{axle}"]


def load_and_ellipse(
    axle: str, car: CarNumbers, numbers: Sequence[Any], a_x: Any, v_x: Any
) -> tuple[Any, Any]:
    """Return λ, the load of an axle over the static one, and G, what the ellipse leaves [-].
    numbers : of `pushed_names`.   a_x : [m/s²].   v_x : [m/s].
    """
    height, brake, drive, cg, down = numbers
    f = (a_x + car.drag * v_x**2) / GRAVITY
    front = axle == "f"
    other, press = (car.l_r + cg, car.press_f) if front else (car.l_f - cg, car.press_r)
    shifted = (-height if front else height) * (car.l_f + car.l_r) / other * f
    load = 1 + shifted + (press + down) * v_x**2
    use = ca.if_else(f > 0, drive, brake) * f
    least = ca.if_else(load > LIGHTEST, load, LIGHTEST)
    return least, ca.sqrt(ca.fmax(1 - use**2, LEAST_GRIP))


@cache
def pushed_function() -> ca.Function:
    """Return (parameters (p,), car (7,), a_x, v_x) -> λ G of both axles, (2,)."""
    ports, s = symbols(parameters=len(NAMES), car=CarNumbers, a_x=1, v_x=1)
    p = _by_name(NAMES, s.parameters)
    both = [
        load_and_ellipse(axle, s.car, [p[name] for name in pushed_names(axle)], s.a_x, s.v_x)
        for axle in "fr"
    ]
    product = ca.vertcat(*(load * left for load, left in both))
    return ca.Function("pushed", list(ports.values()), [product])


@cache
def curve_function() -> ca.Function:
    """Return (numbers (9,), slip) -> φ, dφ/dx, ∂φ/∂numbers (9,); forces in static axle loads."""
    vector, x = ca.SX.sym("numbers", 5 + len(SLIPS)), ca.SX.sym("x")
    phi, slope = _curve(*ca.vertsplit(vector), x)
    gradient = ca.densify(ca.jacobian(phi, vector)).T
    return ca.Function("curve", [vector, x], [phi, slope, gradient])


@cache
def slope_function() -> ca.Function:
    """Return (numbers (9,), slip) -> dφ/dx alone [static loads/rad], in a third of the time."""
    vector, x = ca.SX.sym("numbers", 5 + len(SLIPS)), ca.SX.sym("x")
    return ca.Function("slope", [vector, x], [_curve(*ca.vertsplit(vector), x)[1]])


def _slip(
    axle: str, at: _At, v_x: Dual, v_y: Dual, r: Dual, delta: Dual, sway: Dual
) -> tuple[dict[str, Dual], Dual]:
    """Return slip and lagged slip of an axle after the sample, and the latter by itself."""
    car, p = at.car, at.p

    def slip(d: Any, vy: Any, vx: Any, yaw: Any, k: Any, s: Any, shift: Any, *p: Any) -> list[Any]:
        arm = (car.l_f - shift) if axle == "f" else -(car.l_r + shift)
        alpha = d - ca.atan((vy + arm * yaw) / vx) + k * s
        return [beyond_play(alpha, *p) if p else alpha]

    def lagged(x0: Any, a0: Any, a1: Any, C: Any, give: Any, vx: Any) -> list[Any]:
        """Exact for α linear over the step."""
        h = vx * at.dt / (give * C + SHORTEST * (car.l_f + car.l_r))
        e = ca.exp(-h)
        x1 = e * x0 + (1 - e) * a0 + (1 - (1 - e) / h) * (a1 - a0)
        return [ca.if_else(at.first > 0, a1, x1)]

    play = [p["steering_play"]] if axle == "f" else []
    share, shift = p[f"sway_share_{axle}"], p["cg_shift"]
    (alpha,) = at.tape.staged(slip, delta, v_y, v_x, r, share, sway, shift, *play)
    last, was, slope = (at.before[f"{name}_{axle}"] for name in ("x", "alpha", "slope"))
    (x,) = at.tape.staged(lagged, last, was, alpha, slope, p[f"compliance_{axle}"], v_x)
    return {f"x_{axle}": x, f"alpha_{axle}": alpha}, x


def _force(axle: str, at: _At, v_x: Dual, x: Dual) -> tuple[dict[str, Dual], Dual]:
    """Return slope and force at a lagged slip, of curve, load and ellipse; the latter by itself."""
    car, p, road = at.car, at.p, at.p["ln_road"]

    def pushes(phi: Any, *of: Any) -> list[Any]:
        *numbers, a_x, speed = of
        load, left = load_and_ellipse(axle, car, numbers, a_x, speed)
        return [phi * load * left]

    ln_m = Dual(road.value + at.signals["road"].value, road.slopes)
    numbers = [p[name] for name in curve_names(axle)]
    value, slope = at.tape.staged(carcass_curve, *numbers, ln_m, x)
    given = (p[name] for name in pushed_names(axle))
    (force,) = at.tape.staged(pushes, value, *given, at.signals["a_x"], v_x)
    return {f"slope_{axle}": slope, f"force_{axle}": force}, force


def _residual(
    axle: str, at: _At, v_x: Dual, v_y: Dual, r: Dual, delta: Dual, force: Dual
) -> tuple[dict[str, Dual], Dual, Dual]:
    """Return the states of the balance of an axle after the sample, F, and e."""
    car, dt, p = at.car, at.dt, at.p

    def balance(
        z0: Any, xi0: Any, u0: Any, F0: Any, angle: Any, ln_I: Any, push: Any,
        vx: Any, vy: Any, yaw: Any, cg: Any,
    ) -> list[Any]:  # fmt: skip
        other = (car.l_r + cg) if axle == "f" else -(car.l_f - cg)
        J = car.inertia * ca.exp(ln_I) / other
        across = F0 * ca.cos(angle)
        xi = vy / GRAVITY + J * yaw
        u = across - vx * yaw / GRAVITY + push
        fall = ca.exp(-RATE * dt)
        mean = (1 - fall) / (RATE * dt)
        z = fall * z0 + mean * (xi - xi0) - (u + u0) / 2 * dt * mean
        z = ca.if_else(at.first > 0, 0, z)
        return [z, xi, u, across]

    bank = Dual(at.signals["bank"].value / GRAVITY + p["bank"].value, p["bank"].slopes)
    names = [f"{name}_{axle}" for name in ("z", "xi", "u")]
    last = (at.before[name] for name in names)
    inputs = (force, delta, p["ln_inertia"], bank, v_x, v_y, r, p["cg_shift"])
    *kept, across = at.tape.staged(balance, *last, *inputs)
    (e,) = at.tape.staged(lambda z: [RATE * z], kept[0])
    return dict(zip(names, kept, strict=True)), across, e


# The same, sample by sample in a car: no smoothing, a gate before it, a_x from v_x alone.

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
    a_x = (g.v_x - slow) / _LAG_OF_A_X - g.v_y * g.r
    following = g.v_x + (slow - g.v_x) * ca.exp(-s.dt / _LAG_OF_A_X)
    values = [g.v_x, g.v_y, g.r, g.delta[0], g.delta[1], a_x, 0, 0, g.on]
    tape = Tape(len(NAMES))
    fixed = _constant(tape, (*SIGNALS, *RATES), [*values, 0, 0, 0])
    duals = _constant(tape, NAMES, ca.vertsplit(s.parameters))
    before = _constant(tape, CARRIED, [old.get(name, 0) for name in CARRIED])
    after, out = _step(_At(tape, before, fixed, duals, s.car, s.dt, g.first))
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
