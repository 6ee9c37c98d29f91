"""What the tracker takes for possible, and what it does where it cannot plan."""

from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Guards:
    """Bounds of measurements and of plans, and the fall-back.

    Without a new plan the old one steers for `hold_time`; then feedback to the path, within the
    hard limits: optimal at each speed for Σ (e_y/`fall_back_e_y`)² + (a/`fall_back_acceleration`)²,
    see `mpc.realtime.fall_back`.

    Parameters
    ----------
    e_y : |e_y| beyond which the car is off the path [m].
    e_psi : |e_psi| beyond which it is [rad].
    v_y : |v_y| beyond which the tire is not known [m/s].
    yaw_rate : |r| beyond which it is not [rad/s].
    min_speed : v_x below which the prediction does not hold [m/s].
    max_speed : v_x beyond which no measurement and no road is believed [m/s].
    max_curvature : |κ| beyond which none is [1/m].
    hold_time : how long an old plan is followed [s].
    fall_back_e_y : deviation [m] that is worth as much as the acceleration.
    fall_back_acceleration : lateral, to come back by [m/s²].

    Raises
    ------
    ValueError
        Where a bound is not positive and finite, or hold_time negative.
    """

    e_y: float = 5.0
    e_psi: float = 1.2
    v_y: float = 10.0
    yaw_rate: float = 2.0
    min_speed: float = 2.0
    max_speed: float = 100.0
    max_curvature: float = 1.0
    hold_time: float = 0.2
    fall_back_e_y: float = 1.0
    fall_back_acceleration: float = 2.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value, may_be_zero = getattr(self, field.name), field.name == "hold_time"
            if not (0.0 < value < np.inf or (may_be_zero and value == 0.0)):
                rule = "not negative" if may_be_zero else "positive"
                raise ValueError(f"{field.name} must be {rule} and finite, it is {value}")
