"""The identifier's step: one casadi.Function that is simulation, test subject and C source.

Carried: xi_hat (2,), z (2,), W (2, n_h), V (n_h, n_in).
Sampled: x = [v_y, r] (2,), u = [δ_f, δ_r] (2,), v_x.
Constant: vehicle (6,) = m, I_z, l_f, l_r, C_f, C_r; A_d (2, 2); gains, in the order of `GAINS`;
sampling (3,) = T_s, force unit U, minimum speed.
Outputs: the next carried values; f_hat (2,) [U], the network's force; axle_force (2,) [N], linear
tire and network together; xi_tilde (2,) [U s].
"""

from typing import NamedTuple

import casadi as ca

from identifier.axle.car import step_function, symbols
from identifier.paper.laws import (
    INPUT_SOURCES,
    LAWS,
    filter_rate,
    observer_rate,
    weight_rates,
)
from identifier.paper.network import Network, hidden_layer, network_signals
from identifier.setup import AXLE_FORCE, Port
from models.bicycle import BicycleParameters, bicycle, linear_axle_force

_LARGEST_SPEED = 300.0  # m/s: no car is faster
_LARGEST_ANGLE = 1.5  # rad: no wheel turns more

CARRY = ("xi_hat", "z", "W", "V")
_NETWORK_PORTS = (
    AXLE_FORCE,
    Port("f_hat", "U", "force of the network alone, front and rear"),
    Port("W", "U", "output weights, rows front and rear", learnt=True),
    Port("V", "-", "hidden weights, rows units, columns scaled inputs", learnt=True),
)
PORTS = (
    *_NETWORK_PORTS,
    Port("xi_tilde", "U s", "error of the observed axle impulse, front and rear"),
    Port("xi_hat", "U s", "observed axle impulse, front and rear"),
    Port("z", "U s^2", "filtered error, front and rear"),
)
OVER = ("x", "u", "v_x")
GAINS = ("eta_W", "eta_V", "rho_W", "rho_V", "forgetting", "lead")


class Structure(NamedTuple):
    """What the step is built from; all numbers stay inputs of it.
    input_source : where the network reads the state.
    """

    network: Network
    law: str
    input_source: str


def build_step(structure: Structure) -> ca.Function:
    """Return the step; vehicle, gains and sampling stay inputs of it."""
    network = structure.network
    n_h, n_in = network.hidden, len(network.inputs)
    ports, s = symbols(
        xi_hat=2,
        z=2,
        W=(2, n_h),
        V=(n_h, n_in),
        x=2,
        u=2,
        v_x=1,
        vehicle=BicycleParameters,
        A_d=(2, 2),
        gains=len(GAINS),
        sampling=3,
    )
    xi_hat, z, W, V, x, u, v_x, _, A_d, gains, sampling = ports.values()
    parameters = s.vehicle
    eta_W, eta_V, rho_W, rho_V, lam, lead = ca.vertsplit(gains)
    dt, unit, min_speed = ca.vertsplit(sampling)
    speed = ca.fmax(v_x, min_speed)
    model = bicycle(parameters, speed)
    xi = model.K_inv @ x / unit
    law, source = LAWS[structure.law], INPUT_SOURCES[structure.input_source]
    error = law.error(lead)

    x_read = unit * model.K @ source(xi, xi_hat)
    x_bar = network.normalized_input(network_signals(parameters, speed, x_read, u))
    sigma = hidden_layer(V, x_bar)
    xi_tilde = xi - xi_hat
    rates = weight_rates(
        drive=error.drive(z, xi_tilde),
        xi_tilde=xi_tilde,
        W=W,
        V=V,
        x_bar=x_bar,
        sigma=sigma,
        A_d=A_d,
        eta_W=eta_W,
        eta_V=eta_V,
        rho_W=rho_W,
        rho_V=rho_V,
        direction=law.direction,
    )
    xi_hat_dot = observer_rate(A_d, model.A_xi, model.B_xi / unit, xi, xi_hat, u, W @ sigma)

    moving = v_x >= min_speed
    # Where no car can be (a spike, a dropout of a sensor: an axle slides more than 63°) nothing is
    # learnt, and no force given: 1000 m/s would carry the weights beyond any number.
    sideways = x[0] + parameters.l_f * x[1], x[0] - parameters.l_r * x[1]
    inside = [ca.fabs(one) <= 2 * speed for one in sideways]
    inside += [ca.fabs(u[i]) <= _LARGEST_ANGLE for i in (0, 1)]
    plausible_sample = ca.logic_and(
        ca.logic_and(ca.logic_and(*inside[:2]), ca.logic_and(*inside[2:])), v_x <= _LARGEST_SPEED
    )
    used = ca.logic_and(moving, plausible_sample)
    f_hat = ca.if_else(used, W @ sigma, 0)
    linear = ca.if_else(used, linear_axle_force(parameters, speed, x, u), 0)
    ahead = ca.if_else(used, dt, 0)  # else nothing moves on: weights keep their values
    # at rest the observer follows the measurement, as far as it can be believed
    observes = ca.logic_or(moving, ca.logic_not(plausible_sample))
    carried = (
        ca.if_else(observes, xi_hat + ahead * xi_hat_dot, xi),
        ca.if_else(moving, z + ahead * filter_rate(lam, z, xi_tilde), 0),
        W + ahead * rates.W_dot,
        V + ahead * rates.V_dot,
    )
    outputs = {"f_hat": f_hat, "axle_force": linear + unit * f_hat}
    outputs["xi_tilde"] = ca.if_else(used, xi_tilde, 0)
    name = f"identifier_{structure.law}"
    return step_function(name, ports, dict(zip(CARRY, carried, strict=True)), outputs)
