"""Logs of a CAN bus with the DBC that tells its signals: each is a channel "Frame.Signal".

A log holds bytes; where in them a signal lies, its factor, offset and unit are the DBC's. Raw
values that the DBC names as not available or invalid are NaN.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, blocks, filled
from models.logs.foreign import need, one_line
from models.logs.frames import EXTENDED, FROM_ALL, Frames, Known, gather, group_of
from models.logs.grouped import GroupedLog, Samples
from models.logs.log import Listed, RecordingError
from models.logs.magic import HEAD, frames_in
from models.logs.stamps import typical_rate
from models.schema import LONGEST_NAME, read_bytes

_FLOATS = (16, 32, 64)  # bits of a signal that is a float
_LONGEST_SIGNAL = 64  # bits
# Names that a DBC gives to values that are no numbers.
_NO_NUMBER = re.compile(
    r"\b(?:sna|snv|invalid|ung(?:ue|ü)ltig|not[ _]?(?:avail\w*|valid)|unavailable|undefined|error"
    r"|fault|failure|fehler|init\w*|n/?a)\b",
    re.I,
)


_Selectors = tuple[tuple[Any, tuple[int, ...]], ...]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Group:
    """Signals that are sent together: they share a clock.
    t : when they were sent [s], (n,).
    data : of the frames of one identifier on one bus, (m, bytes).
    sent : which of the frames hold the signals, (n,); None where all do.
    """

    name: str
    t: Array
    data: NDArray[np.uint8]
    sent: NDArray[np.intp] | None

    def values(self, signal: Any) -> Array:
        """Return a signal in its unit, (n,)."""
        data, sent = self.data, self.sent
        return filled(
            self.t.size, lambda part: _values_of(data[part if sent is None else sent[part]], signal)
        )


class _Place(NamedTuple):
    """Where a channel is: with which others it is sent, and the signal of the DBC.
    fault: why it cannot be read as the DBC tells it, "" where it can.
    """

    group: _Group
    signal: Any
    fault: str


class _Dbc(NamedTuple):
    """What a DBC tells: messages by identifier, with `EXTENDED`; what is wrong, by their signals.
    faults: by names of frame and signal, a line each.
    """

    messages: dict[int, Any]
    known: Known
    faults: dict[tuple[str, str], str]


def _samples(asked: Sequence[tuple[Listed, _Place]]) -> list[Samples]:
    groups: dict[_Group, dict[str, Any]] = {}
    for listed, place in asked:
        if place.fault:
            raise RecordingError(place.fault)
        groups.setdefault(place.group, {})[listed.name] = place.signal
    return [
        Samples(group.name, group.t, {name: group.values(one) for name, one in signals.items()})
        for group, signals in groups.items()
    ]


def open_(path: Path, dbc: Path | None = None) -> GroupedLog[_Place]:
    """Read the frames of a log that a DBC knows and list their signals."""
    if dbc is None:
        raise RecordingError(
            f"{path}: has frames of a bus; give the DBC file of their signals, "
            'in the [file] of log.toml: dbc = "car.dbc"'
        )
    given = _read_dbc(dbc)
    with one_line(path, "a CAN log"):
        with path.open("rb") as file:
            kind = frames_in(file.read(HEAD))
        if not kind:
            raise RecordingError(
                f"{path}: is no CAN log: neither ASC, BLF, candump, TRC, a table of frames nor MDF4"
            )
        log = gather(path, kind, given.known)
        senders = Counter((bus, given.known.named(one)) for bus, one in log.frames)
        found = [
            (_group(bus, identifier, senders[bus, given.known.named(identifier)]), listed, place)
            for (bus, identifier), frames in log.frames.items()
            for listed, place in _channels(given, identifier, frames)
        ]
    said = tuple(
        f"{count} {what} frames are not read" for what, count in log.others.items() if count
    )
    return GroupedLog.of(
        path,
        log.format,
        "a CAN log",
        "message",
        found,
        said,
        _samples,
        missing=f"frame that {dbc} knows",
    )


def _group(bus: str, identifier: int, senders: int) -> str:
    """Return what frames are said to be of: their bus and, of several senders of J1939, which."""
    return f"bus {bus}" + f" from {identifier & 0xFF:02X}" * (senders > 1)


def _channels(given: _Dbc, identifier: int, frames: Frames) -> Iterator[tuple[Listed, _Place]]:
    """Yield the signals that are sent in the frames of a message."""
    named = given.known.named(identifier)
    assert named is not None
    message = given.messages[named]
    groups: dict[tuple[tuple[str, tuple[int, ...]], ...], _Group] = {}
    for signal in message.signals:
        selectors = _selectors(message, signal)
        key = tuple((one.name, ids) for one, ids in selectors)
        faults = [given.faults.get((message.name, one.name), "") for one, _ in selectors]
        if any(faults):
            raise RecordingError(next(filter(None, faults)))
        if key not in groups:
            sent = _sent(frames, selectors)
            t = frames.t if sent is None else frames.t[sent]
            groups[key] = _Group(name=message.name, t=t, data=frames.data, sent=sent)
        group = groups[key]
        if group.t.size:
            listed = Listed(
                name=f"{message.name}.{signal.name}",
                unit=(signal.unit or "").strip()[:LONGEST_NAME],
                samples=group.t.size,
                rate=typical_rate(group.t),
            )
            yield listed, _Place(group, signal, given.faults.get((message.name, signal.name), ""))


def _read_dbc(path: Path) -> _Dbc:
    """Return the messages of a DBC and what is wrong with their signals."""
    with one_line(path, "a DBC file"):
        raw = read_bytes(path, RecordingError)
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("cp1252", errors="replace")
        database = need(path, "cantools.database", "DBC", "can")
        found = database.load_string(text, database_format="dbc", strict=False)
        messages = {
            message.frame_id | (EXTENDED if message.is_extended_frame else 0): message
            for message in found.messages
            if message.length and message.signals
        }
    if not messages:
        raise RecordingError(f"{path}: is not a DBC file with messages and signals")
    faults = {
        (message.name, signal.name): f"{path}: frame {message.name}: signal {signal.name} {fault}"
        for message in messages.values()
        for signal in message.signals
        if (fault := _fault(message, signal))
    }
    attributes = found.dbc.attributes if found.dbc else {}
    j1939 = "ProtocolType" in attributes and attributes["ProtocolType"].value == "J1939"
    groups = {
        group_of(key): key
        for key, one in messages.items()
        if key & EXTENDED and (j1939 or one.protocol == "j1939" or key & 0xFF == FROM_ALL)
    }
    widths = {key: one.length for key, one in messages.items()}
    return _Dbc(messages, Known(widths, groups), faults)


def _fault(message: Any, signal: Any) -> str:
    """Return the rule that a signal breaks, with the value; "" where it breaks none."""
    sizes = _FLOATS if signal.is_float else range(1, _LONGEST_SIGNAL + 1)
    if signal.length not in sizes:
        allowed = "16, 32 or 64" if signal.is_float else f"1 to {_LONGEST_SIGNAL}"
        return f"must have {allowed} bits, it has {signal.length}"
    _, end = _bytes_of(signal)
    return "" if end <= message.length else f"lies beyond its frame of {message.length} bytes"


def _bytes_of(signal: Any) -> tuple[int, int]:
    """Return the first byte of a frame that a signal lies in, and the one behind its last."""
    first = _first_bit(signal)
    return first // 8, (first + signal.length - 1) // 8 + 1


def _first_bit(signal: Any) -> int:
    """Return the bit that a signal begins at, counted in the order of its bytes."""
    # Motorola numbers the bits of a byte downwards, and a signal by its highest bit.
    start = int(signal.start)
    return start if signal.byte_order == "little_endian" else 8 * (start // 8) + 7 - start % 8


def _selectors(message: Any, signal: Any) -> _Selectors:
    """Return the signals that say whether a signal is sent, with the values that do."""
    named = {one.name: one for one in message.signals}
    result: list[tuple[Any, tuple[int, ...]]] = []
    while signal.multiplexer_signal in named and len(result) < len(named):
        selector = named[signal.multiplexer_signal]
        result.append((selector, tuple(signal.multiplexer_ids or ())))
        signal = selector
    return tuple(result)


def _sent(frames: Frames, selectors: _Selectors) -> NDArray[np.intp] | None:
    """Return which frames hold a signal, None where all do: of multiplexed ones not all do."""
    if not selectors:
        return None
    sent = np.ones(frames.t.size, dtype=bool)
    for selector, ids in selectors:
        for part in blocks(sent.size):
            sent[part] &= np.isin(_raw_values(frames.data[part], selector), ids)
    return np.flatnonzero(sent)


def _values_of(data: NDArray[np.uint8], signal: Any) -> Array:
    """Return a signal in its unit, (n,), NaN where the DBC says that a value is no number.
    data : of the frames, (n, bytes).
    """
    raw = _raw_values(data, signal)
    values = raw.astype(np.float64) * float(signal.scale) + float(signal.offset)
    named = {value: str(name).replace("_", " ") for value, name in (signal.choices or {}).items()}
    values[np.isin(raw, [value for value, name in named.items() if _NO_NUMBER.search(name)])] = (
        np.nan
    )
    return values


def _raw_values(data: NDArray[np.uint8], signal: Any) -> NDArray[Any]:
    """Return the integers, or floats, of a signal as they are in frames, (n,).
    data : of the frames, (n, bytes).
    """
    length, little = signal.length, signal.byte_order == "little_endian"
    first, (begin, end) = _first_bit(signal), _bytes_of(signal)
    order: Literal["little", "big"] = "little" if little else "big"
    bits = np.unpackbits(data[:, begin:end], axis=1, bitorder=order)
    bits = bits[:, first - 8 * begin : first - 8 * begin + length]
    empty = np.zeros((len(bits), 64 - length), np.uint8)
    joined = np.concatenate([bits, empty] if little else [empty, bits], axis=1)
    packed = np.packbits(joined, axis=1, bitorder=order).reshape(-1)
    raw: NDArray[np.uint64] = packed.view("<u8" if little else ">u8").astype(np.uint64)
    if signal.is_float:
        return np.asarray(raw.astype(f"u{length // 8}").view(f"f{length // 8}"))
    if not signal.is_signed:
        return raw
    shift = 64 - length
    return np.asarray((raw << np.uint64(shift)).view(np.int64) >> np.int64(shift))
