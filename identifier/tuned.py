"""What may be tuned about each method, and the method with other numbers.

Ranges are wide and centered on the numbers that follow from the vehicle, since nobody knows better
beforehand; those of the paper's laws come from their limit of stability.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

from identifier.axle import AxleDesign
from identifier.defaults import LAWS, natural_network
from identifier.method import Method
from identifier.methods import make_method
from identifier.paper_tuning import SIZE, TUNABLES, hidden_units, tuned_design
from identifier.regression import RegressionDesign
from identifier.tuning import Range
from models.vehicle import Vehicle

REGRESSION_FACTORS: Mapping[str, float] = {  # times and divided by
    "filter_rate": 4.0,
    "forgetting": 10.0,
    "learning_rate": 10.0,
    "ridge": 10.0,
    "quiet": 3.0,
}
AXLE_FACTORS: Mapping[str, float] = {
    "regression.bandwidth": 2.0,
    "regression.memory": 4.0,
    "regression.error": 3.0,
    "regression.relative_error": 3.0,
    "regression.correlation_time": 3.0,
    "prior.sd_shape": 2.0,
    "prior.sd_stiffness": 2.0,
    "prior.compliance": 3.0,
    "prior.sd_compliance": 3.0,
    "prior.sway_share": 3.0,
    "prior.sd_sway_share": 3.0,
    "sway.frequency": 1.5,
    "change.threshold": 2.0,
}


def tunables(name: str, vehicle: Vehicle) -> Mapping[str, Range]:
    """Return what may be tuned about a method; empty where there is nothing.

    Parameters
    ----------
    name : of the method.
    vehicle : the car.
    """
    if name in LAWS:
        return TUNABLES
    method = make_method(name, vehicle)
    if isinstance(method, RegressionDesign):
        return {SIZE: TUNABLES[SIZE], **_around(method, REGRESSION_FACTORS)}
    if isinstance(method, AxleDesign):
        return _around(method, AXLE_FACTORS)
    found: Mapping[str, Range] = getattr(method, "tunables", {})
    return found


def tuned_method(name: str, vehicle: Vehicle, values: Mapping[str, float], seed: int = 0) -> Method:
    """Return a method with values of its tunables.

    Parameters
    ----------
    name : of the method.
    vehicle : the car.
    values : by name; "part.number" is a number of a part. Empty leaves the method as it is.
    seed : seed of the initial weights.
    """
    if name in LAWS and values:
        return tuned_design(vehicle, name, values, seed=seed)
    method = make_method(name, vehicle, seed)
    if isinstance(method, RegressionDesign) and SIZE in values:
        method = replace(method, network=natural_network(vehicle, hidden=hidden_units(values)))
    numbers = {path: value for path, value in values.items() if path != SIZE}
    return reduce(lambda record, path: _set(record, path, numbers[path]), numbers, method)


def _around(method: Any, factors: Mapping[str, float]) -> dict[str, Range]:
    found = {}
    for path, factor in factors.items():
        value = reduce(getattr, path.split("."), method)
        found[path] = Range(value / factor, value * factor, log=True)
    return found


def _set(record: Any, path: str, value: float) -> Any:
    """Return the record with one number of it, or of a part of it, replaced."""
    head, _, rest = path.partition(".")
    return replace(record, **{head: _set(getattr(record, head), rest, value) if rest else value})
