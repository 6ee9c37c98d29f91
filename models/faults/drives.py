"""Faults of a drive: sensors that sit or look elsewhere, a banked road, a car told wrongly.

x forward, y left, z up; SI units; angles and rates turn left when positive.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from codegen.arrays import Array
from models.faults.signals import (
    Fault,
    FaultError,
    channel_of,
    require_finite,
)
from models.recordings import Recording
from models.recordings.record import CHANNELS
from models.rules import require_positive
from models.vehicle import GRAVITY, Vehicle

# Of mounting: where a sensor sits and where it looks.

PLACED = ("velocity", "accelerometer")


@dataclass(frozen=True, slots=True, kw_only=True)
class Misaligned:
    """A velocity sensor that does not look straight ahead.

    angle : by which it is turned to the left [rad]: v_y reads v_y cos - v_x sin of it.
    """

    angle: float

    def __post_init__(self) -> None:
        require_finite(self)

    def __str__(self) -> str:
        """Return it in words."""
        return f"velocity sensor turned by {math.degrees(self.angle):g} deg"

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the velocity in the axes of the sensor."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        v_x, v_y = recording.v_x, recording.needed("v_y")
        return replace(recording, v_x=c * v_x + s * v_y, v_y=c * v_y - s * v_x)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorElsewhere:
    """A sensor that is not at the center of gravity.

    Of velocity it shows v_x - y r and v_y + x r, of acceleration a_y + x dr/dt - y r^2, with the
    slope of r between neighboring samples.

    sensor : one of `PLACED`.
    x, y : where it is from the center of gravity, ahead and to the left [m].
    """

    sensor: str
    x: float = 0.0
    y: float = 0.0

    def __post_init__(self) -> None:
        if self.sensor not in PLACED:
            raise FaultError(f"sensor must be one of {', '.join(PLACED)}, it is {self.sensor!r}")
        require_finite(self)

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.sensor} {self.x:g} m ahead and {self.y:g} m left of the c.g."

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the signals of that place."""
        x, y, r = self.x, self.y, recording.r
        if self.sensor == "velocity":
            v_y = recording.needed("v_y") + x * r
            return replace(recording, v_x=recording.v_x - y * r, v_y=v_y)
        r_dot = np.gradient(r, recording.dt)
        return replace(recording, a_y=channel_of(recording, "a_y") + x * r_dot - y * r**2)


# Of the road.


@dataclass(frozen=True, slots=True, kw_only=True)
class Bank:
    """A road that falls to the left by an angle, or by one that swings: g sin of it on the body.

    On the plant, `Plant.simulate(bank=Bank(...).angle_at)` drives on it. On a recording it is put
    in by kinematics: the tires keep their slip and force, and the car turns downhill by
    Δr = g sin(angle)/v_x, while v_y rises by l_r Δr and the steering by what keeps the front slip.
    Newton's law holds exactly at constant speed and angle; as they change, dΔr/dt is a yaw
    acceleration without a moment and l_r dΔr/dt a lateral one without a force. An accelerometer
    feels the tires alone, so a_y stays. Below the car's lowest speed Δr fades to zero.

    vehicle : the car that drives; its l_f and l_r are what is needed.
    angle : of the road across the car, largest [rad].
    period : of the crown [s], a cosine; infinite for a constant angle.
    """

    vehicle: Vehicle
    angle: float
    period: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.angle) and self.period > 0.0):
            raise FaultError(
                f"angle must be finite and period positive, they are {self.angle} and {self.period}"
            )

    def __str__(self) -> str:
        """Return it in words."""
        swing = "" if math.isinf(self.period) else f", swinging in {self.period:g} s"
        return f"bank of {math.degrees(self.angle):g} deg{swing}"

    def angle_at(self, t: Array) -> Array:
        """Return the angle [rad], (n,).

        t : times [s], (n,).
        """
        angle: Array = self.angle * np.cos(2.0 * math.pi * t / self.period)
        return angle

    def apply(self, recording: Recording) -> Recording:
        """Return the recording of the same tire forces on the banked road."""
        l_f, l_r, slow = self.vehicle.l_f, self.vehicle.l_r, self.vehicle.lowest_speed
        v_x = recording.v_x
        moving = np.clip(v_x / slow, 0.0, 1.0)
        turn = moving * GRAVITY * np.sin(self.angle_at(recording.t)) / np.maximum(v_x, slow)
        v_y = recording.needed("v_y") + l_r * turn
        on_bank = replace(recording, v_y=v_y, r=recording.r + turn)
        lost = recording.alpha(l_f, l_r) - on_bank.alpha(l_f, l_r)
        return replace(on_bank, delta_f=recording.delta_f + lost[:, 0])


# Put together.


@dataclass(frozen=True, slots=True, kw_only=True)
class Together:
    """Several faults at once, one after the other in their order."""

    faults: tuple[Fault, ...]

    def __str__(self) -> str:
        """Return it in words."""
        return "; ".join(map(str, self.faults)) or "no fault"

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with all of them."""
        for fault in self.faults:
            recording = fault.apply(recording)
        return recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Passing:
    """A fault of the beginning that fades away: a sensor that warms up, a road that levels out.

    until : time until which it is there in full [s], on the recording's clock.
    fade : how long it then takes to vanish, in a straight line [s].
    """

    fault: Fault
    until: float
    fade: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.until) and 0.0 <= self.fade < math.inf):
            raise FaultError(
                "until must be finite and fade finite and not negative, they are "
                f"{self.until} and {self.fade}"
            )

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.fault} until {self.until:g} s, gone {self.fade:g} s later"

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the fault where it is not gone yet."""
        broken, over = self.fault.apply(recording), recording.t - self.until
        left = np.where(over <= 0.0, 1.0, 1.0 - over / max(self.fade, 1e-9))
        left = np.maximum(left, 0.0)
        return replace(
            recording,
            **{
                name: good + left * (getattr(broken, name) - good)
                for name in CHANNELS
                if (good := getattr(recording, name)) is not None
            },
        )


# Of what is told of the car.


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongNumber:
    """A number of the car that is told wrongly by a factor.

    field : name of the number in `Vehicle`.
    """

    field: str
    factor: float

    def __post_init__(self) -> None:
        numbers = [one.name for one in fields(Vehicle) if one.type in (float, "float")]
        if self.field not in numbers:
            raise FaultError(f"field must be one of {', '.join(numbers)}, it is {self.field!r}")
        require_positive(FaultError, factor=self.factor)

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.field} told {self.factor:g} times"

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return the car as it is told."""
        return replace(vehicle, **{self.field: self.factor * getattr(vehicle, self.field)})


@dataclass(frozen=True, slots=True, kw_only=True)
class SwappedAxles:
    """l_f told for l_r and l_r for l_f."""

    def __str__(self) -> str:
        """Return it in words."""
        return "l_f and l_r swapped"

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return the car as it is told."""
        return replace(vehicle, l_f=vehicle.l_r, l_r=vehicle.l_f)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShiftedCenter:
    """A center of gravity told farther back than it is, at the same wheelbase.

    share : of the wheelbase, by which l_f is told too long; negative where too short [-].
    """

    share: float

    def __post_init__(self) -> None:
        if not abs(self.share) < 0.5:
            raise FaultError(f"share must lie within a half, it is {self.share}")

    def __str__(self) -> str:
        """Return it in words."""
        return f"c.g. told {100.0 * self.share:g} % of the wheelbase too far back"

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return the car as it is told."""
        shift = self.share * vehicle.wheelbase
        return replace(vehicle, l_f=vehicle.l_f + shift, l_r=vehicle.l_r - shift)


@dataclass(frozen=True, slots=True, kw_only=True)
class AnotherCar:
    """Another car told than the one that drove: the file of a 1:10 car for one of two tons."""

    told: Vehicle

    def __str__(self) -> str:
        """Return it in words."""
        return f"told to be {self.told.name}"

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return that other car, whatever car drove.

        vehicle : that drove; not looked at.
        """
        del vehicle
        return self.told
