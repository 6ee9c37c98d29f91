"""How fast a path can be driven: v² |κ| = a_y, with braking before the turn and power after it.

The grip is an ellipse: of a_accel and a_brake, sqrt(1 - (v² κ / a_y_max)²) is left in a turn.
"""

import math

import numpy as np

from codegen.arrays import Array
from models.rules import require_positive
from mpc.path.line import PathError
from mpc.path.path import Path


def grip_speed(
    path: Path, *, a_y_max: float, v_max: float, a_accel: float, a_brake: float
) -> Array:
    """Return the fastest speed that keeps the limits, at `path.s` (n,) [m/s].

    On a closed path the lap is a flying one. Read it elsewhere by `path.along(speed, s)`.

    Parameters
    ----------
    a_y_max : lateral acceleration allowed [m/s²].
    v_max : speed allowed [m/s].
    a_accel : acceleration on the straight [m/s²].
    a_brake : deceleration on the straight, positive [m/s²].
    """
    _require_positive(path, a_y_max=a_y_max, v_max=v_max, a_accel=a_accel, a_brake=a_brake)
    kappa = np.abs(path.kappa)
    square = np.minimum(v_max**2, a_y_max / np.maximum(kappa, a_y_max / v_max**2))
    if path.closed:  # the slowest place limits itself; start both passes there
        square, kappa = square[:-1], kappa[:-1]
        slowest = int(square.argmin())
        order = (np.arange(square.size + 1) + slowest) % square.size
    else:
        order = np.arange(square.size)
    lap, bend = square[order], kappa[order] / a_y_max
    lap = _pass(lap, bend, 2.0 * a_accel * path.step)
    lap = _pass(lap[::-1], bend[::-1], 2.0 * a_brake * path.step)[::-1]
    speed = np.empty(square.size)
    speed[order] = np.sqrt(lap)
    return np.append(speed, speed[0]) if path.closed else speed


def steady_speed(path: Path, *, a_y_max: float, share: float = 1.0) -> float:
    """Return the constant speed [m/s] at which the tightest place takes share a_y_max.

    Parameters
    ----------
    a_y_max : lateral acceleration at the limit of grip [m/s²].
    share : of a_y_max [-].
    """
    _require_positive(path, a_y_max=a_y_max, share=share)
    if path.peak_curvature * path.length < 1e-6:
        raise PathError(f"{path.name}: has no turn that limits the speed, choose one")
    return math.sqrt(share * a_y_max / path.peak_curvature)


def _require_positive(path: Path, **values: float) -> None:
    require_positive(PathError, **{f"{path.name}: {name}": x for name, x in values.items()})


def _pass(square: Array, bend: Array, gain: float) -> Array:
    """Limit how fast v² rises from place to place: by gain, times what the turn leaves."""
    limits, bends = square.tolist(), bend.tolist()
    out = limits[:1]
    for i in range(1, len(limits)):
        here = out[-1]
        left = math.sqrt(max(0.0, 1.0 - (here * bends[i - 1]) ** 2))
        out.append(min(limits[i], here + gain * left))
    return np.array(out)
