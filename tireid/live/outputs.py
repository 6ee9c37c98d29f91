"""What comes out of a live run: a topic, a page that shows it, a recording, and stored tires.

Nobody who reads is waited for: a client that stops reading loses its oldest messages. The page
holds no data. The topic can be read by whoever reaches its port, and written by nobody; a browser
on this machine lets pages of any site reach it, as it lets the app of Foxglove.
"""

import json
import logging
import os
import socket
import tempfile
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from socketserver import ThreadingTCPServer
from threading import Event, Thread
from typing import Any, Self

from identifier.frozen import FrozenModelError
from identifier.tire_model import TireModel
from models.extras import needs
from tireid.live.state import State
from tireid.output import OutputError
from tireid.progress import say

TOPIC = "/tireid/state"
_BACKLOG = 64  # messages that wait for a client: 13 s of them, 0.3 MB
_CHUNK = 1 << 16  # bytes of a recording between writes: 3 s of it are lost where the power fails
_SILENT = 5.0  # s, after which a browser that says nothing is dropped
_PATIENCE = 1.0  # s for a server to end: a client that does not read would have it wait for ever
_FILES = {  # all that is served, by what is asked for
    "/": ("live/page.html", "text/html; charset=utf-8"),
    "/report.css": ("report.css", "text/css"),
    "/uPlot.min.css": ("live/uplot/uPlot.min.css", "text/css"),
    "/uPlot.iife.min.js": ("live/uplot/uPlot.iife.min.js", "text/javascript"),
}


class Outputs:
    """Sends states to a topic with a page, and to a file.

    Parameters
    ----------
    serve : host and port of the page; the topic is at the next port. Port 0: any two free ones.
    record : MCAP file to write; it must not exist.
    """

    def __init__(self, serve: tuple[str, int] | None = None, record: Path | None = None) -> None:
        self._logs: list[Callable[[bytes, int], None]] = []  # message, and its time [ns]
        lines = []
        with ExitStack() as stack:
            if record is not None:
                recording = _Recording(record)
                stack.callback(recording.close)
                self._logs.append(recording.log)
                lines.append(f"record {record}")
            if serve is not None:
                lines.append(self._serve(*serve, stack))
            self._stack = stack.pop_all()
        self.words = "\n".join(lines)

    def _serve(self, host: str, port: int, stack: ExitStack) -> str:
        try:
            import foxglove
        except ImportError:
            raise ImportError(needs("--serve", "the package foxglove-sdk", "live")) from None
        # Whatever a client does wrong is an error there, a line each.
        logging.getLogger("foxglove.websocket").setLevel(logging.CRITICAL)
        self._context = context = foxglove.Context()  # the channel ends with it
        try:
            server = foxglove.start_server(
                name="tireid", host=host, port=port and port + 1, capabilities=[],
                context=context, message_backlog_size=_BACKLOG,
            )  # fmt: skip
            stack.callback(_stop, server)
            pages = stack.enter_context(_Pages(host, port, server.port))
        except (OSError, OverflowError, RuntimeError) as error:
            reason = str(getattr(error, "strerror", None) or error).rpartition(": ")[2]
            raise OutputError(
                f"--serve {host}:{port}: ports {port} and {port + 1} of {host} must be free: "
                f"{reason.partition(' (os')[0]}; choose another, as --serve 127.0.0.1:8775"
            ) from None
        Thread(target=pages.serve_forever, args=(0.1,), daemon=True).start()
        stack.callback(pages.shutdown)
        topic = foxglove.Channel(TOPIC, schema=State.schema(), context=context)
        self._logs.append(lambda message, now: topic.log(message, log_time=now))
        name = f"[{host}]" if ":" in host else host
        return (
            f"page http://{name}:{pages.server_address[1]}/, "
            f"topic {TOPIC} at ws://{name}:{server.port} (Foxglove)"
        )

    def send(self, state: State) -> None:
        """Send a state to all."""
        message, now = json.dumps(state.to_dict(), allow_nan=False).encode(), time.time_ns()
        for log in self._logs:
            log(message, now)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()


def _stop(server: Any) -> None:
    ending = Thread(target=server.stop, daemon=True)
    ending.start()
    ending.join(_PATIENCE)


class _Recording:
    """An MCAP file. Where it cannot be written any more that is said once, and all else goes on."""

    def __init__(self, path: Path) -> None:
        try:
            from mcap.writer import Writer
        except ImportError:
            raise ImportError(needs("--record", "the package mcap", "live")) from None
        try:
            self._file = path.open("xb")
        except FileExistsError:
            raise OutputError(f"{path} exists: choose another name for --record") from None
        self._writer = writer = Writer(self._file, chunk_size=_CHUNK)
        writer.start(library="tireid")
        schema = State.schema()
        number = writer.register_schema(schema["title"], "jsonschema", json.dumps(schema).encode())
        self._channel = writer.register_channel(TOPIC, "json", number)

    def log(self, message: bytes, now: int) -> None:
        self._write(lambda: self._writer.add_message(self._channel, now, message, now))

    def close(self) -> None:
        self._write(self._writer.finish)
        self._file.close()

    def _write(self, step: Callable[[], None]) -> None:
        if self._file.closed:
            return
        try:
            step()
            self._file.flush()
        except OSError as error:
            say(f"{self._file.name} ends here, all else goes on: {error.strerror}")
            with suppress(OSError):
                self._file.close()


class _Pages(ThreadingTCPServer):
    """Serves the page; each browser has its thread, so that a slow one delays nobody."""

    allow_reuse_address = os.name != "nt"
    daemon_threads = True

    def __init__(self, host: str, port: int, topic: int) -> None:
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self.topic = topic
        super().__init__((host, port), _Page)

    def handle_error(self, *_: object) -> None:
        """Forget a browser that went away."""


class _Page(BaseHTTPRequestHandler):
    timeout = _SILENT
    server: _Pages

    def do_GET(self) -> None:
        if self.path not in _FILES:
            self.send_error(404)
            return
        name, kind = _FILES[self.path]
        content = (Path(__file__).parents[1] / name).read_bytes()
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")  # the next run may have other ports
        self.end_headers()
        self.wfile.write(content.replace(b"%PORT%", b"%d" % self.server.topic))

    def log_message(self, *_: object) -> None:
        """Be silent."""


class Store:
    """Tires in a folder, from one run to the next; a thread of its own writes the newest.

    Parameters
    ----------
    folder : is made where there is none.
    every : time between two writes [s].

    Raises
    ------
    FrozenModelError
        Where the folder holds tires that cannot be read; they stay as they are.
    """

    def __init__(self, folder: Path, every: float = 60.0) -> None:
        self._path = folder / "tires.json"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            reason = f"cannot be written: {error.strerror}; choose another folder"
            raise OutputError(f"--store {folder}: {reason}") from None
        try:
            self._stored = TireModel.load(self._path) if os.path.lexists(self._path) else None
        except FrozenModelError as error:
            raise FrozenModelError(f"{error}; move it away or choose another --store") from None
        self._newest: deque[TireModel] = deque(maxlen=1)
        self._end = Event()
        self._thread = Thread(target=self._write, args=(every,), daemon=True)
        self._thread.start()

    def stored(self) -> TireModel | None:
        """Return the tires of an earlier run; None where there are none."""
        return self._stored

    def offer(self, tires: TireModel | None) -> None:
        """Have tires, if any, written when it is time, unless newer ones come first."""
        if tires is not None:
            self._newest.append(tires)

    def close(self) -> None:
        """Write the last tires that were offered."""
        self._end.set()
        self._thread.join()

    def _write(self, every: float) -> None:
        ends = False
        while not ends:
            ends = self._end.wait(every)
            with suppress(IndexError):
                tires = self._newest.pop()
                try:
                    tires.save(self._path)
                except OSError as error:
                    say(f"{self._path} stays as it was, it cannot be written: {error.strerror}")
