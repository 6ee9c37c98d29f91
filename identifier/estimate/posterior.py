"""What an estimate leaves: parameters, how sure, and what its drives reached."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.motion.parameters import INDEX


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
    ended : whether nothing was left to gain; else the descent ended at its limit of iterations.
    """

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
    ended: bool = True

    def __getitem__(self, name: str) -> float:
        return float(self.p[INDEX[name]])

    def sd(self, name: str) -> float:
        """Return the standard deviation of a parameter; 0 where it did not move."""
        return float(np.sqrt(self.covariance[INDEX[name], INDEX[name]]))


class Segment(NamedTuple):
    """A part of a drive on another road: from, to [s], its friction over that of the curves, sd."""

    begin: float
    end: float
    ratio: float
    sd: float


class Reach(NamedTuple):
    """What identification drives reached, and what is particular to them.
    slip : largest of each axle [rad], (2,).
    speeds, a_x : least and largest [m/s], [m/s²], (2,).
    alike, pairs : sum of products of what the model misses, over its size, at two times
        0.15 s apart (of a sedan), (2,), and how many there are: white noise of the sensors has no
        part in it.
    segments : on another road.
    parted : of drives without v_y, side slip by which soft and stiff tires that explain them alike
        part, rms [rad].
    a_y_late : of such drives, by which a_y was later than the yaw rate [s]; negative where it
        would have to be earlier, which is rejected.
    a_y_place : of such drives, how far ahead of the center of gravity a_y was measured [m].
    a_y_instead : the other one in place of that of both which is not 0, where no drive tells.
    """

    slip: Array = np.zeros(2)
    speeds: Array = np.array([np.inf, -np.inf])
    a_x: Array = np.array([np.inf, -np.inf])
    alike: Array = np.zeros(2)
    pairs: float = 0.0
    segments: tuple[Segment, ...] = ()
    parted: float = 0.0
    a_y_late: float = 0.0
    a_y_place: float = 0.0
    a_y_instead: float = 0.0

    def with_(self, other: "Reach") -> "Reach":
        """Return what both reached."""
        speeds, a_x = (
            np.array([min(one[0], two[0]), max(one[1], two[1])])
            for one, two in ((self.speeds, other.speeds), (self.a_x, other.a_x))
        )
        return Reach(
            np.maximum(self.slip, other.slip),
            speeds,
            a_x,
            self.alike + other.alike,
            self.pairs + other.pairs,
            self.segments + other.segments,
            max(self.parted, other.parted),
            *(max(pair, key=abs) for pair in zip(self[-3:], other[-3:], strict=True)),
        )

    @property
    def unexplained(self) -> Array:
        """Size of what the drives miss for longer than noise, over the errors that are usual, 2 %
        of the static load and 4 % of the lateral acceleration in g, (2,).
        """
        return np.sqrt(np.maximum(self.alike, 0.0) / max(self.pairs, 1e-9))
