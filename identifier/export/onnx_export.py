"""A frozen model as an ONNX file, for whoever runs networks in a tool of their own."""

from pathlib import Path

from identifier.axle.model import AxleModel
from identifier.export.onnx_axle import axle_graph
from identifier.export.onnx_network import network_graph
from identifier.method import FrozenModel
from identifier.network_model import NetworkModel
from identifier.onnx_model import OnnxModel
from models.files import write_atomically


class NoOnnxError(ValueError):
    """A frozen model of a kind that has no ONNX form."""


def onnx_bytes(model: FrozenModel, *, single: bool = False) -> bytes:
    """Return a frozen model as the content of an ONNX file; the same model gives the same bytes.

    Parameters
    ----------
    model : the whole model for a network, the static force curves for an axle model, and the
        network itself for one that came from an ONNX file.
    single : whether numbers are float32; else they are float64.

    Raises
    ------
    NoOnnxError
        For any other kind of model.
    MissingOnnxError
        Where the package onnx is not installed.
    """
    match model:
        case NetworkModel():
            return network_graph(model, single=single)
        case AxleModel():
            return axle_graph(model, single=single)
        case OnnxModel():
            return model.content
        case _:
            raise NoOnnxError(
                f"{type(model).__name__} has no ONNX form, only networks and axle curves have"
            )


def export_onnx(model: FrozenModel, path: Path, *, single: bool = False) -> None:
    """Write a frozen model as an ONNX file.

    Parameters
    ----------
    model : see `onnx_bytes`.
    path : the file.
    single : whether numbers are float32; else they are float64.

    Raises
    ------
    NoOnnxError
        For a kind of model that has no ONNX form.
    MissingOnnxError
        Where the package onnx is not installed.
    """
    write_atomically(path, onnx_bytes(model, single=single))
