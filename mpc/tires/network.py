"""The paper's network as a prediction tire: F = C α + U Ŵ tanh(V̂ x̄), every number a weight."""

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.own_network import OnnxModel, read_network
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


# A user's network as a prediction tire; the numbers of its tensors become run-time weights.
#
# The structure is the network with symbols in place of numbers, so that networks of one
# architecture share their compiled code, and a retrained one is swapped in like any other weights.


@dataclass(frozen=True, slots=True, kw_only=True)
class _OnnxAxles(SmallSlip):
    """Axle forces of a static network of signals; w: its constants, one after another.
    inputs : signals that it reads, of `identifier.paper.network.SIGNALS`.
    slip_sign : 1 where it reads slip angles in the paper's sign, -1 for ISO 8855.
    """

    program: str = field(repr=False)
    inputs: tuple[str, ...]
    slip_sign: int
    n_weights: int

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        del slip
        bicycle = BicycleParameters(*at.car, C_f=0.0, C_r=0.0)
        signals = network_signals(
            bicycle, at.v_x, ca.vertcat(at.v_y, at.r), ca.vertcat(at.delta, 0)
        )
        for name in ("alpha_f", "alpha_r"):
            signals[name] = self.slip_sign * signals[name]
        F = _loaded(self.program)(*(signals[name] for name in self.inputs), at.w)
        return F[0], F[1]


@cache
def _loaded(program: str) -> ca.Function:
    return ca.Function.deserialize(program)


def onnx_tire(model: OnnxModel) -> PredictionTire:
    network, weights = _lifted(model.content, model.inputs)
    structure = _OnnxAxles(
        program=network.serialize(),
        inputs=model.signals,
        slip_sign=model.slip_sign,
        n_weights=weights.size,
    )
    return PredictionTire(structure, weights, model.vehicle)


@cache
def _lifted(content: bytes, inputs: tuple[str, ...] | None) -> tuple[ca.Function, Array]:
    """Return the network as an SX function of its signals and w, and the w that it came with."""
    network = read_network(content, inputs)
    signals = [ca.MX.sym(f"signal_{i}") for i in range(network.n_in())]
    constants: list[tuple[Any, Array]] = []
    results = _evaluated(network, signals, constants)
    symbols, values = zip(*constants, strict=True)
    plain = ca.Function("plain", [*signals, *symbols], [ca.vertcat(*results)]).expand()
    w = ca.SX.sym("w", sum(value.size for value in values))
    parts = ca.vertsplit(w, np.cumsum([0, *(value.size for value in values)]).tolist())
    shaped = [ca.reshape(part, *s.shape) for part, s in zip(parts, symbols, strict=True)]
    scalars = [ca.SX.sym(f"signal_{i}") for i in range(network.n_in())]
    lifted = ca.Function("network", [*scalars, w], [plain(*scalars, *shaped)])
    return lifted, np.concatenate(values)


def _evaluated(
    function: ca.Function, arguments: list[Any], constants: list[tuple[Any, Array]]
) -> Any:
    """Return the results with calls inlined and every constant a symbol, noted with its value."""
    results: Any = function.call(arguments, True, False)
    old, new = [], []
    for node in _nodes(results, ca.OP_CONST):
        value = np.array(ca.densify(node.to_DM())).ravel(order="F")
        if value.size > 1 or not _is_of_the_formula(float(value[0])):
            old.append(node)
            new.append(ca.MX.sym(f"w{len(constants)}", *node.shape))
            constants.append((new[-1], value))
    results = ca.graph_substitute(results, old, new) if old else results
    for node in _nodes(results, ca.OP_CALL):
        called = node.which_function()
        inside = [ca.MX.sym("argument", *called.size_in(i)) for i in range(called.n_in())]
        given = [node.dep(i) for i in range(node.n_dep())]
        inlined = ca.substitute(_evaluated(called, inside, constants), inside, given)
        outputs = [node.get_output(i) for i in range(called.n_out())]
        results = ca.graph_substitute(results, outputs, inlined)
    return results


def _nodes(results: Any, operation: int) -> list[Any]:
    graph = ca.Function("graph", ca.symvar(ca.veccat(*results)), results)
    return [
        graph.instruction_MX(k)
        for k in range(graph.n_instructions())
        if graph.instruction_id(k) == operation
    ]


def _is_of_the_formula(value: float) -> bool:
    """Return whether a lone number is an exponent or a half rather than something learnt."""
    return abs(value) <= 4.0 and (2.0 * value).is_integer()
