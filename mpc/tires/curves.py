"""Axle curves in closed form: linear, and the Magic Formula without E; F = curve(α) cos δ.

Source: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., (4.49). No longitudinal slip.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from codegen.arrays import Array
from models.vehicle import Vehicle
from mpc.tires.tire import Pair, Point, PredictionTire, SmallSlip, TireStructure


@dataclass(frozen=True, slots=True)
class MagicAxles(TireStructure):
    """D sin(C atan(B α)); w = [B, C, D] of the front, then of the rear axle, [1/rad, -, N]."""

    n_weights = 6

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        front, rear = (
            D * ca.sin(C * ca.atan(B * alpha))
            for alpha, (B, C, D) in (
                (slip[0], ca.vertsplit(at.w[:3])),
                (slip[1], ca.vertsplit(at.w[3:])),
            )
        )
        return front * ca.cos(at.delta), rear


@dataclass(frozen=True, slots=True)
class LaggedAxles(TireStructure):
    """A curve of lagged slip, offsets of the sensors taken off; w = [curve's, σ_f, σ_r, δ_0, b].

    σ [m]: relaxation lengths. δ_0 [rad]: zero of the steering. b [m/s]: bias of v_y. The tracker
    reads the same sensors as the identifier did.
    lagged : whether the slip lags; else σ does nothing.
    """

    curve: TireStructure
    lagged: bool = True

    @property
    def n_weights(self) -> int:
        return self.curve.n_weights + 4

    def slip(self, at: Point) -> Pair:
        """Return the slip angles, offsets of the sensors taken off [rad]."""
        n = self.curve.n_weights
        front, rear = self.curve.slip(at._replace(v_y=at.v_y - at.w[n + 3]))
        return front + at.w[n + 2], rear

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        return self.curve.force(slip, at._replace(w=at.w[: self.curve.n_weights]))

    def lag_length(self, slip: Pair, at: Point) -> Pair:
        """Return the relaxation lengths [m]."""
        del slip
        n = self.curve.n_weights
        return at.w[n], at.w[n + 1]


@dataclass(frozen=True, slots=True)
class LinearAxles(SmallSlip):
    """F = C α; w = [C_f, C_r] [N/rad]."""

    n_weights = 2

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        w = at.w
        return w[0] * slip[0], w[1] * slip[1]


def linear_tire(vehicle: Vehicle, stiffness: Array | None = None) -> PredictionTire:
    """Return the tire of the linear bicycle.
    stiffness : C_f, C_r per axle [N/rad] (2,); None takes those that the vehicle states.
    """
    weights = vehicle.bicycle[4:] if stiffness is None else stiffness
    return PredictionTire(LinearAxles(), np.array(weights, dtype=np.float64), vehicle)
