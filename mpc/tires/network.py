"""The paper's network as a prediction tire: F = C α + U Ŵ tanh(V̂ x̄), every number a weight."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.paper.network import NetworkModel, network_signals
from models.bicycle import BicycleParameters
from mpc.tires.tire import Pair, Point, PredictionTire, SmallSlip


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkAxles(SmallSlip):
    """w = [C_f, C_r, U Ŵ by columns (2, n_h), V̂ diag(1/scale) by columns (n_h, n_in)].

    The force unit and the scales of the inputs are in the weights: they cost no operation.
    hidden : number of hidden units n_h.
    inputs : signals of x̄, of `identifier.paper.network.SIGNALS`.
    """

    hidden: int
    inputs: tuple[str, ...]

    @property
    def n_weights(self) -> int:
        return 2 + self.hidden * (2 + len(self.inputs))

    def at_friction(self, weights: Array, ratio: float) -> Array | None:
        """Return `weights` (n_weights,) of another friction; None where it reads the speed."""
        if "v_x" in self.inputs:
            return None
        w, end = weights.copy(), 2 + 2 * self.hidden  # C α is its own similar
        w[2:end] *= ratio
        w[end:] /= ratio
        return w

    def similar(self, at: Point, ratio: Any) -> Point | None:
        """Return the signals over the ratio; None where the network reads the speed."""
        if "v_x" in self.inputs:
            return None
        return at._replace(v_y=at.v_y / ratio, r=at.r / ratio, delta=at.delta / ratio)

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        v_y, r, delta, v_x, car, w = at
        n_h, end = self.hidden, 2 + 2 * self.hidden
        W = ca.reshape(w[2:end], 2, n_h)
        V = ca.reshape(w[end:], n_h, len(self.inputs))
        bicycle = BicycleParameters(*car, C_f=w[0], C_r=w[1])
        signals = network_signals(bicycle, v_x, ca.vertcat(v_y, r), ca.vertcat(delta, 0))
        hidden = ca.tanh(V @ ca.vertcat(*(signals[name] for name in self.inputs)))
        residual = W @ hidden
        return w[0] * slip[0] + residual[0], w[1] * slip[1] + residual[1]


def network_tire(model: NetworkModel) -> PredictionTire:
    network, scale = model.network, np.array(model.network.scale)
    weights = np.concatenate(
        [
            np.array(model.vehicle.bicycle[4:]),
            (model.force_unit * model.weights.W).ravel(order="F"),
            (model.weights.V / scale).ravel(order="F"),
        ]
    )
    structure = NetworkAxles(hidden=network.hidden, inputs=network.inputs)
    return PredictionTire(structure, weights, model.vehicle)
