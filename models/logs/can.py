"""Logs of a CAN bus with the DBC that tells its signals: each is a channel "Frame.Signal".

Logs keep frames as ASC, BLF, candump, TRC, tables in text, MDF4 with a bus. They are gathered by
bus and identifier, times beside bytes; what is no data frame, or not in the database, is counted.
Those of J1939 are known by their parameter group: priority and addresses of the sender, and of the
receiver where the group has one, may differ from the database's. Where in the bytes a signal lies,
its factor, offset and unit are the DBC's. Raw values that the DBC names as not available or invalid
are NaN.
"""

import csv
import math
import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, blocks, filled
from codegen.escape import displayed
from models.limits import limits
from models.logs.foreign import need, one_line
from models.logs.grouped import GroupedLog, Samples
from models.logs.growing import Growing
from models.logs.log import Listed, RecordingError, chosen, few
from models.logs.magic import HEAD, frames_in
from models.logs.mdf import is_bus, opened
from models.logs.stamps import nanoseconds, since, typical_rate
from models.logs.units import TABLES
from models.schema import LONGEST_NAME, read_bytes

_FRAMES_AT_ONCE = 1 << 16  # frames that are gathered at a time
_SHORT = 0x7FF  # largest identifier of 11 bits
_IDENTIFIER = (1 << 29) - 1  # mask of the 29 bits of the longest identifier
_INFLATION = 1032  # most bytes that deflate makes of one
_CONTAINER = 10  # kind of an object of a BLF that holds others
_DEFLATED = b"\2\0"  # begins one that is packed by zlib
_METHOD = 16  # bytes of a container that say how it is packed, before its data
_FROM_ALL = 0xFE  # address that a database of J1939 gives where any may send
_FLOATS = (16, 32, 64)  # bits of a signal that is a float
_LONGEST_SIGNAL = 64  # bits
_LONGEST_FRAME = 1785  # bytes, of J1939 in several packets
CALENDAR = 1e8  # [s]: times above count from 1970

_FRAME = "CAN_DataFrame"  # of MDF
_NO_DATA = ("CAN_RemoteFrame", "CAN_ErrorFrame")
EXTENDED = 1 << 31  # marks an identifier of 29 bits
_OBJECT = struct.Struct("<4sHHII")  # of BLF: mark, size and version of the header, size, type
_FILE_SIZE = struct.Struct("<Q")  # of BLF, at byte 16 of its header

_Key = tuple[str, int]  # bus, identifier with EXTENDED


def _group_of(identifier: int) -> int:
    group = (identifier >> 8) & 0x3FFFF
    return group if (group >> 8) & 0xFF >= 240 else group & 0x3FF00  # else it has a receiver


class Dbc(NamedTuple):
    """What a DBC tells.
    messages: by identifier, with `EXTENDED`; groups: of J1939 -> identifier in the DBC; faults: by
    names of frame and signal what is wrong with it, a line each.
    """

    messages: dict[int, Any]
    groups: dict[int, int]
    faults: dict[tuple[str, str], str]

    def message(self, identifier: int) -> Any:
        """Return the message of a frame; None where the DBC does not know it."""
        if identifier not in self.messages and identifier & EXTENDED:
            identifier = self.groups.get(_group_of(identifier), identifier)
        return self.messages.get(identifier)

    def mask(self, identifier: int) -> int:
        """Return the bits of an identifier that the frames of its message share."""
        if identifier not in self.groups.values():
            return _IDENTIFIER if identifier & EXTENDED else _SHORT
        return 0x3FFFF00 if (identifier >> 16) & 0xFF >= 240 else 0x3FF0000


class _Frames(NamedTuple):
    """Frames of one identifier on one bus.
    t: (n,) [s]; data: (n, bytes).
    """

    t: Array
    data: NDArray[np.uint8]


class _Part(NamedTuple):
    """Some frames of one identifier on one bus: t (n,) [s], sizes (n,) and data (n, bytes)."""

    bus: str
    identifier: int
    t: Array
    sizes: NDArray[np.int64]
    data: NDArray[np.uint8]


_Log = tuple[dict[_Key, _Frames], Counter[str]]  # and how many others it has, by what they are


def _gather(path: Path, kind: str, given: Dbc) -> _Log:
    found: dict[_Key, tuple[Growing, Growing]] = {}
    others: Counter[str] = Counter({"unknown": 0, "cut short": 0})
    count = 0
    for bus, identifier, t, sizes, data in (
        _of_mdf(path, others) if kind == "MDF4" else _of_messages(path, kind, others)
    ):
        if (message := given.message(identifier)) is None:
            others["unknown"] += t.size
            continue
        whole = sizes >= message.length
        others["cut short"] += int(np.sum(~whole))
        if whole.any():
            times, rows = found.setdefault((bus, identifier), (Growing(), Growing(np.uint8)))
            times.extend(t[whole])
            rows.extend(data[whole, : message.length].reshape(-1))
            count += int(np.sum(whole))
            few(path, count, "samples", "frames")
    frames = {}
    for key, (times, rows) in found.items():
        t, data = times.finished(), rows.finished().reshape(len(times), -1)
        if kind == "MDF4" and np.any(t[1:] < t[:-1]):  # groups of a file follow one another
            order = np.argsort(t, kind="stable")
            t, data = t[order], data[order]
        frames[key] = _Frames(t, data)
    first = min((float(kept.t.min()) for kept in frames.values()), default=0.0)
    if first > CALENDAR:
        frames = {key: kept._replace(t=since(kept.t, first)) for key, kept in frames.items()}
    return frames, others


def _of_messages(path: Path, kind: str, others: Counter[str]) -> Iterator[_Part]:
    messages = _messages(path, kind)
    while some := list(islice(messages, _FRAMES_AT_ONCE)):
        found: dict[_Key, list[Any]] = {}
        for one in some:
            if one.is_error_frame or one.is_remote_frame:
                others["error and remote"] += 1
            else:
                identifier = one.arbitration_id | EXTENDED * one.is_extended_id
                found.setdefault((str(one.channel), identifier), []).append(one)
        for key, frames in found.items():
            t, sizes = np.array([(one.timestamp, len(one.data)) for one in frames]).T
            # Shorter ones are filled up by zeros.
            data = np.array([bytes(one.data[:_LONGEST_FRAME]) for one in frames])
            yield _Part(*key, t, sizes, data.view(np.uint8).reshape(t.size, -1))


def _messages(path: Path, kind: str) -> Iterator[Any]:
    if kind in ("CSV", "candump text"):
        yield from _of_table(path) if kind == "CSV" else _of_lines(path)
        return
    io = need(path, "can.io", "CAN logs", "can")
    if kind == "BLF":
        _require_whole_blf(path)
        with io.BLFReader(path) as reader:
            yield from reader
        return
    reader_of = {"ASC": io.ASCReader, "candump": io.CanutilsLogReader, "TRC": io.TRCReader}[kind]
    with path.open("r", encoding="latin-1") as text, reader_of(text) as reader:
        messages = iter(reader)
        for message in messages:
            if getattr(reader, "timestamps_format", None) == "relative":
                raise RecordingError(
                    f"{path}: its times count from the frame before each; save it with "
                    "timestamps absolute"
                )
            yield message


class _Frame(NamedTuple):
    timestamp: float
    arbitration_id: int
    data: bytes
    channel: str
    is_extended_id: bool
    is_error_frame: bool = False
    is_remote_frame: bool = False


_LINE = re.compile(  # of candump without -L: (1600000000.123456)  can0  18F0093E   [8]  01 02 ...
    r"\s*\((?P<time>[\d.]+|[\d-]+ [\d:.]+)\)\s+(?P<bus>\w+)\s+(?:[RT]X\s[- \w]*\s)?"
    r"(?P<id>[0-9A-Fa-f]{3,8})\s+\[\d+\]\s+(?P<data>remote request|(?:[0-9A-Fa-f]{2}\s*)*)"
)


def _of_lines(path: Path) -> Iterator[_Frame]:
    before = -math.inf
    with path.open("r", encoding="latin-1") as text:
        for number, line in enumerate(text, start=1):
            found = _LINE.match(line)
            if found is None:
                if line.strip():
                    raise RecordingError(
                        f"{path}: line {number} has no time in front of its frame; record with "
                        "candump -L"
                    )
                continue
            ns = None if "." in found["time"][:12] else nanoseconds(found["time"])
            time = float(found["time"]) if ns is None else ns / 1e9
            if time < before - 1.0:
                raise RecordingError(
                    f"{path}: line {number} is {before - time:.3g} s before the one above: times "
                    "must count from one instant; record with candump -L"
                )
            before = time
            word = found["id"]
            remote = found["data"].startswith("remote")
            data = b"" if remote else bytes.fromhex(found["data"])
            yield _Frame(time, int(word, 16), data, found["bus"], len(word) > 3, False, remote)


def _of_table(path: Path) -> Iterator[_Frame]:
    """Yield the frames of a table in text; identifiers and bytes are hexadecimal."""
    with path.open("r", encoding="utf-8-sig", errors="replace", newline="") as text:
        rows = csv.reader(text, delimiter=";" if ";" in text.readline() else ",")
        text.seek(0)
        header = [re.sub("[^a-z0-9]", "", one.lower()) for one in next(rows, [])]
        at = {
            what: next((header.index(one) for one in names.split() if one in header), -1)
            for what, names in TABLES["frames"].items()
        }
        if lacking := ", ".join(what for what in ("time", "id", "data") if at[what] < 0):
            raise RecordingError(f"{path}: a table of frames must have a column for {lacking}")
        many = header[at["data"]] in ("d0", "d1")  # a byte a column
        decimal = header[at["id"]] in ("addr", "address")
        for number, row in enumerate(rows, start=2):
            if not row:
                continue
            try:
                word, cell = row[at["id"]].strip(), row[at["time"]].strip()
                identifier = int(word, 10 if decimal and word.isdigit() else 16)
                rest = row[at["data"] :] if many else row[at["data"]].split()
                data = bytes.fromhex("".join(one.strip().removeprefix("0x") for one in rest))
                # SavvyCAN counts whole microseconds, all others seconds.
                time = float(cell) * (1e-6 if many and "." not in cell else 1.0)
                given = row[at["long"]].strip().lower() if at["long"] >= 0 else ""
                extended = given in ("true", "1") if given else identifier > _SHORT
                bus = row[at["bus"]].strip() if at["bus"] >= 0 else "0"
            except (ValueError, IndexError):
                raise RecordingError(
                    f"{path}: line {number} must hold a frame: time, identifier and bytes in "
                    f"hexadecimal, not {displayed(','.join(row))}"
                ) from None
            yield _Frame(time, identifier & _IDENTIFIER, data, bus, extended)


def _require_whole_blf(path: Path) -> None:
    """Refuse a file that is shorter than it says, or inflates to more than is allowed."""
    most = 1e6 * limits().block
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(144)
        given = _FILE_SIZE.unpack_from(head, 16)[0]
        if given > size:
            raise RecordingError(f"{path}: is cut off, it has {size} of {given} bytes")
        file.seek(struct.unpack_from("<I", head, 4)[0])
        while len(mark := file.read(_OBJECT.size)) == _OBJECT.size:
            signature, _, _, length, kind = _OBJECT.unpack(mark)
            if signature != b"LOBJ" or length < _OBJECT.size or length > size:
                return  # the reader says so
            body = length - _OBJECT.size
            if kind == _CONTAINER and body * _INFLATION > most:
                data = file.read(body)
                unpacked = data[_METHOD:]
                if data.startswith(_DEFLATED):
                    unpacked = zlib.decompressobj().decompress(unpacked, int(most) + 1)
                few(path, len(unpacked) / 1e6, "block", "megabytes of a block")
                body = 0
            file.seek(body + length % 4, 1)


def _of_mdf(path: Path, others: Counter[str]) -> Iterator[_Part]:
    """Yield the frames of the buses that an MDF4 file logs."""
    with opened(path, "CAN frames of MDF") as file:
        if str(file.version) < "4":
            raise RecordingError(f"{path}: an MDF3 file holds no frames; leave the DBC out")
        for number, group in enumerate(file.groups):
            samples = int(group.channel_group.cycles_nr)
            few(path, samples, "samples", "frames")
            if not is_bus(group):
                continue
            names = {channel.name for channel in group.channels}
            if not {f"{_FRAME}.ID", f"{_FRAME}.DataBytes"} <= names:  # no data frames of a CAN bus
                known_others = {name.partition(".")[0] for name in names} & set(_NO_DATA)
                others["error and remote" if known_others else "other"] += samples
                continue
            for first in range(0, samples, _FRAMES_AT_ONCE):
                count = min(_FRAMES_AT_ONCE, samples - first)
                yield from _of_group(file, names, number, first, count)


def _of_group(file: Any, names: set[str], number: int, first: int, count: int) -> Iterator[_Part]:
    """Yield some frames of a group by their bus and identifier."""

    def signal(name: str) -> Any:
        return file.get(
            f"{_FRAME}.{name}", group=number, raw=True, ignore_invalidation_bits=True,
            record_offset=first, record_count=count,
        )  # fmt: skip

    def whole(name: str, otherwise: Any) -> NDArray[np.int64]:
        there = f"{_FRAME}.{name}" in names
        return np.broadcast_to(signal(name).samples.astype(int) if there else otherwise, count)

    identifiers = signal("ID")
    data = np.asarray(signal("DataBytes").samples, dtype=np.uint8).reshape(count, -1)
    raw = identifiers.samples.astype(np.int64)
    ids = raw & _IDENTIFIER
    is_long = whole("IDE", (raw & EXTENDED != 0) | (ids > _SHORT)) != 0
    ids, buses = np.where(is_long, ids | EXTENDED, ids), whole("BusChannel", 0)
    sizes = np.minimum(whole("DataLength", data.shape[1]), data.shape[1])
    t = np.asarray(identifiers.timestamps, dtype=np.float64)
    for identifier, bus in np.unique([ids, buses], axis=1).T.tolist():
        which = (ids == identifier) & (buses == bus)
        yield _Part(str(bus), identifier, t[which], sizes[which], data[which])


# Signals of frames, by a DBC.

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


# Where a channel is: with which others it is sent, the signal of the DBC, and why it cannot be read
# as the DBC tells it, "" where it can.
_Place = tuple[_Group, Any, str]


def _samples(requested: Sequence[tuple[Listed, _Place]]) -> list[Samples]:
    groups: dict[_Group, dict[str, Any]] = {}
    for listed, (group, signal, fault) in requested:
        if fault:
            raise RecordingError(fault)
        groups.setdefault(group, {})[listed.name] = signal
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
    given = read_dbc(dbc)
    with one_line(path, "a CAN log"):
        with path.open("rb") as file:
            kind = frames_in(file.read(HEAD))
        if not kind:
            raise RecordingError(
                f"{path}: is no CAN log: neither ASC, BLF, candump, TRC, a table of frames nor MDF4"
            )
        gathered, others = _gather(path, kind, given)
        senders = Counter((bus, given.message(one).name) for bus, one in gathered)
        found = []
        for (bus, identifier), frames in gathered.items():
            message = given.message(identifier)
            several = senders[bus, message.name] > 1  # of J1939: which
            group = f"bus {bus}" + f" from {identifier & 0xFF:02X}" * several
            found += [(group, *one) for one in _channels(given, message, frames)]
    said = tuple(f"{count} {what} frames are not read" for what, count in others.items() if count)
    return GroupedLog(
        path,
        f"CAN {kind}",
        "a CAN log",
        "message",
        found,
        said,
        _samples,
        f"frame that {dbc} knows",
    )


def _channels(given: Dbc, message: Any, frames: _Frames) -> Iterator[tuple[Listed, _Place]]:
    """Yield the signals that are sent in the frames of a message."""
    groups: dict[tuple[tuple[str, tuple[int, ...]], ...], _Group] = {}
    for signal in message.signals:
        selectors = _selectors(message, signal)
        key = tuple((one.name, ids) for one, ids in selectors)
        for one, _ in selectors:
            if fault := given.faults.get((message.name, one.name)):
                raise RecordingError(fault)
        if key not in groups:
            sent = _sent(frames, selectors)
            t = frames.t if sent is None else frames.t[sent]
            groups[key] = _Group(name=message.name, t=t, data=frames.data, sent=sent)
        group = groups[key]
        if group.t.size:
            listed = Listed(
                f"{message.name}.{signal.name}",
                (signal.unit or "").strip()[:LONGEST_NAME],
                group.t.size,
                typical_rate(group.t),
            )
            yield listed, (group, signal, given.faults.get((message.name, signal.name), ""))


def read_dbc(path: Path) -> Dbc:
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
        _group_of(key): key
        for key, one in messages.items()
        if key & EXTENDED and (j1939 or one.protocol == "j1939" or key & 0xFF == _FROM_ALL)
    }
    return Dbc(messages, groups, faults)


def _fault(message: Any, signal: Any) -> str:
    """Return the rule that a signal breaks, with the value; "" where it breaks none."""
    sizes = _FLOATS if signal.is_float else range(1, _LONGEST_SIGNAL + 1)
    if signal.length not in sizes:
        allowed = "16, 32 or 64" if signal.is_float else f"1 to {_LONGEST_SIGNAL}"
        return f"must have {allowed} bits, it has {signal.length}"
    inside = _place(signal)[0].stop <= message.length
    return "" if inside else f"lies beyond its frame of {message.length} bytes"


def _place(signal: Any) -> tuple[slice, int]:
    """Return the bytes of a frame that a signal lies in, and how many bits of them are before it.

    Motorola numbers the bits of a byte downwards, and a signal by its highest bit.
    """
    from cantools.database.utils import start_bit

    first = start_bit(signal)
    return slice(first // 8, (first + signal.length - 1) // 8 + 1), first % 8


def _selectors(message: Any, signal: Any) -> _Selectors:
    """Return the signals that say whether a signal is sent, with the values that do."""
    named = {one.name: one for one in message.signals}
    result: list[tuple[Any, tuple[int, ...]]] = []
    while signal.multiplexer_signal in named and len(result) < len(named):
        selector = named[signal.multiplexer_signal]
        result.append((selector, tuple(signal.multiplexer_ids or ())))
        signal = selector
    return tuple(result)


def _sent(frames: _Frames, selectors: _Selectors) -> NDArray[np.intp] | None:
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
    values[np.isin(raw, _no_numbers(signal))] = np.nan
    return values


def _no_numbers(signal: Any) -> list[int]:
    named = (signal.choices or {}).items()
    return [value for value, name in named if _NO_NUMBER.search(str(name).replace("_", " "))]


def _raw_values(data: NDArray[np.uint8], signal: Any) -> NDArray[Any]:
    """Return the integers, or floats, of a signal as they are in frames, (n,).
    data : of the frames, (n, bytes).
    """
    length, little = signal.length, signal.byte_order == "little_endian"
    where, before = _place(signal)
    order: Literal["little", "big"] = "little" if little else "big"
    bits = np.unpackbits(data[:, where], axis=1, bitorder=order)[:, before : before + length]
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


# The same of one frame at a time, as it comes from a bus.


def wanted(path: Path, names: Sequence[str]) -> tuple[Dbc, list[tuple[int, Any]]]:
    """Return a DBC, and of each signal "Frame.Signal" the identifier and the signal in it."""
    given = read_dbc(path)
    listed = {
        f"{message.name}.{one.name}": (identifier, one)
        for identifier, message in given.messages.items()
        for one in message.signals
    }
    found = chosen(path, names, listed)
    for identifier, signal in found:
        message = given.messages[identifier]
        for one in (signal, *(one for one, _ in _selectors(message, signal))):
            if fault := given.faults.get((message.name, one.name)):
                raise RecordingError(fault)
    return given, found


def reader_of(message: Any, signal: Any) -> Callable[[bytes], float | None]:
    """Return what reads a signal in its unit from a frame as `_values_of` does, bit for bit.

    It gives NaN where the DBC says that a value is no number, None where the frame does not hold
    the signal.
    """
    raw, none = _raw_reader(signal), frozenset(_no_numbers(signal))
    selectors = [(_raw_reader(one), ids) for one, ids in _selectors(message, signal)]
    scale, offset = float(signal.scale), float(signal.offset)

    def read(data: bytes) -> float | None:
        for selector, ids in selectors:
            if selector(data) not in ids:
                return None
        value = raw(data)
        return math.nan if value in none else float(value) * scale + offset

    return read


def _raw_reader(signal: Any) -> Callable[[bytes], int | float]:
    length, (where, before) = signal.length, _place(signal)
    order: Literal["little", "big"] = "little" if signal.byte_order == "little_endian" else "big"
    shift = before if order == "little" else 8 * (where.stop - where.start) - before - length
    mask, half = (1 << length) - 1, 1 << (length - 1 if signal.is_signed else length)
    kind = struct.Struct({16: "<e", 32: "<f", 64: "<d"}[length]) if signal.is_float else None

    def read(data: bytes) -> int | float:
        bits = int.from_bytes(data[where], order) >> shift & mask
        if kind is not None:
            number: float = kind.unpack(bits.to_bytes(length // 8, "little"))[0]
            return number
        return bits - 2 * half if bits >= half else bits

    return read
