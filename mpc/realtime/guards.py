"""What the tracker takes for possible, and what it does where it cannot plan."""

from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Guards:
    """Bounds of measurements and of plans, and the fall-back.

    Without a new plan the old one steers for `hold_time`; then δ = κ L - gain_e_y e_y
    - gain_e_psi e_psi - gain_yaw_rate (r - κ v_x), within the hard limits.

    Parameters
    ----------
    e_y : |e_y| beyond which the car is off the path [m].
    e_psi : |e_psi| beyond which it is [rad].
    v_y : |v_y| beyond which the tire is not known [m/s].
    yaw_rate : |r| beyond which it is not [rad/s].
    min_speed : v_x below which the prediction does not hold [m/s].
    hold_time : how long an old plan is followed [s].
    gain_e_y : [rad/m].
    gain_e_psi : without unit.
    gain_yaw_rate : [s].

    Raises
    ------
    ValueError
        Where a bound is not positive and finite, or a gain or hold_time negative.
    """

    e_y: float = 5.0
    e_psi: float = 1.2
    v_y: float = 10.0
    yaw_rate: float = 2.0
    min_speed: float = 2.0
    hold_time: float = 0.2
    gain_e_y: float = 0.04
    gain_e_psi: float = 0.4
    gain_yaw_rate: float = 0.1

    def __post_init__(self) -> None:
        for field in fields(self):
            value, may_be_zero = getattr(self, field.name), field.name.startswith(("gain", "hold"))
            if not (0.0 < value < np.inf or (may_be_zero and value == 0.0)):
                rule = "not negative" if may_be_zero else "positive"
                raise ValueError(f"{field.name} must be {rule} and finite, it is {value}")
