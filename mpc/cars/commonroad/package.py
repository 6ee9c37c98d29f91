"""The package commonroad-vehicle-models, which not everybody has installed."""

import copy
import importlib
from dataclasses import asdict
from typing import Any


class MissingCommonRoadError(ImportError):
    """The package is not installed; `pip install tireid[commonroad]` brings it."""


def require_commonroad() -> None:
    """Refuse to go on without the package.

    Raises
    ------
    MissingCommonRoadError
        Where it is not installed.
    """
    try:
        importlib.import_module("vehiclemodels.parameters_vehicle2")
    except ImportError:
        raise MissingCommonRoadError(
            "the CommonRoad cars need the package commonroad-vehicle-models: "
            "pip install tireid[commonroad]"
        ) from None


def bmw_320i() -> Any:
    """Return a copy of the parameters of their BMW 320i.

    Raises
    ------
    MissingCommonRoadError
        Where the package is not installed.
    """
    require_commonroad()
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

    return copy.deepcopy(parameters_vehicle2())


def bmw_tire() -> dict[str, float]:
    """Return the coefficients of its tires by name, in their order and sign."""
    return {key: float(value) for key, value in asdict(bmw_320i().tire).items()}


def bmw_parameters(scale: float = 1.0, *, repaired: bool = False) -> Any:
    """Return their parameter set with friction scaled in both directions.

    Parameters
    ----------
    scale : friction over the tire's own [-].
    repaired : their axle loads put the center of gravity 16 mm behind the point about which their
        yaw moments are taken, because both axles have the same unsprung mass. True moves 6.6 kg
        of it from the rear to the front axle, so that the two points are one.
    """
    parameters = bmw_320i()
    if repaired:
        unsprung = parameters.m_uf + parameters.m_ur
        parameters.m_uf = unsprung * parameters.b / (parameters.a + parameters.b)
        parameters.m_ur = unsprung - parameters.m_uf
    scale_friction(parameters, bmw_tire(), scale)
    return parameters


def scale_friction(parameters: Any, tire: dict[str, float], scale: float) -> None:
    """Set the friction of a parameter set.

    Parameters
    ----------
    parameters : theirs, changed in place.
    tire : the coefficients at scale 1.
    scale : friction over the tire's own [-].
    """
    parameters.tire.p_dy1 = scale * tire["p_dy1"]
    parameters.tire.p_dx1 = scale * tire["p_dx1"]
