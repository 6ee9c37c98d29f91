"""Samples of the frames of a CAN bus: signals that come one after another, at common instants.

The instants are those of the channel whose rate is nearest to 100 Hz. There another channel has
what `models.logs.clock` gives it of samples that were there by then: a log of the same frames, read
by `read_recording`, has the same bits where frames come at 100 Hz or slower.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from models.logs.can import CALENDAR, EXTENDED, reader_of, wanted
from models.logs.clock import FASTER, GAP_INTERVALS, ON_STEP
from models.logs.log import RecordingError, some
from models.recordings.choice import has_v_y, missing_signals
from models.recordings.map import LogMap
from tireid.live.packets import READ, Reading, Sample
from tireid.live.state import Counts

_DT = 0.01  # s, of the clock of all methods
_NEAR = ON_STEP * _DT  # s, within which two instants are one
_OBSERVED = 0.5  # s, of which rates are learnt
_FEWEST = 3  # samples that tell a rate
_LONGEST = 5.0  # s, after which a signal that did not come is missing
_MOST = 8192  # samples of a channel that wait for others: 8 s at 1 kHz
_BACK = 1.0  # s, from which a clock that goes back begins anew


class _Channel:
    """The last samples of a signal of the bus, in SI.

    read : returns its value in a frame.   factor : to SI.
    """

    def __init__(self, name: str, read: Callable[[bytes], float | None], factor: float) -> None:
        self.name, self._read, self._factor = name, read, factor
        self.last = deque[tuple[float, float]](maxlen=_MOST)  # time [s] and value, rising
        self.interval = math.nan  # between samples [s], typical

    def take(self, t: float, data: bytes) -> bool:
        """Take a frame; return whether it holds the signal."""
        value = self._read(data)
        if value is None:
            return False
        if not self.last or t > self.last[-1][0]:
            self.last.append((t, value * self._factor))
        return True

    def at(self, t: float, longest: float) -> float:
        """Return the value at an instant, as `models.logs.clock.sampled` has it; NaN in a gap.

        t : instant [s]; samples that later ones have no need of are dropped.
        longest : age of a sample that is no gap yet [s].
        """
        while len(self.last) > 2 and self.last[2][0] <= t - _DT:
            self.last.popleft()
        there = [one for one in self.last if one[0] <= t + _NEAR]
        longest = max(longest, GAP_INTERVALS * self.interval)
        if not there or t - there[-1][0] > longest:
            return math.nan
        here, now = there[-1]
        if self.interval < _DT / FASTER:
            recent = [value for time, value in there if time > t - _DT + _NEAR] or [now]
            return sum(recent) / len(recent)
        before, old = there[-2] if len(there) > 1 else (here, now)
        step, ahead = here - before, t - here
        if ahead > _NEAR and 0.0 < step <= GAP_INTERVALS * self.interval:
            return now + min(ahead, step) / step * (now - old)
        return now


class Frames:
    """Joins the frames of a bus, as python-can gives them, to samples.

    label : of the source, for messages.   counts : in which frames that are too short are counted.
    """

    def __init__(self, label: str, log_map: LogMap, counts: Counts) -> None:
        self._label, self._counts, self._longest = label, counts, log_map.longest_gap
        signals = {name: one for name, one in log_map.signals.items() if name in READ}
        missing, self.v_y = missing_signals(signals), has_v_y(signals)
        lacking = " and ".join(f"signals.{name}" for name in missing)
        for wrong, rule in (
            (not log_map.dbc, 'a DBC file must be declared: [file] dbc = "car.dbc" in log.toml'),
            (missing, f'{lacking} must be declared in log.toml: channel = "FRAME.SIGNAL"'),
            (log_map.clock, "clock.channel of log.toml is not read live: frames have times"),
        ):
            if wrong:
                raise RecordingError(f"{label}: {rule}")
        names = [one for signal in signals.values() for one in signal.channel]
        self._dbc, found = wanted(Path(log_map.dbc), names)
        units = {
            name: (one.unit or "").strip() for name, (_, one) in zip(names, found, strict=True)
        }
        self._reading = Reading(log_map, signals, units)
        self._channels: list[_Channel] = []
        self._of: dict[str, list[_Channel]] = {}  # by message
        for (key, signal), (name, factor) in zip(found, self._reading.channels, strict=True):
            message = self._dbc.messages[key]
            self._channels.append(_Channel(name, reader_of(message, signal), factor))
            self._of.setdefault(message.name, []).append(self._channels[-1])
        self.filters = [
            {"can_id": key & ~EXTENDED, "can_mask": self._dbc.mask(key),
             "extended": key >= EXTENDED}
            for key in {key for key, _ in found}
        ]  # fmt: skip
        self._senders: dict[str, int] = {}  # of J1939 the first to send a message
        self._zero = self._first = self._newest = math.nan  # [s]
        self._base: _Channel | None = None
        self.waiting = deque[float]()  # instants of which frames may still come [s]

    def take(self, frame: Any) -> Iterator[Sample]:
        """Yield the samples that a frame completes; None, where none came: those that wait."""
        if frame is None:
            yield from self._complete(math.inf)
            return
        key = frame.arbitration_id | EXTENDED * frame.is_extended_id
        message = self._dbc.message(key)
        if frame.is_error_frame or frame.is_remote_frame or message is None:
            return
        channels = self._of.get(message.name)
        if channels is None or self._senders.setdefault(message.name, key) != key:
            return
        if len(frame.data) < message.length:
            self._counts.unreadable += 1
            return
        t = frame.timestamp
        if math.isnan(self._zero):
            self._zero = t
        if self._zero > CALENDAR:  # as `models.logs.stamps.since`
            t = round((t - self._zero) * 1e6) / 1e6
        if not t >= self._newest - _BACK:
            self._first, self._newest, self._base = t, t, None
            for one in self._channels:
                one.last.clear()
            self.waiting.clear()
        self._newest = max(self._newest, t)
        for one in channels:
            if one.take(t, frame.data[: message.length]) and one is self._base:
                self.waiting.append(t)
        if self._base is None and t - self._first > _OBSERVED:
            self._observe(t)
        yield from self._complete(t)

    def _observe(self, t: float) -> None:
        """Choose the channel of the instants, where all came."""
        if lost := [one.name for one in self._channels if len(one.last) < _FEWEST]:
            if t - self._first > _LONGEST:
                raise RecordingError(
                    f"{self._label}: within {_LONGEST:g} s there was no {some(lost)}, only frames "
                    f"{some(sorted(self._senders))}; is it another bus?"
                )
            return
        for one in self._channels:
            one.interval = median(b - a for (a, _), (b, _) in pairwise(one.last))
        # Rates that differ by jitter alone are equal: the first counts.
        by_rate = [round(abs(math.log(one.interval / _DT)), 3) for one in self._channels]
        self._base = self._channels[by_rate.index(min(by_rate))]
        begin = max(one.last[0][0] for one in self._channels) - 1e-9
        self.waiting.extend(t for t, _ in self._base.last if t >= begin)

    def _complete(self, t: float) -> Iterator[Sample]:
        """Yield the samples of instants that no frame after a time can change."""
        while self.waiting:
            instant = self.waiting[0]
            newest = min((one.last[-1][0] for one in self._channels if one.last), default=t)
            if t <= instant + _NEAR and newest < instant - _NEAR:
                return
            self.waiting.popleft()
            values = [one.at(instant, self._longest) for one in self._channels]
            yield self._reading.sample(instant, values)
