"""A design of the paper's identifier: everything that is chosen before the car drives."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.method import Setup
from identifier.paper.laws import DRIVING_ERRORS, INPUT_SOURCES, INTEGRATORS, Gains
from identifier.paper.network import Network, NetworkModel, Weights
from identifier.paper.step import CARRY, GAINS, OVER, Structure, build_step
from identifier.tire_model import TireModel
from models.bicycle import BicycleParameters, bicycle
from models.recordings import Recording
from models.rules import require_within
from models.schema import Table, read_toml
from models.vehicle import GRAVITY, Vehicle

# How hard a car is driven: the conditions that a design is made for, judged at, and stored with.
#
# A bound that is proven holds on every drive that keeps all of them; a drive that breaks one proves
# nothing. They stand in design.toml, so that the same file is judged alike wherever it is judged.

SPEED_SPREAD = 0.05  # of the speed, give or take
RANGES = {  # SI, of what is driven on wheels
    "v_x": (0.01, 150.0),
    "slip": (1e-4, 1.5),
    "friction": (1e-3, 10.0),
    "bandwidth": (1e-3, 1e3),
    "noise_v_y": (0.0, 150.0),
    "noise_r": (0.0, 100.0),
    "noise_delta": (0.0, 1.5),
}
YAW_OVERSHOOT = 1.5  # largest yaw rate, of the steady one at the friction limit


@dataclass(frozen=True, slots=True, kw_only=True)
class Driving:
    """Conditions of driving, SI.

    The sensors may err by as much as the noise at every sample, in any direction: it is a largest
    error, not a standard deviation.

    Parameters
    ----------
    v_x : speed [m/s], give or take `SPEED_SPREAD`.
    slip : largest slip angle of an axle [rad].
    friction : largest μ of the road [-]; an axle pushes with at most μ times its load.
    bandwidth : highest frequency of the steering [Hz].
    noise_v_x : largest error of the speed [m/s].
    noise_v_y : largest error of the lateral velocity [m/s].
    noise_r : largest error of the yaw rate [rad/s].
    noise_delta : largest error of a steering angle [rad].

    Raises
    ------
    ValueError
        Where a condition is not positive or outside `RANGES`, or a noise negative, not a number or
        beyond the speed.
    """

    v_x: float
    slip: float
    friction: float
    bandwidth: float
    noise_v_x: float = 0.0
    noise_v_y: float = 0.0
    noise_r: float = 0.0
    noise_delta: float = 0.0

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            lowest = value >= 0.0 if one.name.startswith("noise") else value > 0.0
            if not (lowest and math.isfinite(value)):
                rule = "not be negative" if one.name.startswith("noise") else "be positive"
                raise ValueError(f"{one.name} must {rule} and finite, it is {value}")
        for name, (least, most) in RANGES.items():
            require_within(ValueError, least, most, **{name: getattr(self, name)})
        if not self.noise_v_x < 0.5 * self.v_x:
            raise ValueError(f"noise_v_x must be below half the speed, it is {self.noise_v_x}")


SHORTEST_STEP, LONGEST_STEP = 1e-4, 0.1  # [s]: finer is only work, coarser is blind


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperIdentifier:
    """Network, law, gains and sampling of one identifier.

    Parameters
    ----------
    gains : gains of observer, filter and laws.
    network : structure of the network.
    law : the driving error, "integral" (the paper's), "instantaneous" (the conventional one) or
        "pi_lead" (which needs the gain `lead`).
    input_source : where the network reads the state, "measured" or "estimated" (the paper's).
    integrator : "euler" or "rk4".
    dt : sampling interval T_s [s].
    force_unit : the unit U of forces inside the identifier [N]; gains are meant in it.
    min_speed : below this speed [m/s] learning rests and forces read zero.
    seed : seed of the initial weights.
    driving : the conditions that it was designed for and is judged at; None takes those of the
        car, `identifier.defaults.natural_driving`.

    Raises
    ------
    ValueError
        Where a name is unknown, or a number not one of a sampled car: dt 0.1 ms to 0.1 s.
    """

    gains: Gains
    network: Network = field(default_factory=Network)
    law: str = "integral"
    input_source: str = "measured"
    integrator: str = "euler"
    dt: float = 0.01
    force_unit: float = 1000.0
    min_speed: float = 1.0
    seed: int = 0
    driving: Driving | None = None

    def __post_init__(self) -> None:
        for name, known in (
            ("law", DRIVING_ERRORS),
            ("input_source", INPUT_SOURCES),
            ("integrator", INTEGRATORS),
        ):
            if getattr(self, name) not in known:
                raise ValueError(
                    f"{name} must be one of {list(known)}, not {getattr(self, name)!r}"
                )
        require_within(ValueError, SHORTEST_STEP, LONGEST_STEP, dt=self.dt)
        require_within(ValueError, 1e-6, 1e9, force_unit=self.force_unit)
        require_within(ValueError, 1e-6, 200.0, min_speed=self.min_speed)
        require_within(ValueError, 0, 2**63 - 1, seed=self.seed)

    @property
    def structure(self) -> Structure:
        """What the compiled step is built from."""
        return Structure(
            network=self.network,
            law=self.law,
            input_source=self.input_source,
            integrator=self.integrator,
            projects=bool(np.isfinite(self.gains.W_max) or np.isfinite(self.gains.V_max)),
            rests=bool(self.gains.W_free > 0.0 or self.gains.V_free > 0.0),
        )

    @classmethod
    def for_vehicle(
        cls, vehicle: Vehicle, *, law: str = "integral", dt: float = 0.01, seed: int = 0
    ) -> "PaperIdentifier":
        """Return the identifier of the paper with gains that follow from the car.

        Parameters
        ----------
        vehicle : the car.
        law : "integral", "instantaneous", "instantaneous_scaled" (at η/λ) or "pi_lead".
        dt : sampling interval [s].
        seed : seed of the initial weights.

        Raises
        ------
        ValueError
            Where the law is unknown.
        """
        from identifier.defaults import paper_identifier  # it finds gains for designs like this one

        return paper_identifier(vehicle, law=law, dt=dt, seed=seed)

    def setup(
        self, vehicle: Vehicle, recording: Recording, start: TireModel | None = None
    ) -> Setup:
        """Return what a run needs; the observer starts at the first measurement.

        Parameters
        ----------
        vehicle : the car as the identifier is told of it.
        recording : what it will run over.
        start : weights to begin with; None draws them from the seed.

        Raises
        ------
        ValueError
            Where stored weights are those of another structure.
        """
        return Setup(
            scan=_scan(self.structure),
            carry={
                "xi_hat": axle_impulse(recording.x[0], vehicle) / self.force_unit,
                "z": np.zeros(2),
                **self._first_weights(start)._asdict(),
            },
            constants={
                "vehicle": np.array(vehicle.bicycle),
                "A_d": self.gains.matrix,
                "gains": np.array([getattr(self.gains, name) for name in GAINS]),
                "sampling": np.array([self.dt, self.force_unit, self.min_speed]),
            },
        )

    def _first_weights(self, start: TireModel | None) -> Weights:
        if start is None:
            return self.network.initial_weights(np.random.default_rng(self.seed))
        if not isinstance(start, NetworkModel) or start.network != self.network:
            raise ValueError("the stored weights are of another structure than the design's")
        return Weights(W=start.weights.W * (start.force_unit / self.force_unit), V=start.weights.V)

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> NetworkModel:
        """Return the model with the carried weights.

        Parameters
        ----------
        vehicle : the car.
        state : W (2, n_h) and V (n_h, n_in).
        """
        return NetworkModel(
            vehicle=vehicle,
            network=self.network,
            weights=Weights(W=state["W"].copy(), V=state["V"].copy()),
            force_unit=self.force_unit,
            min_speed=self.min_speed,
        )


@cache
def _scan(structure: Structure) -> Scan:
    return Scan(build_step(structure), carry=CARRY, over=OVER)


def axle_impulse(x: Array, vehicle: Vehicle) -> Array:
    """Return ξ = K⁻¹ x of (7), (2,) [N s].

    Parameters
    ----------
    x : [v_y, r] (2,).
    vehicle : the car, which gives K.
    """
    impulse: Array = _K_inv(vehicle.bicycle) @ x
    return impulse


@lru_cache(maxsize=1024)
def _K_inv(parameters: BicycleParameters) -> Array:
    return np.array(ca.DM(bicycle(parameters, 1.0).K_inv))  # K does not depend on v_x


def natural_force_unit(mass: float) -> float:
    """Return the power of ten [N] nearest to a fifteenth of a car's weight.

    The gains are well scaled where forces are of order one: 1 kN for a passenger car, 1 N for a
    1:10 model.

    Parameters
    ----------
    mass : mass of the car [kg].
    """
    return float(10.0 ** round(np.log10(mass * GRAVITY / 15)))


# A design as a TOML file: design.toml, read strictly and written with its units.

COMMENTS = {
    "law": "integral | instantaneous | pi_lead",
    "input_source": "the state that the network reads: measured | estimated",
    "integrator": "euler | rk4",
    "dt": "s",
    "force_unit": "N, the unit U of forces in the gains",
    "min_speed": "m/s, below it learning rests",
    "seed": "of the initial weights",
    "A_d": "1/s, by rows, Hurwitz",
    "forgetting": "1/s, lambda",
    "eta_W": "1/s^4 (instantaneous: 1/s^3)",
    "eta_V": "1/(U^2 s^4) (instantaneous: 1/(U^2 s^3))",
    "rho_W": "1/(U s^2)",
    "rho_V": "1/(U s^2)",
    "W_max": "U, projection of W (inf: none)",
    "V_max": "projection of V (inf: none)",
    "W_free": "U, dead zone of the leakage of W (0: all of W leaks, the paper's)",
    "V_free": "dead zone of the leakage of V (0: all of V leaks, the paper's)",
    "lead": "s, tau of pi_lead",
    "hidden": "units",
    "inputs": "what the network reads",
    "scale": "divisors of the inputs, SI",
    "v_x": "m/s, give or take 5 %",
    "slip": "rad, largest slip angle of an axle",
    "friction": "largest of the road",
    "bandwidth": "Hz, highest frequency of the steering",
    "noise_v_x": "m/s, largest error of the sensor",
    "noise_v_y": "m/s, largest error of the sensor",
    "noise_r": "rad/s, largest error of the sensor",
    "noise_delta": "rad, largest error of the sensor",
}


class DesignFileError(ValueError):
    """A file does not hold a design; the message names file, key and rule."""


def read_design(path: Path) -> PaperIdentifier:
    """Read a design.

    Parameters
    ----------
    path : TOML with the keys of `PaperIdentifier`, and tables [gains], [network] and, where the
        conditions of driving are declared, [driving].

    Raises
    ------
    DesignFileError
        One line with file, key and rule.
    """
    try:
        data = read_toml(path, DesignFileError)
    except OSError as error:
        raise DesignFileError(f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    inner = {name: data.pop(name, None) for name in TABLES}
    gains, network, driving = (
        None if part is None else Table(part, f"{path}: ", DesignFileError, f"{name}.").record(cls)
        for (name, part), cls in zip(inner.items(), (Gains, Network, Driving), strict=True)
    )
    values = Table(data, f"{path}: ", DesignFileError).record(PaperIdentifier, skip=TABLES)
    if gains is None:
        raise DesignFileError(f"{path}: the table [gains] is missing")
    try:
        return PaperIdentifier(
            gains=Gains(**gains),
            network=Network(**(network or {})),
            driving=None if driving is None else Driving(**driving),
            **values,
        )
    except ValueError as error:
        raise DesignFileError(f"{path}: {error}") from None


def design_text(design: PaperIdentifier) -> str:
    """Return a design as TOML that `read_design` reads back exactly.

    Parameters
    ----------
    design : the design.
    """
    lines = [
        _line(design, field.name) for field in fields(PaperIdentifier) if field.name not in TABLES
    ]
    for name in TABLES:
        record = getattr(design, name)
        if record is None:
            continue
        lines += ["", f"[{name}]", *(_line(record, field.name) for field in fields(record))]
    return "\n".join(lines) + "\n"


TABLES = ("gains", "network", "driving")


def _line(record: Any, name: str) -> str:
    return f"{name} = {_toml(getattr(record, name))}  # {COMMENTS[name]}"


def _toml(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(item) for item in value)}]"
    if isinstance(value, float):
        return "inf" if math.isinf(value) else repr(float(value))
    return json.dumps(value)
