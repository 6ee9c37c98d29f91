"""What estimators of v_y without a sensor of it share: they read r, a_y, v_x and steering alone.

x = [v_y, r] [m/s, rad/s].   u = [δ_f, δ_r] [rad].   F: axle forces [N], frame of the body.
ẋ = K F - [v_x r, 0];   measured are r and, at the center of gravity, a_y = (F_f + F_r)/m.
A steady turn needs F_r = l_f m v_x r/L, so that on a linear tire its v_y is
l_r r + v_x (δ_r - F_r/C_r): what every one of them begins with.
"""

from typing import Any, NamedTuple

import casadi as ca

from identifier.baselines.kalman import FilteredTire, midpoint
from identifier.baselines.ports import Sample, motion_rate, sample_ports, turning_force
from identifier.setup import Port
from models.bicycle import BicycleParameters

OVER = ("x", "u", "v_x", "a_y")  # of x the yaw rate alone
V_Y = Port("v_y", "m/s", "lateral velocity at the center of gravity, positive to the left")
V_Y_SD = Port("v_y_sd", "m/s", "standard deviation of v_y")
_MOST_FELT = 98.0  # m/s²: no car feels more
MOST_SLIDING = 0.7  # |v_y|/v_x beyond which an estimate is none


class _Given(NamedTuple):
    """A sample without v_y: the ports of it, and a_y [m/s²], 0 where there is none.
    has_a_y : whether a_y is there, and one of a car.   a_y_port : the port itself, as it is.
    """

    sample: Sample
    a_y: Any
    has_a_y: Any
    a_y_port: Any

    @property
    def ports(self) -> list[Any]:
        """The ports of `OVER`, then vehicle and sampling."""
        s = self.sample
        return [s.x, s.u, s.v_x, self.a_y_port, s.vehicle, s.sampling]

    @property
    def r(self) -> Any:
        """The measured yaw rate [rad/s]."""
        return self.sample.x[1]


def given_ports() -> _Given:
    a_y = ca.SX.sym("a_y")
    has_a_y = ca.fabs(a_y) < _MOST_FELT  # NaN is not
    return _Given(sample_ports(), ca.if_else(has_a_y, a_y, 0), has_a_y, a_y)


def steady_v_y(p: BicycleParameters, v_x: Any, r: Any, u: Any) -> Any:
    """Return v_y of a steady turn on the linear rear tire [m/s].
    v_x : longitudinal speed [m/s].   r : yaw rate [rad/s].   u : [δ_f, δ_r] (2,).
    """
    F_r = turning_force(p, v_x, ca.vertcat(0, r))[1]
    return p.l_r * r + v_x * (u[1] - F_r / p.C_r)


def axle_force(
    tire: FilteredTire, p: BicycleParameters, known: Any, estimate: Any, v_x: Any, u: Any
) -> Any:
    """Return the axle forces of an estimate, (2,) [N].
    tire : forces by θ, without lag.   estimate : [v_y, r, θ].
    v_x : longitudinal speed [m/s], not zero.   u : [δ_f, δ_r] (2,).
    """
    x, theta = estimate[:2], estimate[2:]
    return tire.force(p, known, theta, tire.slip(p, known, theta, v_x, x, u), u)


def predicted(
    tire: FilteredTire, p: BicycleParameters, known: Any, estimate: Any, v_x: Any, u: Any, dt: Any
) -> Any:
    """Return the estimate a step later, θ as it is.
    estimate : [v_y, r, θ], symbols.   dt : sampling interval [s].
    """
    F = axle_force(tire, p, known, estimate, v_x, u)
    rate = motion_rate(p, v_x, estimate[:2], F)
    return ca.vertcat(midpoint(estimate, rate, dt), estimate[2:])


def expected(
    tire: FilteredTire, p: BicycleParameters, known: Any, estimate: Any, v_x: Any, u: Any
) -> Any:
    """Return what the sensors should show of an estimate: r [rad/s] and a_y [m/s²], (2,)."""
    F = axle_force(tire, p, known, estimate, v_x, u)
    return ca.vertcat(estimate[1], (F[0] + F[1]) / p.m)


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
