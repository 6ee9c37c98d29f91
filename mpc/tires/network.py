"""The paper's network as a prediction tire: F = C α + U Ŵ tanh(V̂ x̄), every number a weight."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from identifier.network import network_signals
from identifier.network_model import NetworkModel
from models.bicycle import BicycleParameters
from mpc.tires.structure import Pair, Point, TireModel, no_lag, small_slip


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkAxles:
    """w = [C_f, C_r, U Ŵ by columns (2, n_h), V̂ diag(1/scale) by columns (n_h, n_in)].

    The force unit and the scales of the inputs are in the weights: they cost no operation.

    Parameters
    ----------
    hidden : number of hidden units n_h.
    inputs : signals of x̄, of `identifier.network.SIGNALS`.
    """

    lagged = False

    hidden: int
    inputs: tuple[str, ...]

    @property
    def n_weights(self) -> int:
        """2 + 2 n_h + n_h n_in."""
        return 2 + self.hidden * (2 + len(self.inputs))

    slip = small_slip
    lag_length = no_lag

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body.

        Parameters
        ----------
        slip : what makes the force [rad].
        at : motion, car and weights.
        """
        v_y, r, delta, v_x, car, w = at
        n_h, end = self.hidden, 2 + 2 * self.hidden
        W = ca.reshape(w[2:end], 2, n_h)
        V = ca.reshape(w[end:], n_h, len(self.inputs))
        bicycle = BicycleParameters(*car, C_f=w[0], C_r=w[1])
        signals = network_signals(bicycle, v_x, ca.vertcat(v_y, r), ca.vertcat(delta, 0))
        hidden = ca.tanh(V @ ca.vertcat(*(signals[name] for name in self.inputs)))
        residual = W @ hidden
        return w[0] * slip[0] + residual[0], w[1] * slip[1] + residual[1]


def network_tire(model: NetworkModel) -> TireModel:
    """Return the prediction tire of a frozen network.

    Parameters
    ----------
    model : frozen weights, with the car whose linear tire they correct.
    """
    network, scale = model.network, np.array(model.network.scale)
    weights = np.concatenate(
        [
            np.array(model.vehicle.bicycle[4:]),
            (model.force_unit * model.weights.W).ravel(order="F"),
            (model.weights.V / scale).ravel(order="F"),
        ]
    )
    structure = NetworkAxles(hidden=network.hidden, inputs=network.inputs)
    return TireModel(structure, weights, model.vehicle)
