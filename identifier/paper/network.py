"""The one-hidden-layer network f̂ = Ŵ tanh(V̂ x̄) and its inputs.

x̄ = (chosen signals) / (their scales), (n_in,).   Ŵ: (2, n_h) in the force unit.   V̂: (n_h, n_in).
There is no bias: f̂ is odd in x̄, as the residual of a symmetric tire is, and f̂(0) = 0.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from codegen.elementary import tanh
from identifier.axle.car import step_function, symbols
from identifier.driving import REFERENCE_WHEELBASE
from identifier.frozen import (
    FORMAT,
    require_min_speed,
    vehicle_from,
    vehicle_numbers,
)
from identifier.method import OTHER_STRUCTURE, resumed
from identifier.setup import Setup
from identifier.tire_model import StaticModel, TireModel
from models.bicycle import BicycleParameters, linear_axle_force, slip_angles
from models.rules import require_positive, require_within
from models.schema import Table, require_few
from models.vehicle import Vehicle

_LARGEST_SUM = 1e9  # of the units of an axle together [N]: what cancels may be large
_LARGEST_V = 1e9  # [-], beyond which tanh is a sign at the slip of a resting car

# Signals that may enter the network, each with the value that counts as large for a passenger car.
SIGNALS: Mapping[str, float] = {
    "v_y": 1.0,  # m/s
    "r": 0.5,  # rad/s
    "delta_f": 0.1,  # rad
    "delta_r": 0.1,  # rad
    "v_x": 20.0,  # m/s
    "alpha_f": 0.1,  # rad
    "alpha_r": 0.1,  # rad
}


class Weights(NamedTuple):
    """Weights of the network: W (2, n_h) in the force unit and V (n_h, n_in)."""

    W: Array
    V: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """Structure of the network: size, inputs and their scales.
    hidden : number of hidden units n_h.
    inputs : signals of x̄, chosen among `SIGNALS`, each at most once.
    scale : divisor of each input in its own unit (m/s, rad/s, rad); None takes those of `SIGNALS`.
    """

    hidden: int = 10
    inputs: tuple[str, ...] = ("v_y", "r", "delta_f", "delta_r")
    scale: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "inputs", tuple(self.inputs))  # a list would not hash
        if self.scale is not None:
            object.__setattr__(self, "scale", tuple(self.scale))
        if self.hidden < 1:
            raise ValueError(f"hidden must be at least 1, it is {self.hidden}")
        require_few(ValueError, "hidden", self.hidden, "hidden", "units")
        unknown = [name for name in self.inputs if name not in SIGNALS]
        if unknown or not self.inputs or len(set(self.inputs)) < len(self.inputs):
            raise ValueError(f"inputs must be chosen among {list(SIGNALS)}, they are {self.inputs}")
        if self.scale is None:
            object.__setattr__(self, "scale", tuple(SIGNALS[name] for name in self.inputs))
        elif len(self.scale) != len(self.inputs) or not all(0 < s < np.inf for s in self.scale):
            raise ValueError(
                f"scale must hold {len(self.inputs)} positive numbers, is {self.scale}"
            )
        assert self.scale is not None
        require_within(ValueError, 1e-6, 1e6, scale=min(self.scale))
        require_within(ValueError, 1e-6, 1e6, scale=max(self.scale))

    def initial_weights(self, rng: np.random.Generator) -> Weights:
        """Return W = 0, which starts at the linear tire, and random V.
        rng : generator of V, drawn from a normal distribution of standard deviation 1.
        """
        return Weights(
            W=np.zeros((2, self.hidden)), V=rng.standard_normal((self.hidden, len(self.inputs)))
        )

    def normalized_input(self, signals: Mapping[str, Any]) -> Any:
        """Return x̄ (n_in,), without unit.
        signals : the CasADi expression of every signal of `inputs`, SI.
        """
        assert self.scale is not None
        pairs = zip(self.inputs, self.scale, strict=True)
        return ca.vertcat(*(signals[name] * (1 / scale) for name, scale in pairs))


def natural_network(vehicle: Vehicle) -> Network:
    """Return a network whose input scales fit the size of the car."""
    ratio = float(np.sqrt(vehicle.wheelbase / REFERENCE_WHEELBASE))
    usual = Network()
    froude = {"v_y": ratio, "r": 1 / ratio}
    scale = tuple(float(SIGNALS[name] * froude.get(name, 1.0)) for name in usual.inputs)
    return Network(scale=scale)


def hidden_layer(V: Any, x_bar: Any) -> Any:
    """Return σ = tanh(V x̄), (n_h,), by the rational tanh that every machine computes alike.
    V : weights (n_h, n_in).   x_bar : scaled input (n_in,).
    """
    return tanh(V @ x_bar)


def network_signals(parameters: BicycleParameters, v_x: Any, x: Any, u: Any) -> dict[str, Any]:
    """Return every signal that a network may read, by name, SI.
    v_x : longitudinal speed [m/s], not zero.   x : [v_y, r] (2,).   u : [δ_f, δ_r] (2,).
    """
    alpha = slip_angles(parameters.l_f, parameters.l_r, v_x, x, u)
    given = (x[0], x[1], u[0], u[1], v_x, alpha[0], alpha[1])
    return dict(zip(SIGNALS, given, strict=True))


# The paper's network, frozen: weights at one instant and all that axle forces need.


@cache
def _frozen(network: Network) -> tuple[ca.Function, dict[str, Any]]:
    """Return axle_force (2,) [N] as a function of weights, state and steering, and its ports.

    Ports: W (2, n_h) and V (n_h, n_in); x = [v_y, r], u = [δ_f, δ_r], v_x, SI; vehicle (6,) = m,
    I_z, l_f, l_r, C_f, C_r; force_unit [N].
    """
    n_h, n_in = network.hidden, len(network.inputs)
    ports, s = symbols(
        W=(2, n_h), V=(n_h, n_in), x=2, u=2, v_x=1, vehicle=BicycleParameters, force_unit=1
    )
    x_bar = network.normalized_input(network_signals(s.vehicle, s.v_x, s.x, s.u))
    force = linear_axle_force(s.vehicle, s.v_x, s.x, s.u)
    force = force + s.force_unit * (s.W @ hidden_layer(s.V, x_bar))
    return step_function("frozen_network", ports, {}, {"axle_force": force}), ports


@cache
def _replay_scan(network: Network) -> Scan:
    """Return the frozen model as it is replayed: no force below min_speed [m/s], a further port."""
    frozen, ports = _frozen(network)
    min_speed, v_x = ca.SX.sym("min_speed"), ports["v_x"]
    force = frozen(*(ports | {"v_x": ca.fmax(v_x, min_speed)}).values())
    ports = ports | {"min_speed": min_speed}
    moving = ca.if_else(v_x >= min_speed, force, 0)
    step = step_function("replayed_network", ports, {}, {"axle_force": moving})
    return Scan(step, carry=(), over=("x", "u", "v_x"))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class NetworkModel(StaticModel):
    """Axle forces F_y = C α + U Ŵ tanh(V̂ x̄) with weights that no longer change.
    weights : W (2, n_h) in the force unit and V (n_h, n_in).   force_unit : U [N].
    min_speed : below this speed [m/s] the forces read zero.
    """

    kind = "network"

    vehicle: Vehicle
    network: Network
    weights: Weights
    force_unit: float
    min_speed: float

    def __post_init__(self) -> None:
        require_positive(ValueError, force_unit=self.force_unit)
        require_min_speed(self.min_speed)
        n_h, n_in = self.network.hidden, len(self.network.inputs)
        for name, value, shape in (
            ("W", self.weights.W, (2, n_h)),
            ("V", self.weights.V, (n_h, n_in)),
        ):
            if value.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, it has {value.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} holds a number that is not finite: the law has diverged")
        with np.errstate(over="ignore"):  # beyond the limit, too
            largest = self.force_unit * np.abs(self.weights.W).sum(axis=1).max()
        require_within(ValueError, 0.0, _LARGEST_SUM, **{"force_unit times |W|": largest})
        require_within(ValueError, 0.0, _LARGEST_V, **{"|V|": np.abs(self.weights.V).max()})

    def setup(self, dt: float) -> Setup:
        del dt
        return Setup(
            scan=_replay_scan(self.network),
            carry={},
            constants={
                "W": self.weights.W,
                "V": self.weights.V,
                "vehicle": np.array(self.vehicle.bicycle),
                "force_unit": np.array(self.force_unit),
                "min_speed": np.array(self.min_speed),
            },
        )

    def static_force(self, x: Any, delta: Any, v_x: Any) -> Any:
        W, V = self.weights
        vehicle, unit = self.vehicle.bicycle, self.force_unit
        u = ca.vertcat(delta, 0)
        return _frozen(self.network)[0](W, V, x, u, v_x, ca.vertcat(*vehicle), unit)

    def to_dict(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "kind": self.kind,
            "units": {"W": "force_unit_N newtons", "V": "-", "scale": "SI, by input"},
            "vehicle": vehicle_numbers(self.vehicle),
            "network": asdict(self.network),
            "force_unit_N": self.force_unit,
            "min_speed_m_s": self.min_speed,
            "W": self.weights.W.tolist(),
            "V": self.weights.V.tolist(),
        }

    @classmethod
    def _read(cls, table: Table) -> Self:
        return cls(
            vehicle=vehicle_from(table.value("vehicle")),
            network=Network(**table.table("network").record(Network)),
            weights=Weights(W=table.array("W"), V=table.array("V")),
            force_unit=table.number("force_unit_N"),
            min_speed=table.number("min_speed_m_s"),
        )


def first_weights(
    network: Network, start: TireModel | None, *, seed: int, force_unit: float
) -> Weights:
    """Return the weights that learning begins with.
    start : stored weights to begin with; None draws them.   force_unit : U of what learns [N].
    """
    if start is None:
        return network.initial_weights(np.random.default_rng(seed))
    stored = resumed(start, NetworkModel, OTHER_STRUCTURE, network=network)
    return Weights(W=stored.weights.W * (stored.force_unit / force_unit), V=stored.weights.V)
