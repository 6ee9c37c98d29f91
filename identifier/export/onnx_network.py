"""The paper's network, frozen, as ONNX: F_y = C α + U Ŵ tanh(V̂ x̄), zero below the minimum speed.

Rows are samples, as ONNX has it, so that every product is transposed: x̄ᵀ V̂ᵀ, σᵀ Ŵᵀ.
"""

import numpy as np

from codegen.escape import visible
from identifier.export.onnx_graph import Graph
from identifier.export.signals import INPUTS, Signal
from identifier.network_model import NetworkModel

SLIP_SIGN = "slip angle δ - atan(v/v_x), the negative of ISO 8855; force to the left is positive"
OUTPUTS = (
    Signal("F_yf", "N", "lateral force of the front axle in the frame of the body, left positive"),
    Signal("F_yr", "N", "lateral force of the rear axle in the frame of the body, left positive"),
)


def network_graph(model: NetworkModel, *, single: bool = False) -> bytes:
    """Return a frozen network as ONNX: v_x, v_y, r, delta_f, delta_r to F_yf, F_yr, (batch, 1).

    Parameters
    ----------
    model : the frozen network.
    single : whether numbers are float32; else they are float64.
    """
    graph = Graph(single)
    _, _, l_f, l_r, C_f, C_r = model.vehicle.bicycle
    speed_floor = graph.constant("min_speed", [[model.min_speed]])
    speed = graph.apply("Max", ["v_x", speed_floor], "speed")
    x = graph.apply("Concat", ["v_y", "r"], "x", axis=1)
    u = graph.apply("Concat", ["delta_f", "delta_r"], "u", axis=1)
    lever = graph.constant("lever", [[1.0, 1.0], [l_f, -l_r]])
    axle_v_y = graph.apply("MatMul", [x, lever], "axle_v_y")
    drift = graph.apply("Div", [axle_v_y, speed], "drift")
    alpha = graph.apply("Sub", [u, drift], "alpha")  # (3), in the paper's sign
    linear = graph.apply("Mul", [alpha, graph.constant("C", [[C_f, C_r]])], "linear")

    signals = ("v_y", "r", "delta_f", "delta_r", "v_x", "alpha_f", "alpha_r")
    everything = graph.apply("Concat", [x, u, speed, alpha], "signals", axis=1)
    network = model.network
    assert network.scale is not None
    choice = np.zeros((len(signals), len(network.inputs)))
    for column, (name, scale) in enumerate(zip(network.inputs, network.scale, strict=True)):
        choice[signals.index(name), column] = 1 / scale
    x_bar = graph.apply("MatMul", [everything, graph.constant("scaling", choice)], "x_bar")
    activation = graph.apply(
        "MatMul", [x_bar, graph.constant("V_T", model.weights.V.T)], "activation"
    )
    sigma = graph.apply("Tanh", [activation], "sigma")
    W_T = graph.constant("W_T", model.force_unit * model.weights.W.T)
    learnt = graph.apply("MatMul", [sigma, W_T], "learnt")
    force = graph.apply("Add", [linear, learnt], "force")

    moving = graph.apply("GreaterOrEqual", ["v_x", speed_floor], "moving")
    axle_force = graph.apply(
        "Where", [moving, force, graph.constant("rest", [[0.0]])], "axle_force"
    )
    for port, axle in zip(OUTPUTS, ([[1.0], [0.0]], [[0.0], [1.0]]), strict=True):
        pick = graph.constant(f"pick_{port.name}", axle)
        graph.apply("MatMul", [axle_force, pick], port.name)
    name = visible(model.vehicle.name)
    return graph.model_bytes(
        "frozen_network",
        INPUTS,
        OUTPUTS,
        f"Axle forces of {name}, F_y = C alpha + U W tanh(V x_bar), zero below "
        f"{model.min_speed:g} m/s; {SLIP_SIGN}",
        {"vehicle": name, "min_speed_m_s": repr(model.min_speed)},
    )
