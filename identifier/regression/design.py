"""A design that learns the last layer by a filtered regression: law, network and numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.method import Method
from identifier.paper.design import natural_force_unit
from identifier.paper.network import Network, NetworkModel, Weights, first_weights, natural_network
from identifier.regression.laws import LAWS, Numbers
from identifier.regression.step import OVER, PORTS, Structure, build_step
from identifier.setup import Port, Setup, in_force_unit
from identifier.tire_model import TireModel
from identifier.tuning import SIZE, SIZE_RANGE, Range, hidden_units, ranges_around, with_numbers
from models.vehicle import Vehicle

# What a search may vary of it, and what the number is multiplied and divided by.
TUNED: Mapping[str, float] = {
    "filter_rate": 4.0,
    "forgetting": 10.0,
    "learning_rate": 10.0,
    "ridge": 10.0,
    "quiet": 3.0,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RegressionIdentifier(Method):
    """Law, network, numbers and sampling; the hidden layer is random and stays as it is.

    Parameters
    ----------
    filter_rate : κ of the filters [1/s]: faster movements of the car are not looked at.
    forgetting : λ [1/s], 0 never forgets; in concurrent learning the fading of stored pairs.
    learning_rate : η [1/s], how fast weights follow; least squares does not read it.
    ridge : δ [s], what the first weights count for, in seconds of driving with |s| = 1.
    quiet : learning rests where the root mean square of the filtered hidden layer is below [-].
    W_max : radius of the projection of W, Frobenius norm [U].
    law : one of `LAWS`.
    memory : number of pairs that concurrent learning keeps.
    dt : sampling interval T_s [s].
    force_unit : the unit U of forces inside the identifier [N].
    min_speed : below this speed [m/s] learning rests and forces read zero.

    Raises
    ------
    ValueError
        Where the law is unknown or a number impossible.
    """

    filter_rate: float
    forgetting: float
    learning_rate: float
    ridge: float
    quiet: float
    W_max: float
    law: str = "rls"
    memory: int = 20
    network: Network = field(default_factory=Network)
    dt: float = 0.01
    force_unit: float = 1000.0
    min_speed: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ValueError(f"law must be one of {list(LAWS)}, not {self.law!r}")
        if self.memory < 1:
            raise ValueError(f"memory must be at least 1, it is {self.memory}")
        for name in ("filter_rate", "ridge", "dt", "force_unit", "min_speed"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be positive, it is {getattr(self, name)}")
        for name in ("forgetting", "learning_rate", "quiet"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must not be negative, it is {getattr(self, name)}")
        if not self.W_max > 0.0:
            raise ValueError(f"W_max must be positive, it is {self.W_max}")

    @classmethod
    def for_vehicle(
        cls,
        vehicle: Vehicle,
        *,
        law: str = "rls",
        network: Network | None = None,
        memory: int = 20,
        dt: float = 0.01,
        seed: int = 0,
    ) -> "RegressionIdentifier":
        """Return a design for a car of any size: times scale with sqrt(L/g), forces with weight.

        Parameters
        ----------
        law : one of `LAWS`.
        network : structure; None takes `natural_network`.
        memory : number of pairs that concurrent learning keeps, twice the hidden units or so.
        dt : sampling interval [s].
        """
        time = vehicle.froude_time
        unit = natural_force_unit(vehicle.mass)
        return cls(
            filter_rate=2.0 / time,
            forgetting=0.05 / time,
            learning_rate=50.0 / time,
            ridge=0.002 * time,
            quiet=0.02,
            W_max=3.0 * vehicle.weight / unit,
            law=law,
            memory=memory,
            network=network or natural_network(vehicle),
            dt=dt,
            force_unit=unit,
            min_speed=vehicle.lowest_speed,
            seed=seed,
        )

    @property
    def tunables(self) -> Mapping[str, Range]:
        """What a search may vary, around the numbers that it has."""
        return {SIZE: SIZE_RANGE, **ranges_around(self, TUNED)}

    def tuned(self, values: Mapping[str, float]) -> "RegressionIdentifier":
        """Return the method with other numbers, a network of another size among them.

        Parameters
        ----------
        values : by name of its `tunables`; empty leaves it as it is.
        """
        numbers = {name: value for name, value in values.items() if name != SIZE}
        changed = with_numbers(self, numbers)
        if SIZE not in values:
            return changed
        return replace(changed, network=replace(self.network, hidden=hidden_units(values)))

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return in_force_unit(PORTS, self.force_unit)

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        start : weights to begin with, hidden layer and all; None begins at the linear tire.

        Raises
        ------
        ValueError
            Where stored weights are those of another structure.
        """
        structure = Structure(network=self.network, law=self.law, memory=self.memory)
        weights, n_h = (
            first_weights(self.network, start, seed=self.seed, force_unit=self.force_unit),
            self.network.hidden,
        )
        return Setup(
            scan=_scan(structure),
            carry={
                "W": weights.W,
                "V": weights.V,
                "target_lag": np.zeros(2),
                "regressor_lag": np.zeros(n_h),
                "fresh": np.ones(1),
                **LAWS[self.law].start(n_h, self.memory, self.ridge),
            },
            constants={
                "W_first": weights.W,
                "vehicle": np.array(vehicle.bicycle),
                "numbers": np.array([getattr(self, name) for name in Numbers._fields]),
                "sampling": np.array([self.dt, self.force_unit, self.min_speed]),
            },
        )

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
    return Scan(build_step(structure), carry=structure.carry, over=OVER)
