"""What an estimate leaves: parameters, how sure, and what the drives did not tell."""

from dataclasses import dataclass

import numpy as np

from codegen.arrays import Array
from identifier.motion.parameters import INDEX
from models.vehicle import Vehicle


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posterior:
    """Gaussian around the optimum.
    p : all parameters, as `motion.parameters` lists them (p,).
    covariance : of them, zero of those that did not move (p, p).
    slope, curvature : of the loss of the drives alone, without the priors (p,), (p, p).
    seconds : of driving that counts [s].
    roads : ln of the friction of other roads than that of the curves (K,).
    road_sd : standard deviation of these (K,).
    scale : S of the residuals of both axles [-], (2,).
    memory : T, their integrated autocorrelation time [s], (2,).   cost : J at the optimum [nats].
    """

    vehicle: Vehicle
    p: Array
    covariance: Array
    slope: Array
    curvature: Array
    seconds: float
    roads: Array
    road_sd: Array
    scale: Array
    memory: Array
    cost: float

    def __getitem__(self, name: str) -> float:
        return float(self.p[INDEX[name]])

    def sd(self, name: str) -> float:
        """Return the standard deviation of a parameter; 0 where it did not move."""
        return float(np.sqrt(self.covariance[INDEX[name], INDEX[name]]))
