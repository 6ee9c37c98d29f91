"""What a method freezes to, as a function of parameters that may be fitted offline."""

from functools import singledispatch

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identifier.axle import AxleDesign, AxleModel
from identifier.baselines.curve_ekf import SPREADS, CurveEkf
from identifier.baselines.curve_model import CurveModel
from identifier.baselines.floor import Structure
from identifier.baselines.linear import LinearBaseline
from identifier.baselines.parametrizations import LIMITS, PARAMETRIZATIONS
from identifier.baselines.stiffness_rls import StiffnessRls
from identifier.design import Design
from identifier.method import CannotFreezeError
from identifier.network import Weights
from identifier.network_model import NetworkModel
from models.vehicle import Vehicle

Array = NDArray[np.float64]
SCATTER = 0.3  # of starts, in standard deviations of the method's own prior


@singledispatch
def structure_of(method: object, vehicle: Vehicle) -> Structure:
    """Return what a method freezes to, with its parameters free.

    Parameters
    ----------
    method : a design of the paper's, an axle design, or a baseline that has a model.
    vehicle : the car.

    Raises
    ------
    CannotFreezeError
        Where the method has no model that could be fitted.
    """
    del vehicle
    raise CannotFreezeError(f"{type(method).__name__} has no structure that could be fitted")


@structure_of.register
def _network(method: Design, vehicle: Vehicle) -> Structure:
    """All weights of the paper's network: W in the force unit, then V, by rows."""
    n_h, n_in = method.network.hidden, len(method.network.inputs)
    free = np.full(n_h * (2 + n_in), np.inf)

    def start(rng: np.random.Generator) -> Array:
        first = method.network.initial_weights(rng)
        return np.concatenate([first.W.ravel(), first.V.ravel()])

    def model(parameters: Array) -> NetworkModel:
        W, V = parameters[: 2 * n_h].reshape(2, n_h), parameters[2 * n_h :].reshape(n_h, n_in)
        return NetworkModel(
            vehicle=vehicle,
            network=method.network,
            weights=Weights(W=W.copy(), V=V.copy()),
            force_unit=method.force_unit,
            min_speed=method.min_speed,
        )

    return Structure(start, model, -free, free)


@structure_of.register
def _axle(method: AxleDesign, vehicle: Vehicle) -> Structure:
    """Weights of the units, and compliance, sway and offsets over their bounds, by rows."""
    n, limits = len(method.ladder), method.bounds
    W, own = method.prior.means(vehicle, method.ladder)
    offsets = (limits.steering, limits.v_y)
    scale = np.array([[limits.compliance, 1.0, offset] for offset in offsets])
    prior = method.prior.covariance(vehicle, method.ladder)
    upper = np.concatenate([np.full(2 * n, limits.weight), np.ones(6)])
    lower = -upper
    lower[2 * n + np.array([0, 1, 3, 4])] = 0.0  # compliance and share of the sway

    def start(rng: np.random.Generator) -> Array:
        scattered = W + SCATTER * method.prior.sd_shape * rng.standard_normal(W.shape)
        return np.concatenate([scattered.ravel(), (own / scale).ravel()])

    def model(parameters: Array) -> AxleModel:
        return AxleModel(
            vehicle=vehicle,
            ladder=method.ladder,
            sway=method.sway,
            plausibility=method.plausibility,
            W=parameters[: 2 * n].reshape(2, n).copy(),
            own=parameters[2 * n :].reshape(2, 3) * scale,
            covariance=prior,
            prior_covariance=prior,
            excitation=np.zeros((2, 9)),
        )

    return Structure(start, model, lower, upper)


@structure_of.register
def _curve(method: CurveEkf, vehicle: Vehicle) -> Structure:
    """The filter's own coordinates of a Magic Formula or Dugoff's tire."""
    kinds, decode, _ = PARAMETRIZATIONS[method.curve]
    spread = np.array([getattr(method, SPREADS[kind]) for kind in kinds])
    limit = np.array([LIMITS[kind] for kind in kinds])
    loads = ca.DM(vehicle.axle_loads)

    def start(rng: np.random.Generator) -> Array:
        return SCATTER * spread * rng.standard_normal(spread.size)

    def model(parameters: Array) -> CurveModel:
        values = decode(vehicle.bicycle, method.friction, loads, ca.DM(parameters))
        return CurveModel(
            vehicle=vehicle,
            curve=method.curve,
            parameters=np.array(ca.DM(values)),
            min_speed=method.min_speed,
        )

    return Structure(start, model, -limit, limit)


@structure_of.register(LinearBaseline)
@structure_of.register(StiffnessRls)
def _linear(method: LinearBaseline | StiffnessRls, vehicle: Vehicle) -> Structure:
    """Logarithms of both stiffnesses over those that the car states."""
    told = np.array([vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear])
    limit = np.full(2, 4.0)

    def start(rng: np.random.Generator) -> Array:
        return SCATTER * rng.standard_normal(2)

    def model(parameters: Array) -> CurveModel:
        return CurveModel(
            vehicle=vehicle,
            curve="linear",
            parameters=(told * np.exp(parameters)).reshape(2, 1),
            min_speed=method.min_speed,
        )

    return Structure(start, model, -limit, limit)
