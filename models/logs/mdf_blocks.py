"""MDF files whose blocks fit together: what asammdf reads without a look goes astray else.

Blocks refer to one another by their place in the file. Before a file is opened its lists of groups
and channels must end; before a group is read its channels must lie in its records, and its records
in the file.
"""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from models.limits import limits
from models.logs.foreign import need
from models.logs.log import RecordingError
from models.schema import require_dense, require_few

_MOST_BLOCKS = 1_000_000  # of data
_BUS_EVENT = 1 << 1  # flag of a group of channels that holds frames of a bus


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
        require_few(RecordingError, str(path), count, "columns", "channels")
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
        for group in _list(path, file, form, _link(file, form.first, form), seen):
            for records in _list(path, file, form, _link(file, group + form.inner, form), seen):
                first = _link(file, records + form.inner, form)
                for _ in _list(path, file, form, first, seen):
                    require_few(RecordingError, str(path), len(seen) / 3, "columns", "channels")


def _list(path: Path, file: BinaryIO, form: _Form, place: int, seen: set[int]) -> Iterator[int]:
    while place:
        if place in seen:
            raise RecordingError(f"{path}: is a damaged MDF file, its blocks run in a circle")
        seen.add(place)
        yield place
        place = _link(file, place + form.next, form)


def _link(file: BinaryIO, place: int, form: _Form) -> int:
    file.seek(place)
    raw = file.read(form.link.size)
    return int(form.link.unpack(raw)[0]) if len(raw) == form.link.size else 0


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
        require_few(RecordingError, str(path), inflated / 1e6, "block", "megabytes of a block")
        total, packed = total + inflated, packed + stored
        require_dense(RecordingError, str(path), total, packed, "groups of channels")
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
