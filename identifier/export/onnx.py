"""A frozen model as an ONNX file, for whoever runs networks in a tool of their own.

Tensors are (batch, columns) of one number type; the batch may have any size. Operators are those
of opset 13, which every runtime of the last years knows, and of which CasADi reads back all.
"""

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from codegen.clean_c import recognized
from codegen.elementary import atan
from codegen.errors import TireidError
from codegen.escape import visible
from codegen.graph import BUILDERS, function_of, graph_of
from identifier.axle.band import AT_SPEEDS, CENTERS, root
from identifier.axle.band_step import AtSample, BandNumbers, band_numbers, half_band, hinges
from identifier.axle.covariance import factors_of, packed
from identifier.axle.model import AxleModel
from identifier.band import LEVEL, normal_quantile
from identifier.estimate.model import FittedModel
from identifier.export.specialize import INPUTS, Signal
from identifier.motion.model import curve_function
from identifier.motion.parameters import INDEX, curve_index
from identifier.paper.network import SIGNALS, NetworkModel
from identifier.tire_model import TireModel
from models.extras import needs


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
        model = onnx.parser.parse_model("\n".join([f"{_HEAD} {name} {head} {{", *self.lines, "}"]))
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
        return model.SerializeToString(deterministic=True)


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
    network, signals = model.network, list(SIGNALS)
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


# The static force curve and half the width of its band, in static axle loads: of an axle model
# Σ_j w_ij tanh(α_i/α_j), of a fit the curve of `identifier.motion.model`, operator by operator.
#
# What the whole model adds, the lag of slip and the sway of the body, has a state and stays out.
# So does downforce, which needs a speed: its κ are given as metadata, F times 1 + κ v_x².


def _axle_curve(model: AxleModel, i: int, x: ca.SX, *, with_band: bool) -> list[ca.SX]:
    """Return φ of an axle at a slip, and half its width at the mean speed of the drive."""
    units = [ca.tanh(x / scale) for scale in model.ladder]
    force = sum(w * t for w, t in zip(model.W[i], units, strict=True))
    if not with_band:
        return [force]
    calibration, q = model.band.calibration, len(units) + 3
    parts = zip(model.W[i] / np.array(model.ladder), units, strict=True)
    at = AtSample(
        units=units,
        slope=sum(w * (1 - t * t) for w, t in parts),
        force=force,
        slip=ca.fabs(x),
        per_v_x=ca.SX(1.0 / calibration.speed),
        e=1,
        by_offset=(1.0, 1.0 / calibration.speed)[i],
    )
    covariances = (model.covariance, model.prior_covariance)
    P, prior = (factors_of(list(packed(one)[i]), q) for one in covariances)
    numbers = band_numbers(calibration, model.vehicle.froude_speed)
    slips = hinges(calibration.factors, CENTERS)[i]
    speeds = hinges(calibration.speeds, AT_SPEEDS)[i]
    numbers = BandNumbers(*(column[i] for column in numbers))
    return [force, half_band(at, P, prior, numbers, list(slips), list(speeds))]


def _fitted_curve(model: FittedModel, i: int, x: ca.SX, *, with_band: bool) -> list[ca.SX]:
    """Return what `_axle_curve` does of a fit, at the speed of its drives."""
    axle, P, band = "fr"[i], model.covariance, model.band
    phi, slope, numbers, *_ = curve_function()(ca.DM(model.p[curve_index(axle)]), x)
    if not with_band:
        return [phi]
    shares = {
        "steering_zero": 1.0 - i,
        "v_y_bias": 1.0 / model.reach.speeds.mean(),
        "v_y_angle": 1.0,
    }
    h = dict(zip(curve_index(axle), ca.vertsplit(ca.vec(numbers)), strict=True))
    h |= {INDEX[name]: share * slope for name, share in shares.items()}
    moves = [k for k in h if P[k, k] > 0.0]
    left = ca.sumsqr(root(P[np.ix_(moves, moves)]).T @ ca.vertcat(*(h[k] for k in moves)))
    variance = left + (band.error_share[i] * phi) ** 2 + band.error_floor[i] ** 2
    return [phi, normal_quantile(LEVEL) * ca.sqrt(variance)]


def _curves(model: AxleModel | FittedModel, *, single: bool, with_band: bool) -> bytes:
    """Return the static curves, alpha_f, alpha_r to F_yf, F_yr, (batch, 1), under static loads."""
    graph, x, car = _Graph(), ca.SX.sym("x"), model.vehicle
    for i, (slip, size) in enumerate(zip(_SLIPS, car.axle_loads, strict=True)):
        if isinstance(model, AxleModel):
            found = _axle_curve(model, i, x, with_band=with_band)
        else:
            found = _fitted_curve(model, i, x, with_band=with_band)
        written = _written(graph, ca.Function("curve", [x], found), slip.name)
        for value, port in zip(written, (_FORCES[i], _HALF_BANDS[i]), strict=False):
            graph.node("Mul", value, graph.number(size), result=port.name)
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


# No runtime has an Atan of double: our own is made of the others.
_OPERATORS = {
    "add": "Add", "sub": "Sub", "mul": "Mul", "div": "Div", "neg": "Neg", "inv": "Reciprocal",
    "tanh": "Tanh", "exp": "Exp", "sin": "Sin", "cos": "Cos", "sqrt": "Sqrt", "fabs": "Abs",
    "lt": "Less", "not": "Not", "select": "Where", "if_else_zero": "Where", "sq": "Mul",
    "twice": "Add",
}  # fmt: skip


def _written(graph: _Graph, function: ca.Function, argument: str) -> list[str]:
    """Add the operators of an SX function of a scalar; return the names of its results."""
    plain = function_of(graph_of(function), function, {**BUILDERS, "atan": atan})
    scalars, names = recognized(graph_of(plain), whole=False), dict[int, str]()
    for place in scalars.reached():
        node = scalars.nodes[place]
        given = [names[a] for a in node.args] * (1 + (node.op in ("sq", "twice")))
        if node.op == "if_else_zero":
            given.append(graph.number(0.0))
        if node.op == "const":
            names[place] = graph.number(node.value)
        elif node.op == "input":
            names[place] = argument
        else:
            names[place] = graph.node(_OPERATORS[node.op], *given)
    return [names[place] for entries in scalars.outputs for place in entries]


def onnx_bytes(model: TireModel, *, single: bool = False, with_band: bool = False) -> bytes:
    """Return a frozen model as the content of an ONNX file; the same model gives the same bytes.
    model : the whole model for a network, the static force curves for an axle model and a fit.
    single : whether numbers are float32; else they are float64.
    """
    if isinstance(model, AxleModel | FittedModel):
        return _curves(model, single=single, with_band=with_band)
    name = type(model).__name__
    if not isinstance(model, NetworkModel):
        raise NoOnnxError(f"{name} has no ONNX form, only networks and axle curves do")
    if with_band:
        raise NoOnnxError(f"{name} cannot tell how sure it is: it has no band")
    return _network(model, single=single)
