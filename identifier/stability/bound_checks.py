"""Properties that bound error and weights, beside the bound of an identifier without a network."""

import math

from identifier.gains import Gains
from identifier.stability.loop import Law
from identifier.stability.lyapunov import Matrix
from identifier.stability.operation import Operation, Proven
from identifier.stability.printed_bounds import printed_bounds
from identifier.stability.property import Property, at_least, at_most, statement
from identifier.stability.state_bound import small_gain, steady_capacity
from identifier.stability.ultimate_bound import trivial_bound

CONDITION = (
    "it holds while slip, friction, speed, steering, yaw rate and noise are as declared, no sample "
    "is left out as impossible, and the first weights keep it (resumed ones too)"
)


def bound_checks(
    gains: Gains, law: Law, operation: Operation, direction: Matrix, proven: Proven
) -> list[Property]:
    """Small gain, bounds of |ξ̃|, |W_hat| and |V_hat|, leakage, capacity, (14).

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    direction : (2, 2) D [s].
    proven : of `proven_bounds`.
    """
    A_d = gains.matrix
    if not operation.resolves(A_d):
        return []  # sampled like this, nothing is bounded
    trivial = trivial_bound(A_d, operation.disturbance.residual)
    theta = small_gain(
        A_d,
        law=law,
        forgetting=gains.forgetting,
        eta_W=gains.eta_W,
        n_h=operation.n_h,
        dt=operation.dt if operation.integrator == "euler" else None,
        direction=direction,
    )
    entries = [
        Property(
            name="small_gain",
            title="theta: below 1 error and weights are proven bounded",
            value=theta,
            limit=1.0,
            margin=1.0 / theta if theta > 0.0 else math.inf,
            status=at_most(theta, good=math.nextafter(1.0, 0.0), bad=None),
            unit="-",
            advice="" if theta < 1.0 else f"multiply eta_W by {0.9 / theta:.2g}, or project W",
        ),
        statement(
            "trivial_bound", "error bound of an identifier without a network", trivial, "U s"
        ),
        *_stated(proven),
        _leakage("leakage_step", "W", proven.leakage_step, gains.rho_W),
        _leakage("leakage_step_V", "V", proven.leakage_step_V, gains.rho_V),
    ]
    if gains.rho_W > 0.0:
        entries.append(_capacity(gains, law, operation, direction))
        if gains.W_free == gains.V_free == 0.0:  # (14) is of a leakage that never rests
            entries += printed_bounds(gains, law, operation, trivial)
    return entries


def _stated(proven: Proven) -> list[Property]:
    """State what is proven; warn where nothing bounds the error or a layer."""
    entries = []
    if proven.leakage is not None:
        entries += [
            statement(
                "error_bound",
                "proven bound of |xi - xi_hat| by the leakage",
                proven.leakage.xi_tilde,
                "U s",
                CONDITION,
            ),
            statement("weight_bound", "proven bound of |W|", proven.leakage.W, "U", CONDITION),
        ]
    if proven.projection is not None:
        entries.append(
            statement(
                "projection_bound",
                "proven bound of |xi - xi_hat| by the projection",
                proven.projection.xi_tilde,
                "U s",
                CONDITION,
            )
        )
    if not math.isfinite(proven.xi_tilde):
        entries.append(
            _unproven(
                "error_bound",
                "proven bound of |xi - xi_hat|: there is none",
                "U s",
                "lower eta_W until theta is below 1 and give W a leakage, or project W",
            )
        )
    if math.isfinite(proven.V):
        entries.append(statement("V_bound", "proven bound of |V|", proven.V, "-", CONDITION))
    else:
        entries.append(
            _unproven(
                "V_bound",
                "proven bound of |V|: there is none",
                "-",
                "give V a leakage below that of one sample, or project V",
            )
        )
    return entries


def _unproven(name: str, title: str, unit: str, advice: str) -> Property:
    return Property(
        name=name,
        title=title,
        value=math.inf,
        limit=None,
        margin=None,
        status="warn",
        unit=unit,
        advice=advice,
    )


def _leakage(name: str, layer: str, step: float, rho: float) -> Property:
    """Judge ρ dt |ξ̃|: up to 1 leakage shrinks the weights, beyond 2 it throws them about."""
    return Property(
        name=name,
        title=f"largest share of {layer} that leaks in one sample",
        value=step,
        limit=1.0,
        margin=1.0 / step if step > 0.0 else math.inf,
        status=at_most(step, good=1.0, bad=2.0),
        unit="-",
        advice="" if step <= 1.0 else f"rho_{layer} below {rho / step:.3g}, or sample faster",
    )


def _capacity(gains: Gains, law: Law, operation: Operation, direction: Matrix) -> Property:
    """Judge the force that leakage lets W hold: beyond the dead zone it holds what it did."""
    resting = math.sqrt(operation.n_h) * gains.W_free
    capacity = resting + steady_capacity(
        gains.matrix,
        law=law,
        forgetting=gains.forgetting,
        eta_W=gains.eta_W,
        rho_W=gains.rho_W,
        n_h=operation.n_h,
        direction=direction,
    )
    need = operation.needed_force
    enough = capacity >= need
    return Property(
        name="capacity",
        title="largest steady force that the leakage lets the network hold",
        value=capacity,
        limit=need,
        margin=capacity / need,
        status=at_least(capacity, good=need, bad=None),
        unit="U",
        advice=""
        if enough
        else f"rho_W below {gains.rho_W * (capacity - resting) / (need - resting):.3g}",
    )
