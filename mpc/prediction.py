"""One stage of the prediction: ẋ, one RK4 step, and the linearization that a solver needs of it.

State, input and parameters are those of `build_dynamics`. The sensitivities of the Runge-Kutta step
are chained by hand from the Jacobians of its four evaluations. Stage and end are tuned as exported
functions are: our own tanh, atan and sin, nothing of a library.
"""

from functools import cache
from typing import Any, NamedTuple

import casadi as ca

from codegen.tuned import tuned
from mpc.problem import N_ERRORS, gauss_newton, tracking_errors
from mpc.tires.tire import Car, Pair, Point, TireStructure, believed

# The car along a path as the tracker predicts it: ẋ and its Jacobian.
#
# x = [e_y, e_psi, v_y, r, δ] and, where the tire lags, [α_f', α_r']: deviation from the path [m],
# left positive; heading against the path's [rad]; lateral velocity [m/s]; yaw rate [rad/s];
# commanded angle of the front wheels [rad]; lagged slip [rad].   u: steering rate [rad/s].
# κ [1/m], > 0 where the path turns left, and v_x [m/s] are constant over a stage of dt [s].
# Force curves are those of the tire up to the slip that is of use, and rise slightly beyond.

_N_CAR = 4
# Least 1 - κ e_y that is believed: towards the center of a turn it vanishes, and ṡ has no bound.
_NEAREST = 0.1


class Ports(NamedTuple):
    """Symbols of a stage, SX: state, input, parameters; the last three are those of `ValidSlip`."""

    x: Any
    u: Any
    kappa: Any
    v_x: Any
    dt: Any
    car: Any
    w: Any
    max_slip: Any
    rise: Any
    grip: Any


class Motion(NamedTuple):
    """Expressions at a state: ẋ (n_x,), ṡ [m/s] and kinematic slip (2,) [rad] with derivatives."""

    x_dot: Any
    x_dot_x: Any
    x_dot_u: Any
    s_dot: Any
    slip: Any
    slip_x: Any


def state_size(structure: TireStructure) -> int:
    """Return n_x, 5 or with lagged slip 7."""
    return 7 if structure.lagged else 5


def stage_ports(structure: TireStructure) -> Ports:
    sizes = (state_size(structure), 1, 1, 1, 1, _N_CAR, structure.n_weights, 2, 2, 1)
    pairs = zip(Ports._fields, sizes, strict=True)
    return Ports(*(ca.SX.sym(name, size) for name, size in pairs))


def motion(structure: TireStructure, p: Ports) -> Motion:
    """Return the equations of motion and their derivatives, chained through the axle forces."""
    e_y, e_psi = p.x[0], p.x[1]
    (v_y, r, _, _, car, _), kinematic, slip, force, lengths = _axles(structure, p)
    F = ca.SX.sym("F", 2)
    c, s = ca.cos(e_psi), ca.sin(e_psi)
    s_dot = (p.v_x * c - v_y * s) * (1 / ca.fmax(1 - p.kappa * e_y, _NEAREST))
    rates = [
        p.v_x * s + v_y * c,
        r - p.kappa * s_dot,
        (F[0] + F[1]) * (1 / car.m) - p.v_x * r,
        (car.l_f * F[0] - car.l_r * F[1]) * (1 / car.I_z),
        p.u,
    ]
    if structure.lagged:
        for now, behind, length in zip(kinematic, slip, lengths, strict=True):
            # A lag under half a stage cannot be seen by it, and would make the step unstable.
            rates.append((now - behind) / ca.fmax(length * (1 / p.v_x), 0.5 * p.dt))
    x_dot = ca.vertcat(*rates)
    x_dot_x = ca.jacobian(x_dot, p.x) + ca.jacobian(x_dot, F) @ ca.jacobian(force, p.x)
    x_dot, x_dot_x = ca.substitute([x_dot, x_dot_x], [F], [force])
    angles = ca.vertcat(*kinematic)
    return Motion(x_dot, x_dot_x, ca.jacobian(x_dot, p.u), s_dot, angles, ca.jacobian(angles, p.x))


def _axles(structure: TireStructure, p: Ports) -> tuple[Point, Pair, Pair, Any, Pair]:
    """Return where the tires are asked, kinematic slip, what makes the force, force and lengths."""
    v_y, r, delta, *lagged = ca.vertsplit(p.x)[2:]
    at = Point(v_y, r, delta, p.v_x, Car(*ca.vertsplit(p.car)), p.w)
    kinematic = structure.slip(at)
    slip = (lagged[0], lagged[1]) if structure.lagged else kinematic
    return at, kinematic, slip, *believed(structure, slip, at, p.max_slip, p.rise, p.grip)


_RESULTS = ("x_next", "A", "B", "H", "h", "slip", "slip_x")


def build_dynamics(structure: TireStructure) -> ca.Function:
    """Return ẋ as a function of x, u, kappa, v_x, dt, car, w, max_slip, rise, grip.

    dt only bounds the lag from below.
    """
    p = stage_ports(structure)
    return ca.Function(
        "dynamics", list(p), [motion(structure, p).x_dot], list(p._fields), ["x_dot"]
    )


def build_rk4(structure: TireStructure) -> ca.Function:
    """Return the state after a stage by one classical Runge-Kutta step; ports as the dynamics."""
    p, f = stage_ports(structure), build_dynamics(structure)
    k1 = f(*p)
    k2 = f(p.x + 0.5 * p.dt * k1, *p[1:])
    k3 = f(p.x + 0.5 * p.dt * k2, *p[1:])
    k4 = f(p.x + p.dt * k3, *p[1:])
    x_next = p.x + p.dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("rk4", list(p), [x_next], list(p._fields), ["x_next"], {"cse": True})


@cache
def build_stage(structure: TireStructure) -> ca.Function:
    """Return the linearized stage as an SX function with dense ports.

    Ports: x (n_x,), u, kappa [1/m], v_x [m/s], dt [s], car (4,), w (n_w,), max_slip (2,) [rad],
    rise (2,) [N/rad], grip [-], q (7,). Results: x_next; A = ∂x_next/∂x, B = ∂x_next/∂u;
    H (n_x, n_x) and h (n_x,) of the cost at x; slip (2,) [rad], the kinematic one, and
    slip_x (2, n_x).
    """
    p = stage_ports(structure)
    at = motion(structure, p)
    f = ca.Function("motion", list(p), [at.x_dot, at.x_dot_x, at.x_dot_u])
    q, cost = _cost(p, at)
    return _finished("stage", p, [*_runge_kutta(f, p), *cost], _RESULTS, q=q)


@cache
def build_end(structure: TireStructure) -> ca.Function:
    """Return the cost and the slips at the end of the horizon: H, h, slip, slip_x of `build_stage`.

    Ports: those of `build_stage` without u and dt, with q of the end.
    """
    p = stage_ports(structure)
    q, cost = _cost(p, motion(structure, p))
    return _finished("end", p, cost, _RESULTS[3:], "u", "dt", q=q)


def _cost(p: Ports, at: Motion) -> tuple[ca.SX, list[ca.SX]]:
    """Return q, and H, h of the cost with the slips and their derivatives."""
    q = ca.SX.sym("q", N_ERRORS)
    H, h = gauss_newton(tracking_errors(p.x, p.kappa, p.v_x, at.s_dot), p.x, q)
    return q, [H, h, at.slip, at.slip_x]


@cache
def build_axles(structure: TireStructure) -> ca.Function:
    """Return what the axles do at a state, for who watches them.

    Ports: x (n_x,), v_x, car, w, max_slip, rise, grip of `build_stage`. Results: force (2,) [N];
    slip (2,) [rad], the kinematic one; length (2,) [m] by which the slip lags, 0 where it does not.
    """
    p = stage_ports(structure)
    _, kinematic, _, force, lengths = _axles(structure, p)
    results = [force, ca.vertcat(*kinematic), ca.vertcat(*lengths)]
    return _finished("axles", p, results, ("force", "slip", "length"), "u", "kappa", "dt")


def _runge_kutta(f: ca.Function, p: Ports) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return x_next, A and B of one classical Runge-Kutta step with f -> (ẋ, ∂ẋ/∂x, ∂ẋ/∂u)."""
    n_x = p.x.numel()
    eye = ca.SX.eye(n_x)
    x, X, U = p.x, eye, ca.SX(n_x, 1)  # at the evaluation: state, ∂/∂x and ∂/∂u of it
    rates, rates_x, rates_u = [], [], []
    for ahead in (0.5, 0.5, 1.0, None):
        k, J, J_u = f(x, *p[1:])
        rates.append(k)
        rates_x.append(J @ X)
        rates_u.append(J @ U + J_u)
        if ahead is not None:
            x, X = p.x + ahead * p.dt * k, eye + ahead * p.dt * rates_x[-1]
            U = ahead * p.dt * rates_u[-1]
    return (p.x + p.dt * _average(rates), eye + p.dt * _average(rates_x), p.dt * _average(rates_u))


def _average(k: list[ca.SX]) -> ca.SX:
    return (k[0] + 2 * (k[1] + k[2]) + k[3]) / 6


def _finished(
    name: str, p: Ports, results: list[ca.SX], names: tuple[str, ...], *without: str, **more: ca.SX
) -> ca.Function:
    ports = {key: port for key, port in (p._asdict() | more).items() if key not in without}
    dense = [ca.densify(value) for value in results]
    function = ca.Function(name, list(ports.values()), dense, list(ports), list(names))
    return tuned(function, sampled=()).function
