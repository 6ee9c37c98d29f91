"""Mutations of ONNX files: weights, shapes, operators and names of the graph, or bytes."""

import random
from typing import Any

import numpy as np

from benchmarks.fuzz.hostile import number, text
from benchmarks.fuzz.raw import bytes_mutated

OPERATORS = (
    "Relu",
    "Loop",
    "MatMul",
    "Softmax",
    "NoSuchThing",
    "RandomNormal",
    "Reshape",
    "Div",
    "If",
)


def onnx_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a network with one thing changed.

    Parameters
    ----------
    rng : source of chance.
    data : of the file, which may be none any more.
    """
    import onnx
    from google.protobuf.message import DecodeError

    if rng.random() < 0.25:
        return bytes_mutated(rng, data)
    try:
        model = onnx.load_from_string(data)
    except (DecodeError, ValueError):
        return bytes_mutated(rng, data)
    graph = model.graph
    if not (graph.initializer and graph.node and graph.input):
        return bytes_mutated(rng, data)
    match rng.randrange(8):
        case 0 | 1 | 2 | 3:
            _change_weights(rng, rng.choice(graph.initializer))
        case 4:
            rng.choice(graph.node).op_type = rng.choice(OPERATORS)
        case 5:
            node = rng.choice(graph.node)
            names = rng.choice((node.input, node.output))
            if names:
                names[rng.randrange(len(names))] = rng.choice(
                    (text(rng).encode("utf-8", "replace").decode(), names[0])
                )
        case 6:
            part = rng.choice((graph.initializer, graph.node, graph.input, graph.output))
            if part:
                del part[rng.randrange(len(part))]
        case _:
            ports = [*graph.input[:1], *graph.output[:1]]  # one may be gone by now
            _change_shape(rng, rng.choice(ports))
    content: bytes = model.SerializeToString()
    return content


def _change_weights(rng: random.Random, tensor: Any) -> None:
    from onnx import numpy_helper

    try:
        values = np.array(numpy_helper.to_array(tensor))
    except (ValueError, TypeError, KeyError, MemoryError):  # changed before into what is no matrix
        tensor.Clear()
        return
    what = rng.randrange(6)
    if what == 0 and tensor.dims:
        tensor.dims[0] = rng.choice((0, -1, 1, 2**40, 3))
        return
    if what == 1:
        tensor.data_type = rng.choice((0, 6, 7, 8, 9, 10, 99))
        return
    if not np.issubdtype(values.dtype, np.floating) or not values.size:
        return
    with np.errstate(over="ignore", invalid="ignore"):
        if what == 2:
            values = values.T.copy()
        elif what == 3:
            values = values * number(rng, 1.0)
        elif what == 4:
            values[...] = number(rng, 1.0)
        else:
            values.flat[rng.randrange(values.size)] = number(rng, 1.0)
    tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))


def _change_shape(rng: random.Random, port: Any) -> None:
    shape = port.type.tensor_type
    if rng.random() < 0.3:
        shape.elem_type = rng.choice((0, 6, 7, 8, 9, 99))
    elif shape.shape.dim:
        shape.shape.dim[-1].dim_value = rng.choice((0, -1, 1, 3, 2**40))
    else:
        port.name = text(rng).encode("utf-8", "replace").decode()
