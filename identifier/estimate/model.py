"""The tires that an estimate found, frozen: curve, lag, sway, load, ellipse and sensors."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import casadi as ca
import numpy as np

from codegen.arrays import LONG, Array, blocks, large
from identifier.axle.car import Car
from identifier.axle.car import car_numbers as axle_numbers
from identifier.axle.curve import Curve
from identifier.axle.dynamics import lagged_force, series_compliance
from identifier.axle.gate import GateState, Plausibility
from identifier.axle.slip import SHORTEST, Sway
from identifier.day import NUMBERS, Day
from identifier.estimate import report
from identifier.estimate.band import FittedBand
from identifier.estimate.day import day_of, days_of, steering_zeros
from identifier.estimate.drive import Drive
from identifier.estimate.latent import LateralVelocity, estimate_v_y
from identifier.estimate.posterior import Reach
from identifier.estimate.priors import Priors
from identifier.estimate.solve import car_numbers, simulate
from identifier.motion.model import (
    REPLAYED,
    carcass_curve,
    curve_function,
    replay_scan,
    slope_function,
)
from identifier.motion.parameters import INDEX, NAMES, curve_index
from identifier.setup import Setup
from identifier.tire_model import Drives, Estimate, Fact, TireModel
from models.recordings import Recording
from models.recordings.portion import Portion
from models.rules import require_positive
from models.schema import Table
from models.vehicle import Vehicle, load_ratio

_Found = TypeVar("_Found")
_WARM = 300  # samples before a part of a long drive, over which lag and sway settle


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class FittedModel(TireModel):
    """Axle forces of the forward model (`motion.model`) at estimated parameters.
    p : parameters, as `motion.parameters` lists them (p,).
    covariance : of them (p, p); zero of what was not estimated.
    reach : what the identification drives reached.
    model_error : share of the measured force that it misses of them, (2,); None where not
        computed.
    held : errors of the sensors for every log: of each day its first sample, and the day; None
        finds them anew for each log.
    """

    kind = "fit"
    scales_with_load = True

    vehicle: Vehicle
    p: Array
    covariance: Array
    reach: Reach
    model_error: Array | None = None
    held: tuple[tuple[int, Day], ...] | None = None

    def __post_init__(self) -> None:
        numbers = (self.p, self.covariance, *self.reach[:5])
        if not all(np.isfinite(one).all() for one in numbers):
            raise ValueError("the numbers of a fit must be finite")
        priors = Priors.of(self.vehicle)
        for name, value, low, high in zip(NAMES, self.p, priors.low, priors.high, strict=True):
            if not low - 1e-9 <= value <= high + 1e-9:
                raise ValueError(f"{name} must be within {low:g} and {high:g}, it is {value:g}")
        if not np.allclose(self.covariance, self.covariance.T, atol=1e-9):
            raise ValueError("covariance must be symmetric")
        if (np.diag(self.covariance) < 0.0).any():
            raise ValueError("covariance must have no negative variance")

    def __getitem__(self, name: str) -> float:
        return float(self.p[INDEX[name]])

    @property
    def min_speed(self) -> float:
        return self.vehicle.lowest_speed

    # The curve.

    def curve_at(self, alpha: Array) -> tuple[Array, Array, Array]:
        """Return φ and dφ/dα (k, 2) [static loads], and slopes of φ over curve numbers (2, k, 9).
        alpha : slip angles of each axle [rad], (k, 2).
        """
        phi, slope, J = [], [], []
        for i, axle in enumerate("fr"):
            numbers = np.tile(self.p[curve_index(axle), None], (1, len(alpha)))
            found = curve_function()(numbers, alpha[:, i][None])
            values = [np.array(one) for one in found]
            phi.append(values[0].ravel())
            slope.append(values[1].ravel())
            J.append(values[2].T)
        return np.column_stack(phi), np.column_stack(slope), np.array(J)

    def _steady(self, alpha: Array, v_x: float) -> Array:
        phi, _, _ = self.curve_at(np.column_stack([alpha, alpha]))
        return phi * self._loads * self.vehicle.load_ratio(v_x)

    def _pair(self, name: str) -> Array:
        """Return a parameter of both axles, (2,)."""
        return np.array([self[f"{name}_f"], self[f"{name}_r"]])

    def _curve(self, slip: Any, v_x: Any) -> Curve:
        """Return the force curve at a slip (2,) [rad] and a speed, in static axle loads."""
        found = [carcass_curve(*self.p[curve_index(axle)], slip[i]) for i, axle in enumerate("fr")]
        phi, slope = (ca.vertcat(*both) for both in zip(*found, strict=True))
        static = Curve(ca.DM(2, 0), phi, slope, slope, ca.DM(2, 1))
        if not self.vehicle.has_downforce:
            return static
        return static.under(load_ratio(ca.DM(self.vehicle.downforce), v_x))

    def curve_expression(self, alpha: Any, v_x: Any) -> Any:
        return self._curve(alpha, v_x).force * ca.DM(self._loads)

    def force_expression(
        self, slip: Any, x: Any, delta: Any, v_x: Any, least_lag: Any = 0.0
    ) -> tuple[Any, Any]:
        """Return the axle forces (2,) [N] and the rate of lagged slip (2,) [rad/s].
        x : [v_y, r] (2,), as the sensors of the drives read them.
        """
        v_y = x[0] - self["v_y_bias"] - self["v_y_angle"] * v_x - self["v_y_lever"] * x[1]
        return lagged_force(
            Car(*axle_numbers(self.vehicle).T),
            self._curve(slip, v_x),
            self.give,
            np.zeros(2),
            slip=slip,
            x=[v_y, x[1]],
            delta=(1.0 + self["steering_gain"]) * delta + self["steering_zero"],
            v_x=v_x,
            least_lag=least_lag,
            play=self["steering_play"],
        )

    lagged = True

    @property
    def give(self) -> Array:
        """Deflection of carcass and body per static axle load [m], (2,)."""
        shares = self._pair("compliance"), self._pair("sway_share")
        return series_compliance(*shares, self.sway.frequency)

    @property
    def sway(self) -> Sway:
        usual = Sway.for_vehicle(self.vehicle)
        return replace(usual, frequency=usual.frequency * math.exp(self["ln_sway"]))

    # Over a drive.

    def predict(self, recording: Recording) -> Array:
        """Return lateral axle forces over a recording, (n, 2) [N], frame of the body.

        Signals go through a zero-phase mean of 0.07 s (`estimate.drive`), the errors of this log's
        sensors (`on`) are taken off; where the car is slower than `min_speed` forces are zero.
        """
        kept = self._over(recording)[0]
        if len(recording) <= LONG:
            return kept
        force = large(kept.shape)
        force[:] = kept
        return force

    def lagged_slip(self, recording: Recording) -> Array:
        return self._over(recording)[1]

    def on(self, recording: Recording) -> Day:
        """Return the errors of a log's sensors, found from its motion with the tires held."""
        if self.held is not None:
            return self.held[0][1]
        day = self._known(recording, day_of)
        if recording.logged_v_y is not None or recording.a_y is None:
            return day
        return day.steered(*self.estimated_v_y(recording.as_logged()).steering_zero)

    def days(self, recording: Recording) -> tuple[tuple[int, Day], ...]:
        if self.held is not None:
            return self.held
        if recording.breaks and recording.logged_v_y is not None:
            return self._known(recording, days_of)
        return _found(_LAST, _steered, recording, self.vehicle, self.on(recording))

    def of_day(self, day: Day) -> Self:
        """Return the tires read by sensors with these errors: every log, the tracker, C."""
        return replace(self, p=day.on(self.p), held=((0, day),))

    def held_on(self, recording: Recording, part: Portion | None = None) -> Self:
        days = self.days(recording)
        if part is not None:
            days = tuple((part.place(first), day) for first, day in days)
        return self if days == self.held else replace(self, held=days)

    def estimated_v_y(self, recording: Recording) -> LateralVelocity:
        """Return the v_y of a drive whose sensors show none, smoothed on these tires.

        Raises
        ------
        RecordingError
            Where there is no a_y either.
        """
        return self._known(recording, estimate_v_y)

    def _known(self, log: Recording, find: Callable[..., _Found]) -> _Found:
        """Return what a log and these tires tell, kept for the next who asks."""
        return _found(_LAST, find, log, self.vehicle, self.p, self.covariance)

    def _over(self, recording: Recording) -> tuple[Array, Array]:
        given = recording, self.vehicle, self.p, self.days(recording)
        return _driven(*given) if len(recording) <= LONG else _found(_LONG_DRIVES, _driven, *given)

    def slope_at(self, slip: Array) -> Array:
        """Return the slope of the curves under static loads at slips [static loads/rad], (n, 2)."""
        both = [
            np.array(slope_function()(self.p[curve_index(axle)], x[None]))
            for axle, x in zip("fr", slip.T, strict=True)
        ]
        return np.vstack(both).T

    @property
    def drives(self) -> Drives:
        return Drives(
            speeds=self.reach.speeds,
            lengthwise=(self.p, self.covariance),
            elsewhere=tuple((one.begin, one.end) for one in self.reach.segments),
            notes=report.notes(self.reach, self.p, self.covariance) + report.of_ratio(self),
            at_bounds=report.at_bounds(self.vehicle, self.p),
        )

    @property
    def band(self) -> FittedBand:
        """How unsure it is, by its covariance and its error on the identification drives."""
        return FittedBand(self)

    @property
    def known_slip(self) -> Array:
        """Largest slip [rad] that the drives reached and where the doubt is small, (2,).

        A step steer decides the force at its end better than the slope at zero: the largest counts.
        """
        return self.band.known_slip()

    @property
    def stiffness(self) -> Array:
        """Slope of the force curves at zero, under static loads [N/rad], (2,)."""
        _, slope, _ = self.curve_at(np.zeros((1, 2)))
        return slope[0] * self._loads

    @property
    def relaxation_length(self) -> Array:
        """Lag of slip at small slip, under static loads [m], (2,); it goes with the slope."""
        stiff = np.maximum(self.stiffness / self._loads, 0.0)
        return self._pair("compliance") * stiff + SHORTEST * self.vehicle.wheelbase

    def estimates(self) -> tuple[Estimate, ...]:
        return report.estimates(self)

    def facts(self) -> tuple[Fact, ...]:
        lines = [Fact("identified up to a slip of", np.degrees(self.known_slip), "deg")]
        return (*lines, *self._of_downforce())

    # Another car, another road, another form.

    def mounted_on(self, vehicle: Vehicle) -> "FittedModel":
        there = Priors.of(vehicle)  # lengths that a small car cannot have end at its bounds
        return replace(
            self,
            vehicle=vehicle,
            p=np.clip(self.p, there.low, there.high),
            reach=self.reach._replace(segments=()),
            model_error=None,
        )

    def at_friction(self, ratio: float) -> "FittedModel":
        require_positive(ValueError, ratio=ratio)
        p = self.p.copy()
        p[INDEX["ln_road"]] += math.log(ratio)
        reach = self.reach._replace(slip=ratio * self.reach.slip, segments=())
        return replace(self, p=p, reach=reach, model_error=None)

    def setup(self, dt: float) -> Setup:
        limits = Plausibility.for_vehicle(self.vehicle)
        return Setup(
            scan=replay_scan(),
            carry={
                "gate": np.zeros(len(GateState._fields)),
                "motion": np.zeros(len(REPLAYED)),
            },
            constants={
                "parameters": self.p,
                "dt": np.array(dt),
                "car": car_numbers(self.vehicle),
                "plausibility": np.array(limits.numbers()),
                "loads": self._loads,
            },
            ends_run=limits.rest(dt),
        )

    def to_dict(self) -> dict[str, Any]:
        return report.to_dict(self)

    @classmethod
    def _read(cls, table: Table) -> Self:
        return cls(**report.read(table))


# A run, its verdict and its report ask about the same drive: the last few answers are kept.
_LONG_DRIVES: deque[Any] = deque(maxlen=2)
_LAST: deque[tuple[tuple[Any, ...], tuple[Any, ...], Any]] = deque(maxlen=32)


def _found(kept: deque[Any], find: Callable[..., _Found], log: Recording, *given: Any) -> _Found:
    """Return what is found of a log, or was: of the same signals and of the same objects."""
    signals = (log.t, log.v_x, log.r, log.a_y, log.a_x, log.delta_f, log.delta_r, log.v_y)
    key, about = (*signals, *given, find), (log.breaks, log.estimated)
    for known, what, found in kept:
        if what == about and all(one is other for one, other in zip(known, key, strict=True)):
            return found
    found = find(log, *given)
    kept.append((key, about, found))
    return found


def _steered(recording: Recording, vehicle: Vehicle, day: Day) -> tuple[tuple[int, Day], ...]:
    """Return the days of a log, of which the first is known and others have other zeros."""
    zeros = steering_zeros(recording, vehicle)
    moved = (1.0 + day["steering_gain"]) * (np.array(NUMBERS) == "steering_zero")
    firsts = [0, *(np.flatnonzero(np.diff(zeros)) + 1).tolist()]
    return tuple((k, replace(day, value=day.value + moved * (zeros[0] - zeros[k]))) for k in firsts)


def _driven(
    recording: Recording, vehicle: Vehicle, tires: Array, days: tuple[tuple[int, Day], ...]
) -> tuple[Array, Array]:
    """Return forces [N] and lagged slip of a drive, (n, 2)."""
    force, slip = large((len(recording), 2)), large((len(recording), 2))
    loads, firsts = np.array(vehicle.axle_loads), [first for first, _ in days]
    for segment in recording.segments:
        p = days[int(np.searchsorted(firsts, segment.start, side="right")) - 1][1].on(tires)
        begin, end = segment.start, min(segment.stop, len(recording))
        for part in blocks(end - begin):
            first = max(part.start - _WARM, 0)
            some = slice(begin + first, begin + part.stop)
            drive = Drive.of(recording, vehicle, some, replay=True)
            out = simulate(drive, p, vehicle)
            kept = slice(begin + part.start, begin + part.stop)
            force[kept] = loads * out["force"][part.start - first :]
            slip[kept] = out["slip"][part.start - first :]
    for one in (force, slip):
        one.setflags(write=len(recording) <= LONG)  # long ones are kept for the next who asks
    return force, slip
