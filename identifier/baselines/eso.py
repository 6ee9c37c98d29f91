"""Extended state observer: the axle forces as states beside the axle impulses.

ξ̇ = F - n, Ḟ = unknown;   ξ [N s]: axle impulse, n [N]: force of a steady turn.
Both error poles of each axle lie at -ω_o (Gao, "Scaling and bandwidth-parameterization based
controller tuning", ACC 2003); sampled, at β = exp(-ω_o T_s) whatever the rate (Miklosovic,
Radke and Gao, "Discrete implementation and generalization of the extended state observer", 2006).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Self

import casadi as ca
import numpy as np

from codegen import Scan
from identifier.baselines.ports import (
    OVER,
    impulse,
    sample_ports,
    turning_force,
)
from identifier.method import Method
from identifier.setup import AXLE_FORCE, Port, Setup
from identifier.tire_model import TireModel
from identifier.tuning import Range, around
from models.rules import require_positive
from models.vehicle import Vehicle

CARRY = ("xi_hat", "F_hat", "turning", "running")
PORTS = (
    AXLE_FORCE,
    Port("xi_hat", "N s", "observed axle impulse, front and rear"),
    Port("F_hat", "N", "observed axle forces, front and rear"),
    Port("turning", "N", "axle forces that hold a steady turn, at the last sample"),
    Port("running", "-", "1 after a sample in motion"),
)


def build_step() -> ca.Function:
    """Return the step; bandwidth, vehicle and sampling stay inputs of it.

    Carried: xi_hat (2,) [N s], F_hat (2,) [N], turning (2,) = n of the last sample [N], running (1
    after a sample in motion). Constant: bandwidth ω_o [rad/s].
    """
    s = sample_ports()
    p, dt = s.parameters, s.sampling[0]
    xi_hat, F_hat, turning = (ca.SX.sym(name, 2) for name in CARRY[:3])
    running, bandwidth = ca.SX.sym("running"), ca.SX.sym("bandwidth")
    beta = ca.exp(-bandwidth * dt)
    xi, n = impulse(p, s.x), turning_force(p, s.v_x, s.x)
    predicted = xi_hat + dt * (F_hat - (turning + n) / 2)
    error = xi - predicted
    # Predicted error (ξ~, F~) moves on with [[β², β² T], [-(1-β)²/T, 1-(1-β)²]]: (z - β)².
    xi_next = predicted + (1 - beta**2) * error
    F_next = F_hat + (1 - beta) ** 2 / dt * error
    going = ca.logic_and(s.moving, running > 0.5)
    F_next = ca.if_else(going, F_next, n)  # a start is taken for a steady turn
    return ca.Function(
        "eso",
        [xi_hat, F_hat, turning, running, s.x, s.u, s.v_x, bandwidth, s.vehicle, s.sampling],
        [
            ca.if_else(going, xi_next, xi),
            F_next,
            n,
            ca.if_else(s.moving, 1, 0),
            ca.if_else(s.moving, F_next, 0),
        ],
        [*CARRY, *OVER, "bandwidth", "vehicle", "sampling"],
        [*(f"{name}_next" for name in CARRY), "axle_force"],
    )


@cache
def _scan() -> Scan:
    return Scan(build_step(), carry=CARRY, over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtendedStateObserver(Method):
    """A signal estimator: it follows any force with a lag of 2/ω_o, and knows no tire.

    Parameters
    ----------
    bandwidth : ω_o [rad/s].
    dt : sampling interval [s].
    min_speed : below this speed [m/s] forces read zero.
    """

    estimates = "axle forces"

    bandwidth: float
    dt: float = 0.01
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        require_positive(ValueError, bandwidth=self.bandwidth, dt=self.dt, min_speed=self.min_speed)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        """Return the observer for a car: ω_o = 25 sqrt(g/L), 48 rad/s for a sedan.

        That is ten times the fastest steering of a driver; noise forbids much more.

        Parameters
        ----------
        dt : sampling interval [s].
        """
        return cls(bandwidth=25.0 / vehicle.froude_time, dt=dt, min_speed=vehicle.lowest_speed)

    @property
    def tunables(self) -> Mapping[str, Range]:
        """What a search may vary, around the numbers that it has."""
        return {"bandwidth": around(self.bandwidth, 4.0)}

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return PORTS

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car; its stiffness is not looked at.
        start : None; a signal estimator cannot begin with a model.

        Raises
        ------
        ValueError
            Where a stored model is given.
        """
        self.require_fresh(start)
        return Setup(
            scan=_scan(),
            carry={
                "xi_hat": np.zeros(2),
                "F_hat": np.zeros(2),
                "turning": np.zeros(2),
                "running": np.zeros(1),
            },
            constants={
                "bandwidth": np.array(self.bandwidth),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )
