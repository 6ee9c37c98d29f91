"""What Kalman filters of tires share: the sampled motion, and corrections that no outlier leads.

The sampled map is the linearly implicit midpoint rule, which no stiff tire at low speed makes
unstable: z⁺ = z + T_s (I - T_s J/2)⁻¹ f, with J = ∂f/∂z. Covariances are corrected in Joseph's
form. An innovation beyond `outlier` standard deviations teaches no more than one at that distance.
Source: Simon, Optimal State Estimation, 2006, sections 5.1 and 13.2.
"""

from typing import Any, NamedTuple

import casadi as ca

from identifier.setup import AXLE_FORCE, COVARIANCE, Port

CARRY = ("estimate", "P", "before", "running")
PORTS = (
    AXLE_FORCE,
    Port("estimate", "m/s; rad/s; -", "v_y, r and the unknowns of the force"),
    Port("P", "of estimate", "covariance of estimate", rule=COVARIANCE),
    Port("before", "rad; rad; m/s", "delta_f, delta_r and v_x of the last sample"),
    Port("running", "-", "1 after a sample in motion"),
)


def midpoint(estimate: Any, rate: Any, dt: Any) -> Any:
    """Return what moves of an estimate a step later, by the linearly implicit midpoint rule.
    estimate : symbols; what moves comes first.   rate : of what moves (n,).
    dt : sampling interval [s].
    """
    n = rate.numel()
    implicit = ca.inv_minor(ca.SX.eye(n) - dt / 2 * ca.jacobian(rate, estimate)[:, :n])
    return estimate[:n] + dt * implicit @ rate


def correct(
    estimate: Any, P: Any, R: Any, x: Any, outlier: Any, *, follow: bool
) -> tuple[Any, Any]:
    """Return estimate and covariance after the measurement of the first two states.
    estimate : before, (n,).   P : its covariance (n, n).
    R : covariance of the measurement (2, 2).   x : the measurement (2,).
    follow : whether it counts for the first two all the same.
    """
    S = P[:2, :2] + R
    gain = P[:, :2] @ ca.inv_minor(S)
    innovation = x - estimate[:2]
    deviation = ca.sqrt(ca.vertcat(S[0, 0], S[1, 1]))
    trusted = ca.fmin(ca.fmax(innovation, -outlier * deviation), outlier * deviation)
    leading = innovation if follow else trusted
    move = ca.vertcat(gain[:2, :] @ leading, gain[2:, :] @ trusted)
    keep = ca.SX.eye(estimate.numel())
    keep[:, :2] -= gain
    after = keep @ P @ keep.T + gain @ R @ gain.T  # Joseph
    return estimate + move, (after + after.T) / 2


class _Corrected(NamedTuple):
    """What a measurement makes of an estimate.
    move : of the estimate (n,).   P : covariance after (n, n).   keep : I - K H (n, n).
    pull : Hᵀ S⁻¹ times the innovation (n,).
    """

    move: Any
    P: Any
    keep: Any
    pull: Any


def corrected(P: Any, H: Any, R: Any, innovation: Any, outlier: Any) -> _Corrected:
    """Return what a measurement of two numbers makes of an estimate, in Joseph's form.
    P : covariance before (n, n).
    H : what the numbers are of the estimate (2, n); a row of zeros measures nothing.
    R : covariance of the numbers (2, 2).   innovation : (2,).
    """
    S = H @ P @ H.T + R
    S_inverse = ca.inv_minor(S)
    most = outlier * ca.sqrt(ca.diag(S))
    trusted = ca.fmin(ca.fmax(innovation, -most), most)
    K = P @ H.T @ S_inverse
    keep = ca.SX.eye(P.size1()) - K @ H
    after = keep @ P @ keep.T + K @ R @ K.T
    return _Corrected(K @ trusted, (after + after.T) / 2, keep, H.T @ S_inverse @ trusted)
