"""A tire whose curves go on rising, slightly, beyond the slip that is of use.

Behind its peak an axle gives less for more slip. A tracker that linearizes there and wants less
force steers on, farther from where it has to go, and stays there. So beyond the useful slip
F = F(held slip) + 0.04 dF/dα(0) (α - held slip): more slip never gives less.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from mpc.tires.reach import curve_slopes, useful_slip
from mpc.tires.structure import Pair, Point, PredictionTire, TireModel

RISE = 0.04  # of the slope at zero; a little less than where slip ends to be of use
N_HELD = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldAxles:
    """Weights: useful slip [rad] and slope beyond [N/rad], front and rear, then those of `inner`.

    Parameters
    ----------
    inner : the tire.
    """

    inner: PredictionTire

    @property
    def n_weights(self) -> int:
        """4 more than the tire has."""
        return N_HELD + self.inner.n_weights

    @property
    def lagged(self) -> bool:
        """Whether the slip of the tire lags."""
        return self.inner.lagged

    def slip(self, at: Point) -> Pair:
        """Return the slip angles [rad].

        Parameters
        ----------
        at : motion, car and weights.
        """
        return self.inner.slip(_inside(at))

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body.

        Parameters
        ----------
        slip : what makes the force [rad].
        at : motion, car and weights.
        """
        most = ca.vertsplit(at.w[:2])
        held = [ca.fmin(ca.fmax(x, -m), m) for x, m in zip(slip, most, strict=True)]
        front, rear = self.inner.force((held[0], held[1]), _inside(at))
        return front + at.w[2] * (slip[0] - held[0]), rear + at.w[3] * (slip[1] - held[1])

    def lag_length(self, slip: Pair, at: Point) -> Pair:
        """Return the relaxation lengths [m].

        Parameters
        ----------
        slip : lagged slip [rad].
        at : motion, car and weights.
        """
        return self.inner.lag_length(slip, _inside(at))


def held(tire: TireModel) -> TireModel:
    """Return the tire with curves that never fall.

    A tire that never flattens is returned as it is, and so is one that is held already.

    Parameters
    ----------
    tire : structure and weights.
    """
    if isinstance(tire.structure, HeldAxles):
        return tire
    useful = useful_slip(tire)
    if not np.isfinite(useful).any():
        return tire
    rise = RISE * curve_slopes(tire)[:, 0]
    most = np.where(np.isfinite(useful), useful, 10.0)
    weights = np.concatenate([most, rise, tire.weights])
    return TireModel(HeldAxles(inner=tire.structure), weights, tire.vehicle)


def _inside(at: Point) -> Point:
    return at._replace(w=at.w[N_HELD:])
