"""Every method by its name: the default, the better laws, the paper's laws and the baselines.

A factory takes the vehicle and the seed of initial weights, where there are random ones, and
returns a method whose numbers follow from the vehicle alone.
"""

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from identifier.axle.design import AxleIdentifier
from identifier.axle.gate import Plausibility
from identifier.axle.model import ARRAYS, AxleModel
from identifier.axle.model import KIND as AXLE
from identifier.axle.slip import Sway
from identifier.baselines import (
    ExtendedStateObserver,
    ForceEkf,
    LinearBaseline,
    StiffnessRls,
    dugoff_ekf,
    magic_formula_ekf,
)
from identifier.baselines.curves import KIND as CURVE
from identifier.baselines.curves import CurveModel
from identifier.defaults import LAWS, natural_operation, paper_identifier
from identifier.method import FORMAT, FrozenModelError, Method, require_alive
from identifier.own_network import KIND as ONNX
from identifier.own_network import OnnxModel
from identifier.paper.design import Driving, PaperIdentifier
from identifier.paper.laws import DRIVING_ERRORS
from identifier.paper.network import KIND as NETWORK
from identifier.paper.network import NetworkModel
from identifier.regression import RegressionIdentifier
from identifier.stability import Certificate
from identifier.stability import certify as certify_gains
from identifier.tire_model import TireModel
from models.schema import Table, read_json, shown
from models.vehicle import Vehicle

Factory = Callable[[Vehicle, int], Method]
REGRESSIONS = ("kreisselmeier", "kreisselmeier_newton", "rls", "concurrent")
DEFAULT = "axle"
REFERENCE = "integral"  # the paper's law, which times are compared with


def _paper(law: str) -> Factory:
    return lambda vehicle, seed: paper_identifier(vehicle, law=law, seed=seed)


def _regression(law: str) -> Factory:
    return lambda vehicle, seed: RegressionIdentifier.for_vehicle(vehicle, law=law, seed=seed)


def _seedless(factory: Callable[[Vehicle], Method]) -> Factory:
    def unseeded(vehicle: Vehicle, seed: int) -> Method:
        del seed
        return factory(vehicle)

    return unseeded


METHODS: Mapping[str, Factory] = {
    DEFAULT: _seedless(AxleIdentifier.for_vehicle),
    **{law: _regression(law) for law in REGRESSIONS},
    **{law: _paper(law) for law in LAWS},
    "linear": _seedless(LinearBaseline.for_vehicle),
    "stiffness_rls": _seedless(StiffnessRls.for_vehicle),
    "magic_formula_ekf": _seedless(magic_formula_ekf),
    "dugoff_ekf": _seedless(dugoff_ekf),
    "eso": _seedless(ExtendedStateObserver.for_vehicle),
    "ekf_force": _seedless(ForceEkf.for_vehicle),
}


def draws_weights(name: str) -> bool:
    """Return whether a method begins with random weights, so that a seed changes its results.

    Parameters
    ----------
    name : one of `METHODS`.
    """
    return name in (*REGRESSIONS, *LAWS)


def make_method(name: str, vehicle: Vehicle, seed: int = 0) -> Method:
    """Return a method with the numbers that follow from the vehicle.

    Parameters
    ----------
    name : one of `METHODS`.
    vehicle : the car.
    seed : seed of the initial weights, where there are random ones.

    Raises
    ------
    ValueError
        Where the name is unknown.
    """
    if name not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, not {name!r}")
    return METHODS[name](vehicle, seed)


def continuing(model: TireModel, vehicle: Vehicle, dt: float = 0.01) -> Method:
    """Return the method that goes on learning from a model.

    Parameters
    ----------
    model : what was learnt.
    vehicle : the car.
    dt : sampling interval [s].

    Raises
    ------
    ValueError
        Where no method goes on from such a model.
    """
    match model:
        case AxleModel():
            return AxleIdentifier.for_vehicle(vehicle, dt=dt)
        case NetworkModel():
            return paper_identifier(vehicle, network=model.network, dt=dt)
        case _:
            raise ValueError(f"no method can go on learning from a {type(model).__name__}")


def certify(method: Method, vehicle: Vehicle, driving: Driving | None = None) -> Certificate:
    """Return what is proven of a method.

    Parameters
    ----------
    method : any method.
    vehicle : the car.
    driving : how hard it is driven; None takes what is stored in a design, else `natural_driving`.
    """
    match method:
        case PaperIdentifier():
            operation = natural_operation(method, vehicle, driving)
            return certify_gains(method.gains, DRIVING_ERRORS[method.law], operation)
        case AxleIdentifier():
            return Certificate(held=method.certificate["held_by_construction"])
        case _:
            return Certificate()


# Frozen models as JSON files: weights.json, whatever kind of model it holds.

LARGEST = 1e9  # of the numbers of an axle model, SI and static axle loads


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
    except FrozenModelError as error:
        raise FrozenModelError(f"{path}: {error}") from None
    return model


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


READERS: Mapping[str, Callable[[dict[str, Any], str], TireModel]] = {
    NETWORK: NetworkModel.from_dict,
    AXLE: _axle,
    CURVE: CurveModel.from_dict,
    ONNX: OnnxModel.from_dict,
}
