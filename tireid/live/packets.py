"""Samples of packets: JSON or packed numbers, whose names, units and signs a log.toml declares.

The numbers have the bits that `read_recording` gives for a log of the same numbers.
"""

import json
import math
import struct
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import NoneType
from typing import Any, NamedTuple

import numpy as np

from models.logs.log import RecordingError, some
from models.logs.signals import BETA, INSTEAD, POSE, WHEELS, Signal, quantity_of
from models.logs.units import PER_SECOND, TIME, is_given, time_unit, to_si
from models.recordings.choice import column_of, has_v_y, missing_signals
from models.recordings.map import AXES, LARGEST_PACKET, LogMap
from tireid.live.state import Counts

_FIRST = 50  # packets, 0.5 s at 100 Hz, after which a name that never came is missing
_DEEPEST = 8  # objects in one another, whose names a message lists
_TIME = "t"  # name that is the time where no other is declared
READ = ("v_x", "v_y", BETA, "r", "delta_f", "a_y")


class Sample(NamedTuple):
    """Signals at an instant [s], in SI and ISO axes; NaN where there is none."""

    t: float
    v_x: float
    r: float
    delta_f: float
    a_y: float
    v_y: float


def require_live(log_map: LogMap) -> None:
    """Refuse what a map declares and only a whole log allows."""
    signals, repair = log_map.signals, log_map.repair
    declared = {
        "file.run": log_map.run, "clock.rate": log_map.rate, "filters.low_pass": log_map.low_pass,
        "repair.delay": repair.delay, "repair.lag": repair.lag,
        "repair.acceleration_sensor_x": repair.acceleration_sensor_x,
        "signals.delta_r": "delta_r" in signals,
        **{f"signals.{name}.sign": one.sign for name, one in signals.items()},
        **{f"signals.{name}": "v_x" not in signals for name in (*WHEELS, *POSE) if name in signals},
    }  # fmt: skip
    if key := next((key for key, value in declared.items() if value), None):
        raise RecordingError(f"{key} of log.toml cannot be read live, only of a log; leave it out")


class Reading:
    """How samples are made of the numbers of channels.

    signals : how each is read, by name.   units : of channels, where the source tells them.
    """

    def __init__(
        self, log_map: LogMap, signals: Mapping[str, Signal], units: Mapping[str, str]
    ) -> None:
        self._repair = log_map.repair or None
        self.channels: list[tuple[str, float]] = []  # name, and factor to SI
        self._parts: list[tuple[str, Signal | None, slice, float]] = []  # None: as its channel
        for name, signal in signals.items():
            first = len(self.channels)
            for one in signal.channel:
                unit = signal.unit if is_given(signal.unit) else units.get(one, "")
                what = f"{column_of(name)} (channel {one!r})"
                self.channels.append((one, to_si(unit, quantity_of(name, unit), what)))
            changed = None if signal.is_plain else signal
            sign = 1.0 if name == "v_x" else AXES[log_map.axes]
            self._parts.append((name, changed, slice(first, len(self.channels)), sign))

    def sample(self, t: float, values: Sequence[float]) -> Sample:
        """Return the sample of an instant.   values : of each channel in SI, NaN of none."""
        now = {"a_y": math.nan, "v_y": math.nan}
        for name, signal, part, sign in self._parts:
            value = values[part.start] if signal is None else signal.at(values[part])
            now[name] = value * sign
        if BETA in now:
            now["v_y"] = now["v_x"] * float(np.tan(now.pop(BETA)))
        if self._repair:
            now = self._repair.at(now)
        return Sample(t, now["v_x"], now["r"], now["delta_f"], now["a_y"], now["v_y"])


class Packets:
    """Reads packets of JSON, or of the numbers that `packet` and `fields` of the map declare.

    label : of the source, for messages.   counts : in which unreadable packets are counted.
    """

    def __init__(self, label: str, log_map: LogMap, counts: Counts) -> None:
        self._label, self._map, self._counts = label, log_map, counts
        self._signals = {name: one for name, one in log_map.signals.items() if name in READ}
        if not log_map.is_complete:  # then standard names are read too
            for name in READ:
                if name != BETA and INSTEAD.get(name) not in self._signals:
                    self._signals.setdefault(name, Signal(channel=(column_of(name),)))
        to_si(log_map.clock_unit, TIME, f"{label}: clock.unit")
        self._per_second = PER_SECOND.get(time_unit(log_map.clock_unit), 1.0)
        self._arrived, self._zero = False, math.nan  # whether time is that of arrival; the first
        self._reading = Reading(log_map, self._signals, {})
        names = [*(name for name, _ in self._reading.channels), log_map.clock or _TIME]
        self._places = [(name, name.split(".")) for name in names]
        self.v_y = True if has_v_y(log_map.signals) else None
        self._looked, self._names = 0, set[str]()
        self._struct = struct.Struct(log_map.packet) if log_map.packet else None
        if self._struct:
            self._looked = _FIRST - 1
            self._look(dict.fromkeys(log_map.fields))

    def take(self, data: bytes | None) -> Iterator[Sample]:
        """Yield the sample of a packet; none of one that cannot be read, which is counted."""
        if data is None:
            return
        try:
            if len(data) > LARGEST_PACKET:
                raise ValueError
            if self._struct:
                packet = dict(zip(self._map.fields, self._struct.unpack(data), strict=True))
            else:
                packet = json.loads(data.decode())
            *values, t = [_number(packet, name, path) for name, path in self._places]
        except (ValueError, TypeError, AttributeError, OverflowError, RecursionError, struct.error):
            self._counts.unreadable += 1
            return
        if self._looked < _FIRST:
            self._look(packet)
        if self._arrived:
            t = time.monotonic()
            self._zero = t if math.isnan(self._zero) else self._zero
            t -= self._zero
        elif self._per_second != 1.0:
            t /= self._per_second
        channels = self._reading.channels
        si = [value * factor for value, (_, factor) in zip(values, channels, strict=True)]
        yield self._reading.sample(t, si)

    def _look(self, packet: Mapping[str, Any]) -> None:
        """Learn the names of the first packets; refuse where one that is needed never came."""
        self._names |= set(_names(packet, ""))
        if self.v_y is None:
            self.v_y = column_of("v_y") in self._names and "v_y" in self._signals
        self._arrived = not self._map.clock and _TIME not in self._names
        self._looked += 1
        if self._looked < _FIRST:
            return
        there = {n: one for n, one in self._signals.items() if self._names.issuperset(one.channel)}
        lost = [name for name in self._signals if name in {*self._map.signals} - {*there}]
        lost += [name for name in missing_signals(there) if name in self._signals]
        missing = {one for name in lost for one in self._signals[name].channel}
        missing |= {self._map.clock} if self._map.clock else set()
        if missing := missing - self._names:
            raise RecordingError(
                f"{self._label}: no packet has {some(sorted(missing))}; they have "
                f"{some(sorted(self._names))}: name the channels in [signals] of log.toml"
            )
        self._names.clear()


def _number(packet: Mapping[str, Any], name: str, path: Sequence[str]) -> float:
    """Return a number of a packet, NaN where it has none; what is no number raises."""
    value = packet.get(name)
    if value is None and len(path) > 1:
        value = packet
        for one in path:
            value = None if value is None else value.get(one)
    if type(value) not in (int, float, NoneType):
        raise TypeError
    return math.nan if value is None else float(value)


def _names(packet: Mapping[str, Any], before: str) -> Iterable[str]:
    for name, value in packet.items():
        yield before + name
        if isinstance(value, dict) and before.count(".") < _DEEPEST:
            yield from _names(value, f"{before}{name}.")
