"""Properties of the learning loop: poles, sampling, margins, damping, drift, bounds."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from codegen.arrays import Array
from identifier.certificate import Property, Status, at_least, statement
from identifier.paper.laws import DrivingError, Gains
from identifier.stability.bounds import small_gain, steady_capacity
from identifier.stability.loop import Loop, eigenvalues
from identifier.stability.lyapunov import lyapunov
from identifier.stability.margins import drift_frequency, gain_margin, phase_margin
from identifier.stability.operation import Operation, Proven
from identifier.stability.printed import printed_bounds, trivial_bound

_ENOUGH_GAIN = 2.0  # times the gains of learning that the loop bears
_ENOUGH_PHASE = 30.0  # deg, of the phase margin
_ENOUGH_DAMPING = 0.2  # [-], of the poles
_LARGEST_STEP = 0.2  # fastest pole times dt that Euler resolves well


def dynamics_checks(gains: Gains, operation: Operation) -> list[Property]:
    """A_d and λ: stable as they are sampled, resolved by the step, faster than the x_hat loop.
    gains : of (8) to (12).
    """
    A_d, dt = gains.matrix, operation.dt
    # of ξ̃' = A_d ξ̃ + (f - f_hat)
    poles = np.linalg.eigvals(A_d)
    step = float(np.abs(poles).max()) * dt
    sampled = np.abs(1.0 + poles * dt)
    slowest = -math.log(float(sampled.max())) / dt
    lyapunov(A_d, np.eye(2))  # raises where P does not solve its equation
    finer = f"slow A_d down or sample every {1e3 * dt * _LARGEST_STEP / step:.3g} ms"
    title = "fastest pole of A_d times the sampling interval"
    sampling = Property.judged("sampling", title, step, "-", limit=_LARGEST_STEP, advice=finer)
    if not operation.resolves(A_d):
        sampling = replace(sampling, status="fail", advice=finer)
    entries = [
        _above_zero(
            "error_dynamics",
            "decay of the slowest pole of A_d, as sampled",
            slowest,
            "give A_d poles with a negative real part that the step resolves",
        ),
        Property.judged(
            "filter_step",
            "lambda times the sampling interval",
            gains.forgetting * dt,
            "-",
            limit=1.0,
            bad=1.0,
            advice=f"lambda below {1.0 / dt:.3g} 1/s, or sample faster",
        ),
        sampling,
    ]
    if operation.input_feedback is not None:
        need = float(np.linalg.eigvals(operation.input_feedback).real.max())
        entries.append(
            _above_zero(
                "estimated_input",
                "decay left where the network reads the estimate on a saturated tire",
                -float(np.linalg.eigvals(A_d + operation.input_feedback).real.max()),
                f"make A_d faster than {need:.3g} 1/s, or let the network read the measured state",
            )
        )
    return entries


def margin_checks(loop: Loop, operation: Operation) -> list[Property]:
    """Gain margin in continuous time and sampled, phase margin, damping."""
    return [
        _gain_check("gain_continuous", "continuous time", loop, None),
        _gain_check("gain_sampled", "sampled", loop, operation.dt),
        Property.judged(
            "phase_margin",
            "phase margin of the sampled loop",
            phase_margin(loop, operation.dt),
            "deg",
            limit=_ENOUGH_PHASE,
            bad=1e-9,
            least=True,
            advice="lower eta_W",
        ),
        Property.judged(
            "damping",
            "damping ratio of the learning loop",
            _worst_damping(loop),
            "-",
            limit=_ENOUGH_DAMPING,
            bad=1e-9,
            least=True,
            advice="raise A_d and forgetting, or lower eta_W",
        ),
    ]


def weight_check(gains: Gains, operation: Operation, kept: float, judged: float) -> Property:
    """Whether |W_hat| stays where the margins were judged; beside the point unless V learns.

    Up to sqrt(η_V⁻¹ η_W)/x_bar_max the V layer adds nothing to the worst loop gain, however large
    the weights at which the margins were judged.
    gains : of (8) to (12).   kept : |W_hat| that is proven [U].
    judged : |W_hat| at which the margins were judged [U].
    """
    limit = math.inf
    if gains.eta_V > 0.0:
        free = math.sqrt(gains.eta_W / gains.eta_V) / operation.x_bar_max
        limit = max(judged, free)
    holds = math.isfinite(kept) and kept <= limit * (1.0 + 1e-9)
    advice = "raise rho_W and keep theta below 1"
    if math.isfinite(limit):
        advice = f"the margins hold up to |W| = {limit:.3g}: raise rho_W"
    return Property(
        name="weight_range",
        title="largest |W| that is proven, against the one that the margins are judged at",
        value=kept,
        limit=limit,
        margin=limit / kept if math.isfinite(kept) else 0.0,
        status="pass" if holds else "warn",
        unit="U",
        advice="" if holds else advice,
    )


def drift_check(
    gains: Gains, law: DrivingError, operation: Operation, direction: Array
) -> Property:
    """Whether a regressor that moves at the maneuver's bandwidth makes the weights drift.
    gains : of (8) to (12).   direction : (2, 2) D [s].
    """
    found = drift_frequency(
        A_d=gains.matrix, forgetting=gains.forgetting, law=law, direction=direction
    )
    title = "steering bandwidth, against the frequency above which weights drift"
    limit, advice = found / (2 * math.pi), "raise A_d and forgetting"
    return Property.judged("drift", title, operation.bandwidth, "Hz", limit=limit, advice=advice)


def _worst_damping(loop: Loop) -> float:
    """Smallest -Re/|.| of the oscillating eigenvalues of the loop, 1 if none oscillates.

    sqrt(a³/g)/2 for the instantaneous law with A_d = -a I; negative where the loop is unstable.
    """
    mu = eigenvalues(loop.matrix())
    turning = mu[np.abs(mu.imag) > 1e-9 * np.abs(mu).max()]
    if turning.size == 0:
        return 1.0 if float(mu.real.max()) <= 0.0 else -1.0
    return float(np.min(-turning.real / np.abs(turning)))


def _gain_check(name: str, how: str, loop: Loop, dt: float | None) -> Property:
    found = gain_margin(loop, dt)
    value = float(np.linalg.eigvalsh(loop.G)[-1])
    status: Status = at_least(found.factor, good=_ENOUGH_GAIN, bad=1.0)
    advice = ""
    if status != "pass":
        factor = found.factor / _ENOUGH_GAIN
        advice = f"multiply eta_W and eta_V by {factor:.2g}" if factor > 0.0 else "change A_d"
        if math.isfinite(found.frequency):
            advice += f"; at the limit it oscillates at {found.frequency / (2 * math.pi):.2g} Hz"
    return Property(
        name=name,
        title=f"loop gain, {how}",
        value=value,
        limit=value * found.factor,
        margin=found.factor,
        status=status,
        unit="1/s^4" if loop.law.z > 0.0 else "1/s^3",
        advice=advice,
    )


def _above_zero(name: str, title: str, value: float, advice: str) -> Property:
    good = value > 0.0
    return Property(
        name=name,
        title=title,
        value=value,
        limit=0.0,
        margin=value,
        status="pass" if good else "fail",
        unit="1/s",
        advice="" if good else advice,
    )


# Properties that bound error and weights, beside the bound of an identifier without a network.

_CONDITION = (
    "valid while slip, friction, speed, steering, yaw rate and noise are as declared, no sample "
    "is rejected, and the first weights satisfy it (resumed ones too)"
)


def bound_checks(
    gains: Gains, law: DrivingError, operation: Operation, direction: Array, proven: Proven
) -> list[Property]:
    """Small gain, bounds of |ξ̃|, |W_hat| and |V_hat|, leakage, capacity, (14).
    gains : of (8) to (12).   direction : (2, 2) D [s].   proven : of `proven_bounds`.
    """
    A_d = gains.matrix
    if not operation.resolves(A_d):
        return []  # sampled like this, nothing is bounded
    trivial = trivial_bound(A_d, operation.disturbance.residual)
    known: Any = {"law": law, "forgetting": gains.forgetting, "eta_W": gains.eta_W}
    known |= {"n_h": operation.n_h, "direction": direction}
    theta = small_gain(A_d, dt=operation.dt, **known)
    fewer = "" if theta < 1.0 else f"multiply eta_W by {0.9 / theta:.2g}"
    title = "theta: below 1 error and weights are proven bounded"
    entries = [
        Property.judged("small_gain", title, theta, "-", limit=1.0, advice=fewer),
        statement(
            "trivial_bound", "error bound of an identifier without a network", trivial, "U s"
        ),
        *_stated(proven),
        _leakage("leakage_step", "W", proven.leakage_step, gains.rho_W),
        _leakage("leakage_step_V", "V", proven.leakage_step_V, gains.rho_V),
    ]
    if gains.rho_W > 0.0:
        capacity = steady_capacity(rho_W=gains.rho_W, **known)
        need = operation.needed_force
        advice = f"rho_W below {gains.rho_W * capacity / need:.3g}" if capacity < need else ""
        title = "largest steady force of the network with this leakage"
        entries.append(
            Property.judged("capacity", title, capacity, "U", limit=need, least=True, advice=advice)
        )
        entries += printed_bounds(gains, law, operation, trivial)
    return entries


def _stated(proven: Proven) -> list[Property]:
    """State what is proven; warn where nothing bounds the error or a layer."""
    entries, error = [], "proven bound of |xi - xi_hat|"
    if proven.leakage is not None:
        entries += [
            statement(
                "error_bound", f"{error} by the leakage", proven.leakage.xi_tilde, "U s", _CONDITION
            ),
            statement("weight_bound", "proven bound of |W|", proven.leakage.W, "U", _CONDITION),
        ]
    else:
        advice = "lower eta_W until theta is below 1 and give W a leakage"
        title = f"{error}: there is none"
        entries.append(statement("error_bound", title, math.inf, "U s", advice, "warn"))
    if math.isfinite(proven.V):
        entries.append(statement("V_bound", "proven bound of |V|", proven.V, "-", _CONDITION))
    else:
        advice = "give V a leakage below that of one sample"
        title = "proven bound of |V|: there is none"
        entries.append(statement("V_bound", title, math.inf, "-", advice, "warn"))
    return entries


def _leakage(name: str, layer: str, step: float, rho: float) -> Property:
    """Judge ρ dt |ξ̃|: up to 1 leakage shrinks the weights, beyond 2 it throws them about."""
    title = f"largest share of {layer} that leaks in one sample"
    advice = "" if step <= 1.0 else f"rho_{layer} below {rho / step:.3g}, or sample faster"
    return Property.judged(name, title, step, "-", limit=1.0, bad=2.0, advice=advice)
