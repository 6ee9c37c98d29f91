"""Limits of acceleration over speed (g-g-v) of a car: from curve, ellipse and load transfer.

Steady turning loads both axles in proportion, so that the weaker one limits the car (Milliken,
Race Car Vehicle Dynamics, 1995, ch. 9). While tires push f weights forward,
a_y(f)/g = min_i φ_i max(1 + κ_i v_x² ∓ (h L/l_o) f, 0.2) sqrt(1 - (c_i f)²), l_o the other arm,
φ_i the largest force of the axle over its slip, c_i of braking or driving. No push is larger than
1/c_i, nor than the smaller φ_i: tires grip lengthwise as sideways.
Planners take a_x/a_x,max + a_y/a_y,max <= 1. a_y,max = a_y(0), and a_x,max is the largest for
which that diamond lies within the diagram: min over f of g f/(1 - a_y(f)/a_y(0)).
φ_i is the lower end of the band of 90 % within the slips that were identified; h and c_i are the
ends of theirs that leave less. Each is right or too low in 95 % of cases.
"""

from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from codegen.escape import visible
from identifier.band import LEVEL, Band, normal_quantile
from identifier.estimate.priors import Priors
from identifier.estimate.solve import car_numbers
from identifier.motion.model import pushed_function
from identifier.motion.parameters import INDEX
from identifier.tire_model import AXLES, TireModel, brisk_speed, require_band
from models.vehicle import GRAVITY, Vehicle

_SPEEDS = 13  # of the table
_PUSHES = 200  # longitudinal forces of a diagram
_SLIPS = 200  # of a curve

NUMBERS = ("load_transfer", "braking_f", "braking_r", "driving_f", "driving_r")


class Limits(NamedTuple):
    """v_x [m/s]; a_y, and what braking and driving leave of a_x,max [m/s²]: (n,) each."""

    v_x: Array
    a_y: Array
    braking: Array
    driving: Array


def limits(model: TireModel) -> Limits:
    """Return the limits of a model's car from standing to the fastest speed that was driven.

    Load transfer and ellipse of a model that has none are what is believed of its car. A model
    that cannot tell how sure it is, or is sure at no slip of an axle, is refused.
    """
    band, car, known, drives = require_band(model), model.vehicle, model.known_slip, model.drives
    assert known is not None
    grip = np.array([_lowest_grip(band, i, float(known[i])) for i in range(2)])
    priors, index = Priors.of(car), [INDEX[name] for name in NUMBERS]
    mean, covariance = drives.lengthwise or (priors.mean, priors.covariance)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    p = mean.copy()
    p[index] = (mean + normal_quantile(LEVEL) * sd)[index]
    top = brisk_speed(car, model.min_speed) if drives.speeds is None else float(drives.speeds[1])
    v_x = np.linspace(0.0, top, _SPEEDS)
    a_y = (grip * car.load_ratio(v_x)).min(axis=1)
    sides = [
        [_side(car, p, grip, *at, sign) for at in zip(v_x, a_y, strict=True)]
        for sign in (-1.0, 1.0)
    ]
    return Limits(v_x, *(GRAVITY * np.array([a_y, *sides])))


def _lowest_grip(band: Band, i: int, known: float) -> float:
    """Return the largest force of the lower end of an axle's band, in static loads."""
    alpha = np.linspace(0.0, known, _SLIPS + 1)[1:]
    half, model = band.half(alpha), band.model
    low = float((model.force(alpha) - half)[:, i].max())
    if known <= 0.0 or low <= 0.0:
        raise ValueError(f"the force of the {AXLES[i]} axle is not known at any slip: drive harder")
    return low / float(model.vehicle.axle_loads[i])


def _side(car: Vehicle, p: Array, grip: Array, v_x: float, a_y: float, sign: float) -> float:
    """Return the largest push of the diamond on one side [weights].

    p : numbers of the forward model.   grip : φ_i (2,).   a_y : without a push [weights].
    sign : 1 where the tires drive, -1 where they brake.
    """
    use = p[[INDEX[f"{'driving' if sign > 0.0 else 'braking'}_{axle}"] for axle in "fr"]]
    most = min(a_y, 1.0 / max(float(use.max()), 1e-9))
    f = np.linspace(0.0, most, _PUSHES + 1)[1:]
    a_x = sign * GRAVITY * f - car.drag * v_x**2
    pushed = np.array(pushed_function()(p, car_numbers(car), a_x[None], v_x)).T
    left = (grip * pushed).min(axis=1)
    return min(most, float((f / np.maximum(1.0 - left / a_y, 1e-9)).min()))


def ggv_text(model: TireModel) -> str:
    """Return the table as planners read it: rows of v, a_x,max, a_y,max behind comments."""
    v_x, a_y, braking, driving = limits(model)
    table = np.column_stack([v_x, np.minimum(braking, driving), a_y])
    rows = [", ".join(f"{value:.3f}" for value in row) for row in table]
    return f"""\
# g-g-v of {visible(model.vehicle.name)}, by tireid from a driving log; friction as on that road.
# Lower end of a band of 90 %: the force is lower in 5 % of cases. Tires are taken to grip
# lengthwise as sideways. Neither drag nor the engine is in it: ax_max_machines has that.
# ax_max is the smaller of braking ({braking.min():.2f} or more) and driving ({driving.min():.2f}),
# for dyn_model_exp = 1.0 (a diamond); with a larger one planners take more than the tires have.
# Ends at the fastest speed that was driven.
# v_mps, ax_max_mps2, ay_max_mps2
""" + "".join(f"{row}\n" for row in rows)
