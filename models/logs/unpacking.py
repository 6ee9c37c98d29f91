"""Compressed parts of a bag unpack to no more than is allowed, whatever they say of themselves."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from models.limits import limits
from models.logs.foreign import need
from models.logs.log import RecordingError
from models.schema import CHUNK, require_few

Unpack = Callable[[bytes, int], bytes]


@contextmanager
def bounded(path: Path) -> Iterator[None]:
    """Let rosbags unpack with limits: it would unpack a chunk or file whole.

    Parameters
    ----------
    path : of the bag.

    Raises
    ------
    RecordingError
        Where a file of a bag unpacks to more than is allowed; so do later the chunks.
    """
    reader = need(path, "rosbags.rosbag2.reader", "ROS 2 bags", "ros")
    mcap = need(path, "rosbags.rosbag2.storage_mcap", "ROS 2 bags", "ros")
    lz4 = need(path, "lz4.frame", "ROS 2 bags", "ros")
    zstd = mcap.zstd
    if path.is_dir():
        for one in sorted(path.glob("*.zstd")):
            _require_small(one, zstd)

    def of_zstd(data: bytes, size: int) -> bytes:
        _require(path, size)
        return bytes(zstd.ZstdDecompressor().decompress(data, max_length=size + 1))

    def of_lz4(data: bytes, size: int) -> bytes:
        _require(path, size)
        return bytes(lz4.LZ4FrameDecompressor().decompress(data, max_length=size + 1))

    def of_message(data: bytes) -> bytes:
        return of_zstd(data, int(1e6 * limits().block))

    table: dict[str, Unpack] = mcap.DECOMPRESSORS
    before = dict(table)
    table.update(zstd=of_zstd, lz4=of_lz4)
    reader.zstd = SimpleNamespace(open=zstd.open, decompress=of_message)
    try:
        yield
    finally:
        table.update(before)
        reader.zstd = zstd


def _require(path: Path, size: int) -> None:
    require_few(RecordingError, str(path), size / 1e6, "block", "megabytes of a chunk")


def _require_small(path: Path, zstd: Any) -> None:
    """Refuse a file that unpacks to more than is allowed."""
    size, most = 0, 1e6 * limits().megabytes
    with zstd.open(path, "rb") as file:
        while size <= most and (part := file.read(CHUNK)):
            size += len(part)
    require_few(RecordingError, str(path), size / 1e6, "megabytes", "megabytes unpacked")
