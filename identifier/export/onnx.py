"""A frozen model as an ONNX file, for whoever runs networks in a tool of their own.

Tensors are (batch, columns) of one number type; the batch may have any size. Operators are those
of opset 13, which every runtime of the last years knows, and of which CasADi reads back all.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from codegen.clean_c import recognized
from codegen.elementary import atan
from codegen.errors import TireidError
from codegen.escape import visible
from codegen.graph import BUILDERS, function_of, graph_of
from identifier.axle.band import FLOOR, RELATIVE, root
from identifier.axle.band_step import LEAST_BEFORE, hinges
from identifier.axle.chosen import CHOSEN as AXLE_CHOSEN
from identifier.axle.model import AxleModel
from identifier.band import LEVEL, normal_quantile
from identifier.estimate.model import FittedModel
from identifier.export.specialize import INPUTS, Signal
from identifier.motion.model import curve_function
from identifier.motion.parameters import INDEX, curve_index
from identifier.paper.network import NetworkModel
from identifier.tire_model import TireModel
from models.extras import needs
from models.files import write_atomically
from models.vehicle import Vehicle


class MissingOnnxError(TireidError, ImportError):
    """The package onnx is not installed; the message says how to install it."""


class NoOnnxError(TireidError, ValueError):
    """A frozen model of a kind that has no ONNX form."""


_HEAD = '<ir_version: 7, opset_import: ["": 13], producer_name: "tireid">'  # 7 came with opset 13
_SLIP_SIGN = "slip angle δ - atan(v/v_x), the negative of ISO 8855; force to the left is positive"
_FORCES = (
    Signal("F_yf", "N", "lateral force of the front axle in the frame of the body, left positive"),
    Signal("F_yr", "N", "lateral force of the rear axle in the frame of the body, left positive"),
)
_SLIPS = (
    Signal("alpha_f", "rad", "slip angle of the front axle, paper's sign"),
    Signal("alpha_r", "rad", "slip angle of the rear axle, paper's sign"),
)
_HALF_BANDS = (
    Signal("F_yf_half_band", "N", "half the width of the 90 % band around F_yf"),
    Signal("F_yr_half_band", "N", "half the width of the 90 % band around F_yr"),
)


class _Graph:
    """A graph that is being written in ONNX's own text, with its constants by name."""

    def __init__(self, text: str = "", numbers: dict[str, ArrayLike] | None = None) -> None:
        self.lines, self.numbers = [text], dict(numbers or {})

    def number(self, value: ArrayLike) -> str:
        """Store a matrix and return its name.   value : its numbers, a scalar or a row too."""
        name = f"number_{len(self.numbers)}"
        self.numbers[name] = np.atleast_2d(np.asarray(value, dtype=np.float64))
        return name

    def node(self, operator: str, *inputs: str, result: str = "") -> str:
        """Add an operator of ONNX, such as "MatMul", and return the name of its result."""
        name = result or f"value_{len(self.lines)}"
        self.lines.append(f"{name} = {operator}({', '.join(inputs)})")
        return name

    def square(self, row: str) -> str:
        return self.node("Mul", row, row)

    def content(
        self,
        name: str,
        inputs: tuple[Signal, ...],
        outputs: tuple[Signal, ...],
        doc: str,
        metadata: dict[str, str],
        *,
        single: bool,
    ) -> bytes:
        """Return the checked model as the content of its file; outputs are results of nodes."""
        try:
            import onnx
        except ImportError as error:
            raise MissingOnnxError(needs("writing ONNX", "the package onnx", "onnx")) from error
        kind, number = ("float", np.float32) if single else ("double", np.float64)
        ports = (
            ", ".join(f"{kind}[batch, 1] {one.name}" for one in row) for row in (inputs, outputs)
        )
        head = " => ".join(f"({row})" for row in ports)
        model: Any = onnx.parser.parse_model(
            "\n".join([f"{_HEAD} {name} {head} {{", *self.lines, "}"])
        )
        model.doc_string = model.graph.doc_string = doc
        for node in model.graph.node:
            node.name = node.output[0]
        for port, signal in zip(
            (*model.graph.input, *model.graph.output), (*inputs, *outputs), strict=True
        ):
            port.doc_string = f"{signal.description} [{signal.unit}]"
        for key, value in self.numbers.items():
            array = np.ascontiguousarray(value, dtype=number)
            model.graph.initializer.append(onnx.numpy_helper.from_array(array, key))
        onnx.helper.set_model_props(model, metadata)
        onnx.checker.check_model(model, full_check=True)
        content: bytes = model.SerializeToString(deterministic=True)
        return content


# The paper's network, frozen: F_y = C α + U Ŵ tanh(V̂ x̄), zero below the minimum speed. Rows are
# samples, as ONNX has it, so that every product is transposed: x̄ᵀ V̂ᵀ, σᵀ Ŵᵀ.
_NETWORK = """
speed = Max(v_x, min_speed)
x = Concat<axis = 1>(v_y, r)
u = Concat<axis = 1>(delta_f, delta_r)
axle_v_y = MatMul(x, lever)
drift = Div(axle_v_y, speed)
alpha = Sub(u, drift)
linear = Mul(alpha, C)
signals = Concat<axis = 1>(x, u, speed, alpha)
x_bar = MatMul(signals, scaling)
activation = MatMul(x_bar, V_T)
sigma = Tanh(activation)
f_hat = MatMul(sigma, W_T)
force = Add(linear, f_hat)
moving = GreaterOrEqual(v_x, min_speed)
axle_force = Where(moving, force, rest)
F_yf = MatMul(axle_force, front)
F_yr = MatMul(axle_force, rear)
"""


def _network(model: NetworkModel, *, single: bool) -> bytes:
    """Return a frozen network: v_x, v_y, r, delta_f, delta_r to F_yf, F_yr, (batch, 1)."""
    _, _, l_f, l_r, C_f, C_r = model.vehicle.bicycle
    network, signals = (
        model.network,
        ("v_y", "r", "delta_f", "delta_r", "v_x", "alpha_f", "alpha_r"),
    )
    assert network.scale is not None
    scaling = np.zeros((len(signals), len(network.inputs)))
    for column, (name, scale) in enumerate(zip(network.inputs, network.scale, strict=True)):
        scaling[signals.index(name), column] = 1 / scale
    numbers: dict[str, ArrayLike] = {
        "min_speed": [[model.min_speed]],
        "lever": [[1.0, 1.0], [l_f, -l_r]],
        "C": [[C_f, C_r]],
        "scaling": scaling,
        "V_T": model.weights.V.T,
        "W_T": model.force_unit * model.weights.W.T,
        "rest": [[0.0]],
        "front": [[1.0], [0.0]],
        "rear": [[0.0], [1.0]],
    }
    car = visible(model.vehicle.name)
    return _Graph(_NETWORK, numbers).content(
        "frozen_network",
        INPUTS,
        _FORCES,
        f"Axle forces of {car}, F_y = C alpha + U W tanh(V x_bar), zero below "
        f"{model.min_speed:g} m/s; {_SLIP_SIGN}",
        {"vehicle": car, "min_speed_m_s": repr(model.min_speed)},
        single=single,
    )


# The static force curve: of an axle model F_i = load_i Σ_j w_ij tanh(α_i/α_j), of a fit the curve
# of `identifier.motion.model`, operator by operator.
#
# What the whole model adds, the lag of slip and the sway of the body, has a state and stays out.
# So does downforce, which needs a speed: its κ are given as metadata, F times 1 + κ v_x².

_AddBand = Callable[[_Graph, int, str], None]  # axle, and the name of its units


def _curves(model: AxleModel, *, single: bool, add_band: _AddBand | None) -> bytes:
    """Return the static curves, alpha_f, alpha_r to F_yf, F_yr, (batch, 1), under static loads."""
    graph = _Graph()
    scales = graph.number(1.0 / np.array(model.ladder))
    for axle, (slip, force, weights, load) in enumerate(
        zip(_SLIPS, _FORCES, model.W, model.vehicle.axle_loads, strict=True)
    ):
        units = graph.node("Tanh", graph.node("MatMul", slip.name, scales))
        graph.node("MatMul", units, graph.number(load * weights[:, None]), result=force.name)
        if add_band is not None:
            add_band(graph, axle, units)
    return _content_of_curves(graph, model.vehicle, single=single, with_band=add_band is not None)


def _content_of_curves(graph: _Graph, car: Vehicle, *, single: bool, with_band: bool) -> bytes:
    loads, more = "", {}
    if car.has_downforce:
        loads = " under static loads, at v_x times 1 + downforce v_x^2"
        keys = ("downforce_front_s2_m2", "downforce_rear_s2_m2")
        more = dict(zip(keys, map(repr, car.downforce), strict=True))
    return graph.content(
        "axle_force_curves",
        _SLIPS,
        (*_FORCES, *_HALF_BANDS) if with_band else _FORCES,
        f"Static axle force over slip angle of {visible(car.name)}{loads}; {_SLIP_SIGN}",
        {"vehicle": visible(car.name), **more},
        single=single,
    )


def _fitted_curves(model: FittedModel, *, single: bool, with_band: bool) -> bytes:
    """Return the static curves of a fit, as those of `_curves`."""
    graph, x = _Graph(), ca.SX.sym("x")
    for i, axle in enumerate("fr"):
        found = curve_function()(ca.DM(model.p[curve_index(axle)]), x)
        at_slip = ca.Function("curve", [x], found[: 3 if with_band else 1])
        phi, *slopes = _written(graph, at_slip, _SLIPS[i].name)
        load = graph.number(model.vehicle.axle_loads[i])
        graph.node("Mul", phi, load, result=_FORCES[i].name)
        if with_band:
            _band_of_fit(model, graph, i, phi, *slopes)
    return _content_of_curves(graph, model.vehicle, single=single, with_band=with_band)


# No runtime has an Atan of double: our own is made of the others.
_BUILDERS = {**BUILDERS, "tanh": ca.tanh, "exp": ca.exp, "atan": atan}
_OPERATORS = {
    "add": "Add", "sub": "Sub", "mul": "Mul", "div": "Div", "neg": "Neg", "inv": "Reciprocal",
    "tanh": "Tanh", "exp": "Exp", "sin": "Sin", "cos": "Cos", "sqrt": "Sqrt", "lt": "Less",
    "select": "Where",
}  # fmt: skip


def _written(graph: _Graph, function: ca.Function, argument: str) -> list[str]:
    """Add the operators of an SX function of a scalar; return the names of its results."""
    plain = function_of(graph_of(function), function, _BUILDERS)
    scalars, names = recognized(graph_of(plain), whole=False), dict[int, str]()
    for place in scalars.reached():
        node = scalars.nodes[place]
        given = [names[a] for a in node.args]
        if node.op == "const":
            names[place] = graph.number(node.value)
        elif node.op == "input":
            names[place] = argument
        elif node.op == "sq":
            names[place] = graph.square(*given)
        elif node.op == "twice":
            names[place] = graph.node("Add", *given, *given)
        else:
            names[place] = graph.node(_OPERATORS[node.op], *given)
    return [names[place] for entries in scalars.outputs for place in entries]


def _sensitivity(graph: _Graph, model: AxleModel, axle: int, units: str, speed: float) -> str:
    """Return h: the force over its weights and the zero of its slip, (batch, n + 1)."""
    by_offset = (1.0, 1.0 / speed)[axle]
    bent = graph.node("Sub", graph.number(1.0), graph.square(units))
    by = (by_offset * model.W[axle] / model.ladder)[:, None]
    slope = graph.node("MatMul", bent, graph.number(by))
    return graph.node("Concat<axis = 1>", units, slope)


def _square_of(graph: _Graph, h: str, P: Array, index: list[int]) -> str:
    """Return h' P h, (batch, 1).   index : of the rows of P that h is of."""
    by = root(P[np.ix_(index, index)])
    product = graph.node("MatMul", h, graph.number(by))
    return graph.node("MatMul", graph.square(product), graph.number(np.ones((by.shape[1], 1))))


def _band_of_fit(
    model: FittedModel, graph: _Graph, i: int, phi: str, slope: str, *numbers: str
) -> None:
    """Add half the width of the band of an axle, as of a fit at the speed of its drives.
    i : 0 in front, 1 at the rear.   phi, slope, numbers : names of φ [static loads], of dφ/dx and
        of the slopes of φ over the numbers of its curve, (batch, 1).
    """
    node, number, band = graph.node, graph.number, model.band
    index, P = curve_index("fr"[i]), model.covariance
    speed = model.reach.speeds.mean()
    shares = {"steering_zero": 1.0 - i, "v_y_bias": 1.0 / speed, "v_y_angle": 1.0}
    columns = dict(zip(index, numbers, strict=True)) | {
        INDEX[name]: node("Mul", slope, number(share)) for name, share in shares.items()
    }
    moves = [k for k in columns if P[k, k] > 0.0]
    h = node("Concat<axis = 1>", *(columns[k] for k in moves))
    left = _square_of(graph, h, P, moves)
    own = graph.square(node("Mul", phi, number(band.error_share[i])))
    total = node("Add", left, node("Add", own, number(band.error_floor[i] ** 2)))
    size = number(model.vehicle.axle_loads[i] * normal_quantile(LEVEL))
    node("Mul", node("Sqrt", total), size, result=_HALF_BANDS[i].name)


def _band_of_axle(model: AxleModel, graph: _Graph, axle: int, units: str) -> None:
    """Add half the width of the band of an axle; the formula of `identifier.axle.band`.
    axle : 0 in front, 1 at the rear.   units : name of t (batch, n).
    """
    node, number = graph.node, graph.number
    load, calibration = model.vehicle.axle_loads[axle], model.band.calibration
    speed = calibration.speed
    n, h = len(model.ladder), _sensitivity(graph, model, axle, units, speed)
    learnt = [*range(n), n + 2]  # weights and the zero of the slip
    left, before = (
        _square_of(graph, h, P[axle], learnt) for P in (model.covariance, model.prior_covariance)
    )
    before = node("Max", before, number(LEAST_BEFORE))
    share = node("Min", node("Div", left, before), number(1.0))
    c = float(calibration.color[axle])
    given = node("Add", number(1.0), node("Mul", share, number(c - 1.0)))
    colored = node("Div", node("Mul", node("Mul", before, share), number(c)), given)
    left = node("Max", colored, left)
    relative = node("Mul", _FORCES[axle].name, number(RELATIVE / load))
    total = node("Add", node("Add", graph.square(relative), number(FLOOR**2)), left)
    ratio = node("Div", left, node("Mul", before, number(AXLE_CHOSEN.unknown**2)))
    unknown = node("Min", ratio, number(1.0))
    slips = hinges(calibration.factors, AXLE_CHOSEN.centers)[axle]
    size = node("Min", node("Abs", _SLIPS[axle].name), number(AXLE_CHOSEN.centers[-1]))
    over = node("Max", node("Sub", size, number(AXLE_CHOSEN.centers[:-1])), number(0.0))
    by_slip = node("Add", node("MatMul", over, number(slips[1:, None])), number(slips[0]))
    at = speed / model.vehicle.froude_speed
    factor = node(
        "Mul", by_slip, number(np.interp(at, AXLE_CHOSEN.at_speeds, calibration.speeds[axle]))
    )
    wide = node("Max", factor, number(1.0))
    narrow, wide = graph.square(factor), graph.square(wide)
    opened = node("Mul", unknown, node("Sub", wide, narrow))
    sd = node("Sqrt", node("Mul", total, node("Add", narrow, opened)))
    node("Mul", sd, number(load * normal_quantile(LEVEL)), result=_HALF_BANDS[axle].name)


def onnx_bytes(model: TireModel, *, single: bool = False, with_band: bool = False) -> bytes:
    """Return a frozen model as the content of an ONNX file; the same model gives the same bytes.
    model : the whole model for a network, the static force curves for an axle model and a fit.
    single : whether numbers are float32; else they are float64.
    """
    if isinstance(model, AxleModel):
        band = partial(_band_of_axle, model) if with_band else None
        return _curves(model, single=single, add_band=band)
    if isinstance(model, FittedModel):
        return _fitted_curves(model, single=single, with_band=with_band)
    name = type(model).__name__
    if not isinstance(model, NetworkModel):
        raise NoOnnxError(f"{name} has no ONNX form, only networks and axle curves do")
    if with_band:
        raise NoOnnxError(f"{name} cannot tell how sure it is: it has no band")
    return _network(model, single=single)


def export_onnx(
    model: TireModel, path: Path, *, single: bool = False, with_band: bool = False
) -> None:
    """Write a frozen model as an ONNX file; arguments as of `onnx_bytes`."""
    write_atomically(path, onnx_bytes(model, single=single, with_band=with_band))
