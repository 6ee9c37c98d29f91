"""The band of a model: between which forces the true ones lie, and what else the tires may be.

Slip angles have the paper's sign; forces are those of the axles, front and rear, in the frame of
the body. What a band is made of depends on how its model was learnt: variances by slip and speed.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, Literal, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from models.recordings import Recording

Axle = Literal["front", "rear"]
AXLES: tuple[Axle, ...] = ("front", "rear")
LEVEL = 0.9  # at which factors are found, and which is asked for if no other is given
SD_FRICTION = 0.3  # of ln μ from one road to another [-]
LARGEST_SD = 0.25  # standard deviation over the prior's, above which a slip is not known
TINY = 1e-30  # keeps quotients of variances finite at no slip
UNCALIBRATED = "of the identifier, not calibrated; run.tire calibrates it on the drive"


def normal_quantile(level: float) -> float:
    """Return z such that |x| <= z holds of a standard normal x in a share of cases.
    level : the share, above 0 and below 1.
    """
    if not 0.0 < level < 1.0:
        raise ValueError(f"level must be above 0 and below 1, it is {level}")
    return NormalDist().inv_cdf(0.5 * (1.0 + level))


class BandSpread(NamedTuple):
    """Variances of the force of an axle [static axle loads²], as errors are declared.

    scaled : that goes with the square of the factor.   fixed : which no factor narrows.
    """

    scaled: Array
    fixed: Array

    def half_width(self, factor: Array | float, level: float) -> Array:
        """Return half the width of a band [static axle loads].
        factor : f, (k, 2) or one for all.
        """
        wide = np.sqrt(factor**2 * self.scaled + np.maximum(factor, 1.0) ** 2 * self.fixed)
        return normal_quantile(level) * wide

    def needed_factor(self, error: Array, noise: Array | float) -> Array:
        """Return f², with which a band of `LEVEL` just reaches an error; 0 where none is needed.
        error : [static axle loads].   noise : its variance that sensors made [static axle loads²].
        """
        size = (error / normal_quantile(LEVEL)) ** 2 - noise
        small = (size - self.fixed) / (self.scaled + TINY)
        large = size / (self.scaled + self.fixed)
        return np.maximum(np.where(large < 1.0, small, large), 0.0)


@dataclass(frozen=True, slots=True)
class Band(ABC):
    """What is not known of the forces of a model, as a band around its curves.

    Parameters
    ----------
    model : whose band it is: forces are curves of a slip that lags.
    """

    model: Any

    @property
    @abstractmethod
    def calibrated(self) -> bool:
        """Whether its width has more in it than noise of the sensors.

        As of `Run.tire`, where enough was driven; else it is that of the identifier.
        """

    @property
    def origin(self) -> str:
        """Where its width comes from, in words."""
        return "calibrated on the drive" if self.calibrated else UNCALIBRATED

    @property
    @abstractmethod
    def speed(self) -> float:
        """Speed [m/s] at which it is given where none is asked for."""

    @abstractmethod
    def spread(self, slip: Array, v_x: Array, pressed: Array) -> BandSpread:
        """Return the variances of the steady forces, (n, 2) each [static axle loads²].

        Parameters
        ----------
        slip : of front and rear axle [rad], (n, 2).
        v_x : speeds [m/s], positive, (n,).
        pressed : loads of the axles over the static ones [-], (n, 2).
        """

    def factor(self, slip: Array, v_x: Array) -> Array | float:
        """Return by how much errors are larger or smaller than declared [-], (n, 2) or one.

        Parameters
        ----------
        slip : of front and rear axle [rad], (n, 2).
        v_x : speeds [m/s], positive, (n,).
        """
        del slip, v_x
        return 1.0

    @abstractmethod
    def relative_sd(self, alpha: Array) -> Array:
        """Return how unsure the forces at slip angles still are, (k, 2): 1 as before learning.

        Standard deviation of the force over that of the prior.

        Parameters
        ----------
        alpha : slip angles [rad], (k,), not zero.
        """

    @abstractmethod
    def calibrated_by(self, calibration: Any, model_error: Array | None = None) -> Any:
        """Return the model, its band calibrated.

        Parameters
        ----------
        calibration : None assumes the declared errors.
        model_error : share of the force that the model misses of the identification drive, (2,);
            None where not computed.
        """

    def samples(self, n: int, rng: np.random.Generator) -> tuple[Any, ...]:
        """Return models drawn from what is not known of the tires.

        Parameters
        ----------
        n : how many.
        rng : numbers of the draw.

        Raises
        ------
        ValueError
            Where n is negative, or no tire is among what was drawn.
        """
        if n < 0:
            raise ValueError(f"n must not be negative, it is {n}")
        return self._samples(n, rng)

    @abstractmethod
    def _samples(self, n: int, rng: np.random.Generator) -> tuple[Any, ...]: ...

    def on_another_road(self, sd_friction: float = SD_FRICTION) -> Any:
        """Return the model for a road whose friction is not that of the identification drive.

        Its curve stays, its band opens along φ = μ φ₀(α/μ), the change that friction makes.

        Parameters
        ----------
        sd_friction : standard deviation of ln μ between the roads [-].
        """
        if not 0.0 <= sd_friction < np.inf:
            raise ValueError(f"sd_friction must be finite, not negative, it is {sd_friction}")
        return self._opened(sd_friction)

    @abstractmethod
    def _opened(self, sd_friction: float) -> Any: ...

    @overload
    def at(
        self, alpha: float, axle: Axle, level: float = ..., *, v_x: float | None = ...
    ) -> tuple[float, float]: ...
    @overload
    def at(
        self,
        alpha: ArrayLike,
        axle: Axle | None = None,
        level: float = ...,
        *,
        v_x: float | None = ...,
    ) -> tuple[Array, Array]: ...

    def at(
        self,
        alpha: ArrayLike,
        axle: Axle | None = None,
        level: float = LEVEL,
        *,
        v_x: float | None = None,
    ) -> tuple[float, float] | tuple[Array, Array]:
        """Return between which forces the true one lies [N]: (low, high), each as of `force`.

        Parameters
        ----------
        alpha : slip angles in the paper's sign [rad], a number or an array of any shape.
        axle : "front" or "rear", for ends of the shape of `alpha`; None gives both, (..., 2).
        level : in which share of cases it shall, above 0 and below 1.
        v_x : speed [m/s], positive; None takes that of the identification drive.

        Raises
        ------
        ValueError
            Where the axle has another name, or level or speed are impossible.
        """
        slip = np.asarray(alpha, dtype=np.float64)
        center = np.asarray(self.model.force(slip, axle, v_x=v_x))
        half = self.half(slip.ravel(), level, v_x=v_x).reshape(*slip.shape, 2)
        half = of_axle(half, axle)
        low, high = center - half, center + half
        return (float(low), float(high)) if low.ndim == 0 else (low, high)

    def half(
        self, alpha: Array, level: float = LEVEL, *, v_x: float | Array | None = None
    ) -> Array:
        """Return half its width around the steady forces, (k, 2) [N].

        Parameters
        ----------
        alpha : slip angles [rad], (k,).
        level : in which share of cases it shall hold, above 0 and below 1.
        v_x : speed [m/s], a number or (k,), positive; None takes that of the identification drive,
            under static loads.
        """
        speed = np.broadcast_to(self.speed if v_x is None else v_x, np.shape(alpha))
        if not (speed > 0.0).all():
            raise ValueError(f"v_x of a band must be positive, it is {speed.min()}")
        pressed = self.model.vehicle.load_ratio(np.zeros(speed.shape) if v_x is None else speed)
        return self._half(np.column_stack([alpha, alpha]), speed, pressed, level)

    def along(self, slip: Array, v_x: Array, level: float = LEVEL) -> Array:
        """Return half its width where each axle has its own slip, (n, 2) [N].

        Parameters
        ----------
        slip : of front and rear axle [rad], (n, 2).
        v_x : speeds [m/s], positive, (n,).
        level : in which share of cases it shall hold, above 0 and below 1.
        """
        return self._half(slip, v_x, self.model.vehicle.load_ratio(v_x), level)

    def _half(self, slip: Array, v_x: Array, pressed: Array, level: float) -> Array:
        width = self.spread(slip, v_x, pressed).half_width(self.factor(slip, v_x), level)
        return width * self.model.vehicle.axle_loads

    def of_curves(self, recording: Recording, level: float = LEVEL) -> Array:
        """Return half its width at the slip and speed of a drive, (n, 2) [N].

        Of the steady forces, without noise of the drive's sensors.
        """
        speed = np.maximum(recording.v_x, self.model.min_speed)
        return self.along(self.model.lagged_slip(recording), speed, level)

    def on(self, recording: Recording) -> "Band":
        """Return the band of a log: with what is missed of it, where that is in the width."""
        del recording
        return self

    def over(self, recording: Recording, level: float = LEVEL) -> Array:
        """Return half its width around the predicted forces of a drive, (n, 2) [N].

        It is zero where the forces read zero.

        Parameters
        ----------
        recording : the drive.
        level : share of samples that it shall hold, above 0 and below 1.
        """
        moving = recording.v_x[:, None] >= self.model.min_speed
        return np.where(moving, self.on(recording).of_curves(recording, level), 0.0)

    def slope_over(self, recording: Recording) -> Array:
        """Return the slope of the curves over the slip of a drive [static loads/rad], (n, 2)."""
        slope = self.model.slope_at(self.model.lagged_slip(recording))
        return slope * self.model.vehicle.load_ratio(recording.v_x)


def of_axle(both: Array, axle: Axle | None) -> Array:
    """Return of what both axles have, (..., 2), that of one; of None both."""
    if axle is None:
        return both
    if axle not in AXLES:
        raise ValueError(f"axle must be front or rear, it is {axle!r}")
    return both[..., AXLES.index(axle)]
