"""What is believed before the car drives: a brush tire of the declared stiffness, and how sure.

Weights are those of a Fiala tire (R. Rajamani, Vehicle Dynamics and Control, section 13.5)
projected on the units. Their covariance is wide along the changes that cars differ in: stiffness,
friction, and any shape a little. Rows are axles, front and rear.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from codegen.arrays import Array
from identifier.axle.curve import unit_matrix
from identifier.band import SD_FRICTION
from models.rules import Positive
from models.vehicle import Vehicle

_RIDGE = 0.3  # keeps projected weights small where units are alike
_STEP = 1.2  # ratio over which log-derivatives are taken

SLIPS = np.linspace(0.002, 0.6, 300)  # rad, where a curve and its projection must agree


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior(Positive):
    """Means and standard deviations before the first sample.
    friction : of the road [-].   sd_stiffness : of ln C [-].
    sd_friction : of ln μ [-].   sd_shape : of each weight on its own [static axle loads].
    compliance, sd_compliance : lateral deflection of the tire per static axle load [m].
    sway_share, sd_sway_share : share of the roll rate that moves the contact patch [-].
    sd_steering : of the front steering's zero [rad].   sd_v_y : of the bias of v_y [m/s].
    """

    friction: float = 0.8
    sd_stiffness: float = 0.5
    sd_friction: float = SD_FRICTION
    sd_shape: float = 0.15
    compliance: float
    sd_compliance: float
    sway_share: float = 0.2
    sd_sway_share: float = 0.3
    sd_steering: float = 0.002
    sd_v_y: float

    def means(self, vehicle: Vehicle, ladder: tuple[float, ...]) -> tuple[Array, Array]:
        """Return weights (2, n) and [compliance, sway share, offset] (2, 3).
        vehicle : the car; its cornering stiffness enters here and nowhere else.
        ladder : slip scales of the units [rad].
        """
        W = np.array(
            [fiala_weights(c, self.friction, ladder) for c in _relative_stiffness(vehicle)]
        )
        return W, np.tile([self.compliance, self.sway_share, 0.0], (2, 1))

    def covariance(self, vehicle: Vehicle, ladder: tuple[float, ...]) -> Array:
        """Return the covariance of [weights, compliance, sway share, offset] (2, n + 3, n + 3).
        ladder : slip scales of the units [rad].
        """
        n, mu = len(ladder), self.friction
        P = np.zeros((2, n + 3, n + 3))
        for i, c in enumerate(_relative_stiffness(vehicle)):
            d_C, d_mu = (
                (fiala_weights(c * s, mu * m, ladder) - fiala_weights(c / s, mu / m, ladder))
                / (2.0 * np.log(_STEP))
                for s, m in ((_STEP, 1.0), (1.0, _STEP))
            )
            P[i, :n, :n] = (
                self.sd_stiffness**2 * np.outer(d_C, d_C)
                + self.sd_friction**2 * np.outer(d_mu, d_mu)
                + self.sd_shape**2 * np.eye(n)
            )
            offset = (self.sd_steering, self.sd_v_y)[i]
            variances = np.array([self.sd_compliance, self.sd_sway_share, offset]) ** 2
            P[i, n:, n:] = np.diag(variances)
        return P


def _relative_stiffness(vehicle: Vehicle) -> tuple[float, float]:
    front, rear = vehicle.axle_loads
    return vehicle.cornering_stiffness_front / front, vehicle.cornering_stiffness_rear / rear


def fiala_force(alpha: Array, stiffness: float, friction: float) -> Array:
    """Return F/F_z of a brush tire, α > 0, (k,).
    alpha : slip angles [rad], (k,).   stiffness : C/F_z [1/rad].   friction : μ [-].
    """
    sliding = np.minimum(np.tan(alpha) * stiffness / (3.0 * friction), 1.0)
    return friction * (1.0 - (1.0 - sliding) ** 3)


def _projected(force: Array, ladder: tuple[float, ...]) -> Array:
    """Return the weights whose curves come closest to given ones, with a little ridge.
    force : curves at `SLIPS` (300,) or (300, k).   ladder : slip scales of the units [rad].
    """
    return _projector(ladder) @ force


@cache
def _projector(ladder: tuple[float, ...]) -> Array:
    """Return the matrix (n, 300) from curves to weights."""
    T = unit_matrix(SLIPS, ladder)
    squared = T.T @ T + _RIDGE**2 * np.eye(len(ladder))
    return np.asarray(np.linalg.solve(squared, T.T), dtype=np.float64)


def fiala_weights(stiffness: float, friction: float, ladder: tuple[float, ...]) -> Array:
    """Return the weights (n,) of a brush tire.
    stiffness : C/F_z [1/rad].   friction : μ [-].   ladder : slip scales of the units [rad].
    """
    return _projected(fiala_force(SLIPS, stiffness, friction), ladder)


@cache
def friction_direction(ladder: tuple[float, ...]) -> Array:
    """Return M (n, n) with dw/d ln μ = M w for φ = μ φ₀(α/μ): friction changes, stiffness does not.
    ladder : slip scales of the units [rad].
    """
    T = unit_matrix(SLIPS, ladder)
    return _projected(T - SLIPS[:, None] / np.array(ladder) * (1.0 - T * T), ladder)
