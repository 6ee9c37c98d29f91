"""A frozen model as an ONNX file, for whoever runs networks in a tool of their own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.escape import visible
from identifier.axle.band import (
    AT_SPEEDS,
    CENTERS,
    FLOOR,
    RELATIVE,
    UNKNOWN,
    root,
)
from identifier.axle.band_step import LEAST_BEFORE, hinges
from identifier.axle.model import AxleModel
from identifier.band import LEVEL, normal_quantile
from identifier.estimate.model import FittedModel
from identifier.export.specialize import INPUTS, Signal
from identifier.own_network import OnnxModel
from identifier.paper.network import NetworkModel
from identifier.tire_model import TireModel
from models.extras import needs
from models.files import write_atomically

# An ONNX graph, node by node: every value is a name, every operation returns that of its result.
#
# Tensors are (batch, columns) of one number type; the batch may have any size. Operators are those
# of opset 13, which every runtime of the last years knows, and of which CasADi reads back all.

OPSET = 13
IR_VERSION = 7  # of the file format that came with opset 13


class MissingOnnxError(TireidError, ImportError):
    """The package onnx is not installed; the message says how to install it."""


def onnx_package() -> Any:
    try:
        import onnx
    except ImportError as error:
        raise MissingOnnxError(needs("writing ONNX", "the package onnx", "onnx")) from error
    return onnx


@dataclass(slots=True)
class Graph:
    """Nodes and constants of a graph that is being written.
    single : whether numbers are float32; else they are float64.
    """

    single: bool
    nodes: list[Any] = field(default_factory=list)
    constants: list[Any] = field(default_factory=list)

    def constant(self, name: str, value: ArrayLike) -> str:
        """Store a matrix and return its name.   value : its numbers (of any shape)."""
        number = np.float32 if self.single else np.float64
        array = np.ascontiguousarray(np.asarray(value), dtype=number)
        self.constants.append(onnx_package().numpy_helper.from_array(array, name))
        return name

    def apply(self, operator: str, inputs: Sequence[str], result: str, **attributes: Any) -> str:
        """Add a node and return the name of its result.   operator : of ONNX, such as "MatMul"."""
        node = onnx_package().helper.make_node(
            operator, list(inputs), [result], name=result, **attributes
        )
        self.nodes.append(node)
        return result

    def model_bytes(
        self,
        name: str,
        inputs: Sequence[Signal],
        outputs: Sequence[Signal],
        doc: str,
        metadata: dict[str, str],
    ) -> bytes:
        """Return the finished, checked model as the content of its file.
        outputs : what it gives; results of nodes have their names.
        """
        onnx = onnx_package()
        helper = onnx.helper
        number = onnx.TensorProto.FLOAT if self.single else onnx.TensorProto.DOUBLE

        def column(port: Signal) -> Any:
            return helper.make_tensor_value_info(
                port.name, number, ["batch", 1], doc_string=f"{port.description} [{port.unit}]"
            )

        graph = helper.make_graph(
            self.nodes,
            name,
            [column(port) for port in inputs],
            [column(port) for port in outputs],
            self.constants,
            doc_string=doc,
        )
        model = helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid("", OPSET)],
            ir_version=IR_VERSION,
            producer_name="tireid",
            doc_string=doc,
        )
        helper.set_model_props(model, metadata)
        onnx.checker.check_model(model, full_check=True)
        content: bytes = model.SerializeToString(deterministic=True)
        return content


# The paper's network, frozen, as ONNX: F_y = C α + U Ŵ tanh(V̂ x̄), zero below the minimum speed.
#
# Rows are samples, as ONNX has it, so that every product is transposed: x̄ᵀ V̂ᵀ, σᵀ Ŵᵀ.

SLIP_SIGN = "slip angle δ - atan(v/v_x), the negative of ISO 8855; force to the left is positive"
OUTPUTS = (
    Signal("F_yf", "N", "lateral force of the front axle in the frame of the body, left positive"),
    Signal("F_yr", "N", "lateral force of the rear axle in the frame of the body, left positive"),
)


def network_graph(model: NetworkModel, *, single: bool = False) -> bytes:
    """Return a frozen network as ONNX: v_x, v_y, r, delta_f, delta_r to F_yf, F_yr, (batch, 1).
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


# The axle model's static force curve as ONNX: F_i = load_i Σ_j w_ij tanh(α_i/α_j).
#
# What the whole model adds, the lag of slip and the sway of the body, has a state and stays out.
# So does downforce, which needs a speed: its κ are given as metadata, F times 1 + κ v_x².

FROZEN_INPUTS = (
    Signal("alpha_f", "rad", "slip angle of the front axle, paper's sign"),
    Signal("alpha_r", "rad", "slip angle of the rear axle, paper's sign"),
)


HALF_BANDS = (
    Signal("F_yf_half_band", "N", "half the width of the 90 % band around F_yf"),
    Signal("F_yr_half_band", "N", "half the width of the 90 % band around F_yr"),
)


AddBand = Callable[[Graph, int, str, str], None]  # axle, names of the units and of the force


def axle_graph(model: AxleModel, *, single: bool = False, add_band: AddBand | None = None) -> bytes:
    """Return the static curves as ONNX; inputs alpha_f, alpha_r, outputs F_yf, F_yr, (batch, 1).

    Of a car with downforce those of the static loads.
    single : whether numbers are float32; else they are float64.
    """
    graph = Graph(single)
    scales = graph.constant("inverse_scales", 1.0 / np.array(model.ladder)[None])
    for axle, (slip, force, weights, load) in enumerate(
        zip(FROZEN_INPUTS, OUTPUTS, model.W, model.vehicle.axle_loads, strict=True)
    ):
        bent = graph.apply("MatMul", [slip.name, scales], f"{slip.name}_over_scales")
        units = graph.apply("Tanh", [bent], f"{slip.name}_units")
        share = graph.constant(f"{force.name}_weights", load * weights[:, None])
        graph.apply("MatMul", [units, share], force.name)
        if add_band is not None:
            add_band(graph, axle, units, force.name)
    car, loads, more = model.vehicle, "", {}
    if car.has_downforce:
        loads = " under static loads, at v_x times 1 + downforce v_x^2"
        keys = ("downforce_front_s2_m2", "downforce_rear_s2_m2")
        more = dict(zip(keys, map(repr, car.downforce), strict=True))
    return graph.model_bytes(
        "axle_force_curves",
        FROZEN_INPUTS,
        (*OUTPUTS, *(HALF_BANDS if add_band is not None else ())),
        f"Static axle force over slip angle of {visible(car.name)}{loads}; {SLIP_SIGN}",
        {"vehicle": visible(car.name), **more},
    )


class _Nodes:
    """Nodes of half the width of the band of an axle."""

    def __init__(self, graph: Graph, port: str) -> None:
        self._graph, self._port = graph, port

    def node(self, operator: str, *inputs: str, **attributes: Any) -> str:
        name = f"{self._port}_{len(self._graph.nodes)}"
        return self._graph.apply(operator, inputs, name, **attributes)

    def number(self, value: ArrayLike) -> str:
        matrix = np.atleast_2d(np.asarray(value, dtype=np.float64))
        return self._graph.constant(f"{self._port}_number_{len(self._graph.constants)}", matrix)

    def square(self, row: str) -> str:
        return self.node("Mul", row, row)

    def variance(self, h: str, P: Array) -> str:
        by = root(P)
        product = self.node("MatMul", h, self.number(by))
        return self.node("MatMul", self.square(product), self.number(np.ones((by.shape[1], 1))))

    def sensitivity(self, model: AxleModel, axle: int, units: str, speed: float) -> str:
        """Return h: the force over its weights and the zero of its slip, (batch, n + 1)."""
        by_offset = (1.0, 1.0 / speed)[axle]
        bent = self.node("Sub", self.number(1.0), self.square(units))
        by = (by_offset * model.W[axle] / model.ladder)[:, None]
        slope = self.node("MatMul", bent, self.number(by))
        return self.node("Concat", units, slope, axis=1)

    def finish(self, variance: str, size: float) -> None:
        self._graph.apply("Mul", [self.node("Sqrt", variance), self.number(size)], self._port)


def _of_curve(model: AxleModel, P: Array, axle: int) -> Array:
    """Return the covariance of weights and the zero of the slip of an axle."""
    n = len(model.ladder)
    learnt = [*range(n), n + 2]
    found: Array = P[axle][np.ix_(learnt, learnt)]
    return found


def _band_of_fit(source: FittedModel, graph: Graph, axle: int, units: str, force: str) -> None:
    """Add half the width of the band of an axle, as of a fit; arguments as of `_band_of_axle`."""
    nodes, model = _Nodes(graph, HALF_BANDS[axle].name), source.in_units()
    load = model.vehicle.axle_loads[axle]
    h = nodes.sensitivity(model, axle, units, float(source.speeds.mean()))
    left = nodes.variance(h, _of_curve(model, model.covariance, axle))
    share = nodes.node("Mul", force, nodes.number(source.band.error_share[axle] / load))
    own = nodes.node("Add", nodes.square(share), nodes.number(source.band.error_floor[axle] ** 2))
    nodes.finish(nodes.node("Add", left, own), load * normal_quantile(LEVEL))


def _band_of_axle(model: AxleModel, graph: Graph, axle: int, units: str, force: str) -> None:
    """Add half the width of the band of an axle; the formula of `identifier.axle.band`.
    axle : 0 in front, 1 at the rear.
    units, force : names of t (batch, n) and of the force [N] (batch, 1).
    """
    nodes = _Nodes(graph, HALF_BANDS[axle].name)
    node, number = nodes.node, nodes.number
    load, calibration = model.vehicle.axle_loads[axle], model.band.calibration
    speed = calibration.speed
    h = nodes.sensitivity(model, axle, units, speed)
    left, before = (
        nodes.variance(h, _of_curve(model, P, axle))
        for P in (model.covariance, model.prior_covariance)
    )
    before = node("Max", before, number(LEAST_BEFORE))
    share = node("Min", node("Div", left, before), number(1.0))
    c = float(calibration.color[axle])
    given = node("Add", number(1.0), node("Mul", share, number(c - 1.0)))
    colored = node("Div", node("Mul", node("Mul", before, share), number(c)), given)
    left = node("Max", colored, left)
    relative = node("Mul", force, number(RELATIVE / load))
    total = node("Add", node("Add", nodes.square(relative), number(FLOOR**2)), left)
    ratio = node("Div", left, node("Mul", before, number(UNKNOWN**2)))
    unknown = node("Min", ratio, number(1.0))
    slips = hinges(calibration.factors, CENTERS)[axle]
    size = node("Min", node("Abs", FROZEN_INPUTS[axle].name), number(CENTERS[-1]))
    over = node("Max", node("Sub", size, number(CENTERS[:-1])), number(0.0))
    by_slip = node("Add", node("MatMul", over, number(slips[1:, None])), number(slips[0]))
    at = speed / model.vehicle.froude_speed
    factor = node("Mul", by_slip, number(np.interp(at, AT_SPEEDS, calibration.speeds[axle])))
    wide = node("Max", factor, number(1.0))
    narrow, wide = nodes.square(factor), nodes.square(wide)
    opened = node("Mul", unknown, node("Sub", wide, narrow))
    variance = node("Mul", total, node("Add", narrow, opened))
    nodes.finish(variance, load * normal_quantile(LEVEL))


# By kind of model: the content of its file, from the model and whether numbers are float32.
GRAPHS: Mapping[str, Callable[[Any, bool], bytes]] = {
    NetworkModel.kind: lambda model, single: network_graph(model, single=single),
    AxleModel.kind: lambda model, single: axle_graph(model, single=single),
    FittedModel.kind: lambda model, single: axle_graph(model.in_units(), single=single),
    OnnxModel.kind: lambda model, _: model.content,
}
BANDED: Mapping[str, Callable[[Any, bool], bytes]] = {  # likewise with the band
    AxleModel.kind: lambda model, single: axle_graph(
        model, single=single, add_band=partial(_band_of_axle, model)
    ),
    FittedModel.kind: lambda model, single: axle_graph(
        model.in_units(), single=single, add_band=partial(_band_of_fit, model)
    ),
}


class NoOnnxError(TireidError, ValueError):
    """A frozen model of a kind that has no ONNX form."""


def onnx_bytes(model: TireModel, *, single: bool = False, with_band: bool = False) -> bytes:
    """Return a frozen model as the content of an ONNX file; the same model gives the same bytes.
    model : the whole model for a network, the static force curves for an axle model and, in hidden
        units, for a fit, the network itself for one that came from an ONNX file.
    single : whether numbers are float32; else they are float64.
    """
    if model.kind not in GRAPHS:
        raise NoOnnxError(
            f"{type(model).__name__} has no ONNX form, only networks and axle curves do"
        )
    if not with_band:
        return GRAPHS[model.kind](model, single)
    if model.kind not in BANDED:
        raise NoOnnxError(f"{type(model).__name__} cannot tell how sure it is: it has no band")
    return BANDED[model.kind](model, single)


def export_onnx(
    model: TireModel, path: Path, *, single: bool = False, with_band: bool = False
) -> None:
    """Write a frozen model as an ONNX file.
    single : whether numbers are float32; else they are float64.
    """
    write_atomically(path, onnx_bytes(model, single=single, with_band=with_band))
