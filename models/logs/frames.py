"""Frames of a CAN bus as logs keep them: ASC, BLF, candump, TRC and MDF4 with a bus in it.

Frames are gathered by bus and identifier, times beside bytes; what is no data frame, or not in the
database, is counted.
"""

import re
import struct
import zlib
from array import array
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.limits import limits
from models.logs.foreign import need, require_room
from models.logs.log import RecordingError
from models.schema import require_few

BLF = b"LOGG"
MDF = (b"MDF     ", b"UnFinMF ")
ASC = re.compile(
    rb"\s*(?://[^\n]*\n\s*)*date\s[^\n]*\n\s*(?://[^\n]*\n\s*)*base\s+(?:hex|dec)\b", re.I
)
CANDUMP = re.compile(rb"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]+#")
TRC = re.compile(rb"\s*;\$FILEVERSION=")
EXTENDED = 1 << 31  # marks an identifier of 29 bits
IDENTIFIER = (1 << 29) - 1
EPOCH = 1e8  # s: stamps above are of the calendar, which doubles hold to less than a microsecond
MICROSECONDS = 1e6
BUS_EVENT = 1 << 1  # flag of a group of an MDF file
INFLATION = 1032  # most bytes that deflate makes of one
OBJECT = struct.Struct("<4sHHII")  # of BLF: mark, size and version of the header, size, type
CONTAINER, DEFLATED = 10, 2
FILE_SIZE = struct.Struct("<Q")  # of BLF, at byte 16 of its header

Key = tuple[str, int]  # bus, identifier with EXTENDED


class Frames(NamedTuple):
    """Frames of one identifier on one bus.

    t: (n,) [s]; data: (n, bytes), of which `sizes` (n,) were sent.
    """

    t: Array
    data: NDArray[np.uint8]
    sizes: NDArray[np.int64]


class _Gathered:
    """Frames as they come."""

    def __init__(self) -> None:
        self.t = array("d")
        self.data: list[bytes] = []


class Log(NamedTuple):
    """Frames of a log by bus and identifier; how many others it has, by what they are."""

    format: str
    frames: dict[Key, Frames]
    others: dict[str, int]


def kind_of(head: bytes) -> str:
    """Return which log of frames a file is, "" for none.

    Parameters
    ----------
    head : its first bytes.
    """
    if head.startswith(BLF):
        return "BLF"
    if head[:8] in MDF:
        return "MDF4"
    texts = {"ASC": ASC, "candump": CANDUMP, "TRC": TRC}
    return next((name for name, pattern in texts.items() if pattern.match(head)), "")


def gather(path: Path, kind: str, known: Container[int]) -> Log:
    """Read the frames of a log.

    Parameters
    ----------
    path : of the file.
    kind : as `kind_of` names it.
    known : identifiers that are kept, with `EXTENDED`.

    Raises
    ------
    RecordingError
        Where there are more than is allowed, or the file is cut off.
    """
    if kind == "MDF4":
        return _of_mdf(path, known)
    found: dict[Key, _Gathered] = {}
    others: dict[str, int] = {}
    count = 0
    for message in _messages(path, kind):
        identifier = message.arbitration_id | (EXTENDED if message.is_extended_id else 0)
        if message.is_error_frame or message.is_remote_frame:
            others["error and remote"] = others.get("error and remote", 0) + 1
        elif identifier not in known:
            others["unknown"] = others.get("unknown", 0) + 1
        else:
            one = found.setdefault((str(message.channel), identifier), _Gathered())
            one.t.append(message.timestamp)
            one.data.append(bytes(message.data))
            count += 1
            if count % 65536 == 0:
                require_few(RecordingError, str(path), 16 * count / 1e6, "megabytes", "megabytes")
    frames = {key: _frames(path, one) for key, one in found.items()}
    first = min((float(kept.t.min()) for kept in frames.values()), default=0.0)
    if first > EPOCH:
        for key, kept in frames.items():
            t = np.round((kept.t - first) * MICROSECONDS) / MICROSECONDS
            frames[key] = kept._replace(t=t)
    return Log(f"CAN {kind}", frames, others)


def _frames(path: Path, one: _Gathered) -> Frames:
    sizes = np.array([len(data) for data in one.data], dtype=np.int64)
    width = int(sizes.max(initial=0))
    require_room(path, sizes.size, width + 8)
    data = b"".join(raw.ljust(width, b"\0") for raw in one.data)
    bytes_ = np.frombuffer(data, np.uint8).reshape(sizes.size, width)
    return Frames(np.array(one.t, dtype=np.float64), bytes_, sizes)


def _messages(path: Path, kind: str) -> Iterator[Any]:
    """Yield the messages of a log."""
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


def _require_whole_blf(path: Path) -> None:
    """Refuse a file that is shorter than it says, or inflates to more than is allowed."""
    most = 1e6 * limits().megabytes
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(144)
        told = FILE_SIZE.unpack_from(head, 16)[0]
        if told > size:
            raise RecordingError(f"{path}: is cut off, it has {size} of {told} bytes")
        file.seek(struct.unpack_from("<I", head, 4)[0])
        while len(mark := file.read(OBJECT.size)) == OBJECT.size:
            signature, _, _, length, kind = OBJECT.unpack(mark)
            if signature != b"LOBJ" or length < OBJECT.size or length > size:
                return  # the reader says so
            body = length - OBJECT.size
            if kind == CONTAINER and body * INFLATION > most:
                data = file.read(body)[16:]
                inflated = len(zlib.decompressobj().decompress(data, int(most) + 1))
                require_few(RecordingError, str(path), inflated / 1e6, "megabytes", "megabytes")
                body = 0
            file.seek(body + length % 4, 1)


def _of_mdf(path: Path, known: Container[int]) -> Log:
    """Read the frames of the buses that an MDF4 file logs."""
    asammdf = need(path, "asammdf", "CAN frames of MDF", "mdf")
    found: dict[Key, list[Frames]] = {}
    others: dict[str, int] = {}
    with asammdf.MDF(path, process_bus_logging=False) as file:
        if str(file.version) < "4":
            raise RecordingError(f"{path}: an MDF3 file holds no frames; leave the DBC out")
        for number, group in enumerate(file.groups):
            names = {channel.name for channel in group.channels}
            if not int(group.channel_group.flags) & BUS_EVENT or "CAN_DataFrame.ID" not in names:
                continue

            def values(name: str, number: int = number, names: set[Any] = names) -> Any:
                full = f"CAN_DataFrame.{name}"
                if full not in names:
                    return None
                return file.get(full, group=number, ignore_invalidation_bits=True, raw=True)

            identifiers = values("ID")
            data = values("DataBytes")
            count = len(identifiers.samples) if identifiers is not None else 0
            if not count or data is None:
                continue
            require_room(path, count, 24 + int(np.prod(data.samples.shape[1:])))
            bytes_ = np.asarray(data.samples, dtype=np.uint8).reshape(count, -1)
            extended, lengths, bus = values("IDE"), values("DataLength"), values("BusChannel")
            raw = np.asarray(identifiers.samples).astype(np.int64)
            ids = raw & IDENTIFIER
            is_long = raw & EXTENDED if extended is None else np.asarray(extended.samples)
            ids = np.where(is_long.astype(bool) | (ids > 0x7FF), ids | EXTENDED, ids)
            sizes = (
                np.full(count, bytes_.shape[1])
                if lengths is None
                else np.minimum(np.asarray(lengths.samples).astype(np.int64), bytes_.shape[1])
            )
            buses = np.zeros(count, int) if bus is None else np.asarray(bus.samples).astype(int)
            t = np.asarray(identifiers.timestamps, dtype=np.float64)
            for one in np.unique(ids).tolist():
                if one not in known:
                    others["unknown"] = others.get("unknown", 0) + int(np.sum(ids == one))
                    continue
                for channel in np.unique(buses[ids == one]).tolist():
                    which = (ids == one) & (buses == channel)
                    part = Frames(t[which], bytes_[which], sizes[which])
                    found.setdefault((str(channel), one), []).append(part)
    return Log("CAN MDF4", {key: _joined(parts) for key, parts in found.items()}, others)


def _joined(parts: list[Frames]) -> Frames:
    """Return frames of several groups in the order of their times."""
    width = max(part.data.shape[1] for part in parts)
    t = np.concatenate([part.t for part in parts])
    data = np.concatenate(
        [np.pad(part.data, ((0, 0), (0, width - part.data.shape[1]))) for part in parts]
    )
    sizes = np.concatenate([part.sizes for part in parts])
    if len(parts) == 1:
        return Frames(t, data, sizes)
    order = np.argsort(t, kind="stable")
    return Frames(t[order], data[order], sizes[order])
