"""A user's own static tire network, an ONNX file, as a frozen model."""

import base64
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.writing import write_file
from identifier.frozen import (
    FORMAT,
    require_alive,
    require_min_speed,
    vehicle_from,
    vehicle_numbers,
)
from identifier.method import Method, require_fresh
from identifier.paper.network import SIGNALS, network_signals
from identifier.setup import Setup
from identifier.tire_model import StaticModel, TireModel
from models.bicycle import BicycleParameters
from models.rules import LARGEST_FORCE, require_positive
from models.schema import Table, read_bytes
from models.vehicle import Vehicle

# A user's static tire network, an ONNX file, as a differentiable function that generates code.
#
# CasADi reads the graph node by node: dense layers and element-wise functions, in float32 or
# float64. Signals are those of `identifier.paper.network.SIGNALS`, SI; the two outputs are F_yf and
# F_yr [N].

FORCES = ("F_yf", "F_yr")
LARGEST = 1e9  # of a weight, SI: a stiffness in N/rad fits
_READS_ONNX = (3, 8, 2)  # the first CasADi that knows the operations of such networks
_BY_COUNT = {
    2: ("alpha_f", "alpha_r"),
    5: ("v_x", "v_y", "r", "delta_f", "delta_r"),
}  # what the columns mean where nobody says


class UnusableNetworkError(TireidError, ValueError):
    """The network is not one of a tire, or uses what cannot be read; the message says what."""


def read_network(content: bytes, inputs: Sequence[str] | None = None) -> ca.Function:
    """Return a network as a function of scalar signals, with the result axle_force (2,) [N].

    The function's inputs bear the names of the signals that the network reads.
    content : the ONNX file. Its tensors are (columns,) or (batch, columns); a batch may be dynamic.
    inputs : the signal in each column, over all input tensors in turn. None takes the names of the
        tensors where each is one column with the name of a signal, else alpha_f, alpha_r for two
        columns and v_x, v_y, r, delta_f, delta_r for five.
    """
    network = _imported(content)
    signals = _signals(network, inputs)
    symbols = {name: ca.MX.sym(name) for name in signals}
    columns = ca.vertcat(*symbols.values())
    arguments, first = [], 0
    for i in range(network.n_in()):
        count = network.numel_in(i)
        arguments.append(ca.reshape(columns[first : first + count], *network.size_in(i)))
        first += count
    results = dict(zip(network.name_out(), network.call(arguments), strict=True))
    if set(results) == set(FORCES):
        results = {name: results[name] for name in FORCES}
    force = ca.vertcat(*(ca.vec(value) for value in results.values()))
    if force.numel() != 2:
        shapes = {name: network.size_out(name) for name in network.name_out()}
        raise UnusableNetworkError(f"the outputs must be the two forces {FORCES}, are {shapes}")
    return ca.Function(
        "tire_network", list(symbols.values()), [ca.densify(force)], list(signals), ["axle_force"]
    )


def _imported(content: bytes) -> ca.Function:
    """Return the graph for one sample, tensors as they stand in the file."""
    version = ca.CasadiMeta.version()
    if tuple(int(part) for part in re.findall(r"\d+", version)[:3]) < _READS_ONNX:
        needed = ".".join(map(str, _READS_ONNX))
        raise UnusableNetworkError(f"reading ONNX needs CasADi {needed}, this is {version}")
    with tempfile.TemporaryDirectory(prefix="tireid-") as folder:
        path = Path(folder) / "network.onnx"
        write_file(path, content)
        try:
            graph = ca.GraphBuilder(str(path), {})
            names = [*graph.name_in(), *graph.name_out()]
            if not names:
                raise UnusableNetworkError("the file holds no ONNX graph")
            for name in names:
                _check_tensor(name, graph.dimension(name), graph.dtype(name))
            for name in graph.name_in():
                graph.bind_shape(name, [abs(size) for size in graph.dimension(name)])
            for parameter in graph.dynamic_params():
                graph.bind_dim(parameter, 1)
            network = graph.create("tire_network", {"symbolic": True})
        except (RuntimeError, NotImplementedError) as error:
            raise UnusableNetworkError(f"CasADi cannot read it: {_reason(error)}") from error
    _require_plausible(network)
    return network


def _require_plausible(network: ca.Function) -> None:
    """Refuse numbers that no tire network holds; a single one may be a limit, as infinity is."""
    if not network.is_a("MXFunction"):
        raise UnusableNetworkError("CasADi reads it as another kind of graph than is known")
    for k in range(network.n_instructions()):
        if network.instruction_id(k) != ca.OP_CONST:
            continue
        values = np.array(network.instruction_MX(k).to_DM())
        limit = values.size == 1 and not np.isnan(values).any()
        if not (limit or (np.abs(values) <= LARGEST).all()):
            raise UnusableNetworkError(
                f"weights must be finite and below {LARGEST:g}, one is "
                f"{values.flat[np.argmax(~(np.abs(values) <= LARGEST))]:g}"
            )


def _check_tensor(name: str, shape: Sequence[int], dtype: str) -> None:
    columns = shape[-1] if shape else 0
    if len(shape) not in (1, 2) or columns < 1 or (len(shape) == 2 and shape[0] not in (-1, 1)):
        raise UnusableNetworkError(
            f"tensor {name!r} must be (columns,) or (batch, columns), is {tuple(shape)} "
            "(-1 is a dynamic size)"
        )
    if dtype not in ("FLOAT", "DOUBLE"):
        raise UnusableNetworkError(f"tensor {name!r} must hold FLOAT or DOUBLE, holds {dtype}")


def _signals(network: ca.Function, inputs: Sequence[str] | None) -> tuple[str, ...]:
    names = tuple(network.name_in())
    count = sum(network.numel_in(i) for i in range(network.n_in()))
    if inputs is not None:
        chosen = tuple(inputs)
    elif len(names) == count and set(names) <= set(SIGNALS):
        chosen = names
    elif count in _BY_COUNT:
        chosen = _BY_COUNT[count]
    else:
        raise UnusableNetworkError(
            f"the network reads {count} columns: declare with inputs which of {list(SIGNALS)} "
            "they are"
        )
    if len(chosen) != count or len(set(chosen)) < count or not set(chosen) <= set(SIGNALS):
        raise UnusableNetworkError(
            f"inputs must be {count} different signals of {list(SIGNALS)}, they are {chosen}"
        )
    return chosen


def _reason(error: Exception) -> Any:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    first = lines[0] if lines else type(error).__name__
    if "Unsupported operation" in first:
        return first[first.index("Unsupported operation") :]
    return lines[1] if len(lines) > 1 and "Assertion" in first else first


STATES = ((1.0, 10.0, 60.0), *([(-most, 0.0, most) for most in (5.0, 2.0, 0.6, 0.6)]))  # SI
OVER = ("x", "u", "v_x")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class OnnxModel(StaticModel):
    """Axle forces of a static network in the frame of the body, left positive.

    A network that reads slip angles is given them in the paper's sign, α = δ - atan(v/v_x),
    where F_y = +C α; ISO 8855 has the opposite sign: for a network of that, set `slip_sign` to -1.
    min_speed : below this speed [m/s] the forces read zero.
    inputs : what the network's columns are, see `read_network`; None goes by names and number.
    slip_sign : 1 where the network's slip angles have the paper's sign, -1 for ISO 8855.
    """

    kind = "onnx"

    vehicle: Vehicle
    content: bytes
    min_speed: float = 1.0
    inputs: tuple[str, ...] | None = None
    slip_sign: int = 1

    def __post_init__(self) -> None:
        require_min_speed(self.min_speed)
        if self.slip_sign not in (1, -1):
            raise ValueError(f"slip_sign must be 1 or -1, it is {self.slip_sign}")
        if self.inputs is not None:
            object.__setattr__(self, "inputs", tuple(self.inputs))
        require_alive(UnusableNetworkError, self.force, self.vehicle)
        self._require_bounded()

    def _require_bounded(self) -> None:
        """Refuse forces that are not finite, or of no tire, where a car may come to be."""
        v_x, v_y, r, delta_f, delta_r = (axis.ravel() for axis in np.meshgrid(*STATES))
        v_x = np.maximum(v_x, self.min_speed)
        x, u = np.stack([v_y, r]), np.stack([delta_f, delta_r])
        force = np.array(self.step(x, u, v_x[None], np.array(self.vehicle.bicycle)))
        largest = float(np.abs(force).max())
        if not largest <= LARGEST_FORCE:
            raise UnusableNetworkError(
                f"axle forces must be finite and below {LARGEST_FORCE:g} N, at speeds of "
                f"{STATES[0][0]:g} to {STATES[0][-1]:g} m/s they reach {largest:g} N"
            )

    @classmethod
    def from_onnx(
        cls,
        path: str | PathLike[str],
        vehicle: Vehicle,
        *,
        min_speed: float = 1.0,
        inputs: tuple[str, ...] | None = None,
        slip_sign: int = 1,
    ) -> "OnnxModel":
        """Read a network file; arguments are those of the class."""
        try:
            return cls(
                vehicle=vehicle,
                content=read_bytes(Path(path), UnusableNetworkError),
                min_speed=min_speed,
                inputs=inputs,
                slip_sign=slip_sign,
            )
        except OSError as error:
            reason = (error.strerror or "cannot be read").lower()
            raise UnusableNetworkError(f"{path}: {reason}") from error
        except ValueError as error:
            given = str(error).removeprefix(f"{path}: ")
            raise UnusableNetworkError(f"{path}: {given}") from error

    @property
    def step(self) -> ca.Function:
        """Function of x = [v_y, r] (2,), u = [δ_f, δ_r] (2,), v_x and vehicle (6,), SI.

        Its result is axle_force (2,) [N]. It has derivatives and generates code.
        """
        return _step(self.content, self.inputs, self.slip_sign)

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that the network reads, column by column."""
        return tuple(read_network(self.content, self.inputs).name_in())

    def setup(self, dt: float) -> Setup:
        del dt
        return Setup(
            scan=_scan(self.content, self.inputs, self.slip_sign),
            carry={},
            constants={
                "vehicle": np.array(self.vehicle.bicycle),
                "min_speed": np.array(self.min_speed),
            },
        )

    def static_force(self, x: Any, delta: Any, v_x: Any) -> Any:
        return self.step(x, ca.vertcat(delta, 0), v_x, ca.vertcat(*self.vehicle.bicycle))

    def to_dict(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "kind": self.kind,
            "units": {"inputs": "SI", "outputs": "N"},
            "vehicle": vehicle_numbers(self.vehicle),
            "min_speed_m_s": self.min_speed,
            "inputs": None if self.inputs is None else list(self.inputs),
            "slip_sign": self.slip_sign,
            "onnx_base64": base64.b64encode(self.content).decode("ascii"),
        }

    @classmethod
    def _read(cls, table: Table) -> Self:
        return cls(
            vehicle=vehicle_from(table.value("vehicle")),
            content=base64.b64decode(table.text("onnx_base64"), validate=True),
            min_speed=table.number("min_speed_m_s"),
            inputs=None if table.value("inputs") is None else table.texts("inputs"),
            slip_sign=table.whole("slip_sign"),
        )


@cache
def _step(content: bytes, inputs: tuple[str, ...] | None, slip_sign: int) -> ca.Function:
    """Return the network as a step; cached by content, for reading a graph takes a while."""
    network = read_network(content, inputs)
    x, u, v_x = ca.MX.sym("x", 2), ca.MX.sym("u", 2), ca.MX.sym("v_x")
    vehicle = ca.MX.sym("vehicle", 6)
    signals = network_signals(BicycleParameters(*ca.vertsplit(vehicle)), v_x, x, u)
    for name in ("alpha_f", "alpha_r"):
        signals[name] = slip_sign * signals[name]
    force = network(*(signals[name] for name in network.name_in()))
    return ca.Function(
        "frozen_onnx", [x, u, v_x, vehicle], [force], [*OVER, "vehicle"], ["axle_force"]
    )


@cache
def _scan(content: bytes, inputs: tuple[str, ...] | None, slip_sign: int) -> Scan:
    """Return the compiled loop: no force below min_speed [m/s], a further port."""
    step = _step(content, inputs, slip_sign)
    ports = {name: ca.MX.sym(name, *step.size_in(name)) for name in step.name_in()}
    min_speed, v_x = ca.MX.sym("min_speed"), ports["v_x"]
    force = step(*{**ports, "v_x": ca.fmax(v_x, min_speed)}.values())
    replay = ca.Function(
        "replayed_onnx",
        [*ports.values(), min_speed],
        [ca.if_else(v_x >= min_speed, force, ca.MX.zeros(2))],
        [*ports, "min_speed"],
        ["axle_force"],
    )
    return Scan(replay, carry=(), over=OVER)


# A network of one's own among the methods: it learns nothing, online and frozen are the same.


@dataclass(frozen=True, slots=True, kw_only=True)
class FrozenMethod(Method):
    """A frozen model that takes part in a comparison of methods.
    dt : sampling interval of recordings [s]; the model has none of its own.
    """

    model: OnnxModel
    dt: float = 0.01

    def __post_init__(self) -> None:
        require_positive(ValueError, dt=self.dt)

    @property
    def min_speed(self) -> float:
        return self.model.min_speed

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        del vehicle
        require_fresh(start)
        return self.model.setup(self.dt)

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> OnnxModel:
        del vehicle, state
        return self.model
