"""The step of every law of this folder: filtered pair, law, projection; one casadi.Function.

Carried: W (2, n_h); V (n_h, n_in), which stays; target_lag (2,), regressor_lag (n_h,) and fresh of
the filters; the statistics of the law.
Sampled: x = [v_y, r] (2,), u = [δ_f, δ_r] (2,), v_x.
Constant: W_first (2, n_h), the weights at the start; vehicle (6,) = m, I_z, l_f, l_r, C_f, C_r;
numbers, in the order of `Numbers`; sampling (3,) = T_s, force unit U, minimum speed.
Outputs: the next carried values; f_hat (2,) [U]; axle_force (2,) [N], linear tire and network;
residual (2,) [U], y - W s before the weights move.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from identifier.paper.laws import ball
from identifier.paper.network import Network, hidden_layer, network_signals
from identifier.paper.step import NETWORK_PORTS
from identifier.regression.laws import LAWS, Lags, Numbers, Weights, filtered_pair
from identifier.setup import COVARIANCE, Port
from models.bicycle import BicycleParameters, bicycle, linear_axle_force

CARRY = ("W", "V", "target_lag", "regressor_lag", "fresh")
OVER = ("x", "u", "v_x")
PORTS = (
    *NETWORK_PORTS,
    Port("residual", "U", "error of the filtered regression, front and rear"),
    Port("target_lag", "U", "filter of the target, front and rear"),
    Port("regressor_lag", "-", "filter of the hidden layer"),
    Port("fresh", "-", "1 where the filters begin anew"),
    Port("P", "1/s", "inverse of the information", learnt=True, rule=COVARIANCE),
    Port("Omega", "s", "information", learnt=True, rule=COVARIANCE),
    Port("Y", "U s", "information times target", learnt=True),
    Port("S", "-", "stored regressors", learnt=True),
    Port("Z", "U", "stored targets", learnt=True),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure:
    """What the step is built from; all numbers stay inputs of it.

    Parameters
    ----------
    memory : number of pairs that concurrent learning keeps.
    """

    network: Network
    law: str
    memory: int

    @property
    def carry(self) -> tuple[str, ...]:
        """Names of the carried ports."""
        return (*CARRY, *LAWS[self.law].start(self.network.hidden, self.memory, 1.0))


def build_step(structure: Structure) -> ca.Function:
    """Return the step; vehicle, numbers and sampling stay inputs of it."""
    network, law = structure.network, LAWS[structure.law]
    n_h, n_in = network.hidden, len(network.inputs)
    W, V = ca.SX.sym("W", 2, n_h), ca.SX.sym("V", n_h, n_in)
    lags = Lags(ca.SX.sym("target_lag", 2), ca.SX.sym("regressor_lag", n_h))
    fresh, W_first = ca.SX.sym("fresh"), ca.SX.sym("W_first", 2, n_h)
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    vehicle, sampling = ca.SX.sym("vehicle", 6), ca.SX.sym("sampling", 3)
    numbers = ca.SX.sym("numbers", len(Numbers._fields))
    state = {
        name: ca.SX.sym(name, *value.shape)
        for name, value in law.start(n_h, structure.memory, 1.0).items()
    }

    parameters, number = BicycleParameters(*ca.vertsplit(vehicle)), Numbers(*ca.vertsplit(numbers))
    dt, unit, min_speed = ca.vertsplit(sampling)
    moving, speed = v_x >= min_speed, ca.fmax(v_x, min_speed)
    model = bicycle(parameters, speed)
    xi = model.K_inv @ x / unit
    sigma = hidden_layer(V, network.normalized_input(network_signals(parameters, speed, x, u)))
    pair, lags_next = filtered_pair(
        lags,
        fresh,
        xi=xi,
        b=model.A_xi @ xi + model.B_xi @ u / unit,
        sigma=sigma,
        filter_rate=number.filter_rate,
        dt=dt,
    )
    excited = ca.logic_and(ca.sumsqr(pair.s) >= n_h * number.quiet**2, ca.sumsqr(pair.s) > 0)
    ahead = ca.if_else(ca.logic_and(moving, excited), dt, 0)  # at 0 no statistic and no W moves
    state_next, W_next = law.update(state, Weights(W, W_first), pair, number, ahead)
    f_hat = _where(moving, W @ sigma)
    linear = _where(moving, linear_axle_force(parameters, speed, x, u))
    return ca.Function(
        f"regression_{structure.law}",
        [W, V, *lags, fresh, *state.values(), x, u, v_x, W_first, vehicle, numbers, sampling],
        [
            ball(W_next, number.W_max),
            V,
            *lags_next,
            ca.logic_not(moving),  # after a rest the filters begin anew
            *(state_next[name] for name in state),
            f_hat,
            linear + unit * f_hat,
            _where(moving, pair.y - W @ pair.s),
        ],
        [*structure.carry, *OVER, "W_first", "vehicle", "numbers", "sampling"],
        [*(f"{name}_next" for name in structure.carry), "f_hat", "axle_force", "residual"],
        {"cse": True},
    )


def _where(condition: Any, value: Any) -> Any:
    return ca.if_else(condition, value, 0)
