"""A design of the paper's identifier: everything that is chosen before the car drives."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.driving import Driving
from identifier.gains import Gains
from identifier.integrators import INTEGRATORS
from identifier.laws import DRIVING_ERRORS
from identifier.method import FrozenModel, Setup
from identifier.network import Network, Weights
from identifier.network_model import NetworkModel
from identifier.observer import INPUT_SOURCES
from identifier.step import CARRY, GAINS, OVER, Structure, build_step
from models.bicycle import BicycleParameters, bicycle
from models.recordings import Recording
from models.rules import require_within
from models.vehicle import GRAVITY, Vehicle

Array = NDArray[np.float64]

SHORTEST_STEP, LONGEST_STEP = 1e-4, 0.1  # [s]: finer is only work, coarser is blind


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
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
    ) -> "Design":
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
        from identifier.defaults import default_design  # it finds gains for designs like this one

        return default_design(vehicle, law=law, dt=dt, seed=seed)

    def setup(
        self, vehicle: Vehicle, recording: Recording, start: FrozenModel | None = None
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

    def _first_weights(self, start: FrozenModel | None) -> Weights:
        if start is None:
            return self.network.initial_weights(np.random.default_rng(self.seed))
        if not isinstance(start, NetworkModel) or start.network != self.network:
            raise ValueError("the stored weights are of another structure than the design's")
        return Weights(W=start.weights.W * (start.force_unit / self.force_unit), V=start.weights.V)

    def frozen(self, vehicle: Vehicle, carried: Mapping[str, Array]) -> NetworkModel:
        """Return the model with the carried weights.

        Parameters
        ----------
        vehicle : the car.
        carried : W (2, n_h) and V (n_h, n_in).
        """
        return NetworkModel(
            vehicle=vehicle,
            network=self.network,
            weights=Weights(W=carried["W"].copy(), V=carried["V"].copy()),
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
