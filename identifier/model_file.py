"""Frozen models as JSON files: weights.json, whatever kind of model it holds."""

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from identifier.axle.gate import Plausibility
from identifier.axle.model import ARRAYS, AxleModel
from identifier.axle.model import KIND as AXLE
from identifier.axle.sway import Sway
from identifier.baselines.curve_model import KIND as CURVE
from identifier.baselines.curve_model import CurveModel
from identifier.method import FrozenModel
from identifier.model_format import DEAD, FORMAT, PROBE, FrozenModelError, require_alive
from identifier.network_model import KIND as NETWORK
from identifier.network_model import NetworkModel
from identifier.onnx_model import KIND as ONNX
from identifier.onnx_model import OnnxModel
from models.doors import Table, read_json, shown

LARGEST = 1e9  # of the numbers of an axle model, SI and static axle loads


def load_model(path: str | PathLike[str]) -> FrozenModel:
    """Read a frozen model of any kind.

    Parameters
    ----------
    path : a file that the `save` of a frozen model wrote.

    Raises
    ------
    FrozenModelError
        Where the file is not such a model; one line that names it.
    """
    path = Path(path)
    try:
        table = Table(read_json(path, FrozenModelError), f"{path}: ", FrozenModelError)
    except OSError as error:
        reason = error.strerror or "not a file"
        raise FrozenModelError(f"{path}: cannot be read: {reason.lower()}") from error
    if "format" not in table or table.value("format") != FORMAT:
        raise FrozenModelError(f"{path}: not a frozen model, format must be {FORMAT!r}")
    kind = table.text("kind")
    if kind not in READERS:
        table.refuse("kind", f"must be one of {list(READERS)}, it is {shown(kind)}")
    model = READERS[kind](dict(table.data), str(path))
    try:
        require_alive(FrozenModelError, model)
        _require_push(model)
    except FrozenModelError as error:
        raise FrozenModelError(f"{path}: {error}") from None
    return model


def _require_push(model: FrozenModel) -> None:
    """Refuse an axle that has next to nothing of the stiffness that the file's car is told."""
    slope = np.diff(model.force_at(np.array([-PROBE, PROBE])), axis=0)[0] / (2.0 * PROBE)
    told = np.array(model.vehicle.bicycle)[4:]
    for axle, here, there in zip(("front", "rear"), slope, told, strict=True):
        if not here >= DEAD * there:
            raise FrozenModelError(
                f"the {axle} axle has {here:.4g} N/rad, its vehicle {there:.4g}: it does not push"
            )


def _axle(data: dict[str, Any], source: str) -> AxleModel:
    """Judge the types and sizes of an axle model's values before they become one."""
    table = Table(data, f"{source}: ", FrozenModelError)
    for name, record in (("sway", Sway), ("plausibility", Plausibility)):
        table.table(name).record(record)
    for name in ("ladder", "edges", *ARRAYS):
        largest = float(np.abs(table.array(name)).max(initial=0.0))
        if largest > LARGEST:
            table.refuse(name, f"must hold numbers below {LARGEST:g}, it reaches {largest:g}")
    return AxleModel.from_dict(data, source)


READERS: Mapping[str, Callable[[dict[str, Any], str], FrozenModel]] = {
    NETWORK: NetworkModel.from_dict,
    AXLE: _axle,
    CURVE: CurveModel.from_dict,
    ONNX: OnnxModel.from_dict,
}
