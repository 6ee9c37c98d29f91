"""Random designs of the paper's laws, for a fair comparison: every law from the same ranges.

The learning rate is drawn as a share of the rate at which the loop becomes unstable at the worst
regressor (|σ|² = n_h), so that slow and fast observers get equally good chances.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from identifier.defaults import LAWS, natural_network
from identifier.design import Design, natural_force_unit
from identifier.gains import Gains, diagonal
from identifier.laws import DRIVING_ERRORS
from identifier.stability.gain_design import gain_for_phase_margin
from identifier.stability.loop import linear_law
from identifier.tuning import Range
from models.vehicle import GRAVITY, Vehicle

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
) -> Design:
    """Return the design with values of `TUNABLES`.

    "instantaneous_scaled" has the gains that the integral law gets, with η/λ.

    Parameters
    ----------
    vehicle : the car.
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
    design = Design(
        gains=gains,
        network=natural_network(vehicle, hidden=n_h),
        law="instantaneous" if scaled else law,
        dt=dt,
        force_unit=natural_force_unit(vehicle.mass),
        min_speed=0.2 * math.sqrt(GRAVITY * vehicle.wheelbase),
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
