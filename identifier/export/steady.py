"""Steady turning of a car: understeer gradient and a table of lateral acceleration.

Steady turning: F_i = m a_y l_o/L, l_o the other arm, and δ = L a_y/v_x² + α_f - α_r, so that
K = ∂(δ - L a_y/v_x²)/∂a_y = (m/L) (l_r/C_f - l_f/C_r), C_i the slope of the force curve at that
force (Milliken, Race Car Vehicle Dynamics, 1995, ch. 5; Pacejka, Tire and Vehicle Dynamics, 2012,
1.3). Angles of the wheels are small; the wheels roll freely. Speed enters by downforce alone:
without it one speed stands for all.

The table of lateral acceleration over speed and steering that controllers look up has large angles:
with r = a_y/v_x, v_y = l_r r - v_x tan α_r and δ = α_f + atan((v_y + l_f r)/v_x), which rises with
a_y up to the limit of an axle, or of stability; past it there is no steady state.
"""

from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.tire_model import TireModel, brisk_speed, require_band
from models.vehicle import GRAVITY, Vehicle

_STEP = 1.0  # m/s², of the lateral acceleration
_SPEEDS = 3  # at which gradients are given of a car with downforce
_DRAWN = 100  # models
_LOWER_SHARE = 0.16  # share of the models that lie below the lower end, a deviation off
_UPPER_SHARE = 0.84  # share of them that lie below the upper end, a deviation off
_COLUMNS = 64  # columns up to the fastest speed that was driven
_ANGLES = np.concatenate([np.arange(0.0, 0.1, 0.0025), np.arange(0.1, 0.425, 0.01)])  # rad; 24 deg
_ACCELERATIONS = 1000  # points of a curve that is turned round

SLIPS = np.linspace(0.0, 0.6, 301)  # rad


class Understeer(NamedTuple):
    """The gradient at speeds v_x [m/s] (n,) and lateral accelerations a_y [m/s²] (k,).
    gradient, sd : K [rad/(m/s²)], (n, k); NaN where an axle is past what is known of it.
    """

    v_x: Array
    a_y: Array
    gradient: Array
    sd: Array

    @property
    def csv(self) -> str:
        """A table with a row for each speed and acceleration, without those that are NaN."""
        k, degrees = self.a_y.size, np.degrees(GRAVITY)
        at = [np.repeat(self.v_x, k), np.tile(self.a_y, self.v_x.size)]
        columns = [*at, degrees * self.gradient.ravel(), degrees * self.sd.ravel()]
        rows = [one for one in zip(*columns, strict=True) if np.isfinite(one).all()]
        lines = [",".join(f"{value:.4g}" for value in row) for row in rows]
        return "\n".join(["v_x_m_s,a_y_m_s2,gradient_deg_per_g,sd_deg_per_g", *lines]) + "\n"


def understeer_gradient(model: TireModel, rng: np.random.Generator) -> Understeer:
    """Return the understeer gradient at the speeds and within the slips that were driven.

    Its standard deviation is half of what lies between the 16 % and 84 % points of models drawn
    from the parameter uncertainty. A model that cannot tell how sure it is is refused.
    """
    drawn = require_band(model).samples(_DRAWN, rng)
    known, speeds, car = model.known_slip, model.drives.speeds, model.vehicle
    if known is None or not known.min() > 0.0:
        raise ValueError("the force of an axle is not known at any slip: drive harder")
    slow, fast = (brisk_speed(car, model.min_speed),) * 2 if speeds is None else speeds
    v_x = np.linspace(slow, fast, _SPEEDS) if car.has_downforce else np.array([fast])
    v_x = np.unique([float(f"{one:.4g}") for one in v_x])  # as it is printed
    force = model.force(SLIPS)
    reached = np.array([np.interp(known[i], SLIPS, force[:, i]) for i in range(2)])
    most = reached / weights(car, v_x)  # (n, 2)
    a_y = np.arange(0.0, most.min(axis=1).max(), _STEP)
    found = _gradients(model, force, v_x, a_y)
    spread = np.array([_gradients(one, one.force(SLIPS), v_x, a_y) for one in drawn])
    with np.errstate(invalid="ignore"):  # beyond what half of them can reach
        low, high = np.quantile(spread, (_LOWER_SHARE, _UPPER_SHARE), axis=0, method="nearest")
        sd = 0.5 * (high - low)
    past = (a_y > most.min(axis=1)[:, None]) | ~np.isfinite(found) | ~np.isfinite(sd)
    return Understeer(v_x, a_y, np.where(past, np.nan, found), np.where(past, np.nan, sd))


def _gradients(model: TireModel, force: Array, v_x: Array, a_y: Array) -> Array:
    """Return K [rad/(m/s²)], (n, k): infinite where the front axle is at its end, else minus it.
    force : at `SLIPS` under static loads, (s, 2) [N].
    """
    gradient = np.zeros((v_x.size, a_y.size))
    for i, sign in ((1, -1.0), (0, 1.0)):
        curve, weight = force[:, i], weights(model.vehicle, v_x)[:, i, None]
        needed = weight * a_y
        stiff = np.interp(slips(curve, needed), SLIPS, np.gradient(curve, SLIPS))
        ended = (needed >= curve.max()) | (stiff <= 0.0)
        share = weight / np.maximum(stiff, 1e-9)
        gradient = np.where(ended, sign * np.inf, gradient + sign * share)
    return gradient


def weights(car: Vehicle, v_x: float | Array) -> Array:
    """Return the force under static loads [N] of each axle per m/s² of a_y, (2,) or (n, 2)."""
    return car.axle_loads / (GRAVITY * car.load_ratio(v_x))


def slips(curve: Array, force: Array) -> Array:
    """Return at which of `SLIPS` an axle has a force [N], up to its largest.
    curve : its forces at all of them [N].
    """
    end = int(curve.argmax()) + 1
    return np.interp(force, curve[:end], SLIPS[:end])


def steady_text(model: TireModel) -> str:
    """Return the table as ForzaETH's race stack reads it: a corner, speeds; rows: angle, a_y."""
    top = brisk_speed(model.vehicle, model.min_speed)
    top = top if model.drives.speeds is None else float(model.drives.speeds[1])
    v_x = top * np.arange(1, _COLUMNS + 1) / _COLUMNS
    table = np.vstack([v_x, np.column_stack([_accelerations(model, one) for one in v_x])])
    rows = zip([0.0, *_ANGLES], table, strict=True)
    return "".join(",".join(f"{one:.6g}" for one in (angle, *row)) + "\n" for angle, row in rows)


def _accelerations(model: TireModel, v_x: float) -> Array:
    """Return a_y [m/s²] at `_ANGLES`, NaN where there is no steady state."""
    car, force = model.vehicle, model.force(SLIPS)
    needed = weights(car, v_x)
    a_y = np.linspace(0.0, float((force.max(axis=0) / needed).min()), _ACCELERATIONS)
    alpha_f, alpha_r = (slips(force[:, i], needed[i] * a_y) for i in range(2))
    r = a_y / v_x
    v_y = car.l_r * r - v_x * np.tan(alpha_r)
    delta = alpha_f + np.arctan((v_y + car.l_f * r) / v_x)
    end = int(np.argmax(np.diff(delta, append=-np.inf) <= 0.0)) + 1  # where it begins to fall
    return np.interp(_ANGLES, delta[:end], a_y[:end], right=np.nan)
