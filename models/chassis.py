"""What a car needs beyond the linear bicycle: roll, load transfer, tire lag and drive force.

SI units, ISO axes (x forward, y left, z up). Numbers are checked when a `Chassis` is made, so a
plant never starts from a value that is not physical.
"""

from dataclasses import dataclass
from pathlib import Path

from models.rules import require_positive, require_within


class VehicleError(ValueError):
    """A vehicle parameter breaks a rule; the message names the key, the rule and the value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chassis:
    """Parameters of the double-track plant which the linear bicycle does not have.

    Parameters
    ----------
    track_front, track_rear : distance between the wheels of an axle [m].
    cg_height : height of the center of gravity above the road [m].
    roll_center_height_front, roll_center_height_rear : height of the roll center of the axle above
        the road [m]; it carries the geometric part of the lateral load transfer.
    roll_stiffness : moment of both axles per roll angle, springs and bars, without gravity
        [N m/rad].
    roll_stiffness_front_share : share of the front axle in stiffness and damping [-].
    roll_damping : moment of both axles per roll rate [N m s/rad].
    roll_inertia : moment of inertia of the body about the x axis through the center of gravity
        [kg m^2].
    roll_camber_front, roll_camber_rear : camber of the wheel over roll of the body [-]; 1 leans
        with the body, 0 stays upright as on a rigid axle.
    relaxation_length_front, relaxation_length_rear : distance rolled until 63 % of a slip change
        has become force [m].
    steering_lag : time constant from commanded to actual road-wheel angle [s].
    drive_front_share : share of the front axle in the driving and braking force [-].
    tire : property file (.tir) of all four tires, or None where a tire object is handed over.

    Raises
    ------
    VehicleError
        For a value that is not positive, outside what any chassis has, or NaN.
    """

    track_front: float
    track_rear: float
    cg_height: float
    roll_center_height_front: float
    roll_center_height_rear: float
    roll_stiffness: float
    roll_stiffness_front_share: float
    roll_damping: float
    roll_inertia: float
    roll_camber_front: float
    roll_camber_rear: float
    relaxation_length_front: float
    relaxation_length_rear: float
    steering_lag: float
    drive_front_share: float
    tire: Path | None = None

    def __post_init__(self) -> None:
        require_positive(
            VehicleError,
            track_front=self.track_front,
            track_rear=self.track_rear,
            cg_height=self.cg_height,
            roll_stiffness=self.roll_stiffness,
            roll_damping=self.roll_damping,
            roll_inertia=self.roll_inertia,
            relaxation_length_front=self.relaxation_length_front,
            relaxation_length_rear=self.relaxation_length_rear,
            steering_lag=self.steering_lag,
        )
        require_within(
            VehicleError,
            1e-3,
            30.0,
            track_front=self.track_front,
            track_rear=self.track_rear,
            cg_height=self.cg_height,
        )
        require_within(
            VehicleError,
            1e-9,
            1e12,
            roll_stiffness=self.roll_stiffness,
            roll_damping=self.roll_damping,
            roll_inertia=self.roll_inertia,
        )
        require_within(
            VehicleError,
            1e-4,
            100.0,
            relaxation_length_front=self.relaxation_length_front,
            relaxation_length_rear=self.relaxation_length_rear,
            steering_lag=self.steering_lag,
        )
        require_within(
            VehicleError,
            0.0,
            1.0,
            roll_stiffness_front_share=self.roll_stiffness_front_share,
            drive_front_share=self.drive_front_share,
        )
        require_within(
            VehicleError,
            -1.0,
            1.0,
            roll_camber_front=self.roll_camber_front,
            roll_camber_rear=self.roll_camber_rear,
        )
        require_within(
            VehicleError,
            0.0,
            self.cg_height,
            roll_center_height_front=self.roll_center_height_front,
            roll_center_height_rear=self.roll_center_height_rear,
        )
