"""ROS 2 bags without ROS: a folder with metadata.yaml, one .db3, one .mcap.

Every number of a message is a channel "topic/field"; its clock is the stamp of the message, or of
its header, and where there is none (or it is not set) the time at which the bag received it. Time
counts from the first message that is read of any topic.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import islice
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.limits import limits
from models.logs.cdr import (
    CdrError,
    Definitions,
    Field,
    Layout,
    fields_of,
    fits,
    layout_of,
    numbers,
)
from models.logs.foreign import need, one_line
from models.logs.grouped import GroupedLog, Samples, noted
from models.logs.growing import Growing
from models.logs.log import Listed, RecordingError, dense, few
from models.logs.magic import BAG_METADATA, MCAP, ROS1, SQLITE
from models.logs.stamps import typical_rate
from models.logs.units import rows_of
from models.schema import CHUNK, most_unpacked, read_text

_NS = 1e9  # in a second
_OTHER_CLOCK = 3600  # seconds between stamps and the bag's own time, above which these differ
_PROBED_MESSAGES = 20  # messages that a rate is taken from
_MESSAGES_AT_ONCE = 2048  # messages that are read at a time
_MOST_BYTES = 1 << 24  # of messages that are read at a time, at most

_STAMPS = ("header.stamp.", "stamp.")
_TIME = ("sec", "nanosec")

_TABLES = rows_of("ros.toml")
_KNOWN: Mapping[str, str] = _TABLES["known"]  # definitions by type
_PACKAGES = tuple(_TABLES["packages"]["known"].split())  # whose types have units


class _Topic(NamedTuple):
    """Messages of one name and type.
    stamp: begins the paths of its clock, None where that is the bag's; zero: of its clock [ns].
    """

    name: str
    kind: str
    messages: int
    fields: tuple[Field, ...]
    stamp: str | None
    zero: int


class _Moving(NamedTuple):
    """A frame of /tf in another, by name: t (n,) [ns], translation and rotation (n, 7)."""

    name: str
    t: NDArray[np.int64]
    values: Array


_Place = tuple[_Topic, Field] | tuple[_Moving, int]  # where a channel is
_TF = "tf2_msgs/msg/TFMessage"
_OF_TF = tuple(
    f"{a}.{b}" for a, some in (("translation", "xyz"), ("rotation", "xyzw")) for b in some
)


def open_(path: Path) -> GroupedLog[_Place]:
    with one_line(path, "a ROS 2 bag"), _opened(path) as bag:
        definitions, undefined = _definitions(path, bag)
        topics, rates, skipped = _topics(bag, definitions)
        moving = _moving(path, bag)
    first = min((int(one.t[0]) for one in moving), default=0)
    zero = min((topic.zero for topic in topics if topic.stamp), default=first)
    found: list[tuple[str, Listed, _Place]] = [
        (_TF, Listed(f"{one.name}/{field}", "m" * (k < 3), one.t.size,
                    typical_rate((one.t - one.t[0]) / _NS)), (one, k))
        for one in moving
        for k, field in enumerate(_OF_TF)
    ]  # fmt: skip
    for topic in topics:
        for field in topic.fields:
            name = f"{topic.name}/{field.path}"
            listed = Listed(name, _unit(field), topic.messages, rates[topic.name])
            found.append((topic.kind, listed, (topic, field)))
    received = [topic.name for topic in topics if topic.stamp is None]
    return GroupedLog(
        path,
        "ROS 2 bag" if _plugin(path) != ".mcap" else "MCAP",
        "a ROS 2 bag",
        "message",
        found,
        (
            *noted("no stamp in the message, its clock is when the bag received it", received),
            *noted("not read", [f"{name} ({why})" for name, why in (undefined | skipped).items()]),
        ),
        partial(_samples, path, definitions, zero),
        "message with numbers",
        received=True,
    )


def _samples(
    path: Path, definitions: Definitions, zero: int, requested: Sequence[tuple[Listed, _Place]]
) -> list[Samples]:
    """Read fields of messages, topic by topic; times of frames count from `zero` [ns]."""
    fields: dict[_Topic, dict[str, Field]] = {}
    frames: dict[str, tuple[_Moving, dict[str, Array]]] = {}
    for listed, place in requested:
        if isinstance(place[0], _Moving):
            moving, k = place[0], place[1]
            frames.setdefault(moving.name, (moving, {}))[1][listed.name] = moving.values[:, k]
        else:
            fields.setdefault(place[0], {})[listed.name] = place[1]
    done = [Samples(one.name, (one.t - zero) / _NS, values) for one, values in frames.values()]
    readings = {
        topic.name: _Reading(path, definitions, topic, some) for topic, some in fields.items()
    }
    with _opened(path) as bag:
        for name, received, raw in _messages(bag, list(fields)):
            readings[name].add(received, raw)
    return [*done, *(reading.finish() for reading in readings.values())]


def _moving(path: Path, bag: Any) -> list[_Moving]:
    """Return the frames of /tf that move."""
    typesys = need(path, "rosbags.typesys", "ROS 2 bags", "ros")
    store = typesys.get_typestore(typesys.Stores.LATEST)
    found: dict[str, list[tuple[float, ...]]] = {}
    count = 0
    for connection, _, raw in bag.messages([c for c in bag.connections if c.msgtype == _TF]):
        for one in store.deserialize_cdr(raw, _TF).transforms:
            parent, child = (x.strip("/") for x in (one.header.frame_id, one.child_frame_id))
            stamp, get = one.header.stamp, attrgetter(*_OF_TF)
            ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            name = f"{connection.topic}/{parent}->{child}"
            found.setdefault(name, []).append((ns, *get(one.transform)))
            count += 1
        few(path, count, "samples", "transforms")
    return [
        _Moving(name, np.array([row[0] for row in rows]), np.array([row[1:] for row in rows]))
        for name, rows in found.items()
        if len({row[1:] for row in rows}) > 1
    ]


def _plugin(path: Path) -> str:
    if path.is_dir():
        return "dir"
    with path.open("rb") as file:
        head = file.read(16)
    if head.startswith(ROS1):
        raise RecordingError(f"{path}: is a bag of ROS 1; convert it: rosbags-convert --src {path}")
    if not head.startswith((SQLITE, MCAP)):
        raise RecordingError(f"{path}: is not a ROS 2 bag: neither SQLite nor MCAP")
    return ".mcap" if head.startswith(MCAP) else ".db3"


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a bag; what is compressed in it unpacks to no more than is allowed."""
    plugin = _plugin(path)
    reader = need(path, "rosbags.rosbag2.reader", "ROS 2 bags", "ros")
    with _bounded(path):
        storage = reader.Reader.STORAGE_PLUGINS[plugin]
        bag = storage(path)
        storage.open(bag)
        try:
            yield bag
        finally:
            bag.close()


def _definitions(path: Path, bag: Any) -> tuple[Definitions, dict[str, str]]:
    """Return the definitions of types, the bag's own first, and why a topic has none."""
    typesys = need(path, "rosbags.typesys", "ROS 2 bags", "ros")
    result = dict(typesys.get_typestore(typesys.Stores.LATEST).fielddefs)
    for kind, text in _KNOWN.items():
        result.update(typesys.get_types_from_msg(text, kind))
    bad: dict[str, str] = {}
    for connection in bag.connections:
        form, text = connection.msgdef.format.name, connection.msgdef.data
        try:
            if form == "MSG":
                result.update(typesys.get_types_from_msg(text, connection.msgtype))
            elif form == "IDL":
                for part in text.split("=" * 80 + "\n"):
                    body = part.partition("\n")[2] if part.startswith("IDL: ") else part
                    result.update(typesys.get_types_from_idl(body) if body.strip() else {})
        except Exception:  # a grammar that fails on what anybody wrote
            bad[connection.topic] = "its definition cannot be parsed"
    return result, bad


def _topics(
    bag: Any, definitions: Definitions
) -> tuple[list[_Topic], dict[str, float], dict[str, str]]:
    """Return the topics with numbers, by name their rates [Hz], and why others have none."""
    rates: dict[str, float] = {}
    counts: Counter[tuple[str, str]] = Counter()
    skipped: dict[str, str] = {}
    for connection in bag.connections:
        if (form := connection.ext.serialization_format) != "cdr":
            skipped[connection.topic] = f"is not CDR but {form}"
        else:
            counts[connection.topic, connection.msgtype] += int(connection.msgcount)
    found: list[tuple[_Topic, int]] = []
    for (name, kind), count in counts.items():
        if count < 1:
            continue
        if name in {topic.name for topic, _ in found}:
            skipped[name] = f"{kind} is a second type of it"
            continue
        try:
            fields = tuple(fields_of(definitions, kind))
            paths = {field.path for field in fields}
            stamp = next((s for s in _STAMPS if {s + one for one in _TIME} <= paths), None)
            kept = tuple(one for one in fields if stamp is None or not one.path.startswith(stamp))
            if not kept:
                continue
            topic = _Topic(name, kind, count, kept, stamp, 0)
            first, stamped, rates[name] = _first(bag, definitions, topic)
        except CdrError as error:
            skipped[name] = str(error)
            continue
        if stamped is None:
            topic = topic._replace(stamp=None)
        found.append((topic._replace(zero=first if stamped is None else stamped), first))
    # The clocks count from the first message of any topic; apart where stamps are not near.
    both = [(topic.zero, first) for topic, first in found if topic.stamp is not None]
    zero = min((first for _, first in found), default=0)
    of_stamps = min((one for one, _ in both), default=zero)
    if not any(abs(one - first) > _OTHER_CLOCK * _NS for one, first in both):
        zero = of_stamps = min(zero, of_stamps)
    topics = [one._replace(zero=zero if one.stamp is None else of_stamps) for one, _ in found]
    return topics, rates, skipped


def _first(bag: Any, definitions: Definitions, topic: _Topic) -> tuple[int, int | None, float]:
    """Return when the first message was received, its stamp if it has one [ns], and the rate [Hz].
    The rate is that of the first messages: a topic may be silent for most of a bag.
    """
    received: list[int] = []
    stamps: list[int] = []
    for _, time, raw in islice(_messages(bag, [topic]), _PROBED_MESSAGES):
        try:
            layout = layout_of(definitions, topic.kind, raw)
        except CdrError:
            if not received:
                raise
            break  # which is given where it is read
        received.append(time)
        if topic.stamp is not None:
            stamps.append(int(_stamps(layout, _rows([raw]), topic.stamp)[0]))
    if not received:
        raise CdrError("it holds no message")
    first = stamps[0] if stamps else 0
    times = np.array(stamps if first else received, dtype=np.int64)
    return received[0], first or None, typical_rate((times - times[0]) / _NS)


def _messages(bag: Any, topics: Sequence[_Topic]) -> Iterator[tuple[str, int, bytes]]:
    """Yield the messages of topics: of which, when they were received [ns], and their bytes."""
    wanted = {(topic.name, topic.kind) for topic in topics}
    connections = [one for one in bag.connections if (one.topic, one.msgtype) in wanted]
    for connection, received, raw in bag.messages(connections):
        yield connection.topic, int(received), raw


class _Reading:
    """Numbers of a topic as its messages come, some of them at a time."""

    def __init__(
        self, path: Path, definitions: Definitions, topic: _Topic, fields: Mapping[str, Field]
    ) -> None:
        self.path, self.definitions, self.topic, self.fields = path, definitions, topic, fields
        self.times: list[int] = []
        self.raws: list[bytes] = []
        self.bytes = 0
        self.layouts: dict[int, list[Layout]] = {}
        self.clock = Growing(np.int64)
        self.parts = {name: Growing() for name in fields}

    def add(self, time: int, raw: bytes) -> None:
        self.times.append(time)
        self.raws.append(raw)
        self.bytes += len(raw)
        if len(self.raws) == _MESSAGES_AT_ONCE or self.bytes > _MOST_BYTES:
            self._read()

    def _read(self) -> None:
        raws, stamp = self.raws, self.topic.stamp
        ns = np.array(self.times, dtype=np.int64)
        values = {name: np.empty(len(raws)) for name in self.fields}
        for layout, which, rows in _grouped(self.definitions, self.topic.kind, raws, self.layouts):
            for name, one in self.fields.items():
                values[name][which] = numbers(layout, rows, one)
            if stamp is not None:
                ns[which] = _stamps(layout, rows, stamp)
        self.clock.extend(ns)
        for name, numbers_of in values.items():
            self.parts[name].extend(numbers_of)
        few(self.path, len(self.clock), "samples", "messages of a topic")
        self.times, self.raws, self.bytes = [], [], 0

    def finish(self) -> Samples:
        """Return the times of the messages and their numbers."""
        if self.raws:
            self._read()
        if len(self.clock) != self.topic.messages:
            raise RecordingError(
                f"{self.path}: {self.topic.name} must have {self.topic.messages} messages, it has "
                f"{len(self.clock)}; was the bag cut off?"
            )
        t = (self.clock.finished() - self.topic.zero) / _NS
        values = {name: one.finished() for name, one in self.parts.items()}
        return Samples(self.topic.name, t, values)


def _grouped(
    definitions: Definitions, kind: str, raws: list[bytes], layouts: dict[int, list[Layout]]
) -> Iterator[tuple[Layout, NDArray[np.intp], NDArray[np.uint8]]]:
    """Yield messages by layout: it, which they are, and their bytes (n, size)."""
    sizes = np.array([len(raw) for raw in raws])
    for size in np.unique(sizes).tolist():
        left = np.flatnonzero(sizes == size)
        known = layouts.setdefault(size, [])
        tried = 0
        while left.size:
            rows = _rows([raws[k] for k in left])
            if tried == len(known):
                known.append(layout_of(definitions, kind, raws[left[0]]))
            same = fits(known[tried], rows)
            if same.any():
                yield known[tried], left[same], rows[same]
            left = left[~same]
            tried += 1


def _rows(raws: list[bytes]) -> NDArray[np.uint8]:
    return np.frombuffer(b"".join(raws), np.uint8).reshape(len(raws), -1)


def _stamps(layout: Layout, rows: NDArray[np.uint8], stamp: str) -> NDArray[np.int64]:
    """Return the stamps of messages [ns]."""
    sec, nanosec = (
        numbers(layout, rows, Field(stamp + name, (), kind)).astype(np.int64)
        for name, kind in zip(_TIME, ("i4", "u4"), strict=True)
    )
    return np.asarray(sec * 1_000_000_000 + nanosec)


def _unit(field: Field) -> str:
    """Return the unit that the type of a known message gives."""
    for kind, name in reversed(field.owners):
        package, _, word = kind.partition("/")
        unit: str = _TABLES["units"].get(f"{word.rpartition('/')[2]}.{name}", "")
        if unit and package in _PACKAGES:
            return unit
    return ""


# Limits on what rosbags does with a bag, whatever the bag says of itself.
#
# Its compressed parts unpack to no more than is allowed. Its metadata, which are YAML, may not be
# deep: the parser takes the square of it; what they say of the quality of service is not parsed.

_DEEP = re.compile(r"(?:[-?:]\s+){16}")  # lists in lists on one line


@contextmanager
def _bounded(path: Path) -> Iterator[None]:
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

    so_far = np.zeros(2)  # unpacked and packed

    def require_allowed(size: int, packed: int) -> None:
        few(path, size / 1e6, "block", "megabytes of a chunk")
        so_far[:] += size, packed
        dense(path, so_far[0], so_far[1], "chunks")

    def unpacked(decompressor: Any, data: bytes, size: int) -> bytes:
        require_allowed(size, len(data))
        return bytes(decompressor().decompress(data, max_length=size + 1))

    def of_message(data: bytes) -> bytes:
        most = most_unpacked(len(data))
        message = bytes(zstd.ZstdDecompressor().decompress(data, max_length=most + 1))
        require_allowed(len(message), len(data))
        return message

    table = mcap.DECOMPRESSORS
    before = dict(table)
    table.update(
        zstd=partial(unpacked, zstd.ZstdDecompressor),
        lz4=partial(unpacked, lz4.LZ4FrameDecompressor),
    )
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
    few(path, max(deepest, indent), "depth", "levels of metadata")
    if _DEEP.search(text):
        raise RecordingError(f"{path}: must not hold lists in lists")


def _require_small(path: Path, zstd: Any) -> None:
    """Refuse a file that unpacks to more than is allowed."""
    size, most = 0, 1e6 * limits().megabytes
    with zstd.open(path, "rb") as file:
        while size <= most and (part := file.read(CHUNK)):
            size += len(part)
            dense(path, size, path.stat().st_size, "zstd data")
    few(path, size / 1e6, "megabytes", "megabytes unpacked")
