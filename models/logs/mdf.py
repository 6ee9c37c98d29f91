"""ASAM MDF 3 and 4: groups of channels, each group on its own clock.

A channel that stands in several groups has the name of its group before its own. Enumerations
(values that a table turns into words) are no signals; where such a table only names states beside
numbers, as "not available", these samples are NaN. So are samples that the logger marked invalid.
"""

import re
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from codegen.arrays import Array, filled
from models.limits import limits
from models.logs.foreign import need, one_line
from models.logs.grouped import GroupedLog, Samples, noted, require_room
from models.logs.log import Listed, RecordingError, dense, few
from models.logs.stamps import typical_rate
from models.schema import LONGEST_NAME

_FORMULA_4 = 3  # kind of conversion of MDF 4 that is a formula
_FORMULA_3 = 10  # the same of MDF 3
_VALUES = (0, 6)  # types of a channel that holds numbers
_TIME = 1  # type of a master that counts seconds
_NUMBERS_AT_ONCE = 1 << 23  # numbers that are read at a time
_PROBED_SAMPLES = 200  # samples of a clock that its rate is taken from
_MOST_BLOCKS = 1_000_000  # of data
_BUS_EVENT = 1 << 1  # flag of a group of channels that holds frames of a bus

_NUMERIC_4, _NUMERIC_3 = frozenset(range(6)), frozenset((0, 1, 2, 3, *range(9, 17)))
_WORDS_4, _WORDS_3 = frozenset((7, 8, 9, 10, 11)), frozenset((11, 12))
# A formula is computed only where it is one: numbers, x, operators and functions.
_FORMULA = re.compile(
    r"(?:[\s\d.+\-*/(),]|\d[eE][+-]?\d|\b[xX]1?\b|\b(?:sin|cos|tan|asin|acos|atan|sinh|cosh|tanh"
    r"|exp|log|log10|abs|sqrt|pow)\b)*"
)
# Why a channel is not listed, by its kind.
_REASONS = {
    "word": "enumerations and texts are no signals",
    "array": "arrays are not read",
    "formula": "a conversion must be a formula of numbers, x, + - * / and functions",
    "clockless": "there is no time beside",
    "frames": 'frames of a bus need a DBC, in the [file] of log.toml dbc = "car.dbc"',
}


class _Place(NamedTuple):
    group: int
    channel: int


_Requested = tuple[Listed, _Place]


def _samples(path: Path, requested: Sequence[_Requested]) -> list[Samples]:
    groups: dict[int, list[_Requested]] = {}
    for one in requested:
        groups.setdefault(one[1].group, []).append(one)
    found = []
    with opened(path, "MDF") as file:
        for mine in groups.values():  # as many channels at a time as the memory takes
            several = max(1, _NUMBERS_AT_ONCE // max(mine[0][0].samples, 1))
            values: dict[str, Array] = {}
            for k in range(0, len(mine), several):
                t = _read(path, file, mine[k : k + several], values)
            found.append(Samples(mine[0][0].name, t, values))
    return found


def _read(path: Path, file: Any, some: Sequence[_Requested], values: dict[str, Array]) -> Array:
    """Add the values of channels of one group to others, and return their times."""
    samples = some[0][0].samples
    require_room(path, samples, 8)
    places = [(None, place.group, place.channel) for _, place in some]
    signals = file.select(places, copy_master=False)
    for (listed, _), signal in zip(some, signals, strict=True):
        read = _numbers(path, listed.name, signal.samples)
        if signal.invalidation_bits is not None:
            read[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
        t = np.array(signal.timestamps, dtype=np.float64)
        if not t.size == read.size == samples:
            raise RecordingError(
                f"{path}: {listed.name} must have {samples} samples, it has "
                f"{min(t.size, read.size)}; was the file cut off?"
            )
        values[listed.name] = filled(samples, read.__getitem__)
    return filled(samples, t.__getitem__)


def open_(path: Path) -> GroupedLog[_Place]:
    found: list[tuple[str, Listed, _Place]] = []
    others: dict[str, list[str]] = {reason: [] for reason in _REASONS}
    with one_line(path, "an MDF file"), opened(path, "MDF") as file:
        is_4 = str(file.version) >= "4"
        for number, group in enumerate(file.groups):
            about = group.channel_group
            titles = (getattr(about, "acq_name", None), getattr(about, "comment", None))
            named = (x for x in titles if isinstance(x, str) and x.strip() and x.isprintable())
            name = next(named, f"group {number + 1}").strip()[:LONGEST_NAME]
            if is_4 and is_bus(group):
                others["frames"].append(name)
                continue
            samples, master = int(about.cycles_nr), file.masters_db.get(number)
            # Other masters are angles, distances or counts.
            clock = master is not None and (
                not is_4 or int(group.channels[master].sync_type) in (0, _TIME)
            )
            rate = float("nan")
            if clock and samples:
                probed = min(samples, _PROBED_SAMPLES)
                t = file.get_master(number, record_offset=0, record_count=probed)
                rate = typical_rate(np.asarray(t, dtype=np.float64))
            for index, channel in enumerate(group.channels):
                if index == master or not samples:
                    continue
                kind = _kind(group, index, is_4) if clock else "clockless"
                if kind != "number":
                    others[kind].append(str(channel.name))
                    continue
                unit = str(file.get_channel_unit(group=number, index=index) or "").strip()
                listed = Listed(str(channel.name), unit, samples, rate)
                found.append((name, listed, _Place(number, index)))
        return GroupedLog(
            path,
            "MDF4" if is_4 else "MDF3",
            "an MDF file",
            "sample",
            found,
            tuple(note for kind, why in _REASONS.items() for note in noted(why, others[kind])),
            partial(_samples, path),
            "numeric channel with a time",
        )


def _kind(group: Any, index: int, is_4: bool) -> str:
    """Return what a channel holds: "number", "word", "formula" that is none, or "array"."""
    channel = group.channels[index]
    if group.channel_dependencies[index]:
        return "array"
    if (is_4 and int(channel.channel_type) not in _VALUES) or channel.data_type not in (
        _NUMERIC_4 if is_4 else _NUMERIC_3
    ):
        return "word"
    return _kind_of_conversion(channel.conversion, is_4)


def _kind_of_conversion(conversion: Any, is_4: bool) -> str:
    if conversion is None:
        return "number"
    kind = int(conversion.conversion_type)
    if kind == (_FORMULA_4 if is_4 else _FORMULA_3):
        raw = conversion.formula
        text = raw.decode("latin-1").strip(" \0") if isinstance(raw, bytes) else str(raw)
        return "number" if _FORMULA.fullmatch(text) else "formula"
    if kind not in (_WORDS_4 if is_4 else _WORDS_3):
        return "number"
    # Words: all of its values are, or some beside a default that is a conversion of its own.
    inner = getattr(conversion, "referenced_blocks", None) or {}
    kinds = {
        _kind_of_conversion(one, is_4)
        for one in inner.values()
        if one is not None and not isinstance(one, str | bytes)
    }
    if kinds - {"number"}:
        return "formula" if "formula" in kinds else "word"
    default = inner.get("default_addr")
    return "word" if default is None or isinstance(default, str | bytes) else "number"


def _numbers(path: Path, name: str, samples: Any) -> Array:
    """Return samples as numbers, NaN for the words among them."""
    values = np.asarray(samples)
    if values.dtype.kind == "O":
        values = np.array(
            [float(one) if isinstance(one, int | float | np.number) else np.nan for one in values]
        )
    if values.ndim != 1 or values.dtype.kind not in "fiub":
        raise RecordingError(f"{path}: {name} must be numeric, its samples are {values.dtype}")
    return values.astype(np.float64)


# Files whose blocks fit together: what asammdf reads without a look goes astray else.
#
# Blocks refer to one another by their place in the file. Before a file is opened its lists of
# groups and channels must end; before a group is read its channels must lie in its records, and its
# records in the file.


def is_bus(group: Any) -> bool:
    """Whether a group of channels of an MDF4 file holds frames of a bus."""
    return bool(int(group.channel_group.flags) & _BUS_EVENT)


class _Form(NamedTuple):
    """Where blocks of a version refer to others: the first group, the next of a kind, the first in.
    link: how a place is stored.
    """

    first: int
    next: int
    inner: int
    link: struct.Struct


@contextmanager
def opened(path: Path, format: str) -> Iterator[Any]:
    """Open a file by asammdf.
    format : that it is read as, for the message where the library is missing.
    """
    asammdf = need(path, "asammdf", format, "mdf")
    _require_ends(path)
    with asammdf.MDF(path, process_bus_logging=False) as file:
        count = sum(len(group.channels) for group in file.groups)
        few(path, count, "columns", "channels")
        for group in file.groups:
            _require_fitting(path, group, str(file.version) >= "4")
        yield file


def _require_ends(path: Path) -> None:
    """Refuse lists of groups and channels that run in circles."""
    with path.open("rb") as file:
        head = file.read(64)
        is_4 = head[8:9] == b"4"
        order = "<" if is_4 or head[24:26] == b"\0\0" else ">"
        form = (
            _Form(88, 24, 32, struct.Struct("<Q"))
            if is_4
            else _Form(68, 4, 8, struct.Struct(order + "I"))
        )
        seen: set[int] = set()
        for group in _linked(path, file, form, form.first, seen):
            for records in _linked(path, file, form, group + form.inner, seen):
                for _ in _linked(path, file, form, records + form.inner, seen):
                    few(path, len(seen) / 3, "columns", "channels")


def _linked(path: Path, file: BinaryIO, form: _Form, link: int, seen: set[int]) -> Iterator[int]:
    """Yield the places of blocks.   link : where that of the first is stored."""
    while True:
        file.seek(link)
        raw = file.read(form.link.size)
        place = int(form.link.unpack(raw)[0]) if len(raw) == form.link.size else 0
        if not place:
            return
        if place in seen:
            raise RecordingError(f"{path}: is a damaged MDF file, its blocks run in a circle")
        seen.add(place)
        yield place
        link = place + form.next


def _require_fitting(path: Path, group: Any, is_4: bool) -> None:
    """Refuse channels beyond their record, and records beyond the file."""
    about = group.channel_group
    width = int(about.samples_byte_nr)
    for channel in group.channels:
        bits = int(channel.bit_count)
        if is_4:
            first = 8 * int(channel.byte_offset) + int(channel.bit_offset)
            if int(channel.channel_type) not in (0, 2):  # others have no place in the record
                continue
            invalid = int(about.invalidation_bytes_nr)
            if invalid and int(channel.pos_invalidation_bit) >= 8 * invalid:
                raise RecordingError(f"{path}: is a damaged MDF file, a channel lies nowhere")
        else:
            first = int(channel.start_offset) + 8 * int(channel.additional_byte_offset)
        if first + bits > 8 * width:
            raise RecordingError(
                f"{path}: is a damaged MDF file, a channel lies beyond its record of {width} bytes"
            )
    file_size, total, packed = path.stat().st_size, 0, 0
    for number, block in enumerate(group.get_data_blocks()):
        inflated, stored = int(block.original_size or 0), int(block.compressed_size or 0)
        few(path, inflated / 1e6, "block", "megabytes of a block")
        total, packed = total + inflated, packed + stored
        dense(path, total, packed, "groups of channels")
        here = group.data_location == 0
        if (
            number > _MOST_BLOCKS
            or total > 1e6 * limits().megabytes
            or (here and int(block.address) + stored > file_size)
        ):
            raise RecordingError(f"{path}: is a damaged or cut off MDF file, its data do not fit")
    record = width + (int(about.invalidation_bytes_nr) if is_4 else 0)
    if group.sorted and total < int(about.cycles_nr) * record:
        raise RecordingError(
            f"{path}: is a cut off MDF file, it holds {total} bytes of {about.cycles_nr} records "
            f"of {record}"
        )
