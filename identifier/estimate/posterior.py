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
    vehicle : the car.
    p : all parameters, as `motion.parameters` lists them (p,).
    index : which of them moved, (n,).
    information : inverse covariance of those (n, n), and of it what the drives told.
    scale : S of the residuals of both axles [-], (2,).
    memory : T, their integrated autocorrelation time [s], (2,).
    cost : J at the optimum [nats].
    """

    vehicle: Vehicle
    p: Array
    index: NDArray[np.intp]
    information: Array
    data_information: Array
    scale: Array
    memory: Array
    cost: float
    iterations: int

    def __getitem__(self, name: str) -> float:
        return float(self.p[INDEX[name]])

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters that moved, (n, n)."""
        inverse: Array = np.linalg.inv(self.information)
        return inverse

    @property
    def whole_covariance(self) -> Array:
        """Covariance of all parameters, zero of those that did not move (p, p)."""
        found = np.zeros((len(self.p), len(self.p)))
        found[np.ix_(self.index, self.index)] = self.covariance
        return found

    def sd(self, name: str) -> float:
        """Return the standard deviation of a parameter; 0 where it did not move."""
        found = np.flatnonzero(self.index == INDEX[name])
        return float(np.sqrt(self.covariance[found[0], found[0]])) if found.size else 0.0
