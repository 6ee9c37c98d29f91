"""What an estimate leaves: parameters, how sure, and what the drives did not tell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.motion.parameters import INDEX
from models.vehicle import Vehicle


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posterior:
    """Gaussian around the optimum.

    Parameters
    ----------
    p : all parameters, as `motion.parameters` lists them (p,).
    covariance : of them, zero of those that did not move (p, p).
    index : which of them moved, (n,).
    information : inverse covariance of those, other roads marginal (n, n).
    roads : ln of the friction of other roads than that of the curves (K,).
    road_sd : standard deviation of these (K,).
    scale : S of the residuals of both axles [-], (2,).
    memory : T, their integrated autocorrelation time [s], (2,).
    cost : J at the optimum [nats].
    """

    vehicle: Vehicle
    p: Array
    covariance: Array
    index: NDArray[np.intp]
    information: Array
    roads: Array
    road_sd: Array
    scale: Array
    memory: Array
    cost: float
    iterations: int

    def __getitem__(self, name: str) -> float:
        return float(self.p[INDEX[name]])

    def sd(self, name: str) -> float:
        """Return the standard deviation of a parameter; 0 where it did not move."""
        return float(np.sqrt(self.covariance[INDEX[name], INDEX[name]]))
