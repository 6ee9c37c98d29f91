"""A user's static tire network, an ONNX file, as a differentiable function that generates code.

CasADi reads the graph node by node: dense layers and element-wise functions, in float32 or float64.
Signals are those of `identifier.network.SIGNALS`, SI; the two outputs are F_yf and F_yr [N].
"""

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from identifier.network import SIGNALS

FORCES = ("F_yf", "F_yr")
LARGEST = 1e9  # of a weight, SI: a stiffness in N/rad fits
READS_ONNX = (3, 8, 2)  # the first CasADi that knows the operations of such networks
BY_COUNT = {
    2: ("alpha_f", "alpha_r"),
    5: ("v_x", "v_y", "r", "delta_f", "delta_r"),
}  # what the columns mean where nobody says


class UnusableNetworkError(ValueError):
    """The network is not one of a tire, or uses what cannot be read; the message says what."""


def read_network(content: bytes, inputs: Sequence[str] | None = None) -> ca.Function:
    """Return a network as a function of scalar signals, with the result axle_force (2,) [N].

    The function's inputs bear the names of the signals that the network reads.

    Parameters
    ----------
    content : the ONNX file. Its tensors are (columns,) or (batch, columns); a batch may be dynamic.
    inputs : the signal in each column, over all input tensors in turn. None takes the names of the
        tensors where each is one column with the name of a signal, else alpha_f, alpha_r for two
        columns and v_x, v_y, r, delta_f, delta_r for five.

    Raises
    ------
    UnusableNetworkError
        Where the file is no ONNX, an operator unknown, or a shape or name does not fit.
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
    if tuple(int(part) for part in re.findall(r"\d+", version)[:3]) < READS_ONNX:
        needed = ".".join(map(str, READS_ONNX))
        raise UnusableNetworkError(f"reading ONNX needs CasADi {needed}, this is {version}")
    with tempfile.TemporaryDirectory(prefix="tireid-") as folder:
        path = Path(folder) / "network.onnx"
        path.write_bytes(content)
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
    elif count in BY_COUNT:
        chosen = BY_COUNT[count]
    else:
        raise UnusableNetworkError(
            f"the network reads {count} columns: say with inputs which of {list(SIGNALS)} they are"
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
