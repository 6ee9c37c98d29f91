"""What may be tuned about each method, and the method with other numbers.

Ranges are wide and centered on the numbers that follow from the vehicle, since nobody knows better
beforehand; those of the paper's laws come from their limit of stability.
"""

from collections.abc import Mapping

from identifier.method import Method
from identifier.methods import make_method
from identifier.paper.design import VARIANTS, PaperIdentifier, natural_force_unit
from identifier.paper.laws import LAWS, Gains, diagonal
from identifier.paper.network import natural_network
from identifier.stability.gain_design import gain_for_phase_margin
from identifier.tuning import SIZE, SIZE_RANGE, Range, hidden_units
from models.vehicle import Vehicle

# Random designs of the paper's laws, for a fair comparison: every law from the same ranges.
#
# The learning rate is drawn as a share of the rate at which the loop becomes unstable at the worst
# regressor (|σ|² = n_h), so that slow and fast observers get equally good chances.

TUNABLES: Mapping[str, Range] = {
    "a": Range(2.0, 20.0, True),  # 1/s, A_d = -a I; a dt <= 0.2
    "forgetting": Range(2.0, 40.0, True),  # 1/s, λ
    "share_of_limit": Range(0.003, 3.0, True),  # of the largest stable η_W n_h; |σ|² is below n_h
    "V_to_W": Range(1e-5, 0.1, True),  # η_V/η_W [1/U²]
    "rho": Range(0.003, 1.0, True),  # ρ1 = ρ2 [1/(U s²)]
    "lead": Range(1.0, 4.0, False),  # τ a of the PI-lead law [-]
    SIZE: SIZE_RANGE,
}
MARGIN_OF_LIMIT = 1e-3  # deg: at no phase margin the loop is at its limit


def tuned_design(
    vehicle: Vehicle, law: str, values: Mapping[str, float], *, seed: int = 0, dt: float = 0.01
) -> PaperIdentifier:
    """Return the design with values of `TUNABLES`.

    The variant at η/λ has the gains that the integral law gets.

    Parameters
    ----------
    law : one of `VARIANTS`.
    values : by name, within the ranges of `TUNABLES`.
    dt : sampling interval [s].

    Raises
    ------
    ValueError
        Where the law is unknown.
    """
    if law not in VARIANTS:
        raise ValueError(f"law must be one of {list(VARIANTS)}, not {law!r}")
    variant = VARIANTS[law]
    a, lam = values["a"], values["forgetting"]
    lead = LAWS[variant.law].lead * values["lead"] / a
    n_h, of = hidden_units(values), variant.gains_of if variant.scaled else variant.law
    eta_W = values["share_of_limit"] * largest_loop_gain(of, a=a, lam=lam, lead=lead, dt=dt) / n_h
    gains = Gains(
        A_d=diagonal(a),
        forgetting=lam,
        eta_W=eta_W,
        eta_V=values["V_to_W"] * eta_W,
        rho_W=values["rho"],
        rho_V=values["rho"],
        lead=lead,
    )
    return PaperIdentifier(
        gains=variant.gains(gains),
        network=natural_network(vehicle, hidden=n_h),
        law=variant.law,
        dt=dt,
        force_unit=natural_force_unit(vehicle.mass),
        min_speed=vehicle.lowest_speed,
        seed=seed,
    )


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
        law=LAWS[law].error(lead),
        phase_margin=MARGIN_OF_LIMIT,
        dt=dt,
    )


def tunables(name: str, vehicle: Vehicle) -> Mapping[str, Range]:
    """Return what may be tuned about a method; empty where there is nothing."""
    if name in VARIANTS:
        return TUNABLES
    return make_method(name, vehicle).tunables


def tuned_method(name: str, vehicle: Vehicle, values: Mapping[str, float], seed: int = 0) -> Method:
    """Return a method with values of its tunables.

    Parameters
    ----------
    values : by name; "part.number" is a number of a part. Empty leaves the method as it is.
    """
    if name in VARIANTS and values:
        return tuned_design(vehicle, name, values, seed=seed)
    return make_method(name, vehicle, seed).tuned(values)
