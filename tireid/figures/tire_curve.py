"""What pictures of a drive say of tires: the slip of its axles, and curves of force over slip."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpc.loop import Drive

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TireCurve:
    """Steady axle forces over slip, one curve an axle.

    Parameters
    ----------
    label : what legends call it.
    alpha : slip in the paper's sign [rad], (k,).
    force : of front and rear axle [N], (k, 2).
    """

    label: str
    alpha: Array
    force: Array


def axle_slip(drive: Drive) -> Array:
    """Return the slip angles δ - atan2(v_y ± l r, v_x) in the paper's sign [rad], (n, 2).

    Parameters
    ----------
    drive : its true motion is taken.
    """
    front = drive.delta - np.arctan2(drive.v_y + drive.vehicle.l_f * drive.r, drive.v_x)
    rear = -np.arctan2(drive.v_y - drive.vehicle.l_r * drive.r, drive.v_x)
    return np.column_stack([front, rear])
