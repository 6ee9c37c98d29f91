"""How hard a car is driven: the conditions that a design is made for, judged at, and stored with.

A bound that is proven holds on every drive that keeps all of them; a drive that breaks one proves
nothing. They stand in design.toml, so that the same file is judged alike wherever it is judged.
"""

import math
from dataclasses import dataclass, fields

from models.rules import require_within
from models.vehicle import Vehicle

SPEED_SPREAD = 0.05  # of the speed, give or take
RANGES = {  # SI, of what is driven on wheels
    "v_x": (0.01, 150.0),
    "slip": (1e-4, 1.5),
    "friction": (1e-3, 10.0),
    "bandwidth": (1e-3, 1e3),
    "noise_v_y": (0.0, 150.0),
    "noise_r": (0.0, 100.0),
    "noise_delta": (0.0, 1.5),
}
YAW_OVERSHOOT = 1.5  # largest yaw rate, of the steady one at the friction limit


@dataclass(frozen=True, slots=True, kw_only=True)
class Driving:
    """Conditions of driving, SI.

    The sensors may err by as much as the noise at every sample, in any direction: it is a largest
    error, not a standard deviation.
    v_x : speed [m/s], give or take `SPEED_SPREAD`.   slip : largest slip angle of an axle [rad].
    friction : largest μ of the road [-]; an axle pushes with at most μ times its load.
    bandwidth : highest frequency of the steering [Hz].
    noise_v_x : largest error of the speed [m/s].
    noise_v_y : largest error of the lateral velocity [m/s].
    noise_r : largest error of the yaw rate [rad/s].
    noise_delta : largest error of a steering angle [rad].
    """

    v_x: float
    slip: float
    friction: float
    bandwidth: float
    noise_v_x: float = 0.0
    noise_v_y: float = 0.0
    noise_r: float = 0.0
    noise_delta: float = 0.0

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            lowest = value >= 0.0 if one.name.startswith("noise") else value > 0.0
            if not (lowest and math.isfinite(value)):
                rule = "not be negative" if one.name.startswith("noise") else "be positive"
                raise ValueError(f"{one.name} must {rule} and finite, it is {value}")
        for name, (least, most) in RANGES.items():
            require_within(ValueError, least, most, **{name: getattr(self, name)})
        if not self.noise_v_x < 0.5 * self.v_x:
            raise ValueError(f"noise_v_x must be below half the speed, it is {self.noise_v_x}")


# The conditions of a car that nobody declared any for.

REFERENCE_WHEELBASE = 2.7  # m: the car for which the numbers below, and scales of inputs, are meant
BANDWIDTH = 0.7  # Hz: a brisk slalom; the steering of a normal driver stays below 0.5 Hz
# Four standard deviations of a good inertial sensor and a steering encoder, m/s, rad/s, rad.
_PEAK_NOISE = {"v_x": 0.12, "v_y": 0.12, "r": 0.012, "delta": 0.002}


def natural_driving(vehicle: Vehicle, *, bandwidth: float = BANDWIDTH) -> Driving:
    """Return hard driving on a dry road: both axles slide, at 4 sqrt(g L) (20 m/s for a sedan).
    vehicle : the car; the slip is twice that at which its linear tire reaches the friction limit.
    bandwidth : highest frequency of steering that matters [Hz].
    """
    stiffness = (vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear)
    sliding = max(load / c for load, c in zip(vehicle.axle_loads, stiffness, strict=True))
    ratio = math.sqrt(vehicle.wheelbase / REFERENCE_WHEELBASE)
    return Driving(
        v_x=4.0 * vehicle.froude_speed,
        slip=2.0 * sliding,
        friction=1.0,
        bandwidth=bandwidth,
        noise_v_x=_PEAK_NOISE["v_x"] * ratio,
        noise_v_y=_PEAK_NOISE["v_y"] * ratio,
        noise_r=_PEAK_NOISE["r"] / ratio,
        noise_delta=_PEAK_NOISE["delta"],
    )
