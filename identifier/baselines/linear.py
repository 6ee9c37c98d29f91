"""The linear tire: as the vehicle states it, which is the least to beat, and learnt online."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.curves import CurveModel, unlagged
from identifier.baselines.ports import (
    LAG_DESCRIBED,
    LAG_PORTS,
    OVER,
    axle_loads,
    impulse,
    lag_symbols,
    lagged_slip,
    sample_ports,
    turning_force,
)
from identifier.method import Method, resumed
from identifier.setup import AXLE_FORCE, NOT_NEGATIVE, Port, Setup
from identifier.tire_model import TireModel
from identifier.tuning import Range, around
from models.bicycle import slip_angles
from models.rules import require_positive, require_within
from models.vehicle import GRAVITY, Vehicle


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
        start : None; there is nothing that a stored model could begin.

        Raises
        ------
        ValueError
            Where a stored model is given.
        """
        self.require_fresh(start)
        return self.frozen(vehicle, {}).setup(self.dt)

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        """Return the linear tire itself."""
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
# ξ̇ = C α' - n filtered by 1/(s/κ + 1), which needs no derivative and couples no axles:
# y = κ ξ - LP[κ ξ - n] = C h, h = LP[α'], the offsets taken off, α' lagged by a σ that is given.
# Per axle J = Σ λ^(k-i) h_i² T_s [rad² s] and C ← C + h (y - h C) T_s/J: least squares in its
# information form. J never falls below what the prior is worth, so that straight driving forgets
# nothing for good. The zero δ₀ of the front steering and the bias b of v_y follow y/C - h, front
# and rear, where the force is small: in a bend a straight line through a curve that saturates has
# an offset that is no sensor's. Without lag and offsets it is the textbook's: Ljung, System
# Identification, 2nd ed., section 11.2.

CARRY = ("stiffness", "information", "offset", "filters", "inputs", "running", *LAG_PORTS)
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
    Port("offset", "rad; m/s", "zero of the front steering, bias of v_y", learnt=True),
    Port("filters", "N; rad; s/m", "filtered target, then slip, front and rear each, then 1/v_x"),
    Port("inputs", "N; rad; s/m", "what the filters read at the last sample"),
    Port("running", "-", "samples since the start"),
    *LAG_DESCRIBED,
)
OWN = ("relaxation_length", "most_steering", "most_v_y")
NUMBERS = ("cutoff", "memory", "prior_slip", "learning_speed", *OWN)
SMALLEST = 0.02  # of the stiffness told: a tire pushes, whatever the noise says
STRAIGHT = 0.1  # static axle loads: below it a force tells of offsets
LARGEST = 1e3  # of a lag [m] and of offsets [rad, m/s]


def build_step() -> ca.Function:
    """Return the step; all numbers stay inputs of it.

    Carried: stiffness (2,) [N/rad], information J (2,) [rad² s], offset (2,) = δ₀ [rad] and b
    [m/s], filters (5,) = LP of [κ ξ - n, α', 1/v_x], inputs (5,) = those before the filter at the
    last sample, running (samples since the start), and the `LaggedSlip`, offsets not taken off.
    Constant: numbers in the order of `NUMBERS`.
    """
    s = sample_ports()
    p, dt = s.parameters, s.sampling[0]
    stiffness, J, offset = (ca.SX.sym(name, 2) for name in CARRY[:3])
    filters, inputs = ca.SX.sym("filters", 5), ca.SX.sym("inputs", 5)
    running, numbers = ca.SX.sym("running"), ca.SX.sym("numbers", len(NUMBERS))
    kappa, memory, prior_slip, learning_speed, sigma, *most = ca.vertsplit(numbers)
    last = lag_symbols()
    xi = impulse(p, s.x)
    alpha = slip_angles(p.l_f, p.l_r, s.speed, s.x, s.u)
    slip = lagged_slip(last, alpha, s.speed * dt, ca.vertcat(sigma, sigma))
    arriving = ca.vertcat(kappa * xi - turning_force(p, s.v_x, s.x), slip, 1 / s.speed)
    keep = ca.exp(-kappa * dt)
    filtered = keep * filters + (1 - keep) / 2 * (inputs + arriving)
    filtered = ca.if_else(running > 0, filtered, arriving)
    y, per_speed = kappa * xi - filtered[:2], filtered[4]
    h = filtered[2:4] + _shift(offset, per_speed)
    warm = running * dt * kappa > 2  # the filters have forgotten their start
    J_next = ca.fmax(ca.exp(-dt / memory) * J + h**2 * dt, prior_slip**2 * memory)
    stated = ca.vertcat(p.C_f, p.C_r)
    C_next = ca.fmax(stiffness + h * (y - h * stiffness) * dt / J_next, SMALLEST * stated)
    straight = ca.if_else(ca.fabs(y) < STRAIGHT * axle_loads(p, GRAVITY), dt / memory, 0)
    missed = straight * (y / stiffness - h) / ca.vertcat(1, per_speed)
    offset_next = ca.fmin(ca.fmax(offset + missed, -ca.vertcat(*most)), ca.vertcat(*most))
    fast = s.v_x >= learning_speed
    learning = ca.logic_and(fast, warm)
    seen = slip + _shift(offset, 1 / s.speed)
    return ca.Function(
        "stiffness_rls",
        [
            *(stiffness, J, offset, filters, inputs, running, *last),
            *(s.x, s.u, s.v_x, numbers, s.vehicle, s.sampling),
        ],
        [
            ca.if_else(learning, C_next, stiffness),
            ca.if_else(learning, J_next, J),
            ca.if_else(learning, offset_next, offset),
            filtered,
            arriving,
            ca.if_else(fast, running + 1, 0),
            *(slip, alpha, ca.if_else(s.moving, 1, 0)),
            ca.if_else(s.moving, stiffness * seen, 0),
        ],
        [*CARRY, *OVER, "numbers", "vehicle", "sampling"],
        [*(f"{name}_next" for name in CARRY), "axle_force"],
    )


def _shift(offset: Any, per_speed: Any) -> Any:
    """Return what the offsets add to measured slip [rad], (2,)."""
    return ca.vertcat(offset[0], 0) + offset[1] * per_speed


@cache
def _scan() -> Scan:
    return Scan(build_step(), carry=CARRY, over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True)
class StiffnessRls(Method):
    """The best linear tire of the recent past; it freezes to a linear tire, lagged, with offsets.

    Parameters
    ----------
    cutoff : κ of the filters [1/s].
    memory : time constant of forgetting [s].
    prior_slip : the prior is worth driving with this root mean square of slip [rad] for as long
        as the memory.
    relaxation_length : σ by which slip lags, of both axles [m]; 0 is the textbook's.
    most_steering : largest zero of the front steering that is learnt [rad]; 0: none.
    most_v_y : largest bias of v_y that is learnt [m/s]; 0: none.
    dt : sampling interval [s].
    learning_speed : below this speed [m/s] learning rests.
    min_speed : below this speed [m/s] forces read zero.

    Raises
    ------
    ValueError
        Where a number is not positive, the lag or an offset's bound negative.
    """

    cutoff: float
    memory: float
    prior_slip: float = 0.003
    relaxation_length: float = 0.0
    most_steering: float = 0.0
    most_v_y: float = 0.0
    dt: float = 0.01
    learning_speed: float = 3.0
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        positive = [name for name in (*NUMBERS, "dt", "min_speed") if name not in OWN]
        require_positive(ValueError, **{name: getattr(self, name) for name in positive})
        require_within(ValueError, 0.0, LARGEST, **{name: getattr(self, name) for name in OWN})

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01, textbook: bool = False) -> Self:
        """Return the method for a car: κ = 3 sqrt(g/L), memory of 20 sqrt(L/g), 10 s for a sedan.

        Parameters
        ----------
        dt : sampling interval [s].
        textbook : without lag and offsets.
        """
        time, speed = vehicle.froude_time, vehicle.froude_speed
        return cls(
            cutoff=3.0 / time,
            memory=20.0 * time,
            relaxation_length=0.0 if textbook else 0.3 * vehicle.wheelbase,
            most_steering=0.0 if textbook else 0.01,
            most_v_y=0.0 if textbook else 0.04 * speed,
            dt=dt,
            learning_speed=0.6 * speed,
            min_speed=vehicle.lowest_speed,
        )

    @property
    def tunables(self) -> Mapping[str, Range]:
        """What a search may vary, around the numbers that it has."""
        own = {name: around(getattr(self, name), 3.0) for name in OWN if getattr(self, name) > 0.0}
        return {
            "cutoff": around(self.cutoff, 4.0),
            "memory": around(self.memory, 10.0),
            "prior_slip": around(self.prior_slip, math.sqrt(10.0)),
            **own,
        }

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return PORTS

    @property
    def remark(self) -> str:
        """Say whether it is more than the textbook's."""
        if not any(getattr(self, name) for name in OWN):
            return "the textbook's, without lag and offsets"
        return "the lag of the tires is given, offsets of the sensors are learnt"

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
        first, offset = np.array(vehicle.bicycle)[4:], np.zeros(2)
        if start is not None:
            refusal = "the stored model is not a linear tire"
            stored = resumed(start, CurveModel, refusal, curve="linear")
            first, offset = stored.parameters[:, 0], stored.offset
        return Setup(
            scan=_scan(),
            carry={
                "stiffness": first,
                "information": np.full(2, self.prior_slip**2 * self.memory),
                "offset": offset,
                "filters": np.zeros(5),
                "inputs": np.zeros(5),
                "running": np.zeros(1),
                **unlagged(),
            },
            constants={
                "numbers": np.array([getattr(self, name) for name in NUMBERS]),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        """Return the linear tire with the carried stiffness and offsets.

        Parameters
        ----------
        state : stiffness (2,) [N/rad], offset (2,) [rad, m/s].
        """
        return CurveModel(
            vehicle=vehicle,
            curve="linear",
            parameters=state["stiffness"].reshape(2, 1).copy(),
            min_speed=self.min_speed,
            relaxation_length=np.full(2, self.relaxation_length),
            offset=state["offset"].ravel().copy(),
        )
