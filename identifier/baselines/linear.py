"""The linear tire: as the vehicle states it, which is the least to beat, and learnt online."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.curves import CurveModel, curve_scan
from identifier.baselines.ports import (
    OVER,
    impulse,
    sample_ports,
    turning_force,
)
from identifier.method import AXLE_FORCE, NOT_NEGATIVE, Method, Port, Setup, resumed
from identifier.tire_model import TireModel
from identifier.tuning import Range, around
from models.bicycle import slip_angles
from models.rules import require_positive
from models.vehicle import Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearBaseline(Method):
    """F = C α of (3) with the stiffness that the vehicle states.

    Parameters
    ----------
    dt : sampling interval [s].
    min_speed : below this speed [m/s] forces read zero.
    """

    dt: float = 0.01
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        require_positive(ValueError, dt=self.dt, min_speed=self.min_speed)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        """Return the method for a car.

        Parameters
        ----------
        dt : sampling interval [s].
        """
        return cls(dt=dt, min_speed=vehicle.lowest_speed)

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car, whose stiffness is used.
        start : None; there is nothing that a stored model could begin.

        Raises
        ------
        ValueError
            Where a stored model is given.
        """
        if start is not None:
            raise ValueError("the linear tire learns nothing, it cannot begin with a stored model")
        return Setup(
            scan=curve_scan("linear"),
            carry={},
            constants={
                "parameters": self.frozen(vehicle, {}).parameters,
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        """Return the linear tire itself.

        Parameters
        ----------
        state : nothing is carried.
        """
        del state
        stiffness = [[vehicle.cornering_stiffness_front], [vehicle.cornering_stiffness_rear]]
        return CurveModel(
            vehicle=vehicle,
            curve="linear",
            parameters=np.array(stiffness),
            min_speed=self.min_speed,
        )


# Cornering stiffness of each axle, online: recursive least squares with forgetting.
#
# ξ̇ = C α - n filtered by 1/(s/κ + 1), which needs no derivative and couples no axles:
# y = κ ξ - LP[κ ξ - n] = C LP[α].   Per axle J = Σ λ^(k-i) h_i² T_s [rad² s] and
# C ← C + h (y - h C) T_s/J: least squares in its information form.
# J never falls below what the prior is worth, so that straight driving forgets nothing for good.
# Source: Ljung, System Identification, 2nd ed., section 11.2.

CARRY = ("stiffness", "information", "filters", "inputs", "running")
PORTS = (
    AXLE_FORCE,
    Port("stiffness", "N/rad", "cornering stiffness, front and rear", learnt=True),
    Port(
        "information",
        "rad^2 s",
        "of the stiffness, front and rear",
        learnt=True,
        rule=NOT_NEGATIVE,
    ),
    Port("filters", "N; rad", "filtered target, then slip, front and rear each"),
    Port("inputs", "N; rad", "what the filters read at the last sample"),
    Port("running", "-", "samples since the start"),
)
NUMBERS = ("cutoff", "memory", "prior_slip", "learning_speed")
SMALLEST = 0.02  # of the stiffness told: a tire pushes, whatever the noise says


def build_step() -> ca.Function:
    """Return the step; all numbers stay inputs of it.

    Carried: stiffness (2,) [N/rad], information J (2,) [rad² s], filters (4,) = LP of [κ ξ - n, α],
    inputs (4,) = those before the filter at the last sample, running (samples since the start).
    Constant: told (2,) [N/rad] and numbers in the order of `NUMBERS`.
    """
    s = sample_ports()
    p, dt = s.parameters, s.sampling[0]
    stiffness, J = ca.SX.sym("stiffness", 2), ca.SX.sym("information", 2)
    filters, inputs = ca.SX.sym("filters", 4), ca.SX.sym("inputs", 4)
    running, numbers = ca.SX.sym("running"), ca.SX.sym("numbers", len(NUMBERS))
    kappa, memory, prior_slip, learning_speed = ca.vertsplit(numbers)
    xi = impulse(p, s.x)
    alpha = slip_angles(p.l_f, p.l_r, s.speed, s.x, s.u)
    arriving = ca.vertcat(kappa * xi - turning_force(p, s.v_x, s.x), alpha)
    keep = ca.exp(-kappa * dt)
    filtered = keep * filters + (1 - keep) / 2 * (inputs + arriving)
    filtered = ca.if_else(running > 0, filtered, arriving)
    y, h = kappa * xi - filtered[:2], filtered[2:]
    warm = running * dt * kappa > 2  # the filters have forgotten their start
    J_next = ca.fmax(ca.exp(-dt / memory) * J + h**2 * dt, prior_slip**2 * memory)
    stated = ca.vertcat(p.C_f, p.C_r)
    C_next = ca.fmax(stiffness + h * (y - h * stiffness) * dt / J_next, SMALLEST * stated)
    fast = s.v_x >= learning_speed
    learning = ca.logic_and(fast, warm)
    return ca.Function(
        "stiffness_rls",
        [stiffness, J, filters, inputs, running, s.x, s.u, s.v_x, numbers, s.vehicle, s.sampling],
        [
            ca.if_else(learning, C_next, stiffness),
            ca.if_else(learning, J_next, J),
            filtered,
            arriving,
            ca.if_else(fast, running + 1, 0),
            ca.if_else(s.moving, stiffness * alpha, 0),
        ],
        [*CARRY, *OVER, "numbers", "vehicle", "sampling"],
        [*(f"{name}_next" for name in CARRY), "axle_force"],
    )


@cache
def _scan() -> Scan:
    return Scan(build_step(), carry=CARRY, over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True)
class StiffnessRls(Method):
    """The best linear tire of the recent past; it freezes to a linear tire.

    Parameters
    ----------
    cutoff : κ of the filters [1/s].
    memory : time constant of forgetting [s].
    prior_slip : the prior is worth driving with this root mean square of slip [rad] for as long
        as the memory.
    dt : sampling interval [s].
    learning_speed : below this speed [m/s] learning rests.
    min_speed : below this speed [m/s] forces read zero.

    Raises
    ------
    ValueError
        Where a number is not positive.
    """

    cutoff: float
    memory: float
    prior_slip: float = 0.003
    dt: float = 0.01
    learning_speed: float = 3.0
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        require_positive(
            ValueError, **{name: getattr(self, name) for name in (*NUMBERS, "dt", "min_speed")}
        )

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        """Return the method for a car: κ = 3 sqrt(g/L), memory of 20 sqrt(L/g), 10 s for a sedan.

        Parameters
        ----------
        dt : sampling interval [s].
        """
        time, speed = vehicle.froude_time, vehicle.froude_speed
        return cls(
            cutoff=3.0 / time,
            memory=20.0 * time,
            dt=dt,
            learning_speed=0.6 * speed,
            min_speed=vehicle.lowest_speed,
        )

    @property
    def tunables(self) -> Mapping[str, Range]:
        """What a search may vary, around the numbers that it has."""
        return {
            "cutoff": around(self.cutoff, 4.0),
            "memory": around(self.memory, 10.0),
            "prior_slip": around(self.prior_slip, math.sqrt(10.0)),
        }

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return PORTS

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car; its stiffness is the prior.
        start : a linear tire to begin with; None takes the vehicle's.

        Raises
        ------
        ValueError
            Where the stored model is of another kind.
        """
        first = np.array([vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear])
        if start is not None:
            refusal = "the stored model is not a linear tire"
            first = resumed(start, CurveModel, refusal, curve="linear").parameters[:, 0]
        return Setup(
            scan=_scan(),
            carry={
                "stiffness": first,
                "information": np.full(2, self.prior_slip**2 * self.memory),
                "filters": np.zeros(4),
                "inputs": np.zeros(4),
                "running": np.zeros(1),
            },
            constants={
                "numbers": np.array([getattr(self, name) for name in NUMBERS]),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        """Return the linear tire with the carried stiffness.

        Parameters
        ----------
        state : stiffness (2,) [N/rad].
        """
        return CurveModel(
            vehicle=vehicle,
            curve="linear",
            parameters=state["stiffness"].reshape(2, 1).copy(),
            min_speed=self.min_speed,
        )
