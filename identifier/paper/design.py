"""A design of the paper's identifier: everything that is chosen before the car drives.

Its numbers may follow from the vehicle alone: lengths scale with the wheelbase L and times with
sqrt(L/g) (Froude), so that one rule serves a passenger car and a 1:10 model.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from codegen.errors import TireidError
from identifier.certificate import Certificate
from identifier.driving import SPEED_SPREAD, Driving, natural_driving
from identifier.method import Method
from identifier.paper.gains import gains_for
from identifier.paper.laws import INPUT_SOURCES, LAWS, Gains, diagonal
from identifier.paper.network import (
    Network,
    NetworkModel,
    Weights,
    first_weights,
    natural_network,
    network_signals,
)
from identifier.paper.step import CARRY, GAINS, OVER, PORTS, Structure, build_step
from identifier.setup import Port, Setup, in_force_unit
from identifier.stability.certificate import certify
from identifier.stability.operation import (
    Operation,
    declared_signals,
    disturbance,
    estimated_input_feedback,
    expected_residual,
)
from identifier.tire_model import TireModel
from models.bicycle import BicycleParameters, bicycle
from models.rules import require_within
from models.schema import Table, read_toml, toml_value
from models.vehicle import GRAVITY, Vehicle

_SHORTEST_STEP = 1e-4  # [s]: finer is only work
_LONGEST_STEP = 0.1  # [s]: coarser is blind


class _Variant(NamedTuple):
    """A law of the paper as it is compared: its law, and where its gains come from.
    law : one of `LAWS`.
    """

    title: str
    law: str
    gains_of: str
    scaled: bool = False

    def gains(self, found: Gains) -> Gains:
        return found.scaled_by_forgetting() if self.scaled else found


VARIANTS: Mapping[str, _Variant] = {
    "integral": _Variant("integral", "integral", "integral"),
    "instantaneous": _Variant("instantaneous", "instantaneous", "integral"),
    "instantaneous_scaled": _Variant(
        "instantaneous at eta/lambda", "instantaneous", "integral", scaled=True
    ),
    "pi_lead": _Variant("PI-lead", "pi_lead", "pi_lead"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperIdentifier(Method):
    """Network, law, gains and sampling of one identifier.

    Parameters
    ----------
    law : the driving error, "integral" (the paper's), "instantaneous" (the conventional one) or
        "pi_lead" (which needs the gain `lead`).
    input_source : where the network reads the state, "measured" or "estimated" (the paper's).
    dt : sampling interval T_s [s], of explicit Euler.
    force_unit : the unit U of forces inside the identifier [N]; gains are meant in it.
    min_speed : below this speed [m/s] learning rests and forces read zero.
    driving : the conditions that it was designed for and is judged at; None takes those of the
        car, `identifier.driving.natural_driving`.

    Raises
    ------
    ValueError
        Where a name is unknown, or a number not one of a sampled car: dt 0.1 ms to 0.1 s.
    """

    gains: Gains
    network: Network = field(default_factory=Network)
    law: str = "integral"
    input_source: str = "measured"
    dt: float = 0.01
    force_unit: float = 1000.0
    min_speed: float = 1.0
    seed: int = 0
    driving: Driving | None = None

    judged_by = "tireid check"  # on the file of the design

    def __post_init__(self) -> None:
        for name, known in (("law", LAWS), ("input_source", INPUT_SOURCES)):
            if getattr(self, name) not in known:
                raise ValueError(
                    f"{name} must be one of {list(known)}, not {getattr(self, name)!r}"
                )
        require_within(ValueError, _SHORTEST_STEP, _LONGEST_STEP, dt=self.dt)
        require_within(ValueError, 1e-6, 1e9, force_unit=self.force_unit)
        require_within(ValueError, 1e-6, 200.0, min_speed=self.min_speed)
        require_within(ValueError, 0, 2**63 - 1, seed=self.seed)

    @property
    def structure(self) -> Structure:
        """What the compiled step is built from."""
        return Structure(network=self.network, law=self.law, input_source=self.input_source)

    @classmethod
    def for_vehicle(
        cls,
        vehicle: Vehicle,
        *,
        law: str = "integral",
        network: Network | None = None,
        dt: float = 0.01,
        seed: int = 0,
    ) -> "PaperIdentifier":
        """Return the identifier of the paper with gains that follow from the car.

        The two instantaneous laws have the gains of the integral law, one as they are and one with
        η/λ, since they are there to be compared with it.

        Parameters
        ----------
        law : one of `VARIANTS`.
        network : structure; None takes `natural_network`.
        dt : sampling interval [s].
        """
        if law not in VARIANTS:
            raise ValueError(f"law must be one of {list(VARIANTS)}, not {law!r}")
        driving, gains_of = natural_driving(vehicle), VARIANTS[law].gains_of
        blank = cls(
            gains=Gains(  # until the design around them is known
                A_d=diagonal(1.0), forgetting=1.0, eta_W=0.0, eta_V=0.0, rho_W=0.0, rho_V=0.0
            ),
            network=network or natural_network(vehicle),
            law=gains_of,
            dt=dt,
            # Gains are well scaled where forces are of order one: 1 kN for a car, 1 N for a 1:10.
            force_unit=float(10.0 ** round(np.log10(vehicle.mass * GRAVITY / 15))),
            min_speed=vehicle.lowest_speed,
            seed=seed,
            driving=driving,
        )
        found = gains_for(LAWS[gains_of], blank.operation(vehicle, driving))
        return replace(blank, gains=found).with_law(law)

    def with_law(self, name: str) -> "PaperIdentifier":
        """Return it run by another law, to compare the two.

        Parameters
        ----------
        name : one of `VARIANTS`.
        """
        variant = VARIANTS[name]
        return replace(self, law=variant.law, gains=variant.gains(self.gains))

    def operation(self, vehicle: Vehicle, driving: Driving | None = None) -> Operation:
        """Return what its certificate must know.

        The V layer is judged up to twice the smallest weights that hold the expected residual with
        every unit saturated: units half open.

        Parameters
        ----------
        driving : how hard it is driven; None takes what it was designed for, else
            `natural_driving`.
        """
        driving = driving or self.driving or natural_driving(vehicle)
        found = disturbance(vehicle, driving, dt=self.dt, unit=self.force_unit)
        expected = expected_residual(vehicle, slip=driving.slip, friction=driving.friction)
        feedback = estimated_input_feedback(vehicle.bicycle, (1.0 - SPEED_SPREAD) * driving.v_x)
        estimated = self.input_source == "estimated"
        return Operation(
            n_h=self.network.hidden,
            dt=self.dt,
            bandwidth=driving.bandwidth,
            disturbance=found,
            needed_force=expected / self.force_unit,
            x_bar_max=_largest_input(self, vehicle, driving),
            V_start=2.0 * math.sqrt(self.network.hidden * len(self.network.inputs)),
            input_feedback=feedback if estimated else None,
            input_per_error=_input_per_error(self, vehicle, driving) if estimated else 0.0,
            W_large=2.0 * expected / self.force_unit / math.sqrt(self.network.hidden),
        )

    def certify(self, vehicle: Vehicle, driving: Driving | None = None) -> Certificate:
        """Return what is proven of its gains."""
        return certify(self.gains, LAWS[self.law], self.operation(vehicle, driving))

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return in_force_unit(PORTS, self.force_unit)

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; the observer starts at the first measurement.

        Parameters
        ----------
        start : weights to begin with; None draws them from the seed.

        Raises
        ------
        ValueError
            Where stored weights are those of another structure.
        """
        return Setup(
            scan=_scan(self.structure),
            carry={
                "xi_hat": np.zeros(2),
                "z": np.zeros(2),
                **first_weights(
                    self.network, start, seed=self.seed, force_unit=self.force_unit
                )._asdict(),
            },
            constants={
                "vehicle": np.array(vehicle.bicycle),
                "A_d": self.gains.matrix,
                "gains": np.array([getattr(self.gains, name) for name in GAINS]),
                "sampling": np.array([self.dt, self.force_unit, self.min_speed]),
            },
            observe=partial(_observed, vehicle, self.force_unit),
        )

    def numbers(self) -> dict[str, Any]:
        """Return all that was chosen, as plain data: gains, network, the rest and the seed."""
        return {
            "gains": asdict(self.gains),
            "network": asdict(self.network),
            "design": {
                "input_source": self.input_source, "dt_s": self.dt,
                "force_unit_N": self.force_unit, "min_speed_m_s": self.min_speed,
            },
            "seed": self.seed,
        }  # fmt: skip

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> NetworkModel:
        """Return the model with the carried weights.

        Parameters
        ----------
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


def _observed(vehicle: Vehicle, force_unit: float, x: Array) -> dict[str, Array]:
    """Return the observer's state at the first measurement."""
    return {"xi_hat": _K_inv(vehicle.bicycle) @ x / force_unit}


@lru_cache(maxsize=1024)
def _K_inv(parameters: BicycleParameters) -> Array:
    return np.array(ca.DM(bicycle(parameters, 1.0).K_inv))  # K does not depend on v_x


# What the certificate of a design must know.


def _largest_input(design: PaperIdentifier, vehicle: Vehicle, driving: Driving) -> float:
    """Bound on |x_bar| [-], noise of the sensors in it."""
    signals, slow = declared_signals(vehicle, driving), (1.0 - SPEED_SPREAD) * driving.v_x
    sideways = driving.noise_v_y + vehicle.wheelbase * driving.noise_r
    speed = driving.noise_v_x * (signals["v_y"] + vehicle.wheelbase * signals["r"]) / slow
    slip = driving.noise_delta + (sideways + speed) / (slow - driving.noise_v_x)
    noise = {
        "v_y": driving.noise_v_y, "r": driving.noise_r, "delta_f": driving.noise_delta,
        "delta_r": driving.noise_delta, "v_x": driving.noise_v_x, "alpha_f": slip, "alpha_r": slip,
    }  # fmt: skip
    assert design.network.scale is not None
    named = zip(design.network.inputs, design.network.scale, strict=True)
    return float(np.linalg.norm([(signals[name] + noise[name]) / scale for name, scale in named]))


def _input_per_error(design: PaperIdentifier, vehicle: Vehicle, driving: Driving) -> float:
    """What |ξ̃| adds to |x_bar| where the network reads x_hat = x - K ξ̃ [1/(U s)].
    driving : how hard it is driven; the slowest speed counts.
    """
    slowest = (1.0 - SPEED_SPREAD) * driving.v_x - driving.noise_v_x
    x = ca.SX.sym("x", 2)
    signals = network_signals(vehicle.bicycle, slowest, x, ca.SX.zeros(2))
    x_bar = design.network.normalized_input(signals)
    K = bicycle(vehicle.bicycle, slowest).K
    per_error = ca.jacobian(x_bar, x) @ ca.DM(K) * design.force_unit
    return float(np.linalg.norm(np.array(ca.evalf(ca.densify(per_error))), 2))


# A design as a TOML file: design.toml, read strictly and written with its units.

COMMENTS = {
    "law": "integral | instantaneous | pi_lead",
    "input_source": "the state that the network reads: measured | estimated",
    "dt": "s", "force_unit": "N, the unit U of forces in the gains",
    "min_speed": "m/s, below it learning rests", "seed": "of the initial weights",
    "A_d": "1/s, by rows, Hurwitz", "forgetting": "1/s, lambda",
    "eta_W": "1/s^4 (instantaneous: 1/s^3)", "eta_V": "1/(U^2 s^4) (instantaneous: 1/(U^2 s^3))",
    "rho_W": "1/(U s^2)", "rho_V": "1/(U s^2)",
    "lead": "s, tau of pi_lead", "hidden": "units", "inputs": "what the network reads",
    "scale": "divisors of the inputs, SI", "v_x": "m/s, give or take 5 %",
    "slip": "rad, largest slip angle of an axle", "friction": "largest of the road",
    "bandwidth": "Hz, highest frequency of the steering",
    "noise_v_x": "m/s, largest error of the sensor",
    "noise_v_y": "m/s, largest error of the sensor",
    "noise_r": "rad/s, largest error of the sensor",
    "noise_delta": "rad, largest error of the sensor",
}  # fmt: skip


class DesignFileError(TireidError, ValueError):
    """A file does not hold a design; the message names file, key and rule."""


def read_design(path: Path) -> PaperIdentifier:
    """Read a design.
    path : TOML with the keys of `PaperIdentifier`, and tables [gains], [network] and, where the
        conditions of driving are declared, [driving].
    """
    data = read_toml(path, DesignFileError)
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
    """Return a design as TOML that `read_design` reads back exactly."""
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
    return f"{name} = {toml_value(getattr(record, name))}  # {COMMENTS[name]}"
