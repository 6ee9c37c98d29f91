"""The axle model's static force curve as ONNX: F_i = load_i Σ_j w_ij tanh(α_i/α_j).

What the whole model adds, the lag of slip and the sway of the body, has a state and stays out.
"""

import numpy as np

from codegen.escape import visible
from identifier.axle.model import AxleModel
from identifier.export.onnx_graph import Graph
from identifier.export.onnx_network import OUTPUTS, SLIP_SIGN
from identifier.export.signals import Signal

INPUTS = (
    Signal("alpha_f", "rad", "slip angle of the front axle, paper's sign"),
    Signal("alpha_r", "rad", "slip angle of the rear axle, paper's sign"),
)


def axle_graph(model: AxleModel, *, single: bool = False) -> bytes:
    """Return the static curves as ONNX; inputs alpha_f, alpha_r, outputs F_yf, F_yr, (batch, 1).

    Parameters
    ----------
    model : the frozen axle model.
    single : whether numbers are float32; else they are float64.
    """
    graph = Graph(single)
    scales = graph.constant("inverse_scales", 1.0 / np.array(model.ladder)[None])
    for slip, force, weights, load in zip(
        INPUTS, OUTPUTS, model.W, model.vehicle.axle_loads, strict=True
    ):
        bent = graph.apply("MatMul", [slip.name, scales], f"{slip.name}_over_scales")
        units = graph.apply("Tanh", [bent], f"{slip.name}_units")
        share = graph.constant(f"{force.name}_weights", load * weights[:, None])
        graph.apply("MatMul", [units, share], force.name)
    return graph.model_bytes(
        "axle_force_curves",
        INPUTS,
        OUTPUTS,
        f"Static axle force over slip angle of {visible(model.vehicle.name)}; {SLIP_SIGN}",
        {"vehicle": visible(model.vehicle.name)},
    )
