"""Faults of known kind and size: of a channel, of a log, of the road, and of what is told of a car.

A fault of a recording takes the recording of a drive and returns what the log would hold with the
fault (`apply`); a wrong number of a car takes the car and returns the one that is told (`tell`).
Forces, where they are known, stay those of the drive. `str` of a fault says it in words.
"""

from models.faults.drives import (
    AnotherCar,
    Bank,
    Misaligned,
    Passing,
    SensorElsewhere,
    ShiftedCenter,
    SwappedAxles,
    Together,
    WrongNumber,
)
from models.faults.signals import (
    KINDS,
    SIZED,
    UNITS,
    ClockJump,
    Fault,
    FaultError,
    Held,
    Jitter,
    Lagging,
    Late,
    Mirrored,
    SensorFault,
    WrongUnit,
)

__all__ = [
    "KINDS",
    "SIZED",
    "UNITS",
    "AnotherCar",
    "Bank",
    "ClockJump",
    "Fault",
    "FaultError",
    "Held",
    "Jitter",
    "Lagging",
    "Late",
    "Mirrored",
    "Misaligned",
    "Passing",
    "SensorElsewhere",
    "SensorFault",
    "ShiftedCenter",
    "SwappedAxles",
    "Together",
    "WrongNumber",
    "WrongUnit",
]
