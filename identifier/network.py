"""The one-hidden-layer network f̂ = Ŵ tanh(V̂ x̄) and its inputs.

x̄ = (chosen signals) / (their scales), (n_in,).   Ŵ: (2, n_h) in the force unit.   V̂: (n_h, n_in).
There is no bias: f̂ is odd in x̄, as the residual of a symmetric tire is, and f̂(0) = 0.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen.tanh import tanh
from models.bicycle import BicycleParameters, slip_angles
from models.doors import require_few
from models.rules import require_within

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

    W: NDArray[np.float64]
    V: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """Structure of the network: size, inputs and their scales.

    Parameters
    ----------
    hidden : number of hidden units n_h.
    inputs : signals of x̄, chosen among `SIGNALS`, each at most once.
    scale : divisor of each input in its own unit (m/s, rad/s, rad); None takes those of `SIGNALS`.

    Raises
    ------
    ValueError
        Where the size is not positive, an input unknown or repeated, or a scale not positive.
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

        Parameters
        ----------
        rng : generator of V, drawn from a normal distribution of standard deviation 1.
        """
        return Weights(
            W=np.zeros((2, self.hidden)), V=rng.standard_normal((self.hidden, len(self.inputs)))
        )

    def normalized_input(self, signals: Mapping[str, Any]) -> Any:
        """Return x̄ (n_in,), without unit.

        Parameters
        ----------
        signals : the CasADi expression of every signal of `inputs`, SI.
        """
        assert self.scale is not None
        pairs = zip(self.inputs, self.scale, strict=True)
        return ca.vertcat(*(signals[name] * (1 / scale) for name, scale in pairs))


def hidden_layer(V: Any, x_bar: Any) -> Any:
    """Return σ = tanh(V x̄), (n_h,), by the rational tanh that every machine computes alike.

    Parameters
    ----------
    V : weights (n_h, n_in).
    x_bar : scaled input (n_in,).
    """
    return tanh(V @ x_bar)


def network_signals(parameters: BicycleParameters, v_x: Any, x: Any, u: Any) -> dict[str, Any]:
    """Return every signal that a network may read, by name, SI.

    Parameters
    ----------
    parameters : of the bicycle.
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    alpha = slip_angles(parameters.l_f, parameters.l_r, v_x, x, u)
    return {
        "v_y": x[0],
        "r": x[1],
        "delta_f": u[0],
        "delta_r": u[1],
        "v_x": v_x,
        "alpha_f": alpha[0],
        "alpha_r": alpha[1],
    }
