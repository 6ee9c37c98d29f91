"""Where samples come from while a car drives: packets, a bus, or a log that is replayed."""

import math
import os
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, Full, Queue
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from codegen.escape import displayed
from models.logs.foreign import need, reason_of
from models.logs.log import RecordingError
from models.recordings.map import LARGEST_PACKET, LogMap
from models.recordings.reader import read_repaired, split_log_argument
from models.recordings.record import Recording
from models.vehicle import Vehicle
from tireid.live.samples import Frames, Packets, Sample, live_map
from tireid.live.state import Counts

FORMS = "udp://[HOST]:PORT, can:[KIND:]CHANNEL, zenoh:KEY, or a log"
QUIET = 0.2  # s without a sample, after which the caller goes on all the same
_WAIT = 0.1  # s, longest wait at a time: the iteration ends no later
_BURST = 2e-3  # s, within which frames of one instant come
_QUEUE = 256  # packets of zenoh that wait, 2.5 s at 100 Hz


@dataclass(slots=True, eq=False)
class Source:
    """Samples, and None where there was none for 0.2 s, until a log ends or the source is closed.

    words : what is read, one line.   steps : samples, and None after each packet or wait.
    tells_v_y : returns whether v_y comes.   free : closes what is open.
    """

    words: str
    steps: Iterator[Sample | None]
    tells_v_y: Callable[[], bool | None]
    free: Callable[[], object] = lambda: None
    _closed: bool = False

    @property
    def v_y(self) -> bool | None:
        """Whether lateral velocity comes; None where only packets will tell."""
        return self.tells_v_y()

    def __iter__(self) -> Iterator[Sample | None]:
        last = time.monotonic()
        for one in self.steps:
            if self._closed:
                return
            if one is not None or time.monotonic() - last >= QUIET:
                last = time.monotonic()
                yield one

    def close(self) -> None:
        """End the iteration, also that of another thread, within 0.1 s."""
        self._closed = True

    def __enter__(self) -> "Source":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        self.free()


def open_source(
    text: str, log_map: LogMap, counts: Counts, *, vehicle: Vehicle, speed: float = 1.0
) -> Source:
    """Open udp://[HOST]:PORT, can:[KIND:]CHANNEL, zenoh:KEY, or a log, also LOG:RUN.

    Parameters
    ----------
    log_map : how it is read.
    counts : in which packets and frames that cannot be read are counted.
    vehicle : as declared, the map's repair not yet applied: a log must fit it.
    speed : of the replay of a log; infinite waits for nothing.
    """
    opened = {"udp": _udp, "can": _can, "zenoh": _zenoh}.get(text.partition(":")[0])
    if opened and ":" in text and not Path(text).exists():
        return opened(text, live_map(log_map), counts)
    if not speed > 0.0:
        raise RecordingError(f"speed must be positive, it is {speed:g}")
    path, run = split_log_argument(text)
    if not path.exists():
        raise RecordingError(f"{displayed(text)} is no file and no source; sources are {FORMS}")
    recording, _ = read_repaired(path, vehicle, run, log_map=log_map)
    if np.any(recording.delta_r):
        raise RecordingError(f"{recording.name}: rear axle steers, which cannot be read live")
    pace = f"at {speed:g} times its speed" if math.isfinite(speed) else "as fast as possible"
    words = f"{recording.name}, {recording.duration:.4g} s {pace}"
    return Source(words, _replayed(recording, speed), lambda: recording.logged_v_y is not None)


def _replayed(recording: Recording, speed: float) -> Iterator[Sample | None]:
    signals = recording.v_x, recording.r, recording.delta_f, recording.a_y, recording.logged_v_y
    none, begin = np.full(len(recording), math.nan), time.monotonic()
    for t, *values in zip(recording.t, *(none if s is None else s for s in signals), strict=True):
        due = begin + float(t - recording.t[0]) / speed
        while (left := due - time.monotonic()) > 0.0:
            time.sleep(min(left, _WAIT))
            yield None
        yield Sample(float(t), *map(float, values))


def _read(
    receive: Callable[[], Any], take: Callable[[Any], Iterable[Sample]]
) -> Iterator[Sample | None]:
    while True:
        yield from take(receive())  # None where nothing came
        yield None


def _udp(text: str, log_map: LogMap, counts: Counts) -> Source:
    try:
        host, port = urlsplit(text).hostname or "127.0.0.1", urlsplit(text).port
        if port is None:
            raise ValueError
    except ValueError:
        raise RecordingError(
            f"{displayed(text)} must be udp://HOST:PORT or udp://:PORT, PORT at most 65535"
        ) from None
    packets = Packets(text, log_map, counts)
    bound = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
    bound.settimeout(_WAIT)
    try:
        bound.bind((host, port))
    except (OSError, UnicodeError) as error:
        bound.close()
        raise RecordingError(
            f"{text}: port {port} of {host} cannot be opened ({reason_of(error)}); name another, "
            "or end the program that has it"
        ) from None

    def receive() -> bytes | None:
        try:
            return bound.recv(LARGEST_PACKET)
        except (TimeoutError, ConnectionError):  # Windows: an answer to a sender did not arrive
            return None

    host, port = bound.getsockname()[:2]
    alone = f" (of this machine; of others: udp://0.0.0.0:{port})" * (host == "127.0.0.1")
    words = f"UDP at {host}:{port}{alone}, {log_map.packet or 'JSON'}"
    return Source(words, _read(receive, packets.take), lambda: packets.v_y, bound.close)


def _zenoh(text: str, log_map: LogMap, counts: Counts) -> Source:
    zenoh = need(Path(text), "zenoh", "it", "live")
    packets, queue = Packets(text, log_map, counts), Queue[bytes](_QUEUE)

    def callback(sample: Any) -> None:
        payload = sample.payload
        with suppress(Full):  # its time will show the loss
            queue.put_nowait(payload.to_bytes() if len(payload) <= LARGEST_PACKET else b"")

    def receive() -> bytes | None:
        with suppress(Empty):
            return queue.get(timeout=_WAIT)
        return None

    try:
        from_env = "ZENOH_CONFIG" in os.environ
        session = zenoh.open(zenoh.Config.from_env() if from_env else zenoh.Config())
        session.declare_subscriber(text.partition(":")[2], callback)
    except Exception as error:
        raise RecordingError(f"{text}: cannot be opened ({reason_of(error)})") from None
    return Source(text, _read(receive, packets.take), lambda: packets.v_y, session.close)


def _can(text: str, log_map: LogMap, counts: Counts) -> Source:
    can = need(Path(text), "can", "it", "live")
    frames = Frames(text, log_map, counts)
    kind, colon, channel = text[4:].partition(":")
    if not colon:
        kind, channel = "socketcan", kind
    more = {"preserve_timestamps": True} if kind == "virtual" else {}
    try:
        bus = can.Bus(channel=channel, interface=kind, can_filters=frames.filters, **more)
    except Exception as error:  # a driver may raise anything
        raise RecordingError(f"{text}: cannot be opened ({reason_of(error)})") from None

    def receive() -> Any:
        try:
            return bus.recv(_BURST if frames.waiting else _WAIT)
        except can.CanError as error:
            raise RecordingError(f"{text}: cannot be read ({reason_of(error)})") from None

    words = f"CAN {kind} {channel}, {log_map.dbc}"
    return Source(words, _read(receive, frames.take), lambda: frames.v_y, bus.shutdown)
