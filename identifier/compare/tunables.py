"""What may be tuned about each method, and the method with other numbers.

Ranges are wide and centered on the numbers that follow from the vehicle, since nobody knows better
beforehand; those of the paper's laws come from their limit of stability.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

from identifier.axle import AxleIdentifier
from identifier.defaults import LAWS, natural_network
from identifier.method import Method
from identifier.methods import make_method
from identifier.paper.design import PaperIdentifier, natural_force_unit
from identifier.paper.laws import DRIVING_ERRORS, Gains, diagonal
from identifier.regression import RegressionIdentifier
from identifier.stability.gain_design import gain_for_phase_margin
from identifier.stability.loop import linear_law
from identifier.tuning import Range
from models.vehicle import Vehicle

# Random designs of the paper's laws, for a fair comparison: every law from the same ranges.
#
# The learning rate is drawn as a share of the rate at which the loop becomes unstable at the worst
# regressor (|σ|² = n_h), so that slow and fast observers get equally good chances.

SIZE = "size"
TUNABLES: Mapping[str, Range] = {
    "a": Range(2.0, 20.0, True),  # 1/s, A_d = -a I; a dt <= 0.2
    "forgetting": Range(2.0, 40.0, True),  # 1/s, λ
    "share_of_limit": Range(0.003, 3.0, True),  # of the largest stable η_W n_h; |σ|² is below n_h
    "V_to_W": Range(1e-5, 0.1, True),  # η_V/η_W [1/U²]
    "rho": Range(0.003, 1.0, True),  # ρ1 = ρ2 [1/(U s²)]
    "lead": Range(1.0, 4.0, False),  # τ a of the PI-lead law [-]
    SIZE: Range(0.0, 3.0, False),  # which of SIZES
}
SIZES = (5, 10, 20)  # hidden units: each is one compilation
MARGIN_OF_LIMIT = 1e-3  # deg: at no phase margin the loop is at its limit


def tuned_design(
    vehicle: Vehicle, law: str, values: Mapping[str, float], *, seed: int = 0, dt: float = 0.01
) -> PaperIdentifier:
    """Return the design with values of `TUNABLES`.

    "instantaneous_scaled" has the gains that the integral law gets, with η/λ.

    Parameters
    ----------
    law : as in `identifier.defaults.LAWS`.
    values : by name, within the ranges of `TUNABLES`.
    seed : seed of the initial weights.
    dt : sampling interval [s].

    Raises
    ------
    ValueError
        Where the law is unknown.
    """
    if law not in LAWS:
        raise ValueError(f"law must be one of {list(LAWS)}, not {law!r}")
    scaled = law == "instantaneous_scaled"
    a, lam = values["a"], values["forgetting"]
    lead = values["lead"] / a if law == "pi_lead" else 0.0
    n_h = hidden_units(values)
    eta_W = (
        values["share_of_limit"]
        * largest_loop_gain("integral" if scaled else law, a=a, lam=lam, lead=lead, dt=dt)
        / n_h
    )
    gains = Gains(
        A_d=diagonal(a),
        forgetting=lam,
        eta_W=eta_W,
        eta_V=values["V_to_W"] * eta_W,
        rho_W=values["rho"],
        rho_V=values["rho"],
        lead=lead,
    )
    design = PaperIdentifier(
        gains=gains,
        network=natural_network(vehicle, hidden=n_h),
        law="instantaneous" if scaled else law,
        dt=dt,
        force_unit=natural_force_unit(vehicle.mass),
        min_speed=vehicle.lowest_speed,
        seed=seed,
    )
    return replace(design, gains=gains.scaled_by_forgetting()) if scaled else design


def hidden_units(values: Mapping[str, float]) -> int:
    """Return the number of hidden units.

    Parameters
    ----------
    values : of `TUNABLES`.
    """
    return SIZES[min(math.floor(values[SIZE]), len(SIZES) - 1)]


def largest_loop_gain(law: str, *, a: float, lam: float, lead: float, dt: float) -> float:
    """Return the loop gain η_W |σ|² at which explicit Euler leaves the loop no phase margin.

    Parameters
    ----------
    law : "integral", "instantaneous" or "pi_lead".
    a : decay rate of A_d = -a I [1/s].
    lam : forgetting factor λ [1/s].
    lead : τ [s], which only the PI-lead law reads.
    dt : sampling interval [s].
    """
    return gain_for_phase_margin(
        a=a,
        lam=lam,
        law=linear_law(DRIVING_ERRORS[law], lead),
        phase_margin=MARGIN_OF_LIMIT,
        dt=dt,
    )


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
    """
    if name in LAWS:
        return TUNABLES
    method = make_method(name, vehicle)
    if isinstance(method, RegressionIdentifier):
        return {SIZE: TUNABLES[SIZE], **_around(method, REGRESSION_FACTORS)}
    if isinstance(method, AxleIdentifier):
        return _around(method, AXLE_FACTORS)
    found: Mapping[str, Range] = getattr(method, "tunables", {})
    return found


def tuned_method(name: str, vehicle: Vehicle, values: Mapping[str, float], seed: int = 0) -> Method:
    """Return a method with values of its tunables.

    Parameters
    ----------
    name : of the method.
    values : by name; "part.number" is a number of a part. Empty leaves the method as it is.
    seed : seed of the initial weights.
    """
    if name in LAWS and values:
        return tuned_design(vehicle, name, values, seed=seed)
    method = make_method(name, vehicle, seed)
    if isinstance(method, RegressionIdentifier) and SIZE in values:
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
