"""Frozen models as JSON files: weights.json, whatever kind of model it holds."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from codegen.escape import shown
from identifier.axle.model import AxleModel
from identifier.baselines.curves import CurveModel
from identifier.estimate.model import FittedModel
from identifier.frozen import FORMAT, FrozenModelError, require_alive
from identifier.own_network import OnnxModel
from identifier.paper.network import NetworkModel
from identifier.tire_model import TireModel
from models.schema import Table, read_json

MODELS: Mapping[str, type[TireModel]] = {
    model.kind: model for model in (NetworkModel, AxleModel, CurveModel, OnnxModel, FittedModel)
}


def load_model(path: str | PathLike[str]) -> TireModel:
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
    table = _stored(path)
    _verdict_of(table)
    kind = table.text("kind")
    if kind not in MODELS:
        table.refuse("kind", f"must be one of {list(MODELS)}, it is {shown(kind)}")
    model = MODELS[kind].from_dict(dict(table.data), str(path))
    try:
        require_alive(FrozenModelError, model)
    except FrozenModelError as error:
        raise FrozenModelError(f"{path}: {error}") from None
    return model


def stored_verdict(path: str | PathLike[str]) -> bool | None:
    """Return whether a stored model was found valid when it was learnt; None where nobody judged.

    Parameters
    ----------
    path : a file that the `save` of a frozen model wrote.

    Raises
    ------
    FrozenModelError
        Where the file is not such a model; one line that names it.
    """
    return _verdict_of(_stored(Path(path)))


def _stored(path: Path) -> Table:
    """Return the table of a file that says it is a frozen model."""
    try:
        table = Table(read_json(path, FrozenModelError), f"{path}: ", FrozenModelError)
    except OSError as error:
        reason = error.strerror or "not a file"
        raise FrozenModelError(f"{path}: cannot be read: {reason.lower()}") from error
    if "format" not in table or table.value("format") != FORMAT:
        raise FrozenModelError(f"{path}: not a frozen model, format must be {FORMAT!r}")
    return table


def _verdict_of(table: Table) -> bool | None:
    valid = table.value("valid") if "valid" in table else None
    if valid is not None and not isinstance(valid, bool):
        table.refuse("valid", f"must be true or false, it is {shown(valid)}")
    return valid
