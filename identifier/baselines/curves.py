"""A Magic Formula an axle behind a fixed lag, which filters identify: its equations, and frozen.

x = [v_y, r] [m/s, rad/s].   u = [δ_f, δ_r] [rad].   F: axle forces [N], frame of the body.
α = δ - atan((v_y ± l r)/v_x) in the paper's sign, the negative of ISO 8855, so that F = +C α.
The tire's lag is dα'/dt = v_x/σ (α - α'), σ the relaxation length (Pacejka, Tyre and Vehicle
Dynamics, 2nd ed., (7.7)): it is solved exactly for α linear over the step, so that no short σ makes
it unstable and σ = 0 is no lag at all. A frozen curve reads the slip with the offsets of the
sensors taken off.
"""

from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.frozen import FORMAT, require_min_speed, vehicle_from, vehicle_numbers
from identifier.setup import Port, Setup
from identifier.tire_model import Fact, TireModel
from models.bicycle import BicycleParameters, slip_angles
from models.schema import Table
from models.vehicle import Vehicle

MOST_FELT = 98.0  # [m/s²] no car feels more: an a_y beyond it is none
SHORTEST = 1e-9  # [m] keeps v_x T_s/σ finite without a lag, where e^(-v_x T_s/σ) is zero
LONGEST = 10.0  # wheelbases, of a relaxation length
MOST_OFFSET = np.array([0.5, 10.0])  # [rad, m/s] beyond it a sensor is not mounted, but broken

OVER = ("x", "u", "v_x")
CURVE = ("B_1_rad", "C", "D_N")  # parameters of an axle's Magic Formula


class Sample(NamedTuple):
    """Ports of one sample and of the car: symbols.

    x (2,), u (2,), v_x, a_y [m/s²], NaN where there is none; vehicle (6,) = m, I_z, l_f, l_r, C_f,
    C_r; sampling (2,) = T_s [s] and the lowest speed [m/s]; the six numbers by letter.
    """

    x: Any
    u: Any
    v_x: Any
    a_y: Any
    vehicle: Any
    sampling: Any
    parameters: BicycleParameters

    @property
    def moving(self) -> Any:
        return self.v_x >= self.sampling[1]

    @property
    def speed(self) -> Any:
        """v_x, held at the lowest speed, so that slip angles stay finite [m/s]."""
        return ca.fmax(self.v_x, self.sampling[1])

    @property
    def has_a_y(self) -> Any:
        """Whether a_y is there, and one of a car."""
        return ca.fabs(self.a_y) < MOST_FELT  # NaN is not


def sample_ports() -> Sample:
    vehicle = ca.SX.sym("vehicle", 6)
    return Sample(
        x=ca.SX.sym("x", 2),
        u=ca.SX.sym("u", 2),
        v_x=ca.SX.sym("v_x"),
        a_y=ca.SX.sym("a_y"),
        vehicle=vehicle,
        sampling=ca.SX.sym("sampling", 2),
        parameters=BicycleParameters(*ca.vertsplit(vehicle)),
    )


def wheel_slip(p: BicycleParameters, v_x: Any, x: Any, u: Any) -> Any:
    """Return slip angles α = δ - atan((v_y ± l r)/v_x) (2,) [rad].
    v_x : longitudinal speed [m/s], not zero.   x : [v_y, r] (2,).   u : [δ_f, δ_r] (2,).
    """
    return u + ca.atan(slip_angles(p.l_f, p.l_r, v_x, x, u) - u)


def measured_slip(p: BicycleParameters, offset: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return slip angles, the offsets of the sensors taken off, (2,) [rad].
    offset : zero of the front steering δ₀ [rad], which is added, and bias b of v_y [m/s], (2,).
    v_x : longitudinal speed [m/s], not zero.   x : [v_y, r] as the sensors read them (2,).
    u : [δ_f, δ_r] (2,).
    """
    return wheel_slip(p, v_x, x - ca.vertcat(offset[1], 0), u + ca.vertcat(offset[0], 0))


def magic_formula(q: Any, alpha: Any, u: Any) -> Any:
    """Return F = D sin(C atan(B α)) cos δ, the Magic Formula without E, (2,) [N].

    Source: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., (4.49) with E = 0.
    q : B [1/rad], C [-], D [N] (2, 3).   alpha : slip angles (2,) [rad].   u : [δ_f, δ_r] (2,).
    """
    B, C, D = q[:, 0], q[:, 1], q[:, 2]
    return D * ca.sin(C * ca.atan(B * alpha)) * ca.cos(u)


class LaggedSlip(NamedTuple):
    """What the lag keeps from one sample to the next: α' and α (2,) [rad], 1 once it has begun."""

    slip: Any
    alpha: Any
    begun: Any


LAG_PORTS = (
    Port("slip", "rad", "lagged slip of what was measured, front and rear"),
    Port("alpha", "rad", "slip angles of the last sample, front and rear"),
    Port("begun", "-", "1 after a sample in motion, from which slip lags"),
)


def lag_symbols() -> LaggedSlip:
    return LaggedSlip(ca.SX.sym("slip", 2), ca.SX.sym("alpha", 2), ca.SX.sym("begun"))


def unlagged() -> dict[str, Array]:
    """Return the carried values of a lag that has not begun, by port."""
    return {"slip": np.zeros(2), "alpha": np.zeros(2), "begun": np.zeros(1)}


def lagged_slip(last: LaggedSlip, alpha: Any, way: Any, sigma: Any) -> Any:
    """Return α' after a step (2,) [rad]; the first sample begins without lag.
    alpha : slip angles now (2,) [rad].   way : v_x T_s, what the tire has rolled [m].
    sigma : relaxation lengths (2,) [m], not negative.
    """
    e = ca.exp(-way / ca.fmax(sigma, SHORTEST))
    follow = e * (last.slip - last.alpha) - (1 - e) * sigma / way * (alpha - last.alpha)
    return alpha + ca.if_else(last.begun > 0.5, follow, 0)


@cache
def _scan() -> Scan:
    """Return the frozen curve as a step with one output, axle_force (2,) [N]; at rest 0.

    Carried: `LaggedSlip`. Constant: parameters of the curve (2, 3), offset (2,) = δ₀ [rad] and
    b [m/s], lag (2,) = σ [m].
    """
    s, last, carry = sample_ports(), lag_symbols(), LaggedSlip._fields
    q, sigma, offset = ca.SX.sym("parameters", 2, 3), ca.SX.sym("lag", 2), ca.SX.sym("offset", 2)
    alpha = measured_slip(s.parameters, offset, s.speed, s.x, s.u)
    slip = lagged_slip(last, alpha, s.speed * s.sampling[0], sigma)
    force = ca.if_else(s.moving, magic_formula(q, slip, s.u), 0)
    step = ca.Function(
        "frozen_magic_formula",
        [*last, q, offset, s.x, s.u, s.v_x, s.vehicle, s.sampling, sigma],
        [slip, alpha, ca.if_else(s.moving, 1, 0), force],
        [*carry, "parameters", "offset", *OVER, "vehicle", "sampling", "lag"],
        [*(f"{port}_next" for port in carry), "axle_force"],
    )
    return Scan(step, carry=carry, over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class CurveModel(TireModel):
    """Axle forces of a Magic Formula with parameters that no longer change.
    parameters : B [1/rad], C [-], D [N], front and rear (2, 3).
    min_speed : below this speed [m/s] the forces read zero.
    relaxation_length : σ by which the slip lags (2,) [m]; 0 is no lag.
    offset : zero of the front steering δ₀ [rad] and bias b of v_y [m/s], (2,).
    """

    kind = "curve"
    lagged = True

    vehicle: Vehicle
    parameters: Array
    min_speed: float
    relaxation_length: Array = field(default_factory=lambda: np.zeros(2))
    offset: Array = field(default_factory=lambda: np.zeros(2))

    def __post_init__(self) -> None:
        require_min_speed(self.min_speed)
        if (
            self.parameters.shape != (2, 3)
            or not (np.isfinite(self.parameters) & (self.parameters > 0.0)).all()
        ):
            raise ValueError(
                f"parameters must be 2 by 3 positive numbers, they are {self.parameters.tolist()}"
            )
        longest = LONGEST * self.vehicle.wheelbase
        for name, value, low, high in (
            ("relaxation_length [m]", self.relaxation_length, 0.0, longest),
            ("offset [rad, m/s]", self.offset, -MOST_OFFSET, MOST_OFFSET),
        ):
            if value.shape != (2,) or not ((low <= value) & (value <= high)).all():
                raise ValueError(
                    f"{name} must be two numbers within {np.round(low, 6)} and "
                    f"{np.round(high, 6)}, it is {value.tolist()}"
                )

    def setup(self, dt: float) -> Setup:
        return Setup(
            scan=_scan(),
            carry=unlagged(),
            constants={
                "parameters": self.parameters,
                "lag": self.relaxation_length,
                "offset": self.offset,
                "vehicle": np.array(self.vehicle.bicycle),
                "sampling": np.array([dt, self.min_speed]),
            },
        )

    def facts(self) -> tuple[Fact, ...]:
        lag = Fact("relaxation length", self.relaxation_length, "m")
        return (*TireModel.facts(self), lag)

    def curve_expression(self, alpha: Any, v_x: Any) -> Any:
        del v_x
        return magic_formula(ca.DM(self.parameters), alpha, np.zeros(2))

    def force_expression(
        self, slip: Any, x: Any, delta: Any, v_x: Any, least_lag: Any = 0.0
    ) -> tuple[Any, Any]:
        """Return the axle forces (2,) [N] and the rate of lagged slip (2,) [rad/s].
        x : [v_y, r] (2,), as the sensors read them while learning.
        """
        u = ca.vertcat(delta, 0)
        alpha = measured_slip(self.vehicle.bicycle, self.offset, v_x, x, u)
        time = ca.fmax(ca.DM(np.maximum(self.relaxation_length, SHORTEST)) / v_x, least_lag)
        return magic_formula(ca.DM(self.parameters), slip, u), (alpha - slip) / time

    def to_dict(self) -> dict[str, Any]:
        front, rear = (dict(zip(CURVE, axle, strict=True)) for axle in self.parameters.tolist())
        return {
            "format": FORMAT,
            "kind": self.kind,
            "vehicle": vehicle_numbers(self.vehicle),
            "curve": "magic_formula",
            "min_speed_m_s": self.min_speed,
            "relaxation_length_m": self.relaxation_length.tolist(),
            "offset_rad_m_s": self.offset.tolist(),
            "front": front,
            "rear": rear,
        }

    @classmethod
    def _read(cls, table: Table) -> Self:
        curve = table.text("curve")
        if curve != "magic_formula":
            raise ValueError(f"curves {curve!r} are of an earlier version: identify again")
        axles = [[table.table(axle).number(name) for name in CURVE] for axle in ("front", "rear")]
        return cls(
            vehicle=vehicle_from(table.value("vehicle")),
            parameters=np.array(axles),
            min_speed=table.number("min_speed_m_s"),
            relaxation_length=table.array("relaxation_length_m"),
            offset=table.array("offset_rad_m_s"),
        )
