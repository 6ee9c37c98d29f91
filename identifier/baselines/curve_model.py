"""A frozen curve of axle force over slip angle: linear, Magic Formula or Dugoff."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.baselines.curves import CURVES
from identifier.baselines.ports import OVER, axle_loads, sample_ports
from identifier.method import Setup
from identifier.model_format import (
    FORMAT,
    FrozenModelError,
    require_min_speed,
    vehicle_from,
    vehicle_numbers,
)
from identifier.tire_model import TireModel, drift
from models.doors import Table
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

KIND = "curve"


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
    vehicle : the car.
    curve : one of `CURVES`.
    parameters : of the curve, front and rear (2, n), SI.
    min_speed : below this speed [m/s] the forces read zero.

    Raises
    ------
    ValueError
        Where the curve is unknown, a parameter not positive and finite, or their shape wrong.
    """

    vehicle: Vehicle
    curve: str
    parameters: NDArray[np.float64]
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

    def setup(self, recording: Recording) -> Setup:
        """Return what a replay needs.

        Parameters
        ----------
        recording : what is replayed; only its sampling interval is looked at.
        """
        return Setup(
            scan=curve_scan(self.curve),
            carry={},
            constants={
                "parameters": self.parameters,
                "vehicle": np.array(self.vehicle.bicycle),
                "sampling": np.array([recording.dt, self.min_speed]),
            },
        )

    def axle_force(self, recording: Recording) -> NDArray[np.float64]:
        """Return lateral axle forces over a recording, (n, 2) [N], frame of the body.

        Parameters
        ----------
        recording : its signals are the input; its forces are not looked at.
        """
        return self.setup(recording).run(recording)["axle_force"]

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
            "kind": KIND,
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
