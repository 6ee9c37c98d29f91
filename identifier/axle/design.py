"""The axle identifier as a method: everything that is chosen before the car drives."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.axle.band import AT_SPEEDS, CENTERS, BandCalibration
from identifier.axle.band_step import band_numbers, hinges
from identifier.axle.bank import UNPROVEN, RoadSlope, SlopeState, road_push
from identifier.axle.car import symbols
from identifier.axle.certificate import certified
from identifier.axle.covariance import narrowed, packed, per_variance, triangle, unpacked
from identifier.axle.curve import EDGES, LADDER, doublings
from identifier.axle.gate import Plausibility
from identifier.axle.learning import (
    BoundNumbers,
    Bounds,
    Regression,
    RoadChange,
    bounded,
    curve_ranges,
    rising_shares,
)
from identifier.axle.model import AxleModel, begun
from identifier.axle.prior import Prior, friction_direction
from identifier.axle.slip import SHORTEST, Sensors, Sway
from identifier.axle.step import CARRY, LEARNING_OVER, PORTS, build_step
from identifier.certificate import Certificate
from identifier.driving import Driving, natural_driving
from identifier.method import (
    OTHER_STRUCTURE,
    Accelerometer,
    Limits,
    Method,
    Track,
    resumed,
)
from identifier.setup import Range, Setup
from identifier.tire_model import AXLES, Reached, TireModel, brisk_speed
from models.rules import require_positive
from models.vehicle import Vehicle

NEAR = 0.99  # of a bound, from which on a number rests at it


@dataclass(frozen=True, slots=True, kw_only=True)
class AxleIdentifier(Method):
    """Axle units, lag, sway, and recursive least squares with directional forgetting.

    Parameters
    ----------
    prior : before the first sample.
    sway : roll of the body.
    bounds : limits of the estimates.
    plausibility : which samples are accepted, and the lowest speeds.
    regression : filter, error model and memory.
    change : when another friction is accepted, and which errors count less.
    road : what of an accelerometer's a_y tells of a road that is not level.
    ladder : slip scales of the units [rad], rising by powers of two.
    dt : sampling interval T_s [s].

    Raises
    ------
    ValueError
        Where the ladder does not rise by powers of two, or dt is not positive.
    """

    prior: Prior
    sway: Sway
    bounds: Bounds
    plausibility: Plausibility
    regression: Regression = field(default_factory=Regression)
    change: RoadChange = field(default_factory=RoadChange)
    road: RoadSlope = field(default_factory=RoadSlope)
    ladder: tuple[float, ...] = LADDER
    dt: float = 0.01

    def __post_init__(self) -> None:
        object.__setattr__(self, "ladder", tuple(self.ladder))  # a list would not hash
        doublings(self.ladder)
        require_positive(ValueError, dt=self.dt)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> "AxleIdentifier":
        """Return the design for a car: lengths scale with L, speeds with U = sqrt(g L) (Froude).

        Parameters
        ----------
        vehicle : only its wheelbase is used here; its cornering stiffness enters the prior.
        dt : sampling interval [s].
        """
        L, U = vehicle.wheelbase, vehicle.froude_speed
        return cls(
            prior=Prior(compliance=0.01 * L, sd_compliance=0.01 * L, sd_v_y=0.01 * U),
            sway=Sway.for_vehicle(vehicle),
            bounds=Bounds(compliance=0.12 * L, v_y=0.15 * U),
            plausibility=Plausibility.for_vehicle(vehicle),
            regression=Regression(noise=0.001 * U),
            dt=dt,
        )

    @property
    def min_speed(self) -> float:
        """Below this speed [m/s] forces read zero; learning rests below `learning_speed`."""
        return self.plausibility.min_speed

    def certify(self, vehicle: Vehicle, driving: Driving | None = None) -> Certificate:
        """Return what is proven of it; the boxes hold after every sample, whatever is measured.

        Parameters
        ----------
        driving : friction and speed of the drop that is followed; None takes `natural_driving`.
        """
        return Certificate(
            properties=certified(self, vehicle, driving or natural_driving(vehicle)),
            limits=self.limits.boxes,
        )

    @property
    def accelerometer(self) -> Accelerometer:
        """What a_y tells of a road that is not level."""
        return Accelerometer(self._road_push)

    @property
    def limits(self) -> Limits:
        """Where its estimates stay after every sample."""
        b = self.bounds
        boxes = curve_boxes(b) | {
            "force_curves_rise_at_slip_rad": 0.0,
            "sway_share": [0.0, 1.0],
            "v_y_offset_m_s": [-b.v_y, b.v_y],
            "covariance_over_prior": [0.0, self.regression.widest],
        }
        return Limits(boxes, self._at_bounds)

    ports = PORTS

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        start : stored weights to begin with, which know how sure they are; None takes the prior.

        Raises
        ------
        ValueError
            Where stored weights are those of another structure.
        """
        n = len(self.ladder)
        W, beside = self.prior.means(vehicle, self.ladder)
        P = prior_P = self.prior.covariance(vehicle, self.ladder)
        excitation, sensors = np.zeros((2, 1 + len(EDGES))), Sensors()
        if start is not None:
            stored = resumed_units(start, self.ladder)
            W, beside, P, excitation = (
                stored.W,
                stored.beside_curve,
                stored.covariance,
                stored.excitation,
            )
            sensors = stored.sensors
            if stored is not start:  # of another form: units can be what no curve of it could
                weights = np.linalg.inv(P[:, :n, :n]) + np.linalg.inv(prior_P[:, :n, :n])
                P = P.copy()
                P[:, :n, n:], P[:, n:, :n], P[:, :n, :n] = 0.0, 0.0, np.linalg.inv(weights)
        widest = per_variance(prior_P, n, self.regression.widest)
        W, beside = self._within_bounds(W, beside, P)
        scan = self._scan(vehicle)
        return Setup(
            scan=scan,
            carry={
                **scan.zeros(),
                "W": W,
                "own": beside,
                "UD": packed(narrowed(P, widest)),
                "slip": np.tile([0.0, 0.0, 1.0, 0.0], (2, 1)),  # slope 1: never divided by zero
                "errors": np.tile([0.0, 1.0, 1.0, 0.0], (2, 1)),
                "excitation": excitation,
                "sensors": np.array(sensors),
            },
            constants={
                **self.plausibility.constants(vehicle, self.ladder, self.dt),
                "roll": np.array(self.sway.numbers()),
                "regression": np.array(self.regression.at(self.dt)),
                "changing": np.array(self.change.at(self.dt, self.regression.rate)),
                "road": np.array(self.road.at(self.dt)),
                "bounds": np.array(self.bounds.of_ladder(self.ladder)),
                "friction_direction": friction_direction(self.ladder),
                "per_variance": widest,
                "rising": rising_shares(self.ladder),
            },
            only_with_a_y=("bank",),
            ends_run=self.plausibility.rest(self.dt),
            ranges=(
                *curve_ranges(self.bounds, self.ladder),
                *(Range("own", i, 0.0, self.bounds.compliance) for i in (0, 3)),
                *(Range("own", i, 0.0, 1.0) for i in (1, 4)),
                Range("own", 2, -self.bounds.steering, self.bounds.steering),
                Range("own", 5, -self.bounds.v_y, self.bounds.v_y),
            ),
        )

    def _scan(self, vehicle: Vehicle, *, bands: bool = False) -> Scan:
        return _scan(doublings(self.ladder), bands=bands, pressed=vehicle.has_downforce)

    @property
    def setup_with_band(self) -> Callable[[Vehicle, TireModel | None], Setup]:
        """As `setup`, of a step that outputs `half_band`, by the calibration of its start."""
        return self._setup_with_band

    def _setup_with_band(self, vehicle: Vehicle, start: TireModel | None) -> Setup:
        setup = self.setup(vehicle, start)
        stored = None if start is None else resumed_units(start, self.ladder).calibration
        given = BandCalibration.declared(brisk_speed(vehicle, self.min_speed))
        noise = np.array([self.regression.noise, self.regression.noise, 0.0])
        calibration = stored or replace(given, noise=noise)
        return setup._replace(
            scan=self._scan(vehicle, bands=True),
            constants={
                **setup.constants,
                "banding": np.column_stack(band_numbers(calibration, vehicle.froude_speed)),
                "slip_factors": hinges(calibration.factors, CENTERS),
                "speed_factors": hinges(calibration.speeds, AT_SPEEDS),
                "prior": packed(self.prior.covariance(vehicle, self.ladder)),
            },
        )

    def _within_bounds(self, W: Array, beside: Array, P: Array) -> tuple[Array, Array]:
        """Return what is begun with, within bounds: a file or a prior may lie outside.
        W : weights [static axle loads], (2, n).
        beside : [compliance [m per load], sway share [-], offset], (2, 3); the offset [rad] in
            front, [m/s] at the rear.
        P : covariance of both, (2, n + 3, n + 3): the least move is in its metric.
        """
        n = len(self.ladder)
        numbers, row = self.bounds.of_ladder(self.ladder), rising_shares(self.ladder)
        project = _projection(n)
        rows = [
            project(np.append(W[i], beside[i]), P[i, :n, :n], np.array(numbers), offset, row)
            for i, offset in enumerate((numbers.steering, numbers.v_y))
        ]
        kept = np.array(ca.vertcat(*rows))
        return kept[:, :n], kept[:, n:]

    def tracks(self, vehicle: Vehicle, state: Mapping[str, Array]) -> tuple[Track, ...]:
        """Return cornering stiffness, relaxation length, and the force that curves saturate at.

        Parameters
        ----------
        state : W (k, 2, n) and own (k, 2, 3) at each of k instants.
        """
        return curve_tracks(vehicle, self.ladder, state["W"], state["own"][:, :, 0])

    def _at_bounds(self, state: Mapping[str, Array]) -> tuple[Reached, ...]:
        """Return stiffness, grip, lag and offsets that rest at their bounds, to a hundredth."""
        b, W, beside = self.bounds, state["W"], state["own"]
        grip, slope = W.sum(axis=1), (W / np.array(self.ladder)).sum(axis=1)
        elsewhere = "a sensor has a larger offset, or another place than declared"
        late = "a sensor is late, or the tires are very soft"
        unexcited = "the drive has no such curve, or mass, signs or units are wrong"
        zero, bias = float(beside[0, 2]), float(beside[1, 2])
        listed = [
            (abs(zero) > NEAR * b.steering,
             Reached("front", "zero of the steering", zero, "rad", elsewhere, True)),
            (abs(bias) > NEAR * b.v_y,
             Reached("rear", "bias of v_y", bias, "m/s", elsewhere, True)),
        ]  # fmt: skip
        for axle, soft, level, steep in zip(AXLES, beside[:, 0], grip, slope, strict=True):
            listed += [
                (soft > NEAR * b.compliance,  # none at all is a stiff tire
                 Reached(axle, "compliance", float(soft), "m per load", late, False)),
                (not b.least_grip / NEAR <= level <= NEAR * b.most_grip,
                 Reached(axle, "grip", float(level), "static loads", unexcited, False)),
                (not b.least_stiffness / NEAR <= steep <= NEAR * b.most_stiffness,
                 Reached(axle, "cornering stiffness", float(steep), "static loads/rad", unexcited,
                         True)),
            ]  # fmt: skip
        return tuple(one for rests, one in listed if rests)

    def _road_push(self, state: Mapping[str, Array]) -> Array:
        """Return what a banked road pushed to the left, (n,) [car weights]."""
        offsets_alone = UNPROVEN * self.regression.sure * self.regression.error
        before = np.asarray(state["bank"]).reshape(-1, len(SlopeState._fields))[:-1].T
        push = road_push(self.road.at(self.dt), SlopeState(*map(ca.DM, before)), offsets_alone)
        return np.array(push, dtype=np.float64).ravel()

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> AxleModel:
        """Return the model with the carried weights.

        Parameters
        ----------
        state : W (2, n), own (2, 3), UD (2, q (q + 1)/2) and excitation (2, 9).
        """
        compliance, share, offset = state["own"].T.copy()
        return AxleModel(
            vehicle=vehicle,
            ladder=self.ladder,
            sway=self.sway,
            plausibility=self.plausibility,
            W=state["W"].copy(),
            compliance=compliance,
            sway_share=share,
            offset=offset,
            covariance=unpacked(state["UD"], len(self.ladder) + 3),
            prior_covariance=self.prior.covariance(vehicle, self.ladder),
            excitation=state["excitation"].copy(),
            sensors=Sensors(*map(float, np.ravel(state["sensors"]))),
        )


def resumed_units(start: TireModel, ladder: tuple[float, ...]) -> AxleModel:
    """Return a stored model to begin with, in the units of a method."""
    return resumed(begun(start, ladder), AxleModel, OTHER_STRUCTURE, ladder=ladder)


def curve_boxes(b: Bounds) -> dict[str, Any]:
    """Return least and largest of what curve, lag and steering have, by name and unit."""
    return {
        "grip_static_axle_loads": [b.least_grip, b.most_grip],
        "weight_static_axle_loads": [-b.weight, b.weight],
        "stiffness_static_axle_loads_rad": [b.least_stiffness, b.most_stiffness],
        "compliance_m": [0.0, b.compliance],
        "steering_offset_rad": [-b.steering, b.steering],
    }


def curve_tracks(
    vehicle: Vehicle, ladder: tuple[float, ...], W: Array, compliance: Array
) -> tuple[Track, ...]:
    """Return cornering stiffness, relaxation length, and the force that curves saturate at.
    W : weights at each of k instants [static axle loads], (k, 2, n).
    compliance : [m per load], (k, 2).
    """
    slope = (W / np.array(ladder)).sum(axis=2)
    lag = compliance * np.maximum(slope, 0.0) + SHORTEST * vehicle.wheelbase
    return (
        Track("cornering stiffness", "N/rad", slope * vehicle.axle_loads),
        Track("relaxation length", "m", lag),
        Track("force at saturation", "static load", W.sum(axis=2)),
    )


@cache
def _projection(n: int) -> ca.Function:
    """Return `bounded` of one axle: [weights, own], P of the weights, numbers, offset, slope."""
    ports, s = symbols(theta=n + 3, P=(n, n), numbers=BoundNumbers, offset=1, slope=n)
    kept = bounded(
        s.numbers,
        ca.vertsplit(s.theta),
        {(j, k): s.P[j, k] for j, k in triangle(n)},
        offset=s.offset,
        slope=ca.vertsplit(s.slope),
    )
    return ca.Function("bounded", list(ports.values()), [ca.horzcat(*kept)])


@cache
def _scan(steps: tuple[int, ...], *, bands: bool, pressed: bool) -> Scan:
    step = build_step(steps, bands=bands, pressed=pressed)
    return Scan(step, carry=CARRY, over=LEARNING_OVER)
