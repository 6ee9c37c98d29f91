"""A design: everything that is chosen before the car drives."""

from dataclasses import dataclass, field

import numpy as np

from identifier.gains import Gains
from identifier.integrators import INTEGRATORS
from identifier.laws import DRIVING_ERRORS
from identifier.network import Network
from identifier.observer import INPUT_SOURCES
from models.vehicle import GRAVITY


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

    Raises
    ------
    ValueError
        Where a name is unknown or a number not positive.
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
        for name in ("dt", "force_unit", "min_speed"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be positive, it is {getattr(self, name)}")

    @property
    def projects(self) -> bool:
        """Whether a projection bounds the weights."""
        return bool(np.isfinite(self.gains.W_max) or np.isfinite(self.gains.V_max))


def natural_force_unit(mass: float) -> float:
    """Return the power of ten [N] nearest to a fifteenth of a car's weight.

    The gains are well scaled where forces are of order one: 1 kN for a passenger car, 1 N for a
    1:10 model.

    Parameters
    ----------
    mass : mass of the car [kg].
    """
    return float(10.0 ** round(np.log10(mass * GRAVITY / 15)))
