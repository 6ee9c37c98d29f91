"""One stage of the prediction: ẋ, one RK4 step, and the linearization that a solver needs of it.

State, input and parameters are those of `mpc.motion`. The sensitivities of the Runge-Kutta step are
chained by hand from the Jacobians of its four evaluations. Stage and end are tuned as exported
functions are: our own tanh, atan and sin, nothing of a library.
"""

from functools import cache

import casadi as ca

from codegen.tuned import tuned
from mpc.cost import N_ERRORS, gauss_newton, tracking_errors
from mpc.motion import Ports, motion, stage_ports
from mpc.tires.structure import PredictionTire

RESULTS = ("x_next", "A", "B", "H", "h", "slip", "slip_x")


def build_dynamics(structure: PredictionTire) -> ca.Function:
    """Return ẋ as a function of x, u, kappa, v_x, dt, car, w, max_slip, rise.

    dt only bounds the lag from below.

    Parameters
    ----------
    structure : of the tire.
    """
    p = stage_ports(structure)
    return ca.Function(
        "dynamics", list(p), [motion(structure, p).x_dot], list(p._fields), ["x_dot"]
    )


def build_rk4(structure: PredictionTire) -> ca.Function:
    """Return the state after a stage by one classical Runge-Kutta step; ports as the dynamics.

    Parameters
    ----------
    structure : of the tire.
    """
    p, f = stage_ports(structure), build_dynamics(structure)
    k1 = f(*p)
    k2 = f(p.x + 0.5 * p.dt * k1, *p[1:])
    k3 = f(p.x + 0.5 * p.dt * k2, *p[1:])
    k4 = f(p.x + p.dt * k3, *p[1:])
    x_next = p.x + p.dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("rk4", list(p), [x_next], list(p._fields), ["x_next"], {"cse": True})


@cache
def build_stage(structure: PredictionTire) -> ca.Function:
    """Return the linearized stage as an SX function with dense ports.

    Ports: x (n_x,), u, kappa [1/m], v_x [m/s], dt [s], car (4,), w (n_w,), max_slip (2,) [rad],
    rise (2,) [N/rad], q (7,). Results: x_next; A = ∂x_next/∂x, B = ∂x_next/∂u; H (n_x, n_x) and
    h (n_x,) of the cost at x; slip (2,) [rad], the kinematic one, and slip_x (2, n_x).

    Parameters
    ----------
    structure : of the tire.
    """
    p = stage_ports(structure)
    q = ca.SX.sym("q", N_ERRORS)
    at = motion(structure, p)
    f = ca.Function("motion", list(p), [at.x_dot, at.x_dot_x, at.x_dot_u])
    x_next, A, B = _runge_kutta(f, p)
    H, h = gauss_newton(tracking_errors(p.x, p.kappa, p.v_x, at.s_dot), p.x, q)
    results = [x_next, A, B, H, h, at.slip, at.slip_x]
    return _finished("stage", {**p._asdict(), "q": q}, results, RESULTS)


@cache
def build_end(structure: PredictionTire) -> ca.Function:
    """Return the cost and the slips at the end of the horizon: H, h, slip, slip_x of `build_stage`.

    Ports: those of `build_stage` without u and dt, with q of the end.

    Parameters
    ----------
    structure : of the tire.
    """
    p = stage_ports(structure)
    q = ca.SX.sym("q", N_ERRORS)
    at = motion(structure, p)
    H, h = gauss_newton(tracking_errors(p.x, p.kappa, p.v_x, at.s_dot), p.x, q)
    ports = {name: port for name, port in p._asdict().items() if name not in ("u", "dt")}
    return _finished("end", {**ports, "q": q}, [H, h, at.slip, at.slip_x], RESULTS[3:])


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
    return (
        p.x + p.dt * _average(rates),
        eye + p.dt * _average(rates_x),
        p.dt * _average(rates_u),
    )


def _average(k: list[ca.SX]) -> ca.SX:
    return (k[0] + 2 * (k[1] + k[2]) + k[3]) / 6


def _finished(
    name: str, ports: dict[str, ca.SX], results: list[ca.SX], names: tuple[str, ...]
) -> ca.Function:
    dense = [ca.densify(value) for value in results]
    function = ca.Function(name, list(ports.values()), dense, list(ports), list(names))
    return tuned(function, sampled=()).function
