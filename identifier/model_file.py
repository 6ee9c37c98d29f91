"""Frozen models as JSON files: weights.json, whatever kind of model it holds."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from identifier.axle.model import KIND as AXLE
from identifier.axle.model import AxleModel
from identifier.baselines.curve_model import KIND as CURVE
from identifier.baselines.curve_model import CurveModel
from identifier.method import FrozenModel
from identifier.model_format import FORMAT, FrozenModelError
from identifier.network_model import KIND as NETWORK
from identifier.network_model import NetworkModel
from identifier.onnx_model import KIND as ONNX
from identifier.onnx_model import OnnxModel

READERS: Mapping[str, Callable[[dict[str, Any], str], FrozenModel]] = {
    NETWORK: NetworkModel.from_dict,
    AXLE: AxleModel.from_dict,
    CURVE: CurveModel.from_dict,
    ONNX: OnnxModel.from_dict,
}


def load_model(path: Path) -> FrozenModel:
    """Read a frozen model of any kind.

    Parameters
    ----------
    path : a file that the `save` of a frozen model wrote.

    Raises
    ------
    FrozenModelError
        Where the file is not such a model; one line that names it.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise FrozenModelError(f"{path}: cannot be read as a frozen model: {error}") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise FrozenModelError(f"{path}: not a frozen model, format must be {FORMAT!r}")
    if data.get("kind") not in READERS:
        raise FrozenModelError(
            f"{path}: kind must be one of {list(READERS)}, is {data.get('kind')}"
        )
    return READERS[data["kind"]](data, str(path))
