"""Numbers without limits for parameters that have some: what a filter may add noise to.

θ = 0 is the prior: the stiffness told, a friction, a usual shape. Logarithms keep stiffness and
friction positive; a logistic keeps the Magic Formula's shape C between 1 and 2, where the force
has a peak and keeps its sign.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from models.bicycle import BicycleParameters
from models.vehicle import Vehicle

Array = NDArray[np.float64]

USUAL_SHAPE = 1.4  # C of a passenger tire, Pacejka, Tyre and Vehicle Dynamics, figure 4.9
LOGIT = math.log((USUAL_SHAPE - 1.0) / (2.0 - USUAL_SHAPE))
STIFFNESS, SHAPE, FRICTION = range(3)
LIMITS = (2.0, 3.0, 1.5)  # of |θ| by kind: stiffness within a factor of 7.4, friction 4.5


class Parametrization(NamedTuple):
    """How θ makes the parameters of a curve.

    kinds : of each θ: STIFFNESS, SHAPE or FRICTION.
    decode(bicycle parameters, prior friction, loads (2,), θ) -> parameters (2, n).
    encode(vehicle, prior friction, parameters (2, n)) -> θ.
    """

    kinds: tuple[int, ...]
    decode: Callable[[BicycleParameters, Any, Any, Any], Any]
    encode: Callable[[Vehicle, float, Array], Array]


def _told(p: BicycleParameters) -> Any:
    return ca.vertcat(p.C_f, p.C_r)


def _decode_magic(p: BicycleParameters, friction: Any, loads: Any, theta: Any) -> Any:
    """θ: log stiffness, logit shape, log friction; front and rear each."""
    slope = _told(p) * ca.exp(theta[0:2])  # B C D, which data tell sooner than B
    C = 1 + 1 / (1 + ca.exp(-theta[2:4] - LOGIT))
    D = friction * loads * ca.exp(theta[4:6])
    return ca.horzcat(slope / (C * D), C, D)


def _encode_magic(vehicle: Vehicle, friction: float, parameters: Array) -> Array:
    B, C, D = parameters.T
    told, loads = np.array(vehicle.bicycle)[4:], np.array(vehicle.axle_loads)
    shape = np.log((C - 1.0) / (2.0 - C)) - LOGIT
    return np.concatenate([np.log(B * C * D / told), shape, np.log(D / (friction * loads))])


def _decode_dugoff(p: BicycleParameters, friction: Any, loads: Any, theta: Any) -> Any:
    """θ: log stiffness front and rear, log friction of the road, which both axles share."""
    del loads
    mu = friction * ca.exp(theta[2])
    return ca.horzcat(_told(p) * ca.exp(theta[0:2]), ca.vertcat(mu, mu))


def _encode_dugoff(vehicle: Vehicle, friction: float, parameters: Array) -> Array:
    C, mu = parameters.T
    told = np.array(vehicle.bicycle)[4:]
    return np.append(np.log(C / told), np.log(mu.mean() / friction))


PARAMETRIZATIONS: Mapping[str, Parametrization] = {
    "magic_formula": Parametrization(
        (STIFFNESS, STIFFNESS, SHAPE, SHAPE, FRICTION, FRICTION), _decode_magic, _encode_magic
    ),
    "dugoff": Parametrization((STIFFNESS, STIFFNESS, FRICTION), _decode_dugoff, _encode_dugoff),
}
