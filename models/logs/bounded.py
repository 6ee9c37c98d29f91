"""Limits on what rosbags does with a bag, whatever the bag says of itself.

Its compressed parts unpack to no more than is allowed. Its metadata, which are YAML, may not be
deep: the parser takes the square of it; what they say of the quality of service is not parsed.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from models.limits import limits
from models.logs.foreign import need
from models.logs.log import RecordingError
from models.logs.magic import BAG_METADATA
from models.schema import CHUNK, most_unpacked, read_text, require_dense, require_few

_Unpack = Callable[[bytes, int], bytes]
_DEEP = re.compile(r"(?:[-?:]\s+){16}")  # lists in lists on one line


@contextmanager
def bounded(path: Path) -> Iterator[None]:
    """Let rosbags read with limits."""
    reader, mcap, sqlite = (
        need(path, f"rosbags.rosbag2.{name}", "ROS 2 bags", "ros")
        for name in ("reader", "storage_mcap", "storage_sqlite3")
    )
    lz4 = need(path, "lz4.frame", "ROS 2 bags", "ros")
    zstd = mcap.zstd
    if path.is_dir():
        _require_shallow(path / BAG_METADATA)
        for one in sorted(path.glob("*.zstd")):
            _require_small(one, zstd)

    def of_zstd(data: bytes, size: int) -> bytes:
        _require(path, size, len(data))
        return bytes(zstd.ZstdDecompressor().decompress(data, max_length=size + 1))

    def of_lz4(data: bytes, size: int) -> bytes:
        _require(path, size, len(data))
        return bytes(lz4.LZ4FrameDecompressor().decompress(data, max_length=size + 1))

    def of_message(data: bytes) -> bytes:
        most = most_unpacked(len(data))
        message = bytes(zstd.ZstdDecompressor().decompress(data, max_length=most + 1))
        _require(path, len(message), len(data))
        return message

    table: dict[str, _Unpack] = mcap.DECOMPRESSORS
    before = dict(table)
    table.update(zstd=of_zstd, lz4=of_lz4)
    reader.zstd = SimpleNamespace(open=zstd.open, decompress=of_message)
    parse = reader.parse_qos
    for module in (reader, mcap, sqlite):
        module.parse_qos = lambda _: []
    try:
        yield
    finally:
        table.update(before)
        reader.zstd = zstd
        for module in (reader, mcap, sqlite):
            module.parse_qos = parse


def _require_shallow(path: Path) -> None:
    """Refuse metadata of more levels than is allowed."""
    text = read_text(path, RecordingError)
    depth = deepest = 0
    for mark in re.findall(r"[\[\]{}]", text):
        depth += 1 if mark in "[{" else -1
        deepest = max(deepest, depth)
    indent = max((len(line) - len(line.lstrip()) for line in text.splitlines()), default=0) // 2
    require_few(RecordingError, str(path), max(deepest, indent), "depth", "levels of metadata")
    if _DEEP.search(text):
        raise RecordingError(f"{path}: must not hold lists in lists")


def _require(path: Path, size: int, packed: int) -> None:
    require_few(RecordingError, str(path), size / 1e6, "block", "megabytes of a chunk")
    require_dense(RecordingError, str(path), size, packed, "chunks")


def _require_small(path: Path, zstd: Any) -> None:
    """Refuse a file that unpacks to more than is allowed."""
    size, most = 0, 1e6 * limits().megabytes
    with zstd.open(path, "rb") as file:
        while size <= most and (part := file.read(CHUNK)):
            size += len(part)
            require_dense(RecordingError, str(path), size, path.stat().st_size, "zstd data")
    require_few(RecordingError, str(path), size / 1e6, "megabytes", "megabytes unpacked")
