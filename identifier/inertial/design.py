"""The inertial identifier as a method: everything that is chosen before the car drives."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.axle.covariance import packed, unpacked
from identifier.axle.curve import EDGES, LADDER, doublings, unit_matrix
from identifier.axle.design import AxleIdentifier, curve_boxes, curve_tracks, resumed_units
from identifier.axle.gate import Plausibility
from identifier.axle.learning import Bounds, curve_ranges, inward, rising_shares
from identifier.axle.model import EXACT, AxleModel, begun
from identifier.axle.prior import Prior
from identifier.axle.slip import FASTEST, Sensors, Sway
from identifier.estimate.model import FittedModel
from identifier.inertial.beliefs import Beliefs, Body, Trust
from identifier.inertial.motion import MOVING, SENSORS, Along, Laws, Learnt
from identifier.inertial.step import (
    CARRY,
    OVER,
    PORTS,
    LearntLimits,
    build_step,
)
from identifier.method import (
    Accelerometer,
    Limits,
    Method,
    Track,
)
from identifier.setup import Range, Setup
from identifier.tire_model import TireModel
from models.rules import require_positive, require_within
from models.vehicle import GRAVITY, Vehicle

_LEAST_SHARE = 1e-6  # of the sway, which a prior has to have
_REACH = 0.3  # rad, up to which directions of curves are those of a tire

MOST = {"bias": 0.1, "roll": 0.3, "gyro": 0.1}  # others are in `Bounds`


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialIdentifier(Method):
    """Lateral velocity and axle curves by one Kalman filter, from r, a_y, v_x and steering alone.

    What is learnt freezes to the same kind of model as that of the axle identifier.
    roll_frequency, roll_damping : of the body in a_y [sqrt(g/L)], [-].
    sensor_position : of the accelerometer, before and left of the center of gravity [m].
    held : whether tires, lag and steering stay those of the model that it begins with, but for
        their grip; else stiffness, lag and steering are learnt, too.
    doubt : standard deviation of the rear force for longer than noise: always [static axle loads],
        and of the force [-].
    a_y_late : by which a_y is later than the yaw rate [s].
    along : how a_x changes lateral forces of tires that are held, as of `motion.Along`.
    sensors : errors of sensors that were known before; that of the steering is taken out.
    ladder : slip scales of the units [rad], rising by powers of two.
    dt : sampling interval T_s [s].
    """

    needs = ("a_y",)

    prior: Prior
    plausibility: Plausibility
    bounds: Bounds
    beliefs: Beliefs = field(default_factory=Beliefs)
    trust: Trust = field(default_factory=Trust)
    roll_frequency: float = 6.0
    roll_damping: float = 0.3
    sensor_position: tuple[float, float] = (0.0, 0.0)
    held: bool = False
    doubt: tuple[float, float] = (0.0, 0.0)
    a_y_late: float = 0.0
    along: tuple[float, ...] = (0.0,) * len(Along._fields)
    sensors: Sensors = EXACT
    ladder: tuple[float, ...] = LADDER
    dt: float = 0.01

    def __post_init__(self) -> None:
        for name in ("ladder", "sensor_position", "doubt"):
            object.__setattr__(self, name, tuple(getattr(self, name)))  # a list would not hash
        doublings(self.ladder)
        require_positive(ValueError, dt=self.dt)
        require_within(ValueError, 0.5, 100.0, roll_frequency=self.roll_frequency)
        require_within(ValueError, 0.01, 10.0, roll_damping=self.roll_damping)
        require_within(ValueError, -1.0, 1.0, a_y_late=self.a_y_late)
        ahead, aside = self.sensor_position
        require_within(ValueError, -20.0, 20.0, ahead=ahead, aside=aside)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> "InertialIdentifier":
        """Return the design for a car: lengths scale with L, speeds with sqrt(g L) (Froude).
        vehicle : only its wheelbase is used here; its cornering stiffness enters the prior.
        dt : sampling interval [s].
        """
        like = AxleIdentifier.for_vehicle(vehicle, dt=dt)
        L, U = vehicle.wheelbase, vehicle.froude_speed
        return cls(
            prior=Prior(
                friction=0.85,
                sd_shape=0.08,
                compliance=0.025 * L,
                sd_compliance=0.02 * L,
                sd_v_y=0.01 * U,
            ),
            plausibility=like.plausibility,
            bounds=like.bounds,
            dt=dt,
        )

    @classmethod
    def holding(
        cls, model: FittedModel, vehicle: Vehicle, *, dt: float = 0.01
    ) -> "InertialIdentifier":
        """Return the design for a car whose tires are known: it begins with the model.
        dt : sampling interval [s].
        """
        usual, tires = cls.for_vehicle(vehicle, dt=dt), begun(model)
        assert isinstance(tires, AxleModel)
        share = max(float(tires.sway_share.mean()), _LEAST_SHARE)
        return replace(
            usual,
            held=True,
            prior=replace(usual.prior, sway_share=share),
            roll_frequency=tires.sway.frequency * vehicle.froude_time,
            doubt=(float(model.band.error_floor[1]), float(model.band.error_share[1])),
            a_y_late=max(model.reach.a_y_late, 0.0),
            sensor_position=(model.reach.a_y_place, 0.0),
            along=Along(
                load_f=-model["load_transfer"] * vehicle.wheelbase / vehicle.l_r,
                load_r=model["load_transfer"] * vehicle.wheelbase / vehicle.l_f,
                brake_f=model["braking_f"],
                brake_r=model["braking_r"],
                drive_f=model["driving_f"],
                drive_r=model["driving_r"],
                drag=vehicle.drag,
            ),
            sensors=tires.sensors,
        )

    @classmethod
    def beginning_with(
        cls, model: TireModel | None, vehicle: Vehicle, *, dt: float
    ) -> "tuple[InertialIdentifier, TireModel | None]":
        """Return the design for a car with these tires, and what its run begins with.
        model : a fit is held, what an axle identifier learnt is gone on from; others help nothing.
        dt : sampling interval [s].
        """
        if isinstance(model, FittedModel):
            return cls.holding(model, vehicle, dt=dt), model
        usual = cls.for_vehicle(vehicle, dt=dt)
        tires = None if model is None else begun(model, usual.ladder)
        if not isinstance(tires, AxleModel) or tires.ladder != usual.ladder:
            return usual, None
        return replace(usual, sensors=tires.sensors), model

    @property
    def min_speed(self) -> float:
        return self.plausibility.min_speed

    @property
    def accelerometer(self) -> Accelerometer:
        """Bias and roll in a_y, by which it estimates v_y."""
        return Accelerometer(self._bias_and_roll, self._body)

    @property
    def limits(self) -> Limits:
        boxes = curve_boxes(self.bounds) | {
            "roll_rad_per_g": [0.0, MOST["roll"]],
            "a_y_offset_g": [-MOST["bias"], MOST["bias"]],
            "yaw_rate_offset_rad_s": [-MOST["gyro"], MOST["gyro"]],
        }
        return Limits(boxes)

    ports = PORTS

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        W, beside = self.prior.means(vehicle, self.ladder)
        compliance = beside[:, 0]
        P = self._prior_covariance(vehicle)
        excitation = np.zeros((2, 1 + len(EDGES)))
        sensors = np.zeros(len(SENSORS))
        sensors[SENSORS.index("roll")] = self.beliefs.roll
        if start is not None:
            stored = resumed_units(start, self.ladder)
            W, P, excitation = stored.W, stored.covariance, stored.excitation
            compliance = stored.compliance
            sensors[SENSORS.index("steering")] = stored.offset[0]
        trust = self.trust.at(self.dt, vehicle.wheelbase, vehicle.froude_time)
        curves = self._directions(W)
        known = self._known(vehicle, P, curves, compliance)
        omega, (ahead, aside) = self._sway(vehicle).frequency, self.sensor_position
        laws = Laws(
            forgets=math.exp(-self.dt / self.trust.correlation_time),
            bank=math.exp(-self.dt / self.trust.bank_time),
            roll_stiffness=omega**2,
            roll_damping=2.0 * self.roll_damping * omega,
            sway=self.prior.sway_share * omega**-2,
            ahead=ahead,
            aside=aside,
            late=self.a_y_late,
            steering_gain=self.sensors.steering_gain,
        )
        pressed, most = vehicle.has_downforce, {"steering": self.bounds.steering, **MOST}
        scan = _scan(doublings(self.ladder), tires=not self.held, pressed=pressed)
        return Setup(
            scan=scan,
            carry={
                **scan.zeros(),  # the covariance of what moves begins with the first sample
                "W": W,
                "own": compliance,
                "sensors": sensors,
                "UD": packed(known[None]),
                "readings": np.concatenate(
                    [np.zeros(4), [trust.r_noise, trust.a_y_noise], np.zeros(4)]
                ),
                "excitation": excitation,
            },
            constants={
                **self.plausibility.constants(vehicle, self.ladder, self.dt),
                "laws": np.array(laws),
                "trust": np.array(trust),
                "learning_speed": np.array(self.plausibility.learning_speed),
                "limits": np.array(self._limits()),
                "bounds": np.array(self.bounds.of_ladder(self.ladder)),
                "rising": rising_shares(self.ladder),
                "curves": curves,
                "compliance": compliance,
                "doubt": np.array(self.doubt),
                **({"along": np.array(self.along)} if self.held else {}),
            },
            ends_run=self.plausibility.rest(self.dt),
            ranges=(
                *curve_ranges(self.bounds, self.ladder),
                *(Range("own", i, 0.0, self.bounds.compliance) for i in (0, 1)),
                *(
                    Range("sensors", i, 0.0 if name == "roll" else -most[name], most[name])
                    for i, name in enumerate(SENSORS)
                ),
            ),
        )

    def _body(self, vehicle: Vehicle) -> Body:
        """Return how the body rolls: by its chassis, or else as is believed of any."""
        frequency = self._sway(vehicle).frequency
        believed = Body(frequency, self.roll_damping, self.beliefs.roll, self.beliefs.sd_roll)
        return Body.of_chassis(vehicle) or believed

    def _sway(self, vehicle: Vehicle) -> Sway:
        """Return the roll of a body of this size."""
        omega = min(self.roll_frequency / vehicle.froude_time, 0.6 * FASTEST)
        return Sway(frequency=omega, damping=self.roll_damping)

    def _limits(self) -> LearntLimits:
        b = self.bounds
        of_sensors = {"steering": b.steering, **MOST}
        most = {"compliance": b.compliance, **of_sensors}
        return LearntLimits(**{name: inward(limit) for name, limit in most.items()})

    @property
    def _learnt(self) -> Learnt:
        return Learnt(not self.held)

    def _directions(self, W: Array) -> Array:
        """Return by how much weights change with ln grip, then with ln stiffness, (4, n).

        A curve φ(x) of another stiffness and the same grip changes by x dφ/dx, one of another grip
        and the same stiffness by φ - x dφ/dx, as near as units come to it.
        """
        slip = np.linspace(0.0, _REACH, 121)[1:]
        T = unit_matrix(slip, self.ladder)
        stiffer = slip[:, None] * ((1.0 - T * T) / np.array(self.ladder)) @ W.T
        n = len(self.ladder)
        damped = np.vstack([T, 1e-3 * np.eye(n)])
        wanted = np.hstack([T @ W.T - stiffer, stiffer])
        found = np.linalg.lstsq(damped, np.vstack([wanted, np.zeros((n, 4))]), rcond=None)[0]
        return found.T

    def _into(self, curves: Array, compliance: Array) -> Array:
        """Return what steps of what is learnt move of each axle's numbers, (2, n + 3, k)."""
        n = len(self.ladder)
        moved = self._learnt.into(n, ca.DM(curves), ca.DM(compliance))[MOVING:, MOVING:]
        *weights, lags, sensors = np.split(np.array(ca.evalf(moved)), [n, 2 * n, 2 * n + 2])
        steering, nothing = sensors[SENSORS.index("steering")], np.zeros(sensors.shape[1])
        front = np.vstack([weights[0], lags[0], nothing, steering])
        return np.array([front, np.vstack([weights[1], lags[1], nothing, nothing])])

    def _known(self, vehicle: Vehicle, P: Array, curves: Array, compliance: Array) -> Array:
        """Return the covariance of what is learnt of covariances of both axles' numbers, (k, k).

        The axles' doubts of their compliance are one.
        """
        names = self._learnt.names
        size_ratio = math.sqrt(vehicle.wheelbase / 2.7)
        sensors = {
            "bias": self.beliefs.bias,
            "roll": self.beliefs.sd_roll,
            "gyro": self.beliefs.gyro / size_ratio,
        }
        known = np.diag([sensors.get(name, 0.0) ** 2 for name in names])
        if self.held:
            known[0, 0] = self.beliefs.grip**2
            return known
        for E, one in zip(self._into(curves, compliance), P, strict=True):
            back = np.linalg.pinv(E)
            known += back @ one @ back.T
        both = [k for k, name in enumerate(names) if name == "compliance"]
        known[both, both] /= 2.0
        return known

    def _prior_covariance(self, vehicle: Vehicle) -> Array:
        """Return the covariance of both axles before the first sample, (2, n + 3, n + 3)."""
        P = self.prior.covariance(vehicle, self.ladder)
        P[0, -1, -1] = self.beliefs.steering**2
        return P

    def tracks(self, vehicle: Vehicle, state: Mapping[str, Array]) -> tuple[Track, ...]:
        compliance = state["own"].reshape(-1, 2)
        return curve_tracks(vehicle, self.ladder, state["W"], compliance)

    def _bias_and_roll(self, state: Mapping[str, Array]) -> Array:
        """Return bias and roll in the measured a_y, (n,) [car weights]."""
        sensors = state["sensors"].reshape(-1, len(SENSORS))[1:]
        tilt = state["body"].reshape(-1, 2)[1:, 0]
        bias, roll = (sensors[:, SENSORS.index(name)] for name in ("bias", "roll"))
        return bias + roll * tilt / GRAVITY

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> AxleModel:
        """Return the model with the carried weights: where tires are held, as sure as typical ones.
        state : W (2, n), own (2,), sensors (4,), UD of both and excitation (2, 9).
        """
        prior = self._prior_covariance(vehicle)
        compliance = np.array(state["own"]).ravel()
        steering = np.ravel(state["sensors"])[SENSORS.index("steering")]
        (P,) = unpacked(state["UD"].reshape(1, -1), len(self._learnt.names))
        after = np.empty_like(prior)
        into = self._into(self._directions(state["W"]), compliance)
        for one, E, before in zip(after, into, prior, strict=True):
            back = np.linalg.pinv(E)  # what weights tell of what is learnt
            gain = before @ back.T @ np.linalg.pinv(back @ before @ back.T)
            one[:] = before + gain @ (P - back @ before @ back.T) @ gain.T
        return AxleModel(
            vehicle=vehicle,
            ladder=self.ladder,
            sway=self._sway(vehicle),
            plausibility=self.plausibility,
            W=state["W"].copy(),
            compliance=compliance,
            sway_share=np.full(2, self.prior.sway_share),
            offset=np.array([steering, 0.0]),
            covariance=after,
            prior_covariance=prior,
            excitation=state["excitation"].copy(),
            sensors=self.sensors,
            tells_v_y=True,
        )


@cache
def _scan(steps: tuple[int, ...], *, tires: bool, pressed: bool) -> Scan:
    return Scan(build_step(steps, tires=tires, pressed=pressed), carry=CARRY, over=OVER)
