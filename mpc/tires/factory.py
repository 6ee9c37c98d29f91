"""One door for every tire: whatever a tire comes as, a structure and its weights come out."""

from collections.abc import Callable, Mapping
from typing import Any

from identifier.axle.model import AxleModel
from identifier.baselines.linear import LinearModel
from identifier.estimate.model import FittedModel
from identifier.paper.network import NetworkModel
from identifier.tire_model import TireModel
from models.tires import DugoffTire, FialaTire, LinearTire, MagicFormula
from models.vehicle import Vehicle
from mpc.tires.axles import axle_tire, fit_tire
from mpc.tires.curves import linear_tire
from mpc.tires.ladder import mounted_tire
from mpc.tires.network import network_tire
from mpc.tires.tire import PredictionTire


def prediction_tire(source: Any, vehicle: Vehicle | None = None) -> PredictionTire:
    """Return the prediction tire of a frozen model, of a tire of `models.tires`, or of a vehicle.

    source : a frozen model; or a tire, two of which are mounted on each axle of `vehicle` at its
    static load; or a vehicle, for the linear tire that it states. A prediction tire is returned as
    it is.   vehicle : the car of the prediction; None takes that of the model.
    """
    if isinstance(source, PredictionTire):
        return source if vehicle is None else source._replace(vehicle=vehicle)
    if isinstance(source, Vehicle):
        return linear_tire(vehicle or source, source.bicycle[4:])
    if isinstance(source, TireModel):
        if source.kind not in MODELS:
            name = type(source).__name__
            raise ValueError(f"the tracker takes no {name}: identify with fit, axle or integral")
        return prediction_tire(MODELS[source.kind](source), vehicle)
    for kind, of_tire in TIRES.items():
        if isinstance(source, kind):
            if vehicle is None:
                raise ValueError(f"{kind.__name__} needs the vehicle that it is mounted on")
            return of_tire(vehicle, source)
    raise TypeError(
        f"no prediction tire can be made of {type(source).__name__}: give a TireModel, as run.tire"
    )


MODELS: Mapping[str, Callable[[Any], PredictionTire]] = {
    NetworkModel.kind: network_tire, AxleModel.kind: axle_tire, FittedModel.kind: fit_tire,
    LinearModel.kind: lambda model: linear_tire(model.vehicle),
}  # fmt: skip
TIRES: Mapping[type, Callable[[Vehicle, Any], PredictionTire]] = {
    LinearTire: lambda vehicle, tire: linear_tire(vehicle, 2 * (2.0 * tire.C_alpha,)),
    **dict.fromkeys((DugoffTire, FialaTire, MagicFormula), mounted_tire),
}
