"""The paper's network, frozen: weights at one instant and all that axle forces need."""

import json
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.method import Setup
from identifier.model_format import FORMAT, FrozenModelError, vehicle_from, vehicle_numbers
from identifier.network import Network, Weights, hidden_layer, network_signals
from models.bicycle import BicycleParameters, linear_axle_force
from models.files import write_atomically
from models.recordings import Recording
from models.vehicle import Vehicle

KIND = "network"


def build_frozen(network: Network) -> ca.Function:
    """Return the frozen model as a function of weights, state and steering.

    Ports: W (2, n_h) and V (n_h, n_in); x = [v_y, r], u = [δ_f, δ_r], v_x, SI; vehicle (6,) = m,
    I_z, l_f, l_r, C_f, C_r; force_unit [N]. Results: f_hat (2,) in the force unit and axle_force
    (2,) [N].

    Parameters
    ----------
    network : structure of the network.
    """
    n_h, n_in = network.hidden, len(network.inputs)
    W, V = ca.SX.sym("W", 2, n_h), ca.SX.sym("V", n_h, n_in)
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    vehicle, unit = ca.SX.sym("vehicle", 6), ca.SX.sym("force_unit")
    parameters = BicycleParameters(*ca.vertsplit(vehicle))
    x_bar = network.normalized_input(network_signals(parameters, v_x, x, u))
    f_hat = W @ hidden_layer(V, x_bar)
    return ca.Function(
        "frozen_network",
        [W, V, x, u, v_x, vehicle, unit],
        [f_hat, linear_axle_force(parameters, v_x, x, u) + unit * f_hat],
        ["W", "V", "x", "u", "v_x", "vehicle", "force_unit"],
        ["f_hat", "axle_force"],
    )


def build_replay(network: Network) -> ca.Function:
    """Return the frozen model as it is replayed: no force below min_speed [m/s], a further port.

    Parameters
    ----------
    network : structure of the network.
    """
    frozen = build_frozen(network)
    ports = {name: ca.SX.sym(name, *frozen.size_in(name)) for name in frozen.name_in()}
    min_speed, v_x = ca.SX.sym("min_speed"), ports["v_x"]
    read = {**ports, "v_x": ca.fmax(v_x, min_speed)}
    force = frozen(*read.values())[1]
    return ca.Function(
        "replayed_network",
        [*ports.values(), min_speed],
        [ca.if_else(v_x >= min_speed, force, 0)],
        [*ports, "min_speed"],
        ["axle_force"],
    )


@cache
def _replay_scan(network: Network) -> Scan:
    return Scan(build_replay(network), carry=(), over=("x", "u", "v_x"))


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkModel:
    """Axle forces F_y = C α + U Ŵ tanh(V̂ x̄) with weights that no longer change.

    Parameters
    ----------
    vehicle : the car, whose linear tire the network corrects.
    network : structure of the network.
    weights : W (2, n_h) in the force unit and V (n_h, n_in).
    force_unit : U [N].
    min_speed : below this speed [m/s] the forces read zero.

    Raises
    ------
    ValueError
        Where a weight has the wrong shape or is not finite.
    """

    vehicle: Vehicle
    network: Network
    weights: Weights
    force_unit: float
    min_speed: float

    def __post_init__(self) -> None:
        for label in ("force_unit", "min_speed"):
            if not 0.0 < getattr(self, label) < np.inf:
                raise ValueError(f"{label} must be positive, it is {getattr(self, label)}")
        n_h, n_in = self.network.hidden, len(self.network.inputs)
        for name, value, shape in (
            ("W", self.weights.W, (2, n_h)),
            ("V", self.weights.V, (n_h, n_in)),
        ):
            if value.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, it has {value.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} holds a number that is not finite: the law has diverged")

    def setup(self, recording: Recording) -> Setup:
        """Return what a replay needs.

        Parameters
        ----------
        recording : what is replayed; it is not looked at.
        """
        del recording
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

    def axle_force(self, recording: Recording) -> NDArray[np.float64]:
        """Return lateral axle forces over a recording, (n, 2) [N], frame of the body.

        Parameters
        ----------
        recording : its signals are the input; its forces are not looked at.
        """
        return self.setup(recording).run(recording)["axle_force"]

    def to_dict(self) -> dict[str, Any]:
        """Return the model as plain numbers and words, ready for JSON."""
        return {
            "format": FORMAT,
            "kind": KIND,
            "units": {"W": "force_unit_N newtons", "V": "-", "scale": "SI, by input"},
            "vehicle": vehicle_numbers(self.vehicle),
            "network": asdict(self.network),
            "force_unit_N": self.force_unit,
            "min_speed_m_s": self.min_speed,
            "W": self.weights.W.tolist(),
            "V": self.weights.V.tolist(),
        }

    def save(self, path: Path) -> None:
        """Write the model as JSON.

        Parameters
        ----------
        path : the file.
        """
        write_atomically(path, json.dumps(self.to_dict(), indent=2) + "\n")

    @classmethod
    def from_dict(cls, data: dict[str, Any], source: str) -> "NetworkModel":
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
            structure = dict(data["network"])
            network = Network(
                hidden=structure["hidden"],
                inputs=tuple(structure["inputs"]),
                scale=tuple(structure["scale"]),
            )
            return cls(
                vehicle=vehicle_from(data["vehicle"]),
                network=network,
                weights=Weights(
                    W=np.array(data["W"], dtype=np.float64), V=np.array(data["V"], dtype=np.float64)
                ),
                force_unit=float(data["force_unit_N"]),
                min_speed=float(data["min_speed_m_s"]),
            )
        except KeyError as error:
            raise FrozenModelError(f"{source}: key {error} is missing") from error
        except (TypeError, ValueError) as error:
            raise FrozenModelError(f"{source}: {error}") from error
