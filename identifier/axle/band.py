"""A band around the curve of an axle: what the covariance leaves open, and what no curve can say.

Half the width at a slip x, in static axle loads: z sqrt((m² + v) (f² (1 - ρ) + max(f, 1)² ρ)).
z: of the level.   v = t'P t + (φ' o)²: variance that learning left, t = tanh(x/α_j), o: standard
deviation of the zero of the slip.   m² = (0.04 φ)² + 0.01²: errors of the model, as learning is
told of them.   f: factor of a range of slip, by which errors on stretches that did not teach the
model are larger or smaller than that.   ρ: v over that from which on a slip is not known, at most
1; there nothing is narrowed.
Learning takes errors to be correlated over a time that is told; where they are over a longer one,
as many samples tell less by `color`, the ratio of both: P' = (P₀⁻¹ + (P⁻¹ - P₀⁻¹)/color)⁻¹, which
ends at the prior P₀ where nothing was learnt.
"""

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple, Self

import numpy as np

from codegen.arrays import Array
from identifier.axle.learning import Regression

RANGES = (0.01, 0.02, 0.04, 0.08, 0.16)  # rad: ends of the ranges of slip, the last is open
CENTERS = (0.005, 0.015, 0.03, 0.06, 0.12, 0.24)  # rad: where the factor of a range holds
LEVEL = 0.9  # at which factors are found, and which is asked for if no other is told
RELATIVE = Regression().relative_error  # of the force
FLOOR = 0.5 * Regression().error  # static axle loads
LEAST, MOST = 0.1, 100.0  # factors
MOST_COLOR = 1000.0
UNKNOWN = 0.25  # standard deviation over the prior's, from which on slip is not known
TINY = 1e-30  # keeps quotients of variances finite at no slip


@dataclass(frozen=True, slots=True, kw_only=True)
class BandCalibration:
    """What stretches that did not teach a model say of its errors.

    Parameters
    ----------
    factors : of the errors of each range of slip, (2, 6).
    color : variance of a mean of errors over that of errors as told, at least 1, (2,).

    Raises
    ------
    ValueError
        Where a number has the wrong shape or is out of its range.
    """

    factors: Array
    color: Array

    def __post_init__(self) -> None:
        for name, shape, low, high in (
            ("factors", (2, len(CENTERS)), LEAST, MOST),
            ("color", (2,), 1.0, MOST_COLOR),
        ):
            value = getattr(self, name)
            if value.shape != shape:
                raise ValueError(f"{name} of the band must have shape {shape}, not {value.shape}")
            if not ((value >= low) & (value <= high)).all():
                raise ValueError(
                    f"{name} of the band must be within {low:g} and {high:g}, they reach from "
                    f"{value.min():g} to {value.max():g}"
                )

    @classmethod
    def told(cls) -> Self:
        """Return that of a model whose errors are as learning is told."""
        return cls(factors=np.ones((2, len(CENTERS))), color=np.ones(2))

    def factor(self, alpha: Array) -> Array:
        """Return the factors at slip angles, (k, 2): between centers straight in the log of slip.

        Parameters
        ----------
        alpha : slip angles [rad], (k,).
        """
        at = np.log(np.maximum(np.abs(alpha), CENTERS[0]))
        return np.stack([np.interp(at, np.log(CENTERS), row) for row in self.factors], axis=1)

    def to_dict(self) -> dict[str, Any]:
        """Return the calibration as plain numbers, ready for JSON."""
        return {
            "ranges": list(RANGES),
            "level": LEVEL,
            "factors": self.factors.tolist(),
            "color": self.color.tolist(),
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Return the calibration that `to_dict` describes.

        Parameters
        ----------
        data : as from `to_dict`.

        Raises
        ------
        ValueError
            Where the ranges or the level are others, or a value is impossible.
        KeyError
            Where a key is missing.
        """
        for name, ours in (("ranges", list(RANGES)), ("level", LEVEL)):
            if data[name] != ours:
                raise ValueError(f"{name} of the band must be {ours}, they are {data[name]}")
        factors, color = (np.array(data[name], dtype=np.float64) for name in ("factors", "color"))
        return cls(factors=factors, color=color)


def ranges_of(slip: Array) -> Any:
    """Return in which of the six ranges slip angles lie.

    Parameters
    ----------
    slip : its size [rad].
    """
    return np.searchsorted(RANGES, slip, side="right")


def normal_quantile(level: float) -> float:
    """Return z such that |x| <= z holds of a standard normal x in a share of cases.

    Parameters
    ----------
    level : the share, above 0 and below 1.

    Raises
    ------
    ValueError
        Where it is not.
    """
    if not 0.0 < level < 1.0:
        raise ValueError(f"level must be above 0 and below 1, it is {level}")
    return NormalDist().inv_cdf(0.5 * (1.0 + level))


def colored(P: Array, prior: Array, color: float, factor: float = 1.0) -> Array:
    """Return a covariance as errors leave it that are correlated longer than learning was told.

    Parameters
    ----------
    P, prior : covariance now and before the first sample (q, q).
    color : how much less samples tell, at least 1.
    factor : of the errors along what was learnt; along the rest it only widens.
    """
    half = np.linalg.cholesky(prior)
    inside = np.linalg.solve(half, np.linalg.solve(half, P).T)
    share, along = np.linalg.eigh(0.5 * (inside + inside.T))
    share = np.maximum(share, 0.0)
    known = np.maximum(1.0 - share, 0.0)
    share = np.where(known > 0.0, share * color / (share * color + known), share)
    held = np.minimum(share / UNKNOWN**2, 1.0)
    share = share * (factor**2 * (1.0 - held) + max(factor, 1.0) ** 2 * held)
    half = half @ along * np.sqrt(share)
    wider: Array = half @ half.T
    return wider


def root(P: Array) -> Array:
    """Return R with R R' = P (q, q), also where P is singular.

    Parameters
    ----------
    P : covariance (q, q).
    """
    sd = np.sqrt(np.diag(P))
    size, along = np.linalg.eigh(P / np.outer(sd, sd))
    half: Array = sd[:, None] * along * np.sqrt(np.maximum(size, 0.0))
    return half


class BandSpread(NamedTuple):
    """Variances of the force of an axle [static axle loads²], as errors are told to be.

    scaled : (1 - ρ) (m² + v), by the factor.   held : ρ (m² + v), which no factor narrows.
    """

    scaled: Array
    held: Array

    @classmethod
    def of(cls, force: Array, left: Array, before: Array) -> Self:
        """Return those of a force, of the variance that learning left, and of the prior's.

        Parameters
        ----------
        force : φ of the model [static axle loads].
        left, before : v and v₀ [static axle loads²].
        """
        share = np.minimum(left / np.maximum(UNKNOWN**2 * before, TINY), 1.0)
        total = (RELATIVE * force) ** 2 + FLOOR**2 + left
        return cls((1.0 - share) * total, share * total)

    def half_width(self, factor: Array, level: float) -> Array:
        """Return half the width of a band [static axle loads].

        Parameters
        ----------
        factor : f, (k, 2).
        level : share of cases that it shall hold.
        """
        wide = np.sqrt(factor**2 * self.scaled + np.maximum(factor, 1.0) ** 2 * self.held)
        return np.asarray(normal_quantile(level) * wide)

    def needed_factor(self, error: Array, noise: Array | float) -> Array:
        """Return f², with which a band of `LEVEL` just reaches an error; 0 where none is needed.

        Parameters
        ----------
        error : [static axle loads].
        noise : its variance that sensors made [static axle loads²].
        """
        size = (error / normal_quantile(LEVEL)) ** 2 - noise
        small = (size - self.held) / (self.scaled + TINY)
        large = size / (self.scaled + self.held)
        return np.maximum(np.where(large < 1.0, small, large), 0.0)
