"""Check by computer algebra what the identifier is built on, with nothing but Newton and Euler.

The bicycle is written down by hand, differentiated by CasADi and compared with the matrices of the
library: the transform ξ = K⁻¹ x decouples the axle forces, and the observer's error obeys A_d.
"""

from typing import Any

import casadi as ca
import numpy as np

from identifier.paper.laws import observer_rate
from models.bicycle import BicycleParameters, bicycle

EXPECTED_BELOW = 1e-12


def newton_euler(p: BicycleParameters, v_x: Any, x: Any, u: Any, f: Any) -> Any:
    """Return [dv_y/dt, dr/dt] of (1)-(3) and (5), by hand."""
    F_yf = p.C_f * (u[0] - (x[0] + p.l_f * x[1]) / v_x) + f[0]
    F_yr = p.C_r * (u[1] - (x[0] - p.l_r * x[1]) / v_x) + f[1]
    return ca.vertcat((F_yf + F_yr) / p.m - v_x * x[1], (p.l_f * F_yf - p.l_r * F_yr) / p.I_z)


def main() -> float:
    """Return the largest relative residual over a hundred random cars and states."""
    p = BicycleParameters(*(ca.SX.sym(name) for name in BicycleParameters._fields))
    v_x, A_d = ca.SX.sym("v_x"), ca.SX.sym("A_d", 2, 2)
    x, u, f = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("f", 2)
    xi_hat, f_hat = ca.SX.sym("xi_hat", 2), ca.SX.sym("f_hat", 2)
    model, x_dot = bicycle(p, v_x), newton_euler(p, v_x, x, u, f)
    xi = model.K_inv @ x
    xi_dot = model.K_inv @ x_dot
    xi_hat_dot = observer_rate(A_d, model.A_xi, model.B_xi, xi, xi_hat, u, f_hat)
    claims = {
        "(4) A is the Jacobian": (ca.jacobian(x_dot, x), model.A),
        "(6) K is the Jacobian": (ca.jacobian(x_dot, f), model.K),
        "(6) B = K diag(C)": (model.K @ ca.diag(ca.vertcat(p.C_f, p.C_r)), model.B),
        "(7) forces decouple": (model.A_xi @ xi + model.B_xi @ u + f, xi_dot),
        "(8) error obeys A_d": (A_d @ (xi - xi_hat) + f - f_hat, xi_dot - xi_hat_dot),
    }
    symbols = [*p, v_x, x, u, f, A_d, xi_hat, f_hat]
    rng, worst = np.random.default_rng(0), 0.0
    for name, (left, right) in claims.items():
        evaluate = ca.Function("claim", symbols, [left - right, right])
        residual = 0.0
        for _ in range(100):
            car = rng.uniform([900, 1000, 0.9, 0.9, 5e4, 5e4], [2500, 4500, 1.8, 1.8, 2e5, 2e5])
            state = rng.normal(size=2), 0.1 * rng.normal(size=2), 1e3 * rng.normal(size=2)
            observer = rng.normal(size=(2, 2)), 1e3 * rng.normal(size=2), 1e3 * rng.normal(size=2)
            gap, size = evaluate(*car, rng.uniform(8, 40), *state, *observer)
            residual = max(residual, float(ca.norm_inf(gap) / ca.norm_inf(size)))
        print(f"{name:24} residual {residual:.1e}")
        worst = max(worst, residual)
    return worst


if __name__ == "__main__":
    main()
