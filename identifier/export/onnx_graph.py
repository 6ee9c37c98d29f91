"""An ONNX graph, node by node: every value is a name, every operation returns that of its result.

Tensors are (batch, columns) of one number type; the batch may have any size. Operators are those of
opset 13, which every runtime of the last years knows, and of which CasADi reads back all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from identifier.export.signals import Signal

OPSET = 13
IR_VERSION = 7  # of the file format that came with opset 13


class MissingOnnxError(ImportError):
    """The package onnx is not installed; `pip install tireid[onnx]` brings it."""


def onnx_package() -> Any:
    """Return the package onnx, which is an extra.

    Raises
    ------
    MissingOnnxError
        Where it is not installed.
    """
    try:
        import onnx
    except ImportError as error:
        raise MissingOnnxError(
            "writing ONNX needs the package onnx: pip install tireid[onnx]"
        ) from error
    return onnx


@dataclass(slots=True)
class Graph:
    """Nodes and constants of a graph that is being written.

    Parameters
    ----------
    single : whether numbers are float32; else they are float64.
    """

    single: bool
    nodes: list[Any] = field(default_factory=list)
    constants: list[Any] = field(default_factory=list)

    def constant(self, name: str, value: ArrayLike) -> str:
        """Store a matrix and return its name.

        Parameters
        ----------
        name : name of the constant.
        value : its numbers.
        """
        number = np.float32 if self.single else np.float64
        array = np.ascontiguousarray(np.asarray(value), dtype=number)
        self.constants.append(onnx_package().numpy_helper.from_array(array, name))
        return name

    def apply(self, operator: str, inputs: Sequence[str], result: str, **attributes: Any) -> str:
        """Add a node and return the name of its result.

        Parameters
        ----------
        operator : of ONNX, such as "MatMul".
        inputs : names of its inputs.
        result : name of its result.
        attributes : of the operator.
        """
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

        Parameters
        ----------
        name : name of the graph.
        inputs : what it reads.
        outputs : what it gives; results of nodes have their names.
        doc : what it computes, for people.
        metadata : facts for programs.
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
