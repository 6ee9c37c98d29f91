"""Logs of a CAN bus with the DBC that tells its signals: each is a channel "Frame.Signal".

A log holds bytes; where in them a signal lies, its factor, offset and unit are the DBC's. Raw
values that the DBC names as not available or invalid are NaN.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.logs.foreign import chosen, need, one_line, seconds_of, typical_rate, unique
from models.logs.frames import EXTENDED, TOGETHER, Frames, gather, kind_of
from models.logs.growing import Growing
from models.logs.log import Channel, Listed, RecordingError
from models.schema import LONGEST_NAME, read_bytes, require_few

PROBED = 200  # frames that a rate is taken from
# Names that a DBC gives to values that are no numbers.
NO_NUMBER = re.compile(
    r"\b(?:sna|snv|invalid|ung(?:ue|ü)ltig|not[ _]?(?:avail\w*|valid)|unavailable|undefined|error"
    r"|fault|failure|fehler|init\w*|n/?a)\b",
    re.I,
)


Selectors = tuple[tuple[Any, tuple[int, ...]], ...]


class _Place(NamedTuple):
    """Where a channel is: frames, signal of the DBC, and what says in which of them it is sent."""

    frames: Frames
    signal: Any
    selectors: Selectors


@dataclass(frozen=True, slots=True, kw_only=True)
class CanFile:
    """A log of frames and what they hold, as `LogFile` says.

    Parameters
    ----------
    path : of the file.
    format : "CAN ASC", "CAN BLF", "CAN candump", "CAN TRC" or "CAN MDF4".
    channels : as listed.
    places : of the channels.
    said : what is left out.
    """

    path: Path
    format: str
    channels: tuple[Listed, ...]
    places: tuple[_Place, ...]
    said: tuple[str, ...]
    _mended: list[str] = field(default_factory=list, compare=False, repr=False)

    @property
    def notes(self) -> tuple[str, ...]:
        """How many frames are left out, and what was mended in what has been read."""
        return (*self.said, *dict.fromkeys(self._mended))

    def listed(self) -> tuple[Listed, ...]:
        """Return the signals that the DBC tells of the frames in the log."""
        return self.channels

    def runs(self) -> tuple[str, ...]:
        """Return no names: a log is one run."""
        return ()

    def read(self, names: Sequence[str], run: str | None = None) -> tuple[Channel, ...]:
        """Return channels in the order of their names.

        Parameters
        ----------
        names : as listed.
        run : None.
        """
        known = {
            one.name: (one, place) for one, place in zip(self.channels, self.places, strict=True)
        }
        result = []
        with one_line(self.path, "a CAN log"):
            for listed, (frames, signal, selectors) in chosen(self.path, names, known, run):
                sent = _sent(frames, selectors)
                stamps = seconds_of(self.path, listed.name, frames.t[sent], "message")
                self._mended.extend(stamps.notes)
                values = Growing()
                for k in range(0, sent.size, TOGETHER):
                    some = slice(k, k + TOGETHER)
                    values.extend(values_of(frames.data[some][sent[some]], signal))
                result.append(
                    Channel(
                        name=listed.name,
                        unit=listed.unit,
                        t=stamps.t,
                        values=values.finished(),
                        place="message",
                        rows=np.arange(1, len(values) + 1),
                    )
                )
        return tuple(result)


def recognizes(head: bytes, path: Path) -> bool:
    """Whether a file is a log of frames alone; an MDF file is where a DBC is given with it.

    Parameters
    ----------
    head : its first bytes.
    path : of the file.
    """
    return path.is_file() and kind_of(head) not in ("", "MDF4")


def open_(path: Path, dbc: Path | None = None) -> CanFile:
    """Read the frames of a log that a DBC knows and list their signals.

    Parameters
    ----------
    path : of the log.
    dbc : tells the signals of its frames.

    Raises
    ------
    RecordingError
        One line, where the log or the DBC cannot be read, or they have no frame in common.
    """
    if dbc is None:
        raise RecordingError(
            f"{path}: holds frames of a bus; give the DBC file that tells their signals, in the "
            '[file] of log.toml: dbc = "car.dbc"'
        )
    messages = _read_dbc(dbc)
    with one_line(path, "a CAN log"):
        with path.open("rb") as file:
            kind = kind_of(file.read(4096))
        if not kind:
            raise RecordingError(f"{path}: is no CAN log: neither ASC, BLF, candump, TRC nor MDF4")
        log = gather(path, kind, {key: one.length for key, one in messages.items()})
        found: list[tuple[str, Listed, _Place]] = []
        for (bus, identifier), frames in log.frames.items():
            message = messages[identifier]
            for signal in message.signals:
                place = _Place(frames, signal, _selectors(message, signal))
                sent = _sent(frames, place.selectors)
                if sent.any():
                    listed = Listed(
                        name=f"{message.name}.{signal.name}",
                        unit=(signal.unit or "").strip()[:LONGEST_NAME],
                        samples=int(sent.sum()),
                        rate=typical_rate(frames.t[sent][:PROBED]),
                    )
                    found.append((f"bus {bus}", listed, place))
    said = tuple(
        f"{count} {what} frames are not read" for what, count in log.others.items() if count
    )
    if not found:
        why = "".join(f"; {one}" for one in said)
        raise RecordingError(f"{path}: holds no frame that {dbc} knows{why}")
    require_few(RecordingError, str(path), len(found), "columns", "channels")
    names = unique((bus, listed.name) for bus, listed, _ in found)
    return CanFile(
        path=path,
        format=log.format,
        channels=tuple(
            Listed(name=name, unit=one.unit, samples=one.samples, rate=one.rate)
            for name, (_, one, _) in zip(names, found, strict=True)
        ),
        places=tuple(place for _, _, place in found),
        said=said,
    )


def _read_dbc(path: Path) -> dict[int, Any]:
    """Return the messages of a DBC by their identifier, with `EXTENDED`."""
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
    return messages


def _selectors(message: Any, signal: Any) -> Selectors:
    """Return the signals that say whether a signal is sent, with the values that do."""
    named = {one.name: one for one in message.signals}
    result: list[tuple[Any, tuple[int, ...]]] = []
    while signal.multiplexer_signal in named and len(result) < len(named):
        selector = named[signal.multiplexer_signal]
        result.append((selector, tuple(signal.multiplexer_ids or ())))
        signal = selector
    return tuple(result)


def _sent(frames: Frames, selectors: Selectors) -> NDArray[np.bool_]:
    """Return which frames hold a signal: of multiplexed ones not all do."""
    sent = np.ones(frames.t.size, dtype=bool)
    for selector, ids in selectors:
        for k in range(0, sent.size, TOGETHER):
            some = slice(k, k + TOGETHER)
            sent[some] &= np.isin(raw_values(frames.data[some], selector), ids)
    return sent


def values_of(data: NDArray[np.uint8], signal: Any) -> Array:
    """Return a signal in its unit, (n,), NaN where the DBC says that a value is no number.

    Parameters
    ----------
    data : of the frames, (n, bytes).
    signal : of the DBC.
    """
    raw = raw_values(data, signal)
    values = raw.astype(np.float64) * float(signal.scale) + float(signal.offset)
    states = [
        value for value, name in (signal.choices or {}).items() if NO_NUMBER.search(_words(name))
    ]
    values[np.isin(raw, states)] = np.nan
    return values


def _words(name: Any) -> str:
    return str(name).replace("_", " ")


def raw_values(data: NDArray[np.uint8], signal: Any) -> NDArray[Any]:
    """Return the integers, or floats, of a signal as they are in frames, (n,).

    Parameters
    ----------
    data : of the frames, (n, bytes).
    signal : of the DBC.
    """
    length, little = signal.length, signal.byte_order == "little_endian"
    # Motorola numbers the bits of a byte downwards, and a signal by its highest bit.
    first = signal.start if little else 8 * (signal.start // 8) + 7 - signal.start % 8
    begin, end = first // 8, (first + length - 1) // 8 + 1
    if end > data.shape[1]:
        raise RecordingError(f"signal {signal.name} lies beyond its frame of {data.shape[1]} bytes")
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
