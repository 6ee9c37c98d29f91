"""Properties that bound error and weights, beside the bound of an identifier without a network."""

import math

from identifier.gains import Gains
from identifier.stability.loop import Law
from identifier.stability.operation import Operation, proven_bounds
from identifier.stability.printed_bounds import printed_bounds
from identifier.stability.property import Property, at_least, at_most, statement
from identifier.stability.state_bound import projection_bound, small_gain, steady_capacity
from identifier.stability.ultimate_bound import trivial_bound


def bound_checks(gains: Gains, law: Law, operation: Operation) -> list[Property]:
    """Small gain, bounds of |ξ̃| and |W_hat|, capacity, (14); those that the gains allow.

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    """
    A_d, n_h = gains.matrix, operation.n_h
    if not operation.resolves(A_d):
        return []  # sampled like this, nothing is bounded
    trivial = trivial_bound(A_d, operation.residual_bound)
    theta = small_gain(
        A_d,
        law=law,
        forgetting=gains.forgetting,
        eta_W=gains.eta_W,
        n_h=n_h,
        dt=operation.euler_step,
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
    ]
    bounds = proven_bounds(gains, law, operation)
    if bounds is not None:
        step = gains.rho_W * operation.dt * bounds.xi_tilde
        entries += [
            statement(
                "error_bound", "proven bound of |xi - xi_hat| from rest", bounds.xi_tilde, "U s"
            ),
            statement("weight_bound", "proven bound of |W| from rest", bounds.W, "U"),
            Property(
                name="leakage_step",
                title="largest leakage in one sample",
                value=step,
                limit=1.0,
                margin=1.0 / step,
                status=at_most(step, good=1.0, bad=None),
                unit="-",
                advice=""
                if step <= 1.0
                else f"rho_W below {gains.rho_W / step:.3g}, or sample faster",
            ),
        ]
    if math.isfinite(gains.W_max):
        projected = projection_bound(
            A_d,
            W_max=gains.W_max,
            n_h=n_h,
            residual_bound=operation.residual_bound,
            dt=operation.euler_step,
        )
        entries.append(statement("projection_bound", "bound by the projection", projected, "U s"))
    if gains.rho_W > 0.0:
        entries += [
            _capacity(gains, law, operation),
            *printed_bounds(gains, law, operation, trivial),
        ]
    return entries


def _capacity(gains: Gains, law: Law, operation: Operation) -> Property:
    """Judge the force that leakage lets W hold."""
    capacity = steady_capacity(
        gains.matrix,
        law=law,
        forgetting=gains.forgetting,
        eta_W=gains.eta_W,
        rho_W=gains.rho_W,
        n_h=operation.n_h,
    )
    need = operation.residual_bound
    enough = capacity >= need
    return Property(
        name="capacity",
        title="largest steady force that the leakage lets the network hold",
        value=capacity,
        limit=need,
        margin=capacity / need,
        status=at_least(capacity, good=need, bad=None),
        unit="U",
        advice="" if enough else f"rho_W below {gains.rho_W * capacity / need:.3g}",
    )
