"""What takes known faults out of a log: units, offsets, delays, lags, sensors that sit elsewhere.

What a log shows of a drive is made in this order: the place of the sensor, the way it looks, its
low pass, its delay, its offset, its factor. It is taken out backwards. Conventions are those of
`benchmarks.faults`: a fault that is applied and repaired gives the drive back.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

import numpy as np

from codegen.arrays import Array, blocks, filled, large
from codegen.escape import displayed
from models.logs.log import RecordingError
from models.recordings.record import CHANNELS, MINIMUM_SAMPLES, Recording
from models.schema import Table, changed
from models.vehicle import AREAS, BICYCLE, Vehicle

_SMOOTHED = 0.08  # half the width of the window before a low pass is inverted, over sqrt(L/g)


@dataclass(frozen=True, slots=True, kw_only=True)
class Repair:
    """Corrections of a log and of its declared car; SI throughout.

    Parameters
    ----------
    velocity_sensor_x : how far ahead of the center of gravity v_y is measured [m].
    velocity_sensor_angle : by which that sensor is turned to the left [rad].
    acceleration_sensor_x : how far ahead of the center of gravity a_y is measured [m].
    sideslip : whether what is logged as v_y is, with its factor, the sideslip angle [rad].
    factor : by channel, what the logged value is multiplied by [-].
    offset : by channel, what is then taken off, in its unit.
    delay : by channel, how late it is against the others [s]; negative where it is early. The
        repaired recording ends, or begins, where a channel has no sample any more.
    lag : by channel, time constant of a low pass of first order that it is behind [s].
    vehicle : numbers of the car in place of the declared ones, by their names in `Vehicle`.
    """

    velocity_sensor_x: float = 0.0
    velocity_sensor_angle: float = 0.0
    acceleration_sensor_x: float = 0.0
    sideslip: bool = False
    factor: Mapping[str, float] = field(default_factory=dict)
    offset: Mapping[str, float] = field(default_factory=dict)
    delay: Mapping[str, float] = field(default_factory=dict)
    lag: Mapping[str, float] = field(default_factory=dict)
    vehicle: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in _TABLES:
            known = (*BICYCLE, *AREAS) if name == "vehicle" else CHANNELS
            for key, value in getattr(self, name).items():
                if key not in known:
                    raise RecordingError(
                        f"repair: {name} must be of {', '.join(known)}, not of {displayed(key)}"
                    )
                _require_finite(f"{name}.{key}", value)
                if name == "factor" and value == 0.0:
                    raise RecordingError(f"repair: factor.{key} must not be 0")
                if name in ("lag", "vehicle") and key not in AREAS and not value > 0.0:
                    raise RecordingError(f"repair: {name}.{key} must be positive, it is {value}")
        for name in _SCALARS:
            _require_finite(name, getattr(self, name))

    def __bool__(self) -> bool:
        return self != Repair()

    def apply(self, recording: Recording, vehicle: Vehicle) -> tuple[Recording, Vehicle]:
        """Return the recording and the car without the faults; true forces stay those of the drive.

        Raises
        ------
        RecordingError
            Where the recording lacks a channel that is to be repaired, or nothing of it is left.
        VehicleError
            Where the numbers of the car are those of no car.
        """
        declared = {name for table in _TABLES[:-1] for name in getattr(self, table)}
        if self.acceleration_sensor_x:
            declared.add("a_y")
        turned = self.velocity_sensor_angle or self.velocity_sensor_x
        if self.sideslip or turned:
            declared.add("v_y")
        for name in CHANNELS:
            if name in declared and getattr(recording, name) is None:
                raise RecordingError(f"{recording.name}: has no {name} that could be repaired")
        if not declared:
            return recording, self.on(vehicle)
        n, t = len(recording), recording.t
        signals: dict[str, Array] = {
            name: filled(n, partial(self._scaled, recording, name))
            for name in CHANNELS
            if getattr(recording, name) is not None
        }
        if self.sideslip:
            factor, offset, speed = *self._scale("v_y"), signals["v_x"]
            angle = recording.needed("v_y")
            signals["v_y"] = filled(n, lambda k: speed[k] * np.tan(angle[k] * factor) - offset)
        for name, delay in self.delay.items():
            late = signals[name]
            signals[name] = _by_segments(recording, partial(_earlier, t, late, delay))
        width = round(_SMOOTHED * vehicle.froude_time / recording.dt)
        for name, lag in self.lag.items():
            low = signals[name]
            signals[name] = large((n,))
            for piece in recording.segments:
                signals[name][piece] = _without_low_pass(low[piece], lag, recording.dt, width)
        r = signals["r"]
        if turned:
            c, s = math.cos(self.velocity_sensor_angle), math.sin(self.velocity_sensor_angle)
            v_x, v_y, x = signals["v_x"], signals["v_y"], self.velocity_sensor_x
            signals["v_x"] = filled(n, lambda k: c * v_x[k] - s * v_y[k])
            signals["v_y"] = filled(n, lambda k: c * v_y[k] + s * v_x[k] - x * r[k])
        if self.acceleration_sensor_x:
            ahead, a_y = self.acceleration_sensor_x, signals["a_y"]
            signals["a_y"] = _by_segments(
                recording, lambda whole, k: a_y[k] - ahead * _rate(r, whole, k, recording.dt)
            )
        changes: dict[str, Any] = dict(signals)
        return self._measured(replace(recording, **changes)), self.on(vehicle)

    def at(self, signals: Mapping[str, float]) -> dict[str, float]:
        """Return the signals of one instant as `apply` leaves them, bit for bit.

        Delays, lags and the place of the accelerometer need other instants; they stay.
        """
        now = {name: value * self._scale(name)[0] - self._scale(name)[1]
               for name, value in signals.items()}  # fmt: skip
        if self.sideslip:
            factor, offset = self._scale("v_y")
            now["v_y"] = now["v_x"] * float(np.tan(signals["v_y"] * factor)) - offset
        if self.velocity_sensor_angle or self.velocity_sensor_x:
            c, s = math.cos(self.velocity_sensor_angle), math.sin(self.velocity_sensor_angle)
            v_x, v_y = now["v_x"], now["v_y"]
            now["v_x"] = c * v_x - s * v_y
            now["v_y"] = c * v_y + s * v_x - self.velocity_sensor_x * now["r"]
        return now

    def _scale(self, name: str) -> tuple[float, float]:
        return self.factor.get(name, 1.0), self.offset.get(name, 0.0)

    def _scaled(self, recording: Recording, name: str, part: slice) -> Array:
        factor, offset = self._scale(name)
        return getattr(recording, name)[part] * factor - offset

    def on(self, vehicle: Vehicle) -> Vehicle:
        """Return the car with the corrected numbers."""
        if not self.vehicle:
            return vehicle
        numbers: dict[str, Any] = dict(self.vehicle)
        estimated = tuple(name for name in vehicle.estimated if name not in numbers)
        return replace(vehicle, estimated=estimated, **numbers)

    def _measured(self, repaired: Recording) -> Recording:
        """Return the samples at which every channel was measured."""
        late = max(0.0, *self.delay.values(), 0.0)
        early = max(0.0, *(-delay for delay in self.delay.values()), 0.0)
        first, last = (math.ceil(time / repaired.dt - 1e-6) for time in (early, late))
        if not (first or last):
            return repaired
        segments = [slice(one.start + first, one.stop - last) for one in repaired.segments]
        kept = [one for one in segments if one.stop - one.start >= MINIMUM_SAMPLES]
        if not kept:
            whole = "any segment of its" if repaired.breaks else "its"
            raise RecordingError(
                f"{repaired.name}: delays of {1e3 * late:g} and {1e3 * early:g} ms leave nothing "
                f"of {whole} {repaired.duration:g} s"
            )
        if not repaired.breaks:
            return repaired.taken(kept[0])
        left = repaired.taken(np.concatenate([np.arange(one.start, one.stop) for one in kept]))
        if lost := len(segments) - len(kept):
            note = f"left out: {lost} segment{'s' * (lost > 1)} of which delays leave nothing"
            left = replace(left, notes=(*left.notes, note))
        return left

    def merged(self, other: "Repair") -> "Repair":
        """Return what both take out, as of numbers that were estimated together.

        Factors multiply, all else adds; of the numbers of the car the other's hold.
        """
        sums: dict[str, Any] = {
            name: _added(getattr(self, name), getattr(other, name))
            for name in ("offset", "delay", "lag")
        }
        one, more = self.factor, other.factor
        factor = {key: one.get(key, 1.0) * more.get(key, 1.0) for key in {**one, **more}}
        places = {name: getattr(self, name) + getattr(other, name) for name in _SCALARS}
        return Repair(
            factor=factor,
            sideslip=self.sideslip or other.sideslip,
            vehicle={**self.vehicle, **other.vehicle},
            **sums,
            **places,
        )

    def then(self, other: "Repair") -> "Repair":
        """Return one repair that does what this and, of what it leaves, another do.

        What is taken off first is scaled by the factors that follow, and turned back where it is
        taken off behind a turned sensor; a place is that of the signals as they end. It is exact
        but for products of small numbers: a turn before v_x and v_y are scaled by different sizes,
        a place before a turn, and channels that are late and are used for another.

        Raises
        ------
        RecordingError
            Where the other takes v_y for an angle of which this took something off, or made it a
            velocity.
        """
        if other.sideslip and (self.sideslip or self.offset.get("v_y")):
            raise RecordingError(
                "repair: what is left is read as a sideslip angle, so nothing may be taken off "
                "v_y before, and it must not have been one: combine both repairs"
            )
        factor = other.factor.get
        f_x, f_y, f_r, f_a = (factor(name, 1.0) for name in ("v_x", "v_y", "r", "a_y"))
        ahead = self.velocity_sensor_x * f_y / f_r
        pushed = self.acceleration_sensor_x * f_a / f_r
        angle = math.copysign(1.0, f_x * f_y) * self.velocity_sensor_angle
        more = {name: other.offset.get(name, 0.0) for name in CHANNELS}
        more["v_y"] += ahead * more["r"]
        c, s = math.cos(angle), math.sin(angle)
        more["v_x"], more["v_y"] = (
            c * more["v_x"] + s * more["v_y"],
            c * more["v_y"] - s * more["v_x"],
        )
        offset = {
            name: self.offset.get(name, 0.0) * factor(name, 1.0) + more[name] for name in CHANNELS
        }
        return replace(
            self.merged(other),
            offset={name: value for name, value in offset.items() if value},
            velocity_sensor_x=ahead + other.velocity_sensor_x,
            velocity_sensor_angle=angle + other.velocity_sensor_angle,
            acceleration_sensor_x=pushed + other.acceleration_sensor_x,
        )

    def tables(self) -> dict[str, Any]:
        """Return it as a document holds it: only what repairs something, tables after numbers."""
        return {k: dict(v) if isinstance(v, Mapping) else v for k, v in changed(self).items()}

    @classmethod
    def of_table(cls, table: Table) -> "Repair":
        """Return it as a document says it.   table : as `tables` returns it."""
        return cls(**table.record(cls))


_TABLES = ("factor", "offset", "delay", "lag", "vehicle")
_SCALARS = tuple(one.name for one in fields(Repair) if one.name not in (*_TABLES, "sideslip"))


def _require_finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise RecordingError(f"repair: {name} must be finite, it is {value}")


def _added(one: Mapping[str, float], other: Mapping[str, float]) -> dict[str, float]:
    return {key: one.get(key, 0.0) + other.get(key, 0.0) for key in {**one, **other}}


def _by_segments(recording: Recording, compute: Callable[[slice, slice], Array]) -> Array:
    """Return values of samples that are computed of their segment alone, block by block (n,).
    compute : returns the values of a part (k,) of a segment, given both.
    """
    values = large((len(recording),))
    for whole in recording.segments:
        for part in blocks(whole.stop, whole.start):
            values[part] = compute(whole, part)
    values.setflags(write=False)
    return values


def _without_low_pass(signal: Array, lag: float, dt: float, half: int) -> Array:
    """Return what went into a low pass, u = y + T ẏ, of y under a Hann window without phase (n,).
    signal : y, what came out (n,).   lag : time constant T of the low pass [s].
    half : samples on each side of the window, which takes noise off first; 0 for none.
    """
    if half > 0:
        bell = np.hanning(2 * half + 3)[1:-1]
        padded = np.pad(signal, half, mode="reflect", reflect_type="odd")
        signal = np.convolve(padded, bell / bell.sum(), "valid")
    return signal + lag * np.gradient(signal, dt)


def _earlier(t: Array, signal: Array, delay: float, whole: slice, part: slice) -> Array:
    return np.interp(t[part] + delay, t[whole], signal[whole])


def _rate(signal: Array, whole: slice, part: slice, dt: float) -> Array:
    """Return the rate of change over a part of a segment of a signal, by central differences."""
    first, end = max(part.start - 1, whole.start), min(part.stop + 1, whole.stop)
    rate: Array = np.gradient(signal[first:end], dt)
    return rate[part.start - first :][: part.stop - part.start]
