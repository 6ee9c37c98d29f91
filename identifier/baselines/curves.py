"""Curves of axle force over slip angle whose few parameters a baseline learns.

α = δ - atan((v_y ± l r)/v_x) in the paper's sign, the negative of ISO 8855, so that F = +C α.
Each curve gives both axle forces in the frame of the body, F cos δ; only the linear one is the
paper's (3) as it stands, with neither atan nor cos.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.ports import OVER, axle_loads, sample_ports
from identifier.method import (
    FORMAT,
    FrozenModelError,
    Setup,
    require_min_speed,
    vehicle_from,
    vehicle_numbers,
)
from identifier.tire_model import TireModel, drift
from models.bicycle import BicycleParameters, linear_axle_force, slip_angles
from models.schema import Table
from models.vehicle import GRAVITY, Vehicle

TINY = 1e-9  # rad: keeps Dugoff's λ finite at zero slip, where it does not matter


class Curve(NamedTuple):
    """A curve: its parameters, named with their units, and its forces.

    force(bicycle parameters, curve parameters (2, n), loads (2,), v_x, x, u) -> (2,) [N].
    """

    parameters: tuple[str, ...]
    force: Callable[..., Any]


def wheel_slip(p: BicycleParameters, v_x: Any, x: Any, u: Any) -> Any:
    """Return slip angles α = δ - atan((v_y ± l r)/v_x) (2,) [rad].

    Parameters
    ----------
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    return u + ca.atan(slip_angles(p.l_f, p.l_r, v_x, x, u) - u)


def linear(p: BicycleParameters, q: Any, loads: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return F = C α of (3), (2,) [N].

    Parameters
    ----------
    p : of the bicycle; its stiffness is not looked at.
    q : C [N/rad] (2, 1).
    loads : not looked at.
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    del loads
    return linear_axle_force(p._replace(C_f=q[0, 0], C_r=q[1, 0]), v_x, x, u)


def magic_formula(p: BicycleParameters, q: Any, loads: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return F = D sin(C atan(B α)) cos δ, the Magic Formula without E, (2,) [N].

    Source: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., (4.49) with E = 0.

    Parameters
    ----------
    q : B [1/rad], C [-], D [N] (2, 3).
    loads : not looked at.
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    del loads
    B, C, D = q[:, 0], q[:, 1], q[:, 2]
    alpha = wheel_slip(p, v_x, x, u)
    return D * ca.sin(C * ca.atan(B * alpha)) * ca.cos(u)


def dugoff(p: BicycleParameters, q: Any, loads: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return Dugoff's force without longitudinal slip, times cos δ, (2,) [N].

    F = C tan α f(λ), λ = μ F_z/(2 C |tan α|), f = λ (2 - λ) for λ < 1, else 1.
    Source: Dugoff, Fancher and Segel, SAE 700377 (1970).

    Parameters
    ----------
    q : C [N/rad], μ [-] (2, 2).
    loads : F_z (2,) [N].
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    C, mu = q[:, 0], q[:, 1]
    slope = ca.tan(ca.fmin(ca.fmax(wheel_slip(p, v_x, x, u), -1.5), 1.5))  # short of a right angle
    lam = ca.fmin(mu * loads / (2 * C * ca.fmax(ca.fabs(slope), TINY)), 1)
    return C * slope * lam * (2 - lam) * ca.cos(u)


CURVES: Mapping[str, Curve] = {
    "linear": Curve(("C_N_rad",), linear),
    "magic_formula": Curve(("B_1_rad", "C", "D_N"), magic_formula),
    "dugoff": Curve(("C_N_rad", "mu"), dugoff),
}

# A frozen curve of axle force over slip angle: linear, Magic Formula or Dugoff.


def build_curve(name: str) -> ca.Function:
    """Return a curve as a function with one result, axle_force (2,) [N]; at rest 0.

    Parameters
    ----------
    name : one of `CURVES`.
    """
    s = sample_ports()
    q = ca.SX.sym("parameters", 2, len(CURVES[name].parameters))
    p = s.parameters
    force = CURVES[name].force(p, q, axle_loads(p, GRAVITY), s.speed, s.x, s.u)
    return ca.Function(
        f"frozen_{name}",
        [q, s.x, s.u, s.v_x, s.vehicle, s.sampling],
        [ca.if_else(s.moving, force, 0)],
        ["parameters", *OVER, "vehicle", "sampling"],
        ["axle_force"],
    )


@cache
def curve_scan(name: str) -> Scan:
    """Return the compiled loop of `build_curve`.

    Parameters
    ----------
    name : one of `CURVES`.
    """
    return Scan(build_curve(name), carry=(), over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CurveModel(TireModel):
    """Axle forces of a curve with parameters that no longer change.

    Parameters
    ----------
    curve : one of `CURVES`.
    parameters : of the curve, front and rear (2, n), SI.
    min_speed : below this speed [m/s] the forces read zero.

    Raises
    ------
    ValueError
        Where the curve is unknown, a parameter not positive and finite, or their shape wrong.
    """

    kind = "curve"

    vehicle: Vehicle
    curve: str
    parameters: Array
    min_speed: float

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

    def setup(self, dt: float) -> Setup:
        """Return what a replay needs.

        Parameters
        ----------
        dt : sampling interval of what is replayed [s].
        """
        return Setup(
            scan=curve_scan(self.curve),
            carry={},
            constants={
                "parameters": self.parameters,
                "vehicle": np.array(self.vehicle.bicycle),
                "sampling": np.array([dt, self.min_speed]),
            },
        )

    def curve_expression(self, alpha: Any, v_x: Any) -> Any:
        """Return the steady axle forces (2,) [N] as a CasADi expression.

        Parameters
        ----------
        alpha : slip angles (2,) [rad], the wheels straight ahead.
        v_x : longitudinal speed [m/s].
        """
        slope = alpha if self.curve == "linear" else ca.tan(alpha)
        return self._static_force(drift(self.vehicle, slope, v_x), 0.0, v_x)

    def force_expression(
        self, slip: Any, x: Any, delta: Any, v_x: Any, least_lag: Any = 0.0
    ) -> tuple[Any, Any]:
        """Return the axle forces (2,) [N] as a CasADi expression, and no rate: nothing lags.

        Parameters
        ----------
        slip : empty.
        x : [v_y, r] (2,).
        delta : angle of the front wheels [rad].
        v_x : longitudinal speed [m/s], positive.
        least_lag : not looked at.
        """
        del slip, least_lag
        return self._static_force(x, delta, v_x), ca.MX(0, 1)

    def _static_force(self, x: Any, delta: Any, v_x: Any) -> Any:
        q, p = ca.DM(self.parameters), self.vehicle.bicycle
        loads = ca.DM(self.vehicle.axle_loads)
        return CURVES[self.curve].force(p, q, loads, v_x, x, ca.vertcat(delta, 0))

    def to_dict(self) -> dict[str, Any]:
        """Return the model as plain numbers and words, ready for JSON."""
        names = CURVES[self.curve].parameters
        return {
            "format": FORMAT,
            "kind": self.kind,
            "vehicle": vehicle_numbers(self.vehicle),
            "curve": self.curve,
            "min_speed_m_s": self.min_speed,
            "front": dict(zip(names, self.parameters[0].tolist(), strict=True)),
            "rear": dict(zip(names, self.parameters[1].tolist(), strict=True)),
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any], source: str) -> "CurveModel":
        """Return the model that `to_dict` describes.

        Parameters
        ----------
        data : as from `to_dict`.
        source : name of the file, for errors.

        Raises
        ------
        FrozenModelError
            Where a key is missing or a value impossible.
        """
        try:
            table = Table(data, "", FrozenModelError)
            curve = table.text("curve")
            if curve not in CURVES:
                raise ValueError(f"curve must be one of {list(CURVES)}, not {curve!r}")
            names = CURVES[curve].parameters
            axles = [
                [table.table(axle).number(name) for name in names] for axle in ("front", "rear")
            ]
            return cls(
                vehicle=vehicle_from(table.value("vehicle")),
                curve=curve,
                parameters=np.array(axles),
                min_speed=table.number("min_speed_m_s"),
            )
        except ValueError as error:
            raise FrozenModelError(f"{source}: {error}") from error
