"""Every method by its name: the default, the paper's laws, the baselines and what is installed.

A factory takes the vehicle and the seed of initial weights, where there are random ones, and
returns a method whose numbers follow from the vehicle alone. An installed distribution adds methods
by entry points of the group `tireid.methods`: a name, and a factory. Built-in names are taken.
"""

from collections.abc import Callable, Mapping
from typing import Any

from codegen.plugins import installed
from identifier.axle.design import AxleIdentifier
from identifier.axle.model import AxleModel
from identifier.baselines import LaggedEkf, LinearBaseline
from identifier.certificate import Certificate
from identifier.driving import Driving
from identifier.estimate.method import FitMethod
from identifier.estimate.model import FittedModel
from identifier.inertial import InertialIdentifier
from identifier.method import Method
from identifier.paper.design import VARIANTS, PaperIdentifier
from identifier.paper.network import NetworkModel
from identifier.tire_model import TireModel
from models.rules import require_kind
from models.vehicle import Vehicle

Factory = Callable[[Vehicle, int], Method]
DEFAULT = "fit"  # on logs
LIVE = "axle"  # the default in a car, sample by sample
WITHOUT_V_Y = "inertial"  # the default in a car without a lateral velocity
REFERENCE = "integral"  # the paper's law, which times are compared with


def _paper(law: str) -> Factory:
    return lambda vehicle, seed: PaperIdentifier.for_vehicle(vehicle, law=law, seed=seed)


def _seedless(factory: Callable[[Vehicle], Method]) -> Factory:
    def unseeded(vehicle: Vehicle, seed: int) -> Method:
        del seed
        return factory(vehicle)

    return unseeded


METHODS: Mapping[str, Factory] = {
    DEFAULT: _seedless(FitMethod.for_vehicle),
    LIVE: _seedless(AxleIdentifier.for_vehicle),
    WITHOUT_V_Y: _seedless(InertialIdentifier.for_vehicle),
    **{law: _paper(law) for law in VARIANTS},
    "linear": _seedless(LinearBaseline.for_vehicle),
    "lagged_ekf": _seedless(LaggedEkf.for_vehicle),
}

# By kind of model, the method that goes on from one.
LEARNERS: Mapping[str, Callable[[Any, Vehicle, float], Method]] = {
    AxleModel.kind: lambda model, vehicle, dt: (
        InertialIdentifier if model.tells_v_y else AxleIdentifier
    ).for_vehicle(vehicle, dt=dt),
    FittedModel.kind: lambda _, vehicle, dt: AxleIdentifier.for_vehicle(vehicle, dt=dt),
    NetworkModel.kind: lambda model, vehicle, dt: PaperIdentifier.for_vehicle(
        vehicle, network=model.network, dt=dt
    ),
}


GROUP = "tireid.methods"
# What benchmarks/rivals has, a distribution of its own, and how it is installed.
RIVALS = ("magic_formula_ekf", "textbook_ekf", "linear_kf", "joint_ekf")
INSTALL = "pip install ./benchmarks/rivals in a clone of the repository"


def draws_weights(name: str) -> bool:
    """Return whether a method begins with random weights, so that a seed changes its results.
    name : one of `methods`.
    """
    return name in VARIANTS


def make_method(name: str, vehicle: Vehicle, seed: int = 0) -> Method:
    """Return a method with the numbers that follow from the vehicle.

    Parameters
    ----------
    name : one of `methods`.
    seed : seed of the initial weights, where there are random ones.

    Raises
    ------
    ValueError
        Where the name is unknown, or what is installed under it makes no method.
    """
    if name in METHODS:
        return METHODS[name](vehicle, seed)
    require_method(name)
    point = installed(GROUP)[name]
    try:
        method = point.load()(vehicle, seed)
    except Exception as error:  # of another's code
        reason = " ".join(str(error).split())
        raise ValueError(f"method {name} ({point.value}) cannot be made: {reason}") from error
    if not isinstance(method, Method):
        raise ValueError(f"method {name} ({point.value}) is a {type(method).__name__}, no Method")
    return method


def require_method(name: str) -> None:
    """Refuse a name that is none of `methods`; of a rival that is not installed, say where it is.

    Raises
    ------
    ValueError
        Where the name is none.
    """
    if name in methods():
        return
    if name in RIVALS:
        raise ValueError(f"method {name} is not installed: {INSTALL}")
    raise ValueError(
        f"method must be one of {', '.join(methods())}, not {name!r}; {DEFAULT} is the default, "
        f"{REFERENCE} the paper's"
    )


def continuing(model: TireModel, vehicle: Vehicle, dt: float = 0.01, *, v_y: bool = True) -> Method:
    """Return the method that goes on from a model: it learns, or holds a fit and estimates v_y.
    dt : sampling interval [s].   v_y : whether there is a lateral velocity.

    Raises
    ------
    ValueError
        Where no method goes on from such a model.
    """
    if not v_y:
        return InertialIdentifier.beginning_with(model, vehicle, dt=dt)[0]
    if model.kind not in LEARNERS:
        raise ValueError(f"no method can continue a {type(model).__name__}")
    return LEARNERS[model.kind](model, vehicle, dt)


def methods() -> tuple[str, ...]:
    """Return the names of all methods, the default first, those of other distributions last.

    fit : curves and car from the whole log; v_y is estimated where there is none.
    axle : the same sample by sample, as in a car; it needs v_y.   inertial : it without v_y.
    integral, instantaneous, instantaneous_scaled, pi_lead : network and laws of the paper (Hong and
    Choi), the first as it proposes.
    linear : the declared stiffnesses.   lagged_ekf : an extended Kalman filter of the force.
    """
    return (*METHODS, *(name for name in installed(GROUP) if name not in METHODS))


def certify(method: Method | str, vehicle: Vehicle, driving: Driving | None = None) -> Certificate:
    """Return what is proven of a method: what the method itself says.

    Parameters
    ----------
    method : a method, or its name as of `methods`.

    Raises
    ------
    ValueError
        Where no method has that name.
    TypeError
        Where an argument is of another kind.
    """
    require_kind(Vehicle, "as of Vehicle.from_toml or sedan", vehicle=vehicle)
    if isinstance(method, str):
        method = make_method(method, vehicle)
    require_kind(Method, "as of make_method, or a name of methods()", method=method)
    return method.certify(vehicle, driving)
