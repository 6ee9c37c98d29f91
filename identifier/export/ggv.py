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

import math
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from codegen.escape import visible
from identifier.axle.band import LEVEL, normal_quantile
from identifier.estimate.priors import Priors
from identifier.motion.parameters import INDEX
from identifier.tire_model import AXLES, TireModel
from models.vehicle import GRAVITY, LIGHTEST

SPEEDS, PUSHES, SLIPS = 13, 200, 200  # of the table, of a diagram, of a curve
HEADER = "# v_mps, ax_max_mps2, ay_max_mps2"
NUMBERS = ("load_transfer", "braking_f", "braking_r", "driving_f", "driving_r")


class Limits(NamedTuple):
    """Limits over speed.

    v_x [m/s], a_y, braking, driving [m/s²]: (n,) each, none negative. `braking` and `driving` are
    what each leaves of a_x,max.
    """

    v_x: Array
    a_y: Array
    braking: Array
    driving: Array


def limits(model: TireModel) -> Limits:
    """Return the limits of a model's car from standing to the fastest speed that was driven.

    Load transfer and ellipse are those of the estimate; of a model without, what is believed of
    its car.

    Raises
    ------
    ValueError
        Where the model cannot tell how sure it is, or an axle has no slip at which it is sure.
    """
    known = model.known_slip
    if known is None or not model.has_band:
        raise ValueError(
            f"a {type(model).__name__} cannot tell how sure it is: no limits that are proven"
        )
    car = model.vehicle
    grip = np.array([_lowest_grip(model, i, float(known[i])) for i in range(2)])
    mean, sd = lengthwise(model)
    h, *c = mean + normal_quantile(LEVEL) * sd
    top = model.reference_speed if model.known_speeds is None else float(model.known_speeds[1])
    v_x = np.linspace(0.0, top, SPEEDS)
    rows = [_at_speed(car.load_ratio(v), grip, h * car.wheelbase, (car.l_f, car.l_r), c)
            for v in v_x]  # fmt: skip
    a_y, braking, driving = GRAVITY * np.array(rows).T
    return Limits(v_x, a_y, braking, driving)


def _lowest_grip(model: TireModel, i: int, known: float) -> float:
    """Return the largest force of the lower end of the band within the known slip, over the load.

    i : axle.   known : [rad].
    """
    alpha = np.linspace(0.0, known, SLIPS + 1)[1:]
    half = model.half_band(alpha, LEVEL)
    least = -math.inf
    if known > 0.0 and half is not None:
        least = float((model.force_at(alpha) - half)[:, i].max() / model.vehicle.axle_loads[i])
    if not least > 0.0:
        raise ValueError(f"the force of the {AXLES[i]} axle is not known at any slip: drive harder")
    return least


def lengthwise(model: TireModel) -> tuple[Array, Array]:
    """Return h and c_i of braking and driving, front and rear, and their sd, (5,) each."""
    found = model.lengthwise
    if found is None:
        priors = Priors.of(model.vehicle)
        found = priors.mean, priors.covariance
    index = [INDEX[name] for name in NUMBERS]
    mean, covariance = found
    return mean[index], np.sqrt(np.maximum(np.diag(covariance)[index], 0.0))


def _at_speed(
    pressed: Array, grip: Array, hL: float, arms: tuple[float, float], use: list[float]
) -> tuple[float, float, float]:
    """Return limits of turning, braking and driving [weights].

    pressed : load over the static one (2,).   grip : φ_i (2,).   hL : [m].   arms : l_f, l_r [m].
    use : c_i of braking and driving (4,).
    """
    a_y = float((grip * pressed).min())
    transfer = hL * np.array([-1.0 / arms[1], 1.0 / arms[0]])
    sides = []
    for sign, c in ((-1.0, np.array(use[:2])), (1.0, np.array(use[2:]))):
        most = min(a_y, 1.0 / max(float(c.max()), 1e-9))
        f = np.linspace(0.0, most, PUSHES + 1)[1:, None]
        load = np.maximum(pressed + sign * transfer * f, LIGHTEST)
        left = (grip * load * np.sqrt(np.maximum(1.0 - (c * f) ** 2, 0.0))).min(axis=1)
        used = np.maximum(1.0 - left / a_y, 1e-9)
        sides.append(min(most, float((f[:, 0] / used).min())))
    return a_y, sides[0], sides[1]


def ggv_text(model: TireModel, found: Limits) -> str:
    """Return the table as planners read it: rows of v, a_x,max, a_y,max behind comments.

    a_x,max is the smaller one of braking and driving, since planners have one for both.
    """
    lines = [
        f"g-g-v of {visible(model.vehicle.name)}, by tireid from a driving log; road as driven.",
        "Lower end of a band of 90 %: the force is lower in 5 % of cases. Tires are taken to grip",
        "lengthwise as sideways. Neither drag nor the engine is in it: ax_max_machines has that.",
        "Ends at the fastest speed that was driven.",
        "ax_max is the smaller of braking and driving, for dyn_model_exp = 1.0 (a diamond): with a",
        "larger exponent planners take more than ellipse and load transfer leave.",
        f"Braking alone {found.braking.min():.2f} to {found.braking.max():.2f} m/s2, driving alone "
        f"{found.driving.min():.2f} to {found.driving.max():.2f} m/s2.",
    ]
    a_x = np.minimum(found.braking, found.driving)
    rows = [f"{v:.3f}, {x:.3f}, {y:.3f}" for v, x, y in zip(found.v_x, a_x, found.a_y, strict=True)]
    return "\n".join([*(f"# {line}" for line in lines), HEADER, *rows]) + "\n"
