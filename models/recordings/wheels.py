"""What wheels are, by which speed is made of theirs: radii, tracks, and which are driven."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from models.logs.log import RecordingError
from models.logs.signals import AXLES, WHEELS
from models.rules import require_within
from models.schema import Table, changed
from models.vehicle import Vehicle

RADII = (0.01, 2.0)  # of a wheel [m], of model cars to dump trucks
_LENGTHS = (0.05, 20.0)  # of a track and a wheelbase [m]
_ACCELERATIONS = (0.5, 100.0)  # [m/s²]
DRIVEN: Mapping[str, tuple[str, ...]] = {
    "front": AXLES[0],
    "rear": AXLES[1],
    "all": WHEELS,
    "none": (),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Wheels:
    """What wheels are, by which v_x is made of their speeds; SI throughout.

    Parameters
    ----------
    radius : by which a wheel rolls [m]: one for all, one per axle, front and rear, or one per wheel
        in the order of `WHEELS`; empty where speeds are logged, or it is not known.
    track : between the wheels of an axle [m], one for both or front and rear; empty where it is not
        known: then wheels of an axle count as one, by their mean.
    wheelbase : L [m]; None where it is not known: then front wheels are taken to roll without slip.
    driven : "front", "rear", "all" or "none"; empty where it is not known.
    acceleration : the largest along the car, either way [m/s²].
    """

    radius: tuple[float, ...] = ()
    track: tuple[float, ...] = ()
    wheelbase: float | None = None
    driven: str = ""
    acceleration: float = 12.0

    def __post_init__(self) -> None:
        for name, sizes, words in (
            ("radius", (0, 1, 2, 4), "one number, one per axle or one per wheel"),
            ("track", (0, 1, 2), "one number or one per axle"),
        ):
            given = getattr(self, name)
            if len(given) not in sizes:
                raise RecordingError(f"wheels: {name} must be {words}, not {len(given)} numbers")
        for name, ends in (("radius", RADII), ("track", _LENGTHS)):
            for one in getattr(self, name):
                require_within(RecordingError, *ends, **{f"wheels: {name}": one})
        if self.wheelbase is not None:
            require_within(RecordingError, *_LENGTHS, **{"wheels: wheelbase": self.wheelbase})
        require_within(
            RecordingError, *_ACCELERATIONS, **{"wheels: acceleration": self.acceleration}
        )
        if self.driven and self.driven not in DRIVEN:
            raise RecordingError(
                f"wheels: driven must be one of {', '.join(DRIVEN)}, not {self.driven!r}"
            )

    def radius_of(self, name: str) -> float | None:
        """Return the radius of a wheel [m], of `wheel` that of the rear axle; None: unknown."""
        if not self.radius:
            return None
        k = WHEELS.index(name) if name in WHEELS[:4] else 2
        if len(self.radius) == 4:
            one = self.radius[2:] if name not in WHEELS[:4] else self.radius[k : k + 1]
            return sum(one) / len(one)
        return self.radius[min(k // 2, len(self.radius) - 1)]

    def completed(self, vehicle: Vehicle) -> "Wheels":
        """Return it, completed by what the vehicle declares."""
        track, chassis = self.track, vehicle.chassis
        if not track and chassis is not None:
            track = (chassis.track_front, chassis.track_rear)
        wheelbase = vehicle.wheelbase if self.wheelbase is None else self.wheelbase
        return replace(self, track=track, wheelbase=wheelbase)

    def table(self) -> dict[str, Any]:
        """Return it as a document holds it: what differs from the defaults."""
        return {
            name: value[0] if isinstance(value, tuple) and len(value) == 1 else value
            for name, value in changed(self).items()
        }

    @classmethod
    def of_table(cls, table: Table) -> "Wheels":
        """Return it as a document says it.   table : as `table` returns it."""
        return cls(**table.record(cls, alone=("radius", "track")))
