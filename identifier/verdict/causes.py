"""The likely cause of what a model does not explain: which one number, if wrong, would do it.

Each cause is tried as what would mend it: some of it is taken out of the recording, or of the car,
and what is then missed is asked again, of a model that was learnt anew on the mended drive. The
cause whose best size leaves least is named, with that size.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from models.recordings import Recording, Repair
from models.vehicle import Vehicle

HUNDRED_KMH = 100.0 / 3.6  # m/s
TELLING = 0.3  # share of what is missed (squared) that a cause must explain to be named
DOUBLINGS = 5  # sizes of one sign that are tried, each twice the last
PATIENCE = 2  # sizes in a row that do not help, after which no larger one is tried


class Mended(NamedTuple):
    """A drive and a car from which a fault was taken out.

    road : what a bank pushes to the left, taken off what the motion shows [weights].
    friction : of the road over that of the drive that taught [-].
    """

    recording: Recording
    vehicle: Vehicle
    road: float = 0.0
    friction: float = 1.0


Mend = Callable[[Recording, Vehicle, float], Mended]


class Cause(NamedTuple):
    """A number that may be wrong.

    code : for machines.   text : with {size} in its unit, or {length} and {where}, it without its
    sign; {told}, what the vehicle file were to hold, and {origin} of a number of it.
    per_unit : of `text` per SI unit.
    step : first that is tried, and most : largest that is believed, in wheelbases or sqrt(g L)
    where `scale` says so.   signed : whether it may be negative.   mend : takes it out.
    tells : the repair of the car that {told} is of.
    """

    code: str
    text: str
    per_unit: float
    step: float
    most: float
    signed: bool
    scale: str
    mend: Mend
    tells: Callable[[Vehicle, float], Repair] | None = None

    def unit(self, vehicle: Vehicle) -> float:
        """Return what `step` and `most` are multiples of for a car, SI."""
        return {"": 1.0, "length": vehicle.wheelbase, "speed": vehicle.froude_speed}[self.scale]


def _by(repair: Callable[[Vehicle, float], Repair]) -> Mend:
    """Return what takes out a fault of a size by a repair of it."""

    def mend(recording: Recording, vehicle: Vehicle, size: float) -> Mended:
        return Mended(*repair(vehicle, size).apply(recording, vehicle))

    return mend


def _off(name: str) -> Mend:
    return _by(lambda _, size: Repair(offset={name: size}))


def _scaled(name: str) -> Mend:
    return _by(lambda _, size: Repair(factor={name: 1.0 / (1.0 + size)}))


def _inertia(vehicle: Vehicle, size: float) -> Repair:
    return Repair(vehicle={"yaw_inertia": math.exp(-size) * vehicle.yaw_inertia})


def _center(vehicle: Vehicle, size: float) -> Repair:
    return Repair(vehicle={"l_f": vehicle.l_f + size, "l_r": vehicle.l_r - size})


def _pressed(vehicle: Vehicle, size: float) -> Repair:
    """Return the areas of a car that presses by a share of its weight more at `HUNDRED_KMH`."""
    more = [told + size / HUNDRED_KMH**2 for told in vehicle.downforce]
    return Repair(vehicle=vehicle.downforce_areas(more))


def _earlier(name: str) -> Mend:
    """Return what takes out a delay, by whole samples: to interpolate would take noise out too."""

    def mend(recording: Recording, vehicle: Vehicle, size: float) -> Mended:
        signal, k = getattr(recording, name), round(size / recording.dt)
        pieces = [signal[piece] for piece in recording.stretches]
        later = np.concatenate(
            [part for one in pieces for part in (one[k:], np.full(min(k, one.size), one[-1]))]
        )
        changes: dict[str, Any] = {name: later}
        return Mended(replace(recording, **changes), vehicle)

    return mend


def _bank(recording: Recording, vehicle: Vehicle, size: float) -> Mended:
    return Mended(recording, vehicle, size)


def _friction(recording: Recording, vehicle: Vehicle, size: float) -> Mended:
    return Mended(recording, vehicle, friction=math.exp(size))


DEGREE, MILLI = math.degrees(1.0), 1e3
CAUSES = (
    Cause("sensor_ahead", "v_y is measured {size:+.2g} m from the center of gravity (+: ahead)",
          1.0, 0.1, 0.8, True, "length",
          _by(lambda _, size: Repair(velocity_sensor_x=size))),
    Cause("v_y_bias", "v_y reads {size:+.2g} m/s too much", 1.0, 0.02, 0.4, True, "speed",
          _off("v_y")),
    Cause("mount", "the velocity sensor is turned by {size:+.2g} degrees (+: to the left)", DEGREE,
          0.008, 0.1, True, "", _by(lambda _, size: Repair(velocity_sensor_angle=size))),
    Cause("steering_zero", "the zero of the steering is off by {size:+.2g} degrees", DEGREE,
          0.008, 0.1, True, "", _off("delta_f")),
    Cause("steering_late", "the steering angle is {size:.0f} ms late against the motion", MILLI,
          0.03, 0.4, False, "", _earlier("delta_f")),
    Cause("yaw_rate_late", "the yaw rate is {size:.0f} ms late (filtered?)", MILLI,
          0.03, 0.6, False, "", _earlier("r")),
    Cause("v_y_late", "v_y is {size:.0f} ms late (filtered?)", MILLI,
          0.03, 0.4, False, "", _earlier("v_y")),
    Cause("yaw_inertia", "the {origin} yaw inertia is about {factor:.2g} times the true one", 1.0,
          0.5, 4.0, True, "", _by(_inertia)),
    Cause("center_of_gravity", "the center of gravity is {length:.2g} m {where} the told one "
          "(l_f and l_r)", 1.0, 0.06, 0.3, True, "length", _by(_center)),
    Cause("downforce", "a downforce of {size:+.0f} % of the weight at 100 km/h (-: lift) beside "
          "what the vehicle file tells (it would say {told})", 100.0, 0.03, 1.0, True, "",
          _by(_pressed), _pressed),
    Cause("bank", "the road falls by {size:+.2g} degrees (+: to the left), or wind pushes so",
          DEGREE, 0.02, 0.2, True, "", _bank),
    Cause("v_y_scale", "v_y is scaled by {size:+.0f} %", 100.0,
          0.1, 0.5, True, "", _scaled("v_y")),
    Cause("yaw_rate_scale", "the yaw rate is scaled by {size:+.0f} %", 100.0,
          0.05, 0.25, True, "", _scaled("r")),
)  # fmt: skip
OF_ROAD = Cause(  # that a model of another drive may be asked about
    "friction", "the road has {factor:.2g} times the friction of the drive that taught", 1.0,
    0.1, 1.7, True, "", _friction,
)  # fmt: skip


class Suspect(NamedTuple):
    """A cause, its best size [SI], and the share of what is missed (squared) that it explains.

    told : what the vehicle file were to hold then, "key = value"; empty of most causes.
    origin : of the number of the car that is the cause, see `Vehicle.origin`.
    """

    cause: Cause
    size: float
    share: float
    told: str = ""
    origin: str = "told"

    @property
    def text(self) -> str:
        """The cause in words, with its size."""
        size = self.size * self.cause.per_unit
        factor = math.exp(min(self.size, 9.0))
        where = "ahead of" if size < 0.0 else "behind"
        return self.cause.text.format(
            size=size,
            length=abs(size),
            where=where,
            factor=factor,
            told=self.told,
            origin=self.origin,
        )


Ask = Callable[[Mended], float]


def suspects(
    ask: Ask, recording: Recording, vehicle: Vehicle, causes: Iterable[Cause] = CAUSES
) -> tuple[Suspect, ...]:
    """Return causes with their best size, the one that explains most first.

    Parameters
    ----------
    ask : returns the share of the force (squared) that is missed where a fault was taken out,
        noise taken off: below zero by chance.
    recording : the drive as it was measured.
    vehicle : the car as it was told.
    causes : that are tried.
    """
    here = ask(Mended(recording, vehicle))
    listed = []
    for cause in causes:
        unit = cause.unit(vehicle)

        def missed(size: float, cause: Cause = cause, unit: float = unit) -> float:
            try:
                return ask(cause.mend(recording, vehicle, size * unit))
            except (ArithmeticError, ValueError):
                return math.inf  # no car, or no drive, is left

        size, left = _least(missed, here, cause)
        share = (here - left) / here if here > 0.0 else 0.0
        told, origin = _told(cause, vehicle, size * unit), vehicle.origin(cause.code)
        listed.append(Suspect(cause, size * unit, share, told, origin))
    return tuple(sorted(listed, key=lambda one: -one.share))


def _told(cause: Cause, vehicle: Vehicle, size: float) -> str:
    """Return what a cause tells of a car, as lines of its file are written, in one."""
    keys = {} if cause.tells is None else cause.tells(vehicle, size).vehicle
    return ", ".join(f"{key} = {value:.2g}" for key, value in keys.items())


def _least(missed: Callable[[float], float], here: float, cause: Cause) -> tuple[float, float]:
    """Return the size that leaves least, and what it leaves: doubled, then by a parabola."""
    tried = {0.0: here}
    for sign in (1.0, -1.0) if cause.signed else (1.0,):
        worse = 0
        for size in sign * cause.step * 2.0 ** np.arange(DOUBLINGS):
            if abs(size) > cause.most or worse == PATIENCE:
                break
            before = min(tried.values())
            tried[float(size)] = missed(float(size))
            worse = 0 if tried[float(size)] < before else worse + 1
    best = min(tried, key=lambda one: tried[one])
    sizes = sorted(tried)
    at = sizes.index(best)
    if 0 < at < len(sizes) - 1:
        around = sizes[at - 1 : at + 2]
        values = [tried[one] for one in around]
        if np.isfinite(values).all():
            a, b, _ = np.polyfit(around, values, 2)
            bent = float(-0.5 * b / a) if a > 0.0 else best
            if around[0] < bent < around[2] and bent not in tried:
                tried[bent] = missed(bent)
    best = min(tried, key=lambda one: tried[one])
    return best, tried[best]
