"""The axle model, frozen: force curves of slip, their lag and sway, and where they are known."""

from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache
from typing import Any, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array, blocks
from codegen.escape import displayed
from identifier.axle.band import (
    RELATIVE,
    BandCalibration,
    colored,
    colored_variance,
    declared_spread,
    root,
    sensor_noise,
)
from identifier.axle.car import Car, car_numbers
from identifier.axle.curve import EDGES, LADDER, doublings, unit_matrix, unit_slopes
from identifier.axle.dynamics import curve_at_speed, lagged_force, series_compliance
from identifier.axle.gate import GateState, Plausibility
from identifier.axle.prior import friction_direction
from identifier.axle.slip import SHORTEST, Sensors, Sway, SwayState, beyond_play
from identifier.axle.step import FROZEN_CARRY, OVER, build_frozen
from identifier.band import (
    LARGEST_SD,
    LEVEL,
    Band,
    BandSpread,
    normal_quantile,
)
from identifier.frozen import FORMAT, FrozenModelError, vehicle_from, vehicle_numbers
from identifier.motion.parameters import INDEX, curve_index
from identifier.setup import Setup
from identifier.tire_model import (
    AXLES,
    GRIP,
    RELAXATION,
    STIFFNESS,
    Estimate,
    Fact,
    TireModel,
    brisk_speed,
)
from models.recordings import Recording
from models.rules import require_positive
from models.schema import Table
from models.vehicle import Vehicle

_LARGEST = 1e9  # of the numbers in a file, SI and static axle loads
_LARGEST_WEIGHT = 100.0  # static axle loads: no unit of a tire carries more
_ROUNDING = 1e-6  # of correlations, as learning in float leaves them
_DECIDED = 0.5  # standard deviation over the prior's, up to which a drive decided a number
_DRAWS = 1000  # of weights, before a possible tire must have been among them
_BENT = 0.4  # slope over that at zero, below which a curve shows where it saturates

BESIDE = ("compliance", "sway_share", "offset")  # the curve
ARRAYS = ("W", *BESIDE, "covariance", "prior_covariance", "excitation")
EXACT = Sensors()


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class AxleModel(TireModel):
    """Axle forces φ(x) = Σ w_j tanh(x/α_j) of lagged slip x, in static axle loads.

    Odd in slip up to the sensor offsets, saturating at Σ w_j. Rows are axles, front and rear.
    Where the car has downforce, forces are those times λ = 1 + κ v_x² (`Vehicle.load_ratio`); what
    is given without a speed is of the static loads.
    ladder : slip scales α_j of the units [rad].   W : weights [static axle loads], (2, n).
    compliance : deflection of the carcass [m per static axle load], (2,).
    sway_share : of the sway of the body that the axle follows [-], (2,).
    offset : zero of the steering in front [rad], bias of v_y at the rear [m/s], (2,).
    covariance : of [W, compliance, sway_share, offset], (2, n + 3, n + 3).
    prior_covariance : `covariance` before the first sample.
    excitation : largest slip [rad], then time of learning above each of `EDGES` [s], (2, 9).
    sensors : errors that were known before it learnt, and stay.
    calibration : of the band, by segments that did not teach it; None where nobody calibrated.
    tells_v_y : whether the inertial identifier learnt it, which needs no v_y and tells it.
    model_error : share of the measured force that it misses of the drive that taught, rms, (2,);
        None where nobody looked.
    """

    kind = "axle"
    scales_with_load = True

    vehicle: Vehicle
    ladder: tuple[float, ...]
    sway: Sway
    plausibility: Plausibility
    W: Array
    compliance: Array
    sway_share: Array
    offset: Array
    covariance: Array
    prior_covariance: Array
    excitation: Array
    sensors: Sensors = EXACT
    calibration: BandCalibration | None = None
    tells_v_y: bool = False
    model_error: Array | None = None

    def __post_init__(self) -> None:
        doublings(self.ladder)
        n = len(self.ladder)
        for name, shape in (
            ("W", (2, n)),
            *((name, (2,)) for name in BESIDE),
            ("covariance", (2, n + 3, n + 3)),
            ("prior_covariance", (2, n + 3, n + 3)),
            ("excitation", (2, 1 + len(EDGES))),
        ):
            value = getattr(self, name)
            if value.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, it has {value.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} holds a number that is not finite")
        for name in ("covariance", "prior_covariance"):
            for P in getattr(self, name):
                if not np.allclose(P, P.T) or not _is_covariance(P):
                    raise ValueError(f"{name} must be symmetric and positive definite")
        if np.abs(self.W).max() > _LARGEST_WEIGHT:
            raise ValueError(
                f"W must be static axle loads below {_LARGEST_WEIGHT:g}, it reaches "
                f"{np.abs(self.W).max():g}"
            )
        error = self.model_error
        if error is not None and not (error.shape == (2,) and (error >= 0.0).all()):
            raise ValueError(f"force_missed must be two shares of at least 0, it is {error}")
        self._require_plausible()

    def _require_plausible(self) -> None:
        """Refuse a lag, a share or an offset that no car has."""
        car, at_most = self.vehicle, self.plausibility
        for name, value, low, high in (
            ("compliance [m]", self.compliance, 0.0, car.wheelbase),
            ("sway share", self.sway_share, 0.0, 1.0),
            ("steering offset [rad]", self.offset[0], -at_most.max_steering, at_most.max_steering),
            ("bias of v_y [m/s]", self.offset[1], -at_most.slow, at_most.slow),
        ):
            if not (np.less_equal(low, value).all() and np.less_equal(value, high).all()):
                raise ValueError(f"{name} must be within {low:g} and {high:g}, it is {value}")

    @property
    def min_speed(self) -> float:
        return self.plausibility.min_speed

    @property
    def stiffness(self) -> Array:
        """Slope of the force curves at zero, under static loads [N/rad], (2,): the linear part."""
        slope: Array = (self.W / np.array(self.ladder)).sum(axis=1)
        return slope * self._loads

    @property
    def relaxation_length(self) -> Array:
        """Lag of slip at small slip, under static loads [m], (2,); it goes with the slope."""
        slope = np.maximum(self.stiffness / self._loads, 0.0)
        return self.compliance * slope + SHORTEST * self.vehicle.wheelbase

    @property
    def beside_curve(self) -> Array:
        """[compliance, sway share, offset] of the axles, as steps carry them, (2, 3)."""
        return np.column_stack([self.compliance, self.sway_share, self.offset])

    def _steady(self, alpha: Array, v_x: float) -> Array:
        force = unit_matrix(alpha, self.ladder) @ self.W.T * self._loads
        return force * self.vehicle.load_ratio(v_x)

    @property
    def band(self) -> "_AxleBand":
        """How unsure it is, by its covariance."""
        return _AxleBand(self)

    @property
    def known_slip(self) -> Array:
        grid = np.linspace(0.0, 1.0, 201)[1:]
        known = np.zeros(2)
        for i, largest in enumerate(self.excitation[:, 0]):
            if largest > 0.0:
                sure = self.band.relative_sd(largest * grid)[:, i] <= LARGEST_SD
                count = sure.size if sure.all() else int(np.argmin(sure))
                known[i] = largest * count / grid.size
        return known

    def slope_at(self, slip: Array) -> Array:
        """Return the slope of the curves under static loads at slips [static loads/rad], (n, 2).
        slip : of front and rear axle [rad], (n, 2).
        """
        slope: Array = (unit_slopes(slip, self.ladder) * self.W).sum(axis=-1)
        return slope

    def estimates(self) -> tuple[Estimate, ...]:
        """Return stiffness, grip, relaxation length and offset of each axle, with their doubt.

        A number is learnt where its standard deviation is at most half of the prior's; the grip,
        where the curve also bends within the known slip.
        """
        n, scales = len(self.ladder), np.array(self.ladder)
        steep, level = np.zeros(n + 3), np.zeros(n + 3)
        steep[:n], level[:n] = 1.0 / scales, 1.0
        lag, zero = np.eye(n + 3)[n], np.eye(n + 3)[n + 2]
        slope = (self.W / scales).sum(axis=1)
        bends = self.slope_at(self.known_slip[None])[0] < _BENT * slope
        given = self.vehicle.bicycle[4:]
        offset = (("zero of the steering", "deg", np.degrees(1.0)), ("bias of v_y", "m/s", 1.0))
        listed = []
        for i, (axle, load) in enumerate(zip(AXLES, self._loads, strict=True)):
            name, unit, scale = offset[i]
            rows = (
                (STIFFNESS, steep, slope[i] * load, load, "N/rad", given[i], True),
                (GRIP, level, self.W[i].sum(), 1.0, "static load", None, bends[i]),
                (RELAXATION, lag, self.relaxation_length[i], max(slope[i], 0.0), "m",
                 None, True),
                (name, zero, scale * self.offset[i], scale, unit, 0.0, True),
            )  # fmt: skip
            for title, along, value, per, its_unit, before, seen in rows:
                now, prior = (
                    float(np.sqrt(along @ P[i] @ along))
                    for P in (self.covariance, self.prior_covariance)
                )
                learnt = bool(seen and now <= _DECIDED * prior)
                listed.append(
                    Estimate(title, axle, float(value), float(per) * now, its_unit, before, learnt)
                )
        return tuple(listed)

    def facts(self) -> tuple[Fact, ...]:
        known = self.known_slip
        lines = list(TireModel.facts(self))
        if (known > 0.0).all():
            unsure = 100.0 * np.diag(self.band.relative_sd(known))
            lines.append(Fact("standard deviation there, of the prior's", unsure, "%"))
        lines.append(Fact("time of learning", self.excitation[:, 1], "s"))
        return (*lines, *self._of_downforce())

    def mounted_on(self, vehicle: Vehicle) -> "AxleModel":
        # It was measured on this car alone.
        return replace(self, vehicle=vehicle, model_error=None)

    def at_friction(self, ratio: float) -> "AxleModel":
        require_positive(ValueError, ratio=ratio)
        n = len(self.ladder)
        unit = np.concatenate([np.full(n, ratio), np.ones(3)])
        excitation = self.excitation.copy()
        excitation[:, 0] *= ratio
        return replace(
            self,
            ladder=tuple(ratio * scale for scale in self.ladder),
            W=ratio * self.W,
            covariance=self.covariance * np.outer(unit, unit),
            prior_covariance=self.prior_covariance * np.outer(unit, unit),
            excitation=excitation,
            model_error=None,  # of the road that taught
        )

    lagged = True

    def curve_expression(self, alpha: Any, v_x: Any) -> Any:
        at = curve_at_speed(alpha, v_x, self.W, self.ladder, self.vehicle)
        return at.force * ca.DM(self._loads)

    def force_expression(
        self, slip: Any, x: Any, delta: Any, v_x: Any, least_lag: Any = 0.0
    ) -> tuple[Any, Any]:
        """Return the axle forces (2,) [N] and the rate of lagged slip (2,) [rad/s].
        slip : lagged slip (2,) [rad].   x : [v_y, r] (2,), as the sensors read them while learning.
        """
        v_y = self.sensors.v_y(x[0], x[1], v_x)
        return lagged_force(
            Car(*car_numbers(self.vehicle).T),
            curve_at_speed(slip, v_x, self.W, self.ladder, self.vehicle),
            series_compliance(self.compliance, self.sway_share, self.sway.frequency),
            self.offset,
            slip=slip,
            x=[v_y, x[1]],
            delta=self.sensors.steering(delta),
            v_x=v_x,
            least_lag=least_lag,
        )

    def lagged_slip(self, recording: Recording) -> Array:
        """Return the slip that makes the force, in the paper's sign, (n, 2) [rad]."""
        return self.setup(recording.dt).output(recording, "lagged_slip")

    def setup(self, dt: float) -> Setup:
        return Setup(
            scan=_frozen_scan(doublings(self.ladder), pressed=self.vehicle.has_downforce),
            carry={
                "gate": np.zeros(len(GateState._fields)),
                "sway": np.zeros(len(SwayState._fields)),
                "slip": np.tile([0.0, 0.0, 1.0, 0.0], (2, 1)),
            },
            constants={
                **self.plausibility.constants(self.vehicle, self.ladder, dt),
                "W": self.W,
                "own": self.beside_curve,
                "roll": np.array(self.sway.numbers()),
                "sensors": np.array(self.sensors),
            },
            ends_run=self.plausibility.rest(dt),
        )

    def to_dict(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "kind": self.kind,
            "units": {
                "ladder": "rad",
                "W": "static axle loads",
                "compliance": "m per static axle load",
                "sway_share": "-",
                "offset": "rad (front), m/s (rear)",
                "excitation": "rad, then s above the edges",
                "edges": "rad",
            },
            "vehicle": vehicle_numbers(self.vehicle),
            "sway": asdict(self.sway),
            "plausibility": asdict(self.plausibility),
            "ladder": list(self.ladder),
            "edges": list(EDGES),
            **{name: getattr(self, name).tolist() for name in ARRAYS},
            "cornering_stiffness_N_rad": self.stiffness.tolist(),
            "relaxation_length_m": self.relaxation_length.tolist(),
            "known_slip_rad": self.known_slip.tolist(),
            **({} if self.calibration is None else {"band": self.calibration.to_dict()}),
            **({"sensors": self.sensors._asdict()} if any(self.sensors) else {}),
            **({"tells_v_y": True} if self.tells_v_y else {}),
            **({} if self.model_error is None else {"force_missed": self.model_error.tolist()}),
        }

    @classmethod
    def _read(cls, table: Table) -> Self:
        if "own" in table:  # files of earlier versions: the three in one
            beside = table.array("own")
            if beside.shape != (2, 3):
                table.refuse("own", f"must have shape (2, 3), it has {beside.shape}")
            three = dict(zip(BESIDE, beside.T.tolist(), strict=True))
            table = Table({**three, **table.data}, "", FrozenModelError)
        numbers: dict[str, Any] = {name: table.array(name) for name in ("ladder", "edges", *ARRAYS)}
        for name, values in numbers.items():
            if (largest := np.abs(values).max(initial=0.0)) > _LARGEST:
                table.refuse(name, f"must hold numbers below {_LARGEST:g}, it reaches {largest:g}")
        ladder, edges = tuple(numbers.pop("ladder").tolist()), numbers.pop("edges").tolist()
        if edges != list(EDGES):
            table.refuse("edges", f"must be {list(EDGES)}, they are {edges}")
        if "sensors" in table:
            sensors = table.table("sensors")
            numbers["sensors"] = Sensors(*(sensors.number(name) for name in Sensors._fields))
        if "band" in table:
            numbers["calibration"] = BandCalibration.from_dict(table.value("band"))
        tells = table.data.get("tells_v_y", False)
        if not isinstance(tells, bool):
            table.refuse("tells_v_y", f"must be true or false, it is {displayed(tells)}")
        if "force_missed" in table:
            numbers["model_error"] = table.array("force_missed")
        return cls(
            vehicle=vehicle_from(table.value("vehicle")),
            ladder=ladder,
            sway=Sway(**table.table("sway").record(Sway)),
            plausibility=Plausibility(**table.table("plausibility").record(Plausibility)),
            tells_v_y=tells,
            **numbers,
        )


_declared = lru_cache(maxsize=8)(BandCalibration.declared)  # asked thrice for every band


@dataclass(frozen=True, slots=True)
class _AxleBand(Band):
    """How unsure an axle model is: by its covariance, and errors that no curve can explain."""

    model: AxleModel

    @property
    def calibrated(self) -> bool:
        return self.model.calibration is not None

    @property
    def calibration(self) -> BandCalibration:
        """That of the model; where there is none, of the declared errors."""
        if self.model.calibration is not None:
            return self.model.calibration
        return _declared(brisk_speed(self.model.vehicle, self.model.min_speed))

    @property
    def speed(self) -> float:
        return self.calibration.speed

    def factor(self, slip: Array, v_x: Array) -> Array:
        relative = v_x / self.model.vehicle.froude_speed
        return self.calibration.factor(slip, relative)

    def spread(self, slip: Array, v_x: Array, pressed: Array) -> BandSpread:
        model, n = self.model, len(self.model.ladder)
        T = np.stack([unit_matrix(slip[:, i], model.ladder) for i in range(2)])
        zero = model.slope_at(slip) * np.column_stack([np.ones_like(v_x), 1.0 / v_x])
        h = np.zeros((2, len(slip), n + 3))
        h[:, :, :n], h[:, :, -1] = T, zero.T  # the slip by its offset, too
        h *= pressed.T[:, :, None]
        left, before = (
            np.einsum("aki,aij,akj->ka", h, both, h)
            for both in (model.covariance, model.prior_covariance)
        )
        calibration = self.calibration
        left = colored_variance(left, before, calibration.color)
        force = np.einsum("aki,ai->ka", T, model.W) * pressed
        return declared_spread(force, left, before, calibration.stretch(v_x)[:, None])

    def relative_sd(self, alpha: Array) -> Array:
        T, n = unit_matrix(alpha, self.model.ladder), len(self.model.ladder)
        ratio = [
            np.einsum("ki,ij,kj->k", T, now[:n, :n], T)
            / np.einsum("ki,ij,kj->k", T, before[:n, :n], T)
            for now, before in zip(self.model.covariance, self.model.prior_covariance, strict=True)
        ]
        relative_sd: Array = np.sqrt(np.maximum(np.stack(ratio, axis=1), 0.0))
        return relative_sd

    def over(self, recording: Recording, level: float = LEVEL) -> Array:
        """Return half its width around the predicted forces of a drive, (n, 2) [N].

        White noise of the drive's own sensors is in it, as far as the lag lets it pass.
        """
        model = self.model
        slip, noise = model.lagged_slip(recording), sensor_noise(recording, model.vehicle)
        half = np.zeros_like(slip)
        for part in blocks(len(slip)):
            v_x = np.maximum(recording.v_x[part], model.min_speed)
            passed = self._noise_passed(slip[part], v_x[:, None], noise, recording.dt)
            passed *= normal_quantile(level) * np.array(model.vehicle.axle_loads)
            wide = np.hypot(self.along(slip[part], v_x, level), passed)
            half[part] = np.where(recording.v_x[part, None] >= model.min_speed, wide, 0.0)
        return half

    def _noise_passed(self, slip: Array, v_x: Array, noise: Array, dt: float) -> Array:
        """Return what noise of sensors makes of the forces, through the lag [static loads], (n, 2).

        White noise through a lag of first order leaves (1 - e)/(1 + e) of its variance.
        """
        model, car = self.model, self.model.vehicle
        sideways, steering = noise[:2] / v_x, np.array([noise[2], 0.0])
        pressed = car.load_ratio(v_x[:, 0])
        slope = model.slope_at(slip) * pressed
        slopes = np.maximum(slope, 0.02 * model.slope_at(np.zeros((1, 2))) * pressed)
        e = np.exp(-v_x * dt / (model.compliance * slopes + SHORTEST * car.wheelbase))
        passed: Array = slope * np.hypot(sideways, steering) * np.sqrt((1.0 - e) / (1.0 + e))
        return passed

    def calibrated_by(
        self, calibration: BandCalibration | None, model_error: Array | None = None
    ) -> AxleModel:
        return replace(self.model, calibration=calibration, model_error=model_error)

    def _opened(self, sd_friction: float) -> AxleModel:
        model, n = self.model, len(self.model.ladder)
        change = sd_friction * model.W @ friction_direction(model.ladder).T
        wider = model.covariance.copy()
        wider[:, :n, :n] += change[:, :, None] * change[:, None, :]
        return replace(model, covariance=wider)

    def _samples(self, n: int, rng: np.random.Generator) -> tuple[AxleModel, ...]:
        model, calibration = self.model, self.calibration
        size = np.sqrt(np.mean(calibration.factors**2, axis=1))
        both = zip(model.covariance, model.prior_covariance, calibration.color, size, strict=True)
        roots = [root(colored(P, prior, float(c), float(f))) for P, prior, c, f in both]
        drawn: list[AxleModel] = []
        for _ in range(_DRAWS * n):
            if len(drawn) == n:
                break
            one = self._drawn(roots, 1.0 + RELATIVE * size * rng.standard_normal(2), rng)
            if one is not None:
                drawn.append(one)
        if len(drawn) < n:
            raise ValueError(
                "no tire is among what the covariance leaves open: it knows too little"
            )
        return tuple(drawn)

    def _drawn(
        self, roots: list[Array], scale: Array, rng: np.random.Generator
    ) -> AxleModel | None:
        """Return a model drawn, offsets and lags within what is possible; None: no tire."""
        model, n, at_most = self.model, len(self.model.ladder), self.model.plausibility
        away = np.array([root @ rng.standard_normal(len(root)) for root in roots])
        W = (model.W + away[:, :n]) * scale[:, None]
        slope = (W / np.array(model.ladder)).sum(axis=1)
        if not ((W.sum(axis=1) > 0.0) & (slope > 0.0)).all() or np.abs(W).max() > _LARGEST_WEIGHT:
            return None
        zeros = np.array([at_most.max_steering, at_most.slow])
        low = np.column_stack([np.zeros((2, 2)), -zeros])
        high = np.column_stack([np.full(2, model.vehicle.wheelbase), np.ones(2), zeros])
        compliance, share, offset = np.clip(model.beside_curve + away[:, n:], low, high).T
        changed = replace(model, W=W, compliance=compliance, sway_share=share, offset=offset)
        return replace(changed, model_error=None)


def _is_covariance(P: Array) -> bool:
    """Return whether variances are positive and correlations those of some errors, to rounding."""
    variances = np.diag(P)
    if not (variances > 0.0).all():
        return False
    sd = np.sqrt(variances)
    return bool(np.linalg.eigvalsh(P / np.outer(sd, sd))[0] > -_ROUNDING)


@cache
def _frozen_scan(steps: tuple[int, ...], *, pressed: bool) -> Scan:
    return Scan(build_frozen(steps, pressed=pressed), carry=FROZEN_CARRY, over=OVER)


# How an identifier of curves begins with a fit.

FOLLOWED = 0.032  # [rad] of slip that curves are followed to at least, as if it were known
WIDEST = 0.6  # [rad], as far as they are followed
BEYOND = 0.3  # weight of a slip that no drive reached
LEAST_VARIANCE = 1e-10  # of weights, lag and zeros, so that no covariance is singular


def begun(model: TireModel, ladder: tuple[float, ...] = LADDER) -> TireModel:
    """Return what an identifier of curves begins with: of a fit its curves in hidden units.

    Lag, sway and errors of the sensors are taken over, and a play of the steering as a flat of the
    front curve; load transfer and ellipse are not. A model of another kind is returned as it is.
    ladder : slip scales of the units [rad].
    """
    if model.kind != "fit":
        return model
    fit: Any = model
    W, P, before = zip(*(_begun_axle(fit, i, ladder) for i in range(2)), strict=True)
    limits = Plausibility.for_vehicle(fit.vehicle)
    most = np.array([limits.max_steering, limits.slow])
    excitation = np.zeros((2, 1 + len(EDGES)))
    excitation[:, 0] = fit.reach.slip
    return AxleModel(
        vehicle=fit.vehicle,
        ladder=ladder,
        sway=fit.sway,
        plausibility=limits,
        W=np.stack(W),
        compliance=np.array([fit["compliance_f"], fit["compliance_r"]]),
        sway_share=np.array([fit["sway_share_f"], fit["sway_share_r"]]),
        offset=np.clip([fit["steering_zero"], fit["v_y_bias"]], -most, most),
        covariance=np.stack(P),
        prior_covariance=np.stack(before),
        excitation=excitation,
        sensors=Sensors(*(fit[name] for name in Sensors._fields)),
    )


def _begun_axle(fit: Any, i: int, ladder: tuple[float, ...]) -> tuple[Array, Array, Array]:
    """Return weights (n,) by least squares of a fit's curve, and the covariances of weights, lag
    and zeros (n + 3, n + 3) that the fit has and that were believed before.
    """
    n, axle, reach = len(ladder), "fr"[i], max(float(fit.known_slip[i]), FOLLOWED)
    slip = np.concatenate([np.linspace(0.0, reach, 120)[1:], np.linspace(reach, WIDEST, 60)])
    weight = np.where(slip <= reach, 1.0, BEYOND)
    units = np.vstack([unit_matrix(slip, ladder) * weight[:, None], 1e-4 * np.eye(n)])
    weights_of = np.linalg.pinv(units)[:, : slip.size] * weight
    pushes = beyond_play(slip, fit["steering_play"]) if i == 0 else slip
    phi, _, J = fit.curve_at(np.column_stack([pushes, pushes]))
    v_x = float(fit.reach.speeds.mean())
    zeros = {"steering_zero": 1.0} if i == 0 else {"v_y_bias": 1.0, "v_y_angle": v_x}
    names = (f"compliance_{axle}", f"sway_share_{axle}", *zeros)
    index = [*curve_index(axle), *(INDEX[name] for name in names)]
    to = np.zeros((n + 3, len(index)))
    to[:n, :9] = weights_of @ J[i]
    to[n, 9] = to[n + 1, 10] = 1.0
    to[n + 2, 11:] = list(zeros.values())
    P, before = (
        to @ whole[np.ix_(index, index)] @ to.T + LEAST_VARIANCE * np.eye(n + 3)
        for whole in (fit.covariance, fit.band.prior_covariance)
    )
    return weights_of @ phi[:, i], P, before
