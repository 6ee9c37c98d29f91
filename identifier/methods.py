"""Every method by its name: the default, the better laws, the paper's laws and the baselines.

A factory takes the vehicle and the seed of initial weights, where there are random ones, and
returns a method whose numbers follow from the vehicle alone.
"""

from collections.abc import Callable, Mapping

from identifier.axle import AxleDesign, AxleModel
from identifier.baselines import (
    ExtendedStateObserver,
    ForceEkf,
    LinearBaseline,
    StiffnessRls,
    dugoff_ekf,
    magic_formula_ekf,
)
from identifier.defaults import LAWS, default_design
from identifier.method import Method
from identifier.network_model import NetworkModel
from identifier.regression import RegressionDesign
from identifier.tire_model import TireModel
from models.vehicle import Vehicle

Factory = Callable[[Vehicle, int], Method]
REGRESSIONS = ("kreisselmeier", "kreisselmeier_newton", "rls", "concurrent")
DEFAULT = "axle"
REFERENCE = "integral"  # the paper's law, which times are compared with


def _paper(law: str) -> Factory:
    return lambda vehicle, seed: default_design(vehicle, law=law, seed=seed)


def _regression(law: str) -> Factory:
    return lambda vehicle, seed: RegressionDesign.for_vehicle(vehicle, law=law, seed=seed)


def _seedless(factory: Callable[[Vehicle], Method]) -> Factory:
    def unseeded(vehicle: Vehicle, seed: int) -> Method:
        del seed
        return factory(vehicle)

    return unseeded


METHODS: Mapping[str, Factory] = {
    DEFAULT: _seedless(AxleDesign.for_vehicle),
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
            return AxleDesign.for_vehicle(vehicle, dt=dt)
        case NetworkModel():
            return default_design(vehicle, network=model.network, dt=dt)
        case _:
            raise ValueError(f"no method can go on learning from a {type(model).__name__}")
