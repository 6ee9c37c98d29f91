"""Steady turning of a car: lateral acceleration over speed and steering, as controllers look it up.

Steady: F_i = m a_y l_o/L, l_o the other arm, so that slips α_i follow, and with r = a_y/v_x
v_y = l_r r - v_x tan α_r,   δ = α_f + atan((v_y + l_f r)/v_x).
δ rises with a_y up to the limit of an axle, or of stability; past it there is no steady state.
"""

import numpy as np

from codegen.arrays import Array
from identifier.export.understeer import SLIPS, slips, weights
from identifier.tire_model import TireModel, brisk_speed

_SPEEDS = 64  # columns up to the fastest speed that was driven
_ANGLES = np.concatenate([np.arange(0.0, 0.1, 0.0025), np.arange(0.1, 0.425, 0.01)])  # rad; 24 deg
_ACCELERATIONS = 1000  # points of a curve that is turned round


def steady_text(model: TireModel) -> str:
    """Return the table as ForzaETH's race stack reads it: a corner, speeds; rows: angle, a_y."""
    top = brisk_speed(model.vehicle, model.min_speed)
    top = top if model.drives.speeds is None else float(model.drives.speeds[1])
    v_x = top * np.arange(1, _SPEEDS + 1) / _SPEEDS
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
