"""Axles with a curve of lagged slip: of a fit the forward model's own, else a ladder of tanh.

F = F_z λ φ(α') cos δ per axle, lag σ = s λ φ'(α') + σ_0, φ' held up as the carcass stretches;
λ = 1 + κ v_x² is the load of the axle over the static one. The numbers of the curves are weights.
"""

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.axle.dynamics import series_compliance
from identifier.axle.model import AxleModel
from identifier.axle.slip import SHORTEST, beyond_play
from identifier.estimate.model import FittedModel
from identifier.motion.model import carcass_curve
from identifier.motion.parameters import curve_index
from models.vehicle import load_ratio
from mpc.tires.tire import DOUBT_STEP, N_DOUBTS, Pair, Point, PredictionTire, TireStructure

_BESIDE = 4  # weights of an axle before its curve


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveAxles(TireStructure):
    """w = [δ_0, g, b, β], then of each axle F_z [N], κ [s²/m²], s [m], σ_0 [m], and its curve.

    δ_0 [rad], g: zero and relative error of the steering. b [m/s], β [rad]: bias of v_y and
    mounting angle of its sensor. They were learnt as errors of sensors, and the tracker reads the
    same sensors.
    lagged : whether the slip lags; else s and σ_0 are there and do nothing.
    """

    saturates = True
    sensors = 4  # weights before those of the axles

    lagged: bool = True

    @property
    def numbers(self) -> int:
        """How many numbers a curve has."""
        raise NotImplementedError

    def curve(self, numbers: Any, slip: Any) -> tuple[Any, Any]:
        """Return φ and φ' as far as the carcass stretches, F_z being 1 of both."""
        raise NotImplementedError

    def on_friction(self, curves: Array, ratio: float) -> None:
        """Change the numbers of curves (2, n) to those of another friction."""
        raise NotImplementedError

    @property
    def n_weights(self) -> int:
        return self.sensors + 2 * (_BESIDE + self.numbers)

    def slip(self, at: Point) -> Pair:
        """Return the slip angles, errors of the sensors taken off [rad]."""
        v_y = at.v_y - at.w[2] - at.w[3] * at.v_x
        delta = CurveAxles.turned(self, at)
        return TireStructure.slip(self, at._replace(v_y=v_y, delta=delta))

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        front, rear = (
            F_z * load_ratio(down, at.v_x) * self.curve(numbers, x)[0]
            for (F_z, down, _, _, numbers), x in zip(self._axles(at.w), slip, strict=True)
        )
        delta = self.turned(at)
        cos_delta = 1 - delta**2 / 2 + delta**4 / 24  # as the frozen models have it
        return front * cos_delta, rear

    def turned(self, at: Point) -> Any:
        """Return the angle of the front wheels, across which they push [rad]."""
        return (1 + at.w[1]) * at.delta + at.w[0]

    def lag_length(self, slip: Pair, at: Point) -> Pair:
        """Return the relaxation lengths [m], which shorten with the slope of the curve."""
        front, rear = (
            give * load_ratio(down, at.v_x) * self.curve(numbers, x)[1] + shortest
            for (_, down, give, shortest, numbers), x in zip(self._axles(at.w), slip, strict=True)
        )
        return front, rear

    def at_friction(self, weights: Array, ratio: float) -> Array:
        """Return `weights` (n_weights,) of another friction."""
        w = weights.copy()
        self.on_friction(w[self.sensors :].reshape(2, -1)[:, _BESIDE:], ratio)
        return w

    def similar(self, at: Point, ratio: Any) -> Point:
        """Return `at`: nothing but slip makes the force."""
        del ratio
        return at

    def _axles(self, w: Any) -> list[tuple[Any, ...]]:
        """Return F_z, κ, s, σ_0 and the numbers of the curve of each axle."""
        size = _BESIDE + self.numbers
        axles = (w[self.sensors + i * size :][:size] for i in range(2))
        return [(axle[0], axle[1], axle[2], axle[3], axle[_BESIDE:]) for axle in axles]


@dataclass(frozen=True, slots=True, kw_only=True)
class LadderAxles(CurveAxles):
    """φ = Σ_j w_j tanh(x/α_j); numbers: 1/α_j (n,), then w_j (n,)."""

    units: int

    @property
    def numbers(self) -> int:
        return 2 * self.units

    def curve(self, numbers: Any, slip: Any) -> tuple[Any, Any]:
        per_scale, W = numbers[: self.units], numbers[self.units :]
        T, slopes = ca.tanh(per_scale * slip), W * per_scale
        least = 0.02 * ca.fmax(ca.sum1(slopes), 0.1)  # as when it was learnt
        return ca.dot(W, T), ca.fmax(ca.dot(slopes, 1 - T * T), least)

    def turned(self, at: Point) -> Any:
        return (1 + at.w[1]) * at.delta  # as the frozen model: its zero is one of slip alone

    def on_friction(self, curves: Array, ratio: float) -> None:
        curves[:, : self.units] /= ratio
        curves[:, self.units :] *= ratio


@dataclass(frozen=True, slots=True, kw_only=True)
class FitAxles(CurveAxles):
    """φ of `identifier.motion.model.carcass_curve`; numbers: ln C to ln m, as it reads them.

    Behind β stands p [rad], the play of the steering to each side.
    """

    numbers = 9
    sensors = 5

    def slip(self, at: Point) -> Pair:
        """Return the slip angles, errors of the sensors and the play taken off [rad]."""
        front, rear = CurveAxles.slip(self, at)
        return beyond_play(front, at.w[4]), rear

    def curve(self, numbers: Any, slip: Any) -> tuple[Any, Any]:
        return carcass_curve(*ca.vertsplit(numbers), slip)

    def on_friction(self, curves: Array, ratio: float) -> None:
        curves[:, -1] += math.log(ratio)


def curve_weights(
    curves: Array,
    *,
    sensors: tuple[float, ...] = (0.0,) * 4,
    loads: Any = 1.0,
    downforce: Any = 0.0,
    give: Any = 0.0,
    shortest: Any = 0.0,
) -> Array:
    """Return w of `CurveAxles`.
    curves : numbers of front and rear, (2, n).   sensors : the weights before the axles.
    loads, downforce, give, shortest : F_z, κ, s and σ_0 of both axles, or (2,).
    """
    beside = [np.broadcast_to(one, 2) for one in (loads, downforce, give, shortest)]
    return np.concatenate([sensors, np.column_stack([*beside, curves]).ravel()])


def axle_tire(model: AxleModel) -> PredictionTire:
    """Return the prediction tire of a frozen axle model.

    The sway of its body takes k ρ'/(ω² v_x) off the slip, ρ in steady cornering the force of the
    axle over its load times g: the body gives way in series with the carcass, and k g/ω² adds to
    the compliance. That is without the inertia of the roll: ω is above what steering asks for.
    """
    scales = 1.0 / np.array(model.ladder)
    curves = np.hstack([np.tile(scales, (2, 1)), model.W])
    errors = model.sensors
    sensors = (model.offset[0], errors.steering_gain, model.offset[1], errors.v_y_angle)
    give = series_compliance(model.compliance, model.sway_share, model.sway.frequency)
    return _tire(LadderAxles(units=scales.size), model, sensors, give, curves)


def fit_tire(model: FittedModel) -> PredictionTire:
    """Return the prediction tire of a fit.
    model : frozen; load transfer, ellipse and the place of the sensor of v_y are left out: the
        tracker is told no a_x.
    """
    names = ("steering_zero", "steering_gain", "v_y_bias", "v_y_angle", "steering_play")
    curves = np.stack([model.p[curve_index(axle)] for axle in "fr"])
    return _tire(FitAxles(), model, tuple(model[name] for name in names), model.give, curves)


def _tire(
    structure: CurveAxles, model: AxleModel | FittedModel, sensors: Any, give: Array, curves: Array
) -> PredictionTire:
    car = model.vehicle
    weights = curve_weights(
        curves,
        sensors=sensors,
        loads=car.axle_loads,
        downforce=car.downforce,
        give=give,
        shortest=SHORTEST * car.wheelbase,
    )
    doubt = model.band.half(DOUBT_STEP * np.arange(N_DOUBTS, dtype=np.float64)).T
    return PredictionTire(structure, weights, car, doubt)
