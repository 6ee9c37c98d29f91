"""Curves of axle force over slip angle whose few parameters a baseline learns.

α = δ - atan((v_y ± l r)/v_x) in the paper's sign, the negative of ISO 8855, so that F = +C α.
Each curve gives both axle forces in the frame of the body, F cos δ; only the linear one is the
paper's (3) as it stands, with neither atan nor cos. A frozen curve reads the slip with the offsets
of the sensors taken off, lagged by the relaxation length; both may be zero.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.chosen import CHOSEN
from identifier.baselines.ports import (
    LAG_PORTS,
    OVER,
    axle_loads,
    lag_symbols,
    lagged_slip,
    sample_ports,
)
from identifier.frozen import (
    FORMAT,
    require_min_speed,
    vehicle_from,
    vehicle_numbers,
)
from identifier.setup import Setup
from identifier.tire_model import Fact, TireModel
from models.bicycle import BicycleParameters, slip_angles
from models.schema import Table
from models.vehicle import GRAVITY, Vehicle

_MOST_OFFSET = np.array([0.5, 10.0])  # rad and m/s: beyond it a sensor is not mounted, but broken


class Curve(NamedTuple):
    """A curve: its parameters, named with their units, the slip it reads, and its forces.

    slip(bicycle parameters, v_x, x, u) -> α (2,) [rad].
    force(curve parameters (2, n), loads (2,) [N], α (2,) [rad], u (2,) [rad]) -> (2,) [N].
    """

    parameters: tuple[str, ...]
    slip: Callable[..., Any]
    force: Callable[..., Any]


def _small_slip(p: BicycleParameters, v_x: Any, x: Any, u: Any) -> Any:
    """Return slip angles α = δ - (v_y ± l r)/v_x of (3), (2,) [rad].
    v_x : longitudinal speed [m/s], not zero.   x : [v_y, r] (2,).   u : [δ_f, δ_r] (2,).
    """
    return slip_angles(p.l_f, p.l_r, v_x, x, u)


def _wheel_slip(p: BicycleParameters, v_x: Any, x: Any, u: Any) -> Any:
    """Return slip angles α = δ - atan((v_y ± l r)/v_x) (2,) [rad].
    v_x : longitudinal speed [m/s], not zero.   x : [v_y, r] (2,).   u : [δ_f, δ_r] (2,).
    """
    return u + ca.atan(_small_slip(p, v_x, x, u) - u)


def linear(q: Any, loads: Any, alpha: Any, u: Any) -> Any:
    """Return F = C α of (3), (2,) [N].   q : C [N/rad] (2, 1).   alpha : slip angles (2,) [rad]."""
    del loads, u
    return q[:, 0] * alpha


def magic_formula(q: Any, loads: Any, alpha: Any, u: Any) -> Any:
    """Return F = D sin(C atan(B α)) cos δ, the Magic Formula without E, (2,) [N].

    Source: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., (4.49) with E = 0.
    q : B [1/rad], C [-], D [N] (2, 3).   alpha : slip angles (2,) [rad].   u : [δ_f, δ_r] (2,).
    """
    del loads
    B, C, D = q[:, 0], q[:, 1], q[:, 2]
    return D * ca.sin(C * ca.atan(B * alpha)) * ca.cos(u)


def dugoff(q: Any, loads: Any, alpha: Any, u: Any) -> Any:
    """Return Dugoff's force without longitudinal slip, times cos δ, (2,) [N].

    F = C tan α f(λ), λ = μ F_z/(2 C |tan α|), f = λ (2 - λ) for λ < 1, else 1.
    Source: Dugoff, Fancher and Segel, SAE 700377 (1970).
    q : C [N/rad], μ [-] (2, 2).   loads : F_z (2,) [N].   alpha : slip angles (2,) [rad].
    u : [δ_f, δ_r] (2,).
    """
    C, mu = q[:, 0], q[:, 1]
    slope = ca.tan(ca.fmin(ca.fmax(alpha, -1.5), 1.5))  # short of a right angle
    lam = ca.fmin(mu * loads / (2 * C * ca.fmax(ca.fabs(slope), CHOSEN.tiny)), 1)
    return C * slope * lam * (2 - lam) * ca.cos(u)


CURVES: Mapping[str, Curve] = {
    "linear": Curve(("C_N_rad",), _small_slip, linear),
    "magic_formula": Curve(("B_1_rad", "C", "D_N"), _wheel_slip, magic_formula),
    "dugoff": Curve(("C_N_rad", "mu"), _wheel_slip, dugoff),
}


def measured_slip(curve: Curve, p: BicycleParameters, offset: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return the slip angles of a curve, the offsets of the sensors taken off, (2,) [rad].
    offset : zero of the front steering δ₀ [rad], which is added, and bias b of v_y [m/s], (2,).
    v_x : longitudinal speed [m/s], not zero.   x : [v_y, r] as the sensors read them (2,).
    u : [δ_f, δ_r] (2,).
    """
    return curve.slip(p, v_x, x - ca.vertcat(offset[1], 0), u + ca.vertcat(offset[0], 0))


# A frozen curve of axle force over slip angle: linear, Magic Formula or Dugoff.


def _build_curve(name: str, *, lagged: bool) -> ca.Function:
    """Return a curve as a step with one output, axle_force (2,) [N]; at rest 0.

    Carried: `LaggedSlip` where it lags, else nothing. Constant: parameters of the curve (2, n),
    offset (2,) = δ₀ [rad] and b [m/s], and where it lags lag (2,) = σ [m].
    name : one of `CURVES`.
    """
    s, last = sample_ports(), lag_symbols()
    q = ca.SX.sym("parameters", 2, len(CURVES[name].parameters))
    sigma, offset = ca.SX.sym("lag", 2), ca.SX.sym("offset", 2)
    p, carry = s.parameters, LAG_PORTS if lagged else ()
    alpha = measured_slip(CURVES[name], p, offset, s.speed, s.x, s.u)
    slip = lagged_slip(last, alpha, s.speed * s.sampling[0], sigma) if lagged else alpha
    force = CURVES[name].force(q, axle_loads(p, GRAVITY), slip, s.u)
    return ca.Function(
        f"frozen_{name}",
        [
            *last[: len(carry)],
            *(q, offset, s.x, s.u, s.v_x, s.vehicle, s.sampling),
            *((sigma,) if lagged else ()),
        ],
        [*(slip, alpha, ca.if_else(s.moving, 1, 0))[: len(carry)], ca.if_else(s.moving, force, 0)],
        [
            *(*carry, "parameters", "offset", *OVER, "vehicle", "sampling"),
            *(("lag",) if lagged else ()),
        ],
        [*(f"{port}_next" for port in carry), "axle_force"],
    )


@cache
def _curve_scan(name: str, *, lagged: bool) -> Scan:
    return Scan(_build_curve(name, lagged=lagged), carry=LAG_PORTS if lagged else (), over=OVER)


def unlagged() -> dict[str, Array]:
    """Return the carried values of a lag that has not begun, by port."""
    return {"slip": np.zeros(2), "alpha": np.zeros(2), "begun": np.zeros(1)}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class CurveModel(TireModel):
    """Axle forces of a curve with parameters that no longer change.
    curve : one of `CURVES`.   parameters : of the curve, front and rear (2, n), SI.
    min_speed : below this speed [m/s] the forces read zero.
    relaxation_length : σ by which the slip lags (2,) [m]; 0 is no lag.
    offset : zero of the front steering δ₀ [rad] and bias b of v_y [m/s], (2,).
    """

    kind = "curve"

    vehicle: Vehicle
    curve: str
    parameters: Array
    min_speed: float
    relaxation_length: Array = field(default_factory=lambda: np.zeros(2))
    offset: Array = field(default_factory=lambda: np.zeros(2))

    def __post_init__(self) -> None:
        if self.curve not in CURVES:
            raise ValueError(f"curve must be one of {list(CURVES)}, not {self.curve!r}")
        require_min_speed(self.min_speed)
        shape = (2, len(CURVES[self.curve].parameters))
        if self.parameters.shape != shape:
            raise ValueError(
                f"parameters must have shape {shape}, they have {self.parameters.shape}"
            )
        if not (np.isfinite(self.parameters) & (self.parameters > 0.0)).all():
            raise ValueError(f"parameters must be positive, they are {self.parameters.tolist()}")
        longest = CHOSEN.longest * self.vehicle.wheelbase
        for name, value, low, high in (
            ("relaxation_length [m]", self.relaxation_length, 0.0, longest),
            ("offset [rad, m/s]", self.offset, -_MOST_OFFSET, _MOST_OFFSET),
        ):
            if value.shape != (2,) or not ((low <= value) & (value <= high)).all():
                raise ValueError(
                    f"{name} must be two numbers within {np.round(low, 6)} and "
                    f"{np.round(high, 6)}, it is {value.tolist()}"
                )

    def setup(self, dt: float) -> Setup:
        return Setup(
            scan=_curve_scan(self.curve, lagged=self.lagged),
            carry=unlagged() if self.lagged else {},
            constants={
                "parameters": self.parameters,
                **({"lag": self.relaxation_length} if self.lagged else {}),
                "offset": self.offset,
                "vehicle": np.array(self.vehicle.bicycle),
                "sampling": np.array([dt, self.min_speed]),
            },
        )

    @property
    def lagged(self) -> bool:
        return bool((self.relaxation_length > 0.0).any())

    def facts(self) -> tuple[Fact, ...]:
        lag = Fact("relaxation length", self.relaxation_length, "m")
        return (*TireModel.facts(self), *((lag,) if self.lagged else ()))

    def curve_expression(self, alpha: Any, v_x: Any) -> Any:
        del v_x
        return self._force(alpha, 0.0)

    def force_expression(
        self, slip: Any, x: Any, delta: Any, v_x: Any, least_lag: Any = 0.0
    ) -> tuple[Any, Any]:
        """Return the axle forces (2,) [N] and the rate of lagged slip, (2,) or none [rad/s].
        x : [v_y, r] (2,), as the sensors read them while learning.
        """
        p, u = self.vehicle.bicycle, ca.vertcat(delta, 0)
        alpha = measured_slip(CURVES[self.curve], p, self.offset, v_x, x, u)
        if not self.lagged:
            return self._force(alpha, delta), ca.MX(0, 1)
        time = ca.fmax(ca.DM(np.maximum(self.relaxation_length, CHOSEN.shortest)) / v_x, least_lag)
        return self._force(slip, delta), (alpha - slip) / time

    def _force(self, alpha: Any, delta: Any) -> Any:
        q, loads = ca.DM(self.parameters), ca.DM(self.vehicle.axle_loads)
        return CURVES[self.curve].force(q, loads, alpha, ca.vertcat(delta, 0))

    def to_dict(self) -> dict[str, Any]:
        names = CURVES[self.curve].parameters
        return {
            "format": FORMAT,
            "kind": self.kind,
            "vehicle": vehicle_numbers(self.vehicle),
            "curve": self.curve,
            "min_speed_m_s": self.min_speed,
            "relaxation_length_m": self.relaxation_length.tolist(),
            "offset_rad_m_s": self.offset.tolist(),
            "front": dict(zip(names, self.parameters[0].tolist(), strict=True)),
            "rear": dict(zip(names, self.parameters[1].tolist(), strict=True)),
        }

    @classmethod
    def _read(cls, table: Table) -> Self:
        curve = table.text("curve")
        if curve not in CURVES:
            raise ValueError(f"curve must be one of {list(CURVES)}, not {curve!r}")
        names = CURVES[curve].parameters
        axles = [[table.table(axle).number(name) for name in names] for axle in ("front", "rear")]
        return cls(
            vehicle=vehicle_from(table.value("vehicle")),
            curve=curve,
            parameters=np.array(axles),
            min_speed=table.number("min_speed_m_s"),
            **{  # files of earlier versions have neither
                name: table.array(key)
                for name, key in (
                    ("relaxation_length", "relaxation_length_m"),
                    ("offset", "offset_rad_m_s"),
                )
                if key in table
            },
        )
