"""A band around the curve of an axle: what the covariance leaves open, and what no curve can say.

Half the width at a slip x and a speed v_x, in static axle loads: z sqrt((m² s² + v)(f² (1 - ρ) +
max(f, 1)² ρ)).
z: of the level.   v = h'P h, h = [t, 0, 0, φ'/v_x or φ']: variance that learning left of weights
t = tanh(x/α_j) and of the zero of the slip.   m² = (0.04 φ)² + 0.01²: errors of the model, as
declared.   s: mean speed of the drive that taught over v_x: an error of a lateral
velocity is one of slip by 1/v_x.   f: factor of a range of slip times one of a range of speed, by
which errors on segments that did not teach the model are larger or smaller than that.   ρ: v over
that from which on a slip is not known, at most 1; there nothing is narrowed.
Learning takes errors to be correlated over a time that is given; where they are over a longer one,
as many samples tell less by `color`, the ratio c of both: P' = (P₀⁻¹ + (P⁻¹ - P₀⁻¹)/c)⁻¹, which
ends at the prior P₀ where nothing was learnt. With v₀ = h'P₀ h and p = v/v₀, v₀ p c/(1 + p (c - 1))
is never below h'P' h: along the axes that P and P₀ share it is a mean of a concave function, here
taken of the mean (Jensen). That bound is v of the band: it costs no inverse.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from codegen.arrays import Array
from identifier.axle.learning import Regression
from identifier.band import LEVEL, TINY, BandSpread
from models.recordings import Recording
from models.recordings.samples import white_noise
from models.schema import Table
from models.vehicle import Vehicle

_RANGES = (0.01, 0.02, 0.04, 0.08, 0.16)  # rad: ends of the ranges of slip, the last is open
CENTERS = (0.005, 0.015, 0.03, 0.06, 0.12, 0.24)  # rad: where the factor of a range holds
SPEEDS = (2.0, 3.0, 4.0)  # sqrt(g L): ends of the ranges of speed, first and last are open
AT_SPEEDS = (1.5, 2.5, 3.5, 4.5)  # sqrt(g L): where the factor of a range of speed holds
STRETCH = (0.5, 2.0)  # least and most of s
LEAST_FACTOR = 0.1  # of the factors of a band, over errors as they are declared [-]
MOST_FACTOR = 100.0  # of the same factors, and of the noise [-]
MOST_COLOR = 1000.0  # of the factor for errors that last longer than they are declared to [-]
UNKNOWN = 0.25  # standard deviation over the prior's, from which on slip is not known

RELATIVE = Regression().relative_error  # of the force
FLOOR = 0.5 * Regression().error  # static axle loads


@dataclass(frozen=True, slots=True, kw_only=True)
class BandCalibration:
    """What stretches that did not teach a model say of its errors.
    factors : of the errors of each range of slip, (2, 6).
    speeds : of the errors of each range of speed, over all, (2, 4).
    color : variance of a mean of errors over that of errors as declared, at least 1, (2,).
    speed : root mean square of v_x there [m/s], positive.
    noise : standard deviation of the white noise that sensors made: of the lateral velocity of
        front and rear axle [m/s], and of the steering in front [rad], (3,).
    """

    factors: Array
    speeds: Array
    color: Array
    speed: float
    noise: Array

    def __post_init__(self) -> None:
        for name, shape, low, high in (
            ("factors", (2, len(CENTERS)), LEAST_FACTOR, MOST_FACTOR),
            ("speeds", (2, len(AT_SPEEDS)), LEAST_FACTOR, MOST_FACTOR),
            ("color", (2,), 1.0, MOST_COLOR),
            ("noise", (3,), 0.0, MOST_FACTOR),
        ):
            value = getattr(self, name)
            if value.shape != shape:
                raise ValueError(f"{name} of the band must have shape {shape}, not {value.shape}")
            if not ((value >= low) & (value <= high)).all():
                raise ValueError(
                    f"{name} of the band must be within {low:g} and {high:g}, they reach from "
                    f"{value.min():g} to {value.max():g}"
                )
        if not 0.0 < self.speed < np.inf:
            raise ValueError(f"speed of the band must be positive, it is {self.speed} m/s")

    @classmethod
    def declared(cls, speed: float) -> Self:
        """Return that of a model whose errors are as declared, of a speed.
        speed : [m/s], positive.
        """
        ones = np.ones((2, len(CENTERS))), np.ones((2, len(AT_SPEEDS)))
        return cls(
            factors=ones[0], speeds=ones[1], color=np.ones(2), speed=speed, noise=np.zeros(3)
        )

    def factor(self, slip: Array, relative_speed: Array) -> Array:
        """Return the factors at slip angles and speeds, (k, 2): straight between centers.
        slip : of front and rear axle [rad], (k, 2).   relative_speed : over sqrt(g L), (k,).
        """
        of_axles = zip(np.abs(slip).T, self.factors, self.speeds, strict=True)
        return np.column_stack(
            [
                np.interp(size, CENTERS, slips) * np.interp(relative_speed, AT_SPEEDS, speeds)
                for size, slips, speeds in of_axles
            ]
        )

    def stretch(self, v_x: Array) -> Array:
        """Return s, by which errors of the model are larger at speeds, (k,).
        v_x : speeds [m/s], positive, (k,).
        """
        return np.clip(self.speed / v_x, *STRETCH)

    def to_dict(self) -> dict[str, Any]:
        """Return the calibration as plain numbers, ready for JSON."""
        return {
            "ranges": list(_RANGES),
            "speed_ranges": list(SPEEDS),
            "level": LEVEL,
            "factors": self.factors.tolist(),
            "speeds": self.speeds.tolist(),
            "color": self.color.tolist(),
            "speed": self.speed,
            "noise": self.noise.tolist(),
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Return the calibration that `to_dict` describes."""
        table = Table(data, "", ValueError, "band.")
        for name, ours in (
            ("ranges", list(_RANGES)),
            ("speed_ranges", list(SPEEDS)),
            ("level", LEVEL),
        ):
            if table.value(name) != ours:
                raise ValueError(f"{name} of the band must be {ours}, they are {data[name]}")
        numbers = {name: table.array(name) for name in ("factors", "speeds", "color", "noise")}
        return cls(**numbers, speed=table.number("speed"))


def ranges_of(slip: Array) -> Any:
    """Return in which of the six ranges slip angles lie.
    slip : its size [rad].
    """
    return np.searchsorted(_RANGES, slip, side="right")


def colored(P: Array, prior: Array, color: float, factor: float = 1.0) -> Array:
    """Return a covariance as errors leave it that are correlated longer than declared.
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
    unknown = np.minimum(share / UNKNOWN**2, 1.0)
    share = share * (factor**2 * (1.0 - unknown) + max(factor, 1.0) ** 2 * unknown)
    half = half @ along * np.sqrt(share)
    return half @ half.T


def colored_variance(left: Array, before: Array, color: Array) -> Array:
    """Return a bound of h'P' h, P' of `colored`, that is never below it and needs no inverse.
    left, before : h'P h and h'P₀ h, (k, 2).   color : how much less samples tell, at least 1, (2,).
    """
    share = np.minimum(left / np.maximum(before, TINY), 1.0)
    return np.maximum(left, before * share * color / (1.0 + share * (color - 1.0)))


def sensor_noise(recording: Recording, vehicle: Vehicle) -> Array:
    """Return the white noise of sensors as the slip of the axles feels it, (3,).

    Standard deviations: lateral velocity of front and rear axle [m/s], steering in front [rad].
    """
    sideways, turning = white_noise(recording.needed("v_y")), white_noise(recording.r)
    return np.array(
        [
            np.hypot(sideways, vehicle.l_f * turning),
            np.hypot(sideways, vehicle.l_r * turning),
            white_noise(recording.delta_f),
        ]
    )


def root(P: Array) -> Array:
    """Return R with R R' = P (q, q), also where P is singular.
    P : covariance (q, q).
    """
    sd = np.sqrt(np.diag(P))
    size, along = np.linalg.eigh(P / np.outer(sd, sd))
    return sd[:, None] * along * np.sqrt(np.maximum(size, 0.0))


def declared_spread(
    force: Array, left: Array, before: Array, stretch: Array | float = 1.0
) -> BandSpread:
    """Return the variances (1 - ρ) (m² s² + v), scaled by the factor, and ρ (m² s² + v), fixed.
    force : φ of the model [static axle loads].   left, before : v and v₀ [static axle loads²].
    stretch : s, of errors of the model [-], a number or (k, 1).
    """
    share = np.minimum(left / np.maximum(UNKNOWN**2 * before, TINY), 1.0)
    total = ((RELATIVE * force) ** 2 + FLOOR**2) * stretch**2 + left
    return BandSpread((1.0 - share) * total, share * total)
