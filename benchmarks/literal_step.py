"""The paper's step as a person first writes it, to measure tuned code against.

Both have the equations of `identifier.paper.step` as they are printed, Euler steps, no guards: once
as a CasADi SX function with the tanh of the C library and every number an input of it, once in
NumPy. Signals and units as there; gains = [eta_W, eta_V, rho_W, rho_V, lambda], sampling = [T_s,
U].
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.paper.laws import filter_rate, observer_rate, weight_rates
from identifier.paper.network import Network, network_signals
from models.bicycle import BicycleParameters, bicycle, linear_axle_force
from models.vehicle import Vehicle


def casadi_step(network: Network) -> ca.Function:
    """Return (xi_hat, z, W, V, x, u, v_x, vehicle, A_d, gains, sampling) -> (next four, force)."""
    xi_hat, z, x, u = (ca.SX.sym(name, 2) for name in ("xi_hat", "z", "x", "u"))
    W = ca.SX.sym("W", 2, network.hidden)
    V = ca.SX.sym("V", network.hidden, len(network.inputs))
    v_x, vehicle, A_d = ca.SX.sym("v_x"), ca.SX.sym("vehicle", 6), ca.SX.sym("A_d", 2, 2)
    gains, sampling = ca.SX.sym("gains", 5), ca.SX.sym("sampling", 2)
    eta_W, eta_V, rho_W, rho_V, forgetting = ca.vertsplit(gains)
    dt, unit = ca.vertsplit(sampling)
    parameters = BicycleParameters(*ca.vertsplit(vehicle))
    model = bicycle(parameters, v_x)
    xi = model.K_inv @ x / unit
    x_bar = network.normalized_input(network_signals(parameters, v_x, x, u))
    sigma = ca.tanh(V @ x_bar)
    rates = weight_rates(
        drive=z,
        xi_tilde=xi - xi_hat,
        W=W,
        V=V,
        x_bar=x_bar,
        sigma=sigma,
        A_d=A_d,
        eta_W=eta_W,
        eta_V=eta_V,
        rho_W=rho_W,
        rho_V=rho_V,
    )
    f_hat = W @ sigma
    xi_hat_dot = observer_rate(A_d, model.A_xi, model.B_xi / unit, xi, xi_hat, u, f_hat)
    following = [
        xi_hat + dt * xi_hat_dot,
        z + dt * filter_rate(forgetting, z, xi - xi_hat),
        W + dt * rates.W_dot,
        V + dt * rates.V_dot,
    ]
    force = linear_axle_force(parameters, v_x, x, u) + unit * f_hat
    inputs = [xi_hat, z, W, V, x, u, v_x, vehicle, A_d, gains, sampling]
    return ca.Function("literal", inputs, [*following, force])


class Carried(NamedTuple):
    """What the NumPy step carries: xi_hat (2,), z (2,), W (2, n_h), V (n_h, n_in)."""

    xi_hat: Array
    z: Array
    W: Array
    V: Array


class NumpyStep:
    """The same step in NumPy; everything that does not depend on the speed is computed once."""

    def __init__(
        self, car: Vehicle, scale: Array, A_d: Array, gains: Array, dt: float, unit: float
    ) -> None:
        m, I_z, l_f, l_r, C_f, C_r = car.bicycle
        self.K = np.array([[1 / m, 1 / m], [l_f / I_z, -l_r / I_z]])  # (6)
        self.K_inv = np.linalg.inv(self.K)
        self.slip = np.array([[1.0, l_f], [1.0, -l_r]])
        self.C = np.array([C_f, C_r])
        self.A_d, self.A_d_T_inv = A_d, np.linalg.inv(A_d.T)
        self.gains, self.dt, self.unit, self.scale = gains, dt, unit, scale

    def __call__(self, now: Carried, x: Array, u: Array, v_x: float) -> tuple[Carried, Array]:
        """Return what is carried on, and the axle forces (2,) [N]."""
        xi_hat, z, W, V = now
        eta_W, eta_V, rho_W, rho_V, forgetting = self.gains
        dt = self.dt
        linear = self.C * (u - self.slip @ x / v_x)  # (3)
        x_bar = np.concatenate([x, u]) / self.scale
        sigma = np.tanh(V @ x_bar)
        f_hat = W @ sigma
        xi = self.K_inv @ x / self.unit
        turning = self.K_inv @ np.array([-v_x * x[1], 0.0])  # what is left of A_xi xi + B_xi u
        xi_tilde = xi - xi_hat
        xi_hat_dot = (linear + turning) / self.unit - self.A_d @ xi_tilde + f_hat  # (8)
        g = self.A_d_T_inv @ z
        leak = np.sqrt(xi_tilde @ xi_tilde)
        W_dot = -eta_W * np.outer(g, sigma) - rho_W * leak * W  # (11)
        V_dot = -eta_V * np.outer((1 - sigma**2) * (W.T @ g), x_bar) - rho_V * leak * V  # (12)
        following = Carried(
            xi_hat + dt * xi_hat_dot,
            z + dt * (xi_tilde - forgetting * z),  # (10)
            W + dt * W_dot,
            V + dt * V_dot,
        )
        return following, linear + self.unit * f_hat


def signals(samples: Array) -> list[tuple[Array, Array, float]]:
    """Return x, u and v_x of every sample, (n, 5) in the order v_x, v_y, r, delta_f, delta_r."""
    rows: list[Any] = [(row[1:3], row[3:5], float(row[0])) for row in samples]
    return rows
