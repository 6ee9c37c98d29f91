"""The tires that an estimate found, frozen: curve, lag, sway, load, ellipse and sensors."""

import math
from collections import deque
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array, blocks, large
from identifier.axle.car import Car
from identifier.axle.car import car_numbers as axle_numbers
from identifier.axle.curve import Curve
from identifier.axle.dynamics import lagged_force, series_compliance
from identifier.axle.gate import GateState, Plausibility
from identifier.axle.slip import SHORTEST, Sway
from identifier.band import (
    LARGEST_SD,
    Band,
    BandSpread,
)
from identifier.estimate.chosen import CHOSEN
from identifier.estimate.drive import Drive
from identifier.estimate.latent import TRUST, LateralVelocity, estimate_v_y
from identifier.estimate.priors import Priors
from identifier.estimate.solve import car_numbers, simulate
from identifier.frozen import FORMAT, vehicle_from, vehicle_numbers
from identifier.motion.model import (
    REPLAYED,
    carcass_curve,
    curve_function,
    pushed_function,
    replay_scan,
)
from identifier.motion.parameters import INDEX, NAMES, PARAMETERS, curve_index
from identifier.setup import Setup
from identifier.tire_model import (
    AXLES,
    GRIP,
    RELAXATION,
    STIFFNESS,
    Axle,
    Drives,
    Estimate,
    Fact,
    Reached,
    TireModel,
    brisk_speed,
)
from models.recordings import Recording
from models.rules import require_positive
from models.schema import Table
from models.vehicle import DOWNFORCE_SPEED, Vehicle, load_ratio

BOUNDED = (("ln_stiffness", "cornering stiffness", True), ("ln_grip", "grip", True))
_KEYS = {  # of arrays in a file
    "covariance": "covariance",
    "driven": "driven_slip_rad",
    "speeds": "speeds_m_s",
    "a_x": "a_x_m_s2",
    "unexplained": "unexplained",
    "force_missed": "force_missed",
}


class Segment(NamedTuple):
    """A part of a drive on another road: from, to [s], its friction over that of the curves, sd."""

    begin: float
    end: float
    ratio: float
    sd: float


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class FittedModel(TireModel):
    """Axle forces of the forward model (`motion.model`) at estimated parameters.
    p : parameters, as `motion.parameters` lists them (p,).
    covariance : of them (p, p); zero of what was not estimated.
    driven : largest slip of each axle that the drives reached [rad], (2,).
    speeds : least and largest speed of them [m/s], (2,).
    a_x : least and largest longitudinal acceleration of them [m/s²], (2,).
    unexplained : size of what the drives miss for longer than noise, over the errors that are
        usual, 2 % of the static load and 4 % of the lateral acceleration in g, (2,).
    force_missed : share of the measured force that it misses of the drives that taught, (2,); None
        where nobody looked.
    parted : of drives without v_y, side slip by which soft and stiff tires that explain them alike
        part, rms [rad].
    a_y_late : of such drives, by which a_y was later than the yaw rate [s].
    """

    kind = "fit"
    scales_with_load = True

    vehicle: Vehicle
    p: Array
    covariance: Array
    driven: Array
    speeds: Array
    a_x: Array
    unexplained: Array
    segments: tuple[Segment, ...] = ()
    force_missed: Array | None = None
    parted: float = 0.0
    a_y_late: float = 0.0

    def __post_init__(self) -> None:
        n = len(NAMES)
        shapes = {
            "p": (n,),
            "covariance": (n, n),
            "driven": (2,),
            "speeds": (2,),
            "a_x": (2,),
            "unexplained": (2,),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"{name} must hold {shape} finite numbers, it has {value.shape}")
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

    def curve_numbers(self, axle: str) -> Array:
        """Return the numbers of the curve of an axle, ln C to ln m, (9,)."""
        return self.p[curve_index(axle)]

    def curve_at(self, alpha: Array) -> tuple[Array, Array, Array]:
        """Return φ and dφ/dα (k, 2) [static loads], and slopes of φ over curve numbers (2, k, 9).
        alpha : slip angles of each axle [rad], (k, 2).
        """
        phi, slope, J = [], [], []
        for i, axle in enumerate("fr"):
            numbers = np.tile(self.curve_numbers(axle)[:, None], (1, len(alpha)))
            found = curve_function()(numbers, alpha[:, i][None])
            values = [np.array(one) for one in found]
            phi.append(values[0].ravel())
            slope.append(values[1].ravel())
            J.append(values[2].T)
        return np.column_stack(phi), np.column_stack(slope), np.array(J)

    def _steady(self, alpha: Array, v_x: float) -> Array:
        phi, _, _ = self.curve_at(np.column_stack([alpha, alpha]))
        return phi * self._loads * self.vehicle.load_ratio(v_x)

    def force(  # type: ignore[override]
        self,
        alpha: ArrayLike,
        axle: Axle | None = None,
        *,
        v_x: float | None = None,
        a_x: float | None = None,
    ) -> float | Array:
        """Return the steady lateral force at slip angles, the wheels straight ahead [N].
        a_x : longitudinal acceleration [m/s²]: braking and power take of the lateral force, and
            shift load between the axles. None is of tires that push nothing lengthwise, as those
            of a car that coasts.
        """
        found = np.asarray(TireModel.force(self, alpha, axle, v_x=v_x))
        if a_x is None:
            return found if found.ndim else float(found)
        speed = self._curve_speed if v_x is None else v_x
        coasting = -self.vehicle.drag * speed**2
        pushed, numbers = pushed_function(), car_numbers(self.vehicle)
        moving, plain = (
            np.array(pushed(self.p, numbers, one, speed)).ravel() for one in (a_x, coasting)
        )
        ratio = moving / plain
        scaled: Array = found * (ratio if axle is None else ratio[AXLES.index(axle)])
        return float(scaled) if scaled.ndim == 0 else scaled

    def _pair(self, name: str) -> Array:
        """Return a parameter of both axles, (2,)."""
        return np.array([self[f"{name}_f"], self[f"{name}_r"]])

    def _curve(self, slip: Any, v_x: Any) -> Curve:
        """Return the force curve at a slip (2,) [rad] and a speed, in static axle loads."""
        found = [carcass_curve(*self.curve_numbers(axle), slip[i]) for i, axle in enumerate("fr")]
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
        )

    @property
    def lagged(self) -> bool:
        return True

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

        Signals go through a zero-phase mean of 0.07 s (`estimate.drive`); where the car is slower
        than `min_speed` forces are zero.
        """
        return self._over(recording)[0] * self._loads

    def lagged_slip(self, recording: Recording) -> Array:
        """Return the slip that makes the force, in the paper's sign, (n, 2) [rad]."""
        return self._over(recording)[1]

    def estimated_v_y(self, recording: Recording) -> LateralVelocity:
        """Return the v_y of a drive whose sensors show none, smoothed on these tires.

        Raises
        ------
        RecordingError
            Where there is no a_y either.
        """
        log = recording
        key = (
            *(log.t, log.v_x, log.r, log.a_y, log.a_x, log.delta_f, log.delta_r),
            *(self.p, self.covariance, self.vehicle),
        )
        for known, breaks, found in _LAST:
            same = all(one is other for one, other in zip(known, key, strict=True))
            if same and breaks == log.breaks:
                return found
        found = estimate_v_y(recording, self.vehicle, self.p, self.covariance)
        _LAST.append((key, log.breaks, found))
        return found

    def _over(self, recording: Recording) -> tuple[Array, Array]:
        force, slip = large((len(recording), 2)), large((len(recording), 2))
        for segment in recording.segments:
            begin, end = segment.start, min(segment.stop, len(recording))
            for part in blocks(end - begin):
                first = max(part.start - CHOSEN.warm, 0)
                some = slice(begin + first, begin + part.stop)
                drive = Drive.of(recording, self.vehicle, some, replay=True)
                out = simulate(drive, self.p, self.vehicle)
                kept = slice(begin + part.start, begin + part.stop)
                force[kept] = out["force"][part.start - first :]
                slip[kept] = out["slip"][part.start - first :]
        return force, slip

    def slope_at(self, slip: Array) -> Array:
        """Return the slope of the curves under static loads at slips [static loads/rad], (n, 2)."""
        return self.curve_at(slip)[1]

    @property
    def drives(self) -> Drives:
        return Drives(
            speeds=self.speeds,
            lengthwise=(self.p, self.covariance),
            elsewhere=tuple((one.begin, one.end) for one in self.segments),
            notes=self._notes(),
            at_bounds=self._at_bounds(),
        )

    def _notes(self) -> tuple[tuple[str, str], ...]:
        listed = [
            (
                "another_road",
                f"from {one.begin:.4g} to {one.end:.4g} s the friction was {one.ratio:.2f} ± "
                f"{one.sd:.2f} times that of the rest of the drive, for which the curves are given",
            )
            for one in self.segments
        ]
        gain, k = self["steering_gain"], INDEX["steering_gain"]
        sd = float(np.sqrt(self.covariance[k, k]))
        if abs(gain) > max(CHOSEN.surely * sd, CHOSEN.noted_gain):
            listed.append(
                (
                    "steering_gain",
                    f"the front wheels turn {1.0 + gain:.2f} ± {sd:.2f} times as far as the log "
                    "says: check the steering ratio; the curves allow for it",
                )
            )
        if self.a_y_late:
            listed.append(
                (
                    "a_y_late",
                    f"a_y is {1e3 * self.a_y_late:.0f} ms late against the yaw rate, as behind a "
                    "filter: it is read so much earlier; log it without the filter",
                )
            )
        if self.parted > TRUST.parted:
            listed.append(
                (
                    "not_observable",
                    "side slip is not observable without v_y: soft and stiff tires explain the "
                    f"drive alike, {np.degrees(self.parted):.2g} deg apart; the stiffness of the "
                    "rear axle decides it",
                )
            )
        return tuple(listed)

    def _at_bounds(self) -> tuple[Reached, ...]:
        """Return the numbers of the tires that rest at the bounds of what tires have."""
        priors, listed = Priors.of(self.vehicle), []
        for i, axle in enumerate(AXLES):
            for name, title, refuses in BOUNDED:
                k = INDEX[f"{name}_{'fr'[i]}"]
                if priors.low[k] + 1e-6 < self.p[k] < priors.high[k] - 1e-6:
                    continue
                listed.append(
                    Reached(
                        axle,
                        title,
                        float(np.exp(self.p[k])),
                        "static loads" if name == "ln_grip" else "static loads per rad",
                        "beyond what tires have: check signs, units and the vehicle file",
                        refuses,
                    )
                )
        return tuple(listed)

    @property
    def band(self) -> "_FittedBand":
        """How unsure it is, by its covariance and its error on the drives that taught."""
        return _FittedBand(self)

    @property
    def known_slip(self) -> Array:
        """Largest slip [rad] that the drives reached and where the doubt is small, (2,).

        A step steer decides the force at its end better than the slope at zero: the largest counts.
        """
        return _known_slip(self).copy()

    @property
    def covariance_before(self) -> Array:
        """Covariance of the beliefs about its car, (p, p)."""
        return _covariance_before(self)

    # What it says of itself.

    @property
    def stiffness(self) -> Array:
        """Slope of the force curves at zero, under static loads [N/rad], (2,)."""
        _, slope, _ = self.curve_at(np.zeros((1, 2)))
        stiffness: Array = slope[0] * self._loads
        return stiffness

    @property
    def relaxation_length(self) -> Array:
        """Lag of slip at small slip, under static loads [m], (2,); it goes with the slope."""
        stiff = np.maximum(self.stiffness / self._loads, 0.0)
        length: Array = self._pair("compliance") * stiff + SHORTEST * self.vehicle.wheelbase
        return length

    def estimates(self) -> tuple[Estimate, ...]:
        before = self.covariance_before
        given = self.vehicle.bicycle[4:]
        band, loads, lag = self.band, self._loads, self.relaxation_length
        stiff = [
            sd[0] / CHOSEN.slope_step for sd in band.of_phi(np.full((1, 2), CHOSEN.slope_step))
        ]
        stiffness = self.stiffness
        C = stiffness / loads
        slip = np.linspace(0.0, CHOSEN.widest, 201)
        slip = np.column_stack([slip, slip])
        phi = self.curve_at(slip)[0]
        peak = np.take_along_axis(slip, phi.argmax(axis=0)[None], axis=0)
        top, wide = phi.max(axis=0), [sd[0] for sd in band.of_phi(peak)]
        sd_C, sd_top = (
            np.hypot(sd[0], size * band.load_doubt) for sd, size in ((stiff, C), (wide, top))
        )

        def sd_of(name: str) -> tuple[float, float]:
            """Return the standard deviation of a parameter, and the prior's."""
            k = INDEX[name]
            return math.sqrt(self.covariance[k, k]), math.sqrt(before[k, k])

        rows: list[tuple[str, Axle, float, float, str, float | None, bool]] = []
        for i, axle in enumerate(AXLES):
            now, prior = sd_of(f"compliance_{axle[0]}")
            known = [sd[0][i] <= CHOSEN.decided * sd[1][i] for sd in (stiff, wide)]
            rows += [
                (STIFFNESS, axle, stiffness[i], sd_C[i] * loads[i], "N/rad", given[i], known[0]),
                (GRIP, axle, top[i], sd_top[i], "static load", None, known[1]),
                (RELAXATION, axle, lag[i], C[i] * now, "m", None, now <= CHOSEN.decided * prior),
            ]
        zeros: tuple[tuple[str, Axle, str, str, float], ...] = (
            ("zero of the steering", "front", "steering_zero", "deg", math.degrees(1.0)),
            ("bias of v_y", "rear", "v_y_bias", "m/s", 1.0),
        )
        for title, axle, name, unit, scale in zeros:
            now, prior = sd_of(name)
            known_zero, value = now <= CHOSEN.decided * prior, scale * self[name]
            rows.append((title, axle, value, scale * now, unit, 0.0, known_zero))
        return tuple(
            Estimate(title, axle, float(value), float(sd), unit, declared, bool(known))
            for title, axle, value, sd, unit, declared, known in rows
        )

    def facts(self) -> tuple[Fact, ...]:
        lines = [Fact("identified up to a slip of", np.degrees(self.known_slip), "deg")]
        if self.vehicle.has_downforce:
            more = 100.0 * (self.vehicle.load_ratio(DOWNFORCE_SPEED) - 1.0)
            lines.append(Fact(f"more of all forces at {DOWNFORCE_SPEED:g} m/s", more, "%"))
        return tuple(lines)

    # Another car, another road, another form.

    def mounted_on(self, vehicle: Vehicle) -> "FittedModel":
        return replace(self, vehicle=vehicle, segments=(), force_missed=None)

    def at_friction(self, ratio: float) -> "FittedModel":
        require_positive(ValueError, ratio=ratio)
        p = self.p.copy()
        p[INDEX["ln_road"]] += math.log(ratio)
        driven = ratio * self.driven
        return replace(self, p=p, driven=driven, segments=(), force_missed=None)

    def as_prior(self, vehicle: Vehicle) -> Priors:
        """Return what it leaves to believe of a car: its numbers, as sure as they are."""
        usual = Priors.of(vehicle)
        where = np.ix_(usual.moves, usual.moves)
        information = np.zeros_like(usual.information)
        sure = self.covariance + CHOSEN.least_doubt * np.diag(usual.sd**2)
        information[where] = np.linalg.inv(sure[where])
        return replace(usual, mean=self.p, information=information, typed=())

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

    # As a file.

    def to_dict(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "kind": self.kind,
            "vehicle": vehicle_numbers(self.vehicle.without_chassis()),
            "parameters": {
                one.name: {"value": float(value), "unit": one.unit, "sd": float(math.sqrt(var))}
                for one, value, var in zip(
                    PARAMETERS, self.p, np.maximum(np.diag(self.covariance), 0.0), strict=True
                )
            },
            **{
                key: value.tolist()
                for name, key in _KEYS.items()
                if (value := getattr(self, name)) is not None
            },
            "segments": [one._asdict() for one in self.segments],
            **({"parted_rad": self.parted} if self.parted else {}),
            **({"a_y_late_s": self.a_y_late} if self.a_y_late else {}),
            "cornering_stiffness_N_rad": self.stiffness.tolist(),
            "relaxation_length_m": self.relaxation_length.tolist(),
            "known_slip_rad": self.known_slip.tolist(),
        }

    @classmethod
    def _read(cls, table: Table) -> Self:
        parameters = table.table("parameters")
        found = {
            "p": np.array([parameters.table(name).number("value") for name in NAMES]),
            **{name: table.array(key) for name, key in _KEYS.items() if name != "force_missed"},
        }
        if "force_missed" in table:
            found["force_missed"] = table.array("force_missed")
        for name, value in found.items():
            if np.abs(value).max(initial=0.0) > CHOSEN.largest:
                table.refuse(
                    _KEYS.get(name, "parameters"), f"must hold numbers below {CHOSEN.largest:g}"
                )
        segments = table.tables("segments") if "segments" in table else []
        parted, late = (
            table.number(key) if key in table else 0.0 for key in ("parted_rad", "a_y_late_s")
        )
        return cls(
            vehicle=vehicle_from(table.value("vehicle")),
            segments=tuple(
                Segment(*(one.number(name) for name in Segment._fields)) for one in segments
            ),
            parted=parted,
            a_y_late=late,
            **found,
        )


@dataclass(frozen=True, slots=True)
class _FittedBand(Band[FittedModel]):
    """How unsure a fit is: by its covariance, and its error on the drives that taught."""

    @property
    def calibrated(self) -> bool:
        """Whether its width is more than noise of the sensors: always."""
        return True

    @property
    def origin(self) -> str:
        front, rear = 100.0 * self._error_at(CHOSEN.typical)
        return (
            f"what the drives leave open, and an error of the model of {front:.0f} / {rear:.0f} % "
            f"at {CHOSEN.typical:g} static loads, from its error on them and a mass known to "
            f"{100.0 * CHOSEN.sure_mass:.0f} %"
        )

    @property
    def speed(self) -> float:
        return brisk_speed(self.model.vehicle, self.model.min_speed)

    @property
    def load_doubt(self) -> Array:
        """Relative standard deviation of the static loads: mass and center of gravity, (2,)."""
        car = self.model.vehicle
        arms = np.array([car.l_r, car.l_f])
        doubt: Array = np.hypot(CHOSEN.sure_mass, CHOSEN.sure_center * car.wheelbase / arms)
        return doubt

    @property
    def error_share(self) -> Array:
        """Standard deviation of the model's own error, the part that goes with the force, (2,)."""
        return np.hypot(
            self.load_doubt, CHOSEN.elsewhere * CHOSEN.error_size[1] * self.model.unexplained
        )

    @property
    def error_floor(self) -> Array:
        """The part of it that is there without a force [static loads], (2,)."""
        floor: Array = CHOSEN.elsewhere * CHOSEN.error_size[0] * self.model.unexplained
        return floor

    def _error_at(self, force: float) -> Array:
        """Return that error over a force [static loads], (2,)."""
        return np.hypot(self.error_share, self.error_floor / force)

    def spread(self, slip: Array, v_x: Array, pressed: Array) -> BandSpread:
        """Return the variances of the steady forces, (n, 2): of curve, zeros and the own error."""
        phi, slope, J = self.model.curve_at(slip)
        variance = np.empty_like(phi)
        for i, axle in enumerate("fr"):
            index = [*curve_index(axle), *_OFFSETS]
            steered = np.full(len(phi), 1.0 if i == 0 else 0.0)
            zeros = np.column_stack([steered, 1.0 / v_x, np.ones(len(phi))])
            h = np.hstack([J[i], slope[:, i, None] * zeros])
            P = self.model.covariance[np.ix_(index, index)]
            variance[:, i] = np.einsum("ki,ij,kj->k", h, P, h)
        own = self.error_floor**2 + (self.error_share * phi) ** 2
        total = (np.maximum(variance, 0.0) + own) * pressed**2
        return BandSpread(total, np.zeros_like(total))

    def of_phi(self, slip: Array) -> tuple[Array, Array]:
        """Return the standard deviation of φ at slips (n, 2), and that before learning."""
        _, _, J = self.model.curve_at(slip)
        sd = []
        for P in (self.model.covariance, self.model.covariance_before):
            found = [
                np.einsum("ki,ij,kj->k", J[i], P[np.ix_(index, index)], J[i])
                for i, index in enumerate(map(curve_index, "fr"))
            ]
            sd.append(np.sqrt(np.maximum(np.column_stack(found), 0.0)))
        return sd[0], sd[1]

    def relative_sd(self, alpha: Array) -> Array:
        sd, prior = self.of_phi(np.column_stack([alpha, alpha]))
        ratio: Array = sd / np.maximum(prior, 1e-12)
        return ratio

    def calibrated_by(self, calibration: Any, force_missed: Array | None = None) -> FittedModel:
        """Return the model with what it misses of the drives that taught."""
        del calibration
        return replace(self.model, force_missed=force_missed)

    def _opened(self, sd_friction: float) -> FittedModel:
        covariance, k = self.model.covariance.copy(), INDEX["ln_road"]
        covariance[k, k] += sd_friction**2
        return replace(self.model, covariance=covariance)

    def _samples(self, n: int, rng: np.random.Generator) -> tuple[FittedModel, ...]:
        model, priors = self.model, Priors.of(self.model.vehicle)
        share = self._error_at(CHOSEN.typical)
        values, vectors = np.linalg.eigh(model.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        drawn = []
        for _ in range(n):
            p = model.p + root @ rng.standard_normal(len(model.p))
            for i, axle in enumerate("fr"):
                p[INDEX[f"ln_stiffness_{axle}"]] += share[i] * rng.standard_normal()
                p[INDEX[f"ln_grip_{axle}"]] += share[i] * rng.standard_normal()
            drawn.append(replace(model, p=np.clip(p, priors.low, priors.high)))
        return tuple(drawn)


# A run, its verdict and its report ask about the same drive: the last few answers are kept.
_LAST: deque[tuple[tuple[Any, ...], tuple[int, ...], LateralVelocity]] = deque(maxlen=4)
_OFFSETS = [INDEX["steering_zero"], INDEX["v_y_bias"], INDEX["v_y_angle"]]


@lru_cache(maxsize=4)
def _known_slip(model: FittedModel) -> Array:
    """Return `FittedModel.known_slip`, which a verdict asks for many times."""
    grid = np.linspace(0.0, 1.0, 101)[1:]
    sd, prior = model.band.of_phi(np.outer(grid, model.driven))
    sure = sd <= LARGEST_SD * np.maximum(prior, 1e-12)
    known: Array = model.driven * np.max(grid[:, None] * sure, axis=0)
    return known


@lru_cache(maxsize=4)
def _covariance_before(model: FittedModel) -> Array:
    """Return `FittedModel.covariance_before`, which a verdict asks for many times, too."""
    return Priors.of(model.vehicle).covariance
