"""Samples of packets, and of the frames of a CAN bus, as a log.toml declares them.

The numbers have the bits that `read_recording` gives for a log of the same numbers. Signals of a
bus come one after another. Instants are those of the channel whose rate is nearest to 100 Hz; there
another channel has what `models.logs.clock` gives it, of samples that were there by then: above
150 Hz a mean, whose last digits may differ.
"""

import json
import math
import struct
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from operator import mul
from pathlib import Path
from types import EllipsisType, NoneType
from typing import Any, NamedTuple

import numpy as np

from models.logs.can import CALENDAR, EXTENDED, reader_of, wanted
from models.logs.clock import BEYOND, FASTER, GAP_INTERVALS, ON_STEP, RECENT
from models.logs.log import RecordingError, some
from models.logs.signals import BETA, INSTEAD, POSE, WHEELS, Signal, quantity_of
from models.logs.units import PER_SECOND, TIME, is_given, time_unit, to_si
from models.recordings.choice import column_of, has_v_y, missing_signals
from models.recordings.map import AXES, LARGEST_PACKET, LogMap
from tireid.live.clock import BACK, DT
from tireid.live.state import Counts

_READ = ("v_x", "v_y", BETA, "r", "delta_f", "a_y")
_JSON = json.JSONDecoder()
_NUMBERS = {int, float, NoneType, EllipsisType}  # types, or nothing
_TIME = "t"  # name that is the time where no other is declared
_FIRST = 50  # packets, 0.5 s at 100 Hz, after which a name that never came is missing
_NEAR = ON_STEP * DT  # s, within which two instants are one
_OBSERVED = 1.0  # s, of which rates of a bus are learnt; a signal that did not come is missing
_MOST = 8192  # samples of a channel that wait for others: 8 s at 1 kHz


class Sample(NamedTuple):
    """Signals at an instant [s], in SI and ISO axes; NaN where there is none."""

    t: float
    v_x: float
    r: float
    delta_f: float
    a_y: float
    v_y: float


def live_map(log_map: LogMap) -> LogMap:
    """Return a map of the signals that are read live; refuse what only a whole log allows."""
    signals, repair = log_map.signals, log_map.repair
    declared = {
        "file.run": log_map.run, "clock.rate": log_map.rate, "filters.low_pass": log_map.low_pass,
        "repair.delay": repair.delay, "repair.lag": repair.lag,
        "repair.acceleration_sensor_x": repair.acceleration_sensor_x,
        "signals.delta_r": "delta_r" in signals,
        **{f"signals.{n}": n in signals and "v_x" not in signals for n in WHEELS},
        **{f"signals.{name}": name in signals for name in POSE},
        **{f"signals.{name}.sign": one.sign for name, one in signals.items()},
    }  # fmt: skip
    if key := next((key for key, value in declared.items() if value), None):
        raise RecordingError(f"{key} of log.toml cannot be read live, only of a log; leave it out")
    return replace(log_map, signals={name: signals[name] for name in signals if name in _READ})


class _Reading:
    """How samples are made of channels.   units : of these, where the source tells them."""

    def __init__(
        self, log_map: LogMap, signals: Mapping[str, Signal], units: Mapping[str, str]
    ) -> None:
        self._repair = log_map.repair or None
        self.channels: list[tuple[str, float]] = []  # name, and factor to SI
        self._values: dict[str, Callable[[Sequence[float]], float]] = {}
        for name, signal in signals.items():
            sign = 1.0 if name == "v_x" else AXES[log_map.axes]
            self._values[name] = _value_of(signal, len(self.channels), sign)
            for one in signal.channel:
                unit = signal.unit if is_given(signal.unit) else units.get(one, "")
                what = f"{column_of(name)} (channel {one!r})"
                self.channels.append((one, to_si(unit, quantity_of(name, unit), what)))

    def sample(self, t: float, values: Sequence[float]) -> Sample:
        """Return the sample of an instant.   values : of each channel in SI, NaN of none."""
        now = {"a_y": math.nan, "v_y": math.nan}
        now |= {name: value(values) for name, value in self._values.items()}
        if BETA in now:
            now["v_y"] = now["v_x"] * float(np.tan(now.pop(BETA)))
        return Sample(t, **self._repair.at(now) if self._repair else now)


def _value_of(signal: Signal, first: int, sign: float) -> Callable[[Sequence[float]], float]:
    """Return what makes a signal of the numbers of all channels.   first : of its channels."""
    factor, offset, ratio = signal.factor, signal.offset, signal.ratio
    if signal.table or len(signal.channel) > 1:
        part = slice(first, first + len(signal.channel))
        return lambda x: sign * float(signal.value([np.array([one]) for one in x[part]], "")[0])
    return lambda x: sign * ((x[first] * factor - offset) / ratio)


class Packets:
    """Reads packets of JSON, or of the numbers that `packet` and `fields` of the map declare."""

    def __init__(self, label: str, log_map: LogMap, counts: Counts) -> None:
        self._label, self._map, self._counts = label, log_map, counts
        self._signals = dict(log_map.signals)
        if not log_map.is_complete:  # then standard names are read too
            for name in _READ:
                if name != BETA and INSTEAD.get(name) not in self._signals:
                    self._signals.setdefault(name, Signal(channel=(column_of(name),)))
        to_si(log_map.clock_unit, TIME, f"{label}: clock.unit")
        self._per_second = PER_SECOND.get(time_unit(log_map.clock_unit), 1.0)
        self._zero: float | None = None  # when packets began [s], where their arrival is the time
        self._reading = _Reading(log_map, self._signals, {})
        self._places = [*(name for name, _ in self._reading.channels), log_map.clock or _TIME]
        self._factors = [factor for _, factor in self._reading.channels]
        self.v_y = True if has_v_y(log_map.signals) else None
        self._struct = struct.Struct(log_map.packet) if log_map.packet else None
        self._looked, self._came = 0, set[str]()
        if self._struct:  # its packets are known
            self._looked, fields = _FIRST - 1, dict.fromkeys(log_map.fields)
            self._look(fields, [_found(fields, name) for name in self._places])

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
                text = data.decode().strip()
                packet, end = _JSON.raw_decode(text)  # half the time of loads
                if end < len(text) or not isinstance(packet, dict):
                    raise ValueError
            found = [_found(packet, name) for name in self._places]
            if not _NUMBERS.issuperset(map(type, found)):
                raise TypeError
            *values, t = [math.nan if one is None or one is ... else float(one) for one in found]
        except (ValueError, TypeError, OverflowError, RecursionError, struct.error):
            self._counts.unreadable += 1
            return
        if self._looked < _FIRST:
            self._look(packet, found)
        if all(one is ... for one in found):
            self._counts.unreadable += 1
            return
        t = t / self._per_second if self._zero is None else time.monotonic() - self._zero
        yield self._reading.sample(t, list(map(mul, values, self._factors)))

    def _look(self, packet: Mapping[str, Any], found: Sequence[Any]) -> None:
        """Learn what the first packets have; refuse where something that is needed never came."""
        places, clock = zip(self._places, found, strict=True), self._map.clock
        self._came |= {name for name, one in places if one is not ...}
        self._looked += 1
        self._zero = None if clock or _TIME in self._came else self._zero or time.monotonic()
        there = {n: one for n, one in self._signals.items() if self._came.issuperset(one.channel)}
        needed = [n for n in (*self._map.signals, *missing_signals(there)) if n in self._signals]
        missing = {one for name in needed for one in self._signals[name].channel}
        missing = (missing | {clock}) - {"", *self._came}
        if self.v_y is None and not missing:
            self.v_y = column_of("v_y") in self._came
        if missing and self._looked == _FIRST:
            raise RecordingError(
                f"{self._label}: no packet has {some(sorted(missing))}; they have "
                f"{some(sorted(packet))}: name the channels in [signals] of log.toml, of an object "
                'within as "imu.r"'
            )


def _found(packet: Mapping[str, Any], name: str) -> Any:
    """Return what a packet has by a name, or by a path into it; ... where it has nothing."""
    if name in packet:
        return packet[name]
    value: Any = packet
    for one in name.split("."):
        value = value.get(one, ...) if isinstance(value, dict) else ...
    return value


class _Channel:
    """The last samples of a signal of a bus, in SI.   longest : age that is no gap yet [s]."""

    def __init__(self, name: str, factor: float, longest: float) -> None:
        self.name, self.factor, self._longest = name, factor, longest
        self.last = deque[tuple[float, float]](maxlen=_MOST)  # time [s] and value, rising
        self.interval = math.nan  # between samples [s], typical

    def at(self, t: float) -> float:
        """Return the value at an instant [s], as `models.logs.clock` has it; NaN in a gap."""
        while len(self.last) > RECENT and self.last[RECENT][0] <= t - DT:
            self.last.popleft()
        last, end = self.last, len(self.last)
        while end and last[end - 1][0] > t + _NEAR:
            end -= 1
        if not end or t - last[end - 1][0] > max(self._longest, GAP_INTERVALS * self.interval):
            return math.nan
        here, now = last[end - 1]
        if self.interval < DT / FASTER:
            begin = end - 1
            while begin and last[begin - 1][0] > t - DT + _NEAR:
                begin -= 1
            return sum(last[k][1] for k in range(begin, end)) / (end - begin)
        before, old = last[end - 2] if end > 1 else (here, now)
        step, ahead = here - before, t - here
        if ahead > _NEAR and 0.0 < step <= GAP_INTERVALS * self.interval:
            recent = [value for _, value in islice(last, max(end - RECENT, 0), end)]
            low, high = min(recent), max(recent)
            room = BEYOND * (high - low)
            change = min(max(now - old, low - room - now), high + room - now)
            return now + min(ahead, step) / step * change
        return now


class Frames:
    """Joins the frames of a bus, as python-can gives them, to samples; a short one is counted."""

    def __init__(self, label: str, log_map: LogMap, counts: Counts) -> None:
        self._label, self._counts = label, counts
        signals, self.v_y = log_map.signals, has_v_y(log_map.signals)
        lacking = [f"signals.{name}" for name in missing_signals(signals)]
        if lacking := ["file.dbc"] * (not log_map.dbc) + lacking:
            names = ", ".join(lacking).replace("v_y", "v_y (or a_y)")
            raise RecordingError(
                f'{label}: {names} of log.toml must be declared: dbc = "car.dbc" in [file], '
                'channel = "FRAME.SIGNAL" in [signals.r]'
            )
        channels = [one for signal in signals.values() for one in signal.channel]
        self._dbc, found = wanted(Path(log_map.dbc), channels)
        units = {n: (one.unit or "").strip() for n, (_, one) in zip(channels, found, strict=True)}
        self._reading = _Reading(log_map, signals, units)
        self._channels = [_Channel(*one, log_map.longest_gap) for one in self._reading.channels]
        self._read, self._of = {}, dict[str, list[tuple[str, _Channel]]]()  # by message
        for (key, signal), channel in zip(found, self._channels, strict=True):
            message = self._dbc.messages[key]
            self._read[message.name] = reader_of(message)
            self._of.setdefault(message.name, []).append((signal.name, channel))
        self.filters = None if self._dbc.groups else [
            {"can_id": key & ~EXTENDED, "can_mask": 0x1FFFFFFF if key & EXTENDED else 0x7FF,
             "extended": key >= EXTENDED}
            for key in {key for key, _ in found}
        ]  # fmt: skip
        self._zero = self._first = self._newest = math.nan  # [s]
        self._base: _Channel | None = None
        self.waiting = deque[float]()  # instants of which frames may still come [s]

    def take(self, frame: Any) -> Iterator[Sample]:
        """Yield the samples that a frame completes; None, where none came: those that wait."""
        if frame is None:
            yield from self._complete(math.inf)
            return
        message = self._dbc.message(frame.arbitration_id | EXTENDED * frame.is_extended_id)
        no_data = frame.is_error_frame or frame.is_remote_frame
        if no_data or message is None or message.name not in self._of:
            return
        if len(frame.data) < message.length or not math.isfinite(frame.timestamp):
            self._counts.unreadable += 1
            return
        t = frame.timestamp
        self._zero = t if math.isnan(self._zero) else self._zero
        if self._zero > CALENDAR:  # as `models.logs.stamps.since`
            t = round((t - self._zero) * 1e6) / 1e6
        if not t >= self._newest - BACK:
            self._first = t
            self.waiting.clear()
            for one in self._channels:
                one.last.clear()
        self._newest = t
        values = self._read[message.name](frame.data)
        for name, one in self._of[message.name]:
            if name in values and not (one.last and t <= one.last[-1][0]):
                one.last.append((t, values[name] * one.factor))
                if one is self._base:
                    self.waiting.append(t)
        if self._base is None and t - self._first > _OBSERVED:
            self._base = self._observed()
        yield from self._complete(t)

    def _observed(self) -> _Channel:
        """Return the channel of the instants, where all came."""
        if lost := [one.name for one in self._channels if len(one.last) < 2]:
            raise RecordingError(
                f"{self._label}: within {_OBSERVED:g} s there was no {some(lost)}; is it another "
                "bus, or another DBC file?"
            )
        for one in self._channels:
            one.interval = float(np.median(np.diff([t for t, _ in one.last])))
        # Rates that differ by jitter alone are equal: the first counts.
        base = min(self._channels, key=lambda one: round(abs(math.log(one.interval / DT)), 3))
        begin = max(one.last[0][0] for one in self._channels) - 1e-9
        self.waiting.extend(t for t, _ in base.last if t >= begin)
        return base

    def _complete(self, t: float) -> Iterator[Sample]:
        """Yield the samples of instants that no frame after a time can change."""
        while self.waiting and t > self.waiting[0] + _NEAR:
            instant = self.waiting.popleft()
            yield self._reading.sample(instant, [one.at(instant) for one in self._channels])
