"""What comes out of a live run: a topic, a page that shows it, a recording, and stored tires.

A client that stops reading loses its oldest messages. Any site in a browser here can read them.
"""

import logging
from contextlib import ExitStack, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import FileIO
from pathlib import Path
from threading import Event, Thread
from typing import Any

from codegen.escape import displayed
from identifier.frozen import FrozenModelError
from identifier.tire_model import TireModel
from models.extras import needs
from models.files import write_atomically
from models.recordings.map import LogMap
from models.schema import changed
from tireid.live.state import State
from tireid.output import OutputError
from tireid.progress import say

TOPIC = "/tireid/state"
AS_LOGGED = "as logged"  # a scale of the steering that nobody declared
_BACKLOG = 64  # messages that wait for a client: 13 s of them, 0.3 MB
_CHUNK = 1 << 16  # bytes of a recording between writes: 3 s of it are lost where the run is killed
_PATIENCE = 1.0  # s for a server to end: a client that does not read would have it wait for ever
_PARTS = ("../report.css", "../uplot/uPlot.min.css", "../uplot/uPlot.iife.min.js")  # of the page


class Outputs(ExitStack):
    """Sends states to a topic with a page, and to a new MCAP file; `words` says where.

    The page has the port that is given, the topic the next one. Port 0: any two free ones.
    """

    def __init__(self, serve: tuple[str, int] | None = None, record: Path | None = None) -> None:
        super().__init__()
        self.words, self._topic = "", None
        if serve is None and record is None:
            return
        try:
            import foxglove
        except ImportError:
            raise ImportError(needs("--serve or --record", "foxglove-sdk", "live")) from None
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)  # not what clients do wrong
        self._context = context = foxglove.Context()  # which the topic needs
        with ExitStack() as stack:
            if serve is not None:
                self._serve(*serve, stack, foxglove.start_server)
            if record is not None:  # a new file, only where nothing else is wrong
                options = foxglove.mcap.MCAPWriteOptions(chunk_size=_CHUNK)
                file = stack.enter_context(_File(record, "x"))
                recording: Any = foxglove.open_mcap(file, context=context, writer_options=options)
                stack.callback(_close, recording)
                self.words += f"record {record}"
            self.enter_context(stack.pop_all())
        self._topic = foxglove.Channel(TOPIC, schema=State.schema(), context=context)

    def _serve(self, host: str, port: int, stack: ExitStack, start: Any) -> None:
        try:
            server = start(
                name="tireid", host=host, port=port and port + 1, capabilities=[],
                context=self._context, message_backlog_size=_BACKLOG,
            )  # fmt: skip
            ending = Thread(target=server.stop, daemon=True)
            stack.callback(ending.join, _PATIENCE)
            stack.callback(ending.start)
            page = type("Page", (_Page,), {"topic": server.port})
            pages = stack.enter_context(ThreadingHTTPServer((host, port), page))
        except (OSError, OverflowError, RuntimeError) as error:
            rule = f"--serve {host}:{port} needs free ports {port} and {port + 1} of this machine"
            raise OutputError(f"{rule}: {error}; choose another, as 127.0.0.1:8775") from None
        Thread(target=pages.serve_forever, daemon=True).start()
        stack.callback(pages.shutdown)
        self.words += (
            f"page http://{host}:{pages.server_port}/, Foxglove ws://{host}:{server.port}\n"
        )

    def send(self, state: State) -> None:
        if self._topic is not None:
            self._topic.log(state.to_dict())


def _close(recording: Any) -> None:
    with suppress(RuntimeError):  # what its file has said
        recording.close()


class _File(FileIO):
    """Where it cannot be written any more that is said once, and all else goes on."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            say(f"{self.name} ends here, all else goes on: {error.strerror}")
            self.close()
            raise


class _Page(BaseHTTPRequestHandler):
    timeout = 5.0  # s, after which a browser that says nothing is dropped
    topic = 0  # its port

    def handle(self) -> None:
        with suppress(OSError):  # a browser that went away
            super().handle()

    def do_GET(self) -> None:
        if self.path != "/":
            self.send_error(404)
            return
        page = (Path(__file__).parent / "page.html").read_text(encoding="utf-8")
        for part in _PARTS:
            page = page.replace(
                f"%{part}%", (Path(__file__).parent / part).read_text(encoding="utf-8")
            )
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(page.replace("%PORT%", str(self.topic)).encode())

    def log_message(self, *_: object) -> None:
        """Be silent."""


def scale_of_steering(log_map: LogMap) -> str:
    """Return how a steering angle is scaled, in words of a log.toml."""
    signal, repair = log_map.signals.get("delta_f"), log_map.repair.factor
    given = {} if signal is None else changed(signal)
    said = [f"{key} = {given[key]}" for key in ("factor", "ratio", "table") if key in given]
    if "delta_f" in repair:
        said.append(f"repair.factor = {repair['delta_f']}")
    return ", ".join(said) or AS_LOGGED


class Store:
    """Tires in a folder, from one run to the next; a thread writes the newest each minute.

    scale : `scale_of_steering`; tires that were identified with another are refused.
    """

    def __init__(self, folder: Path, scale: str = AS_LOGGED, every: float = 60.0) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._path = folder / "tires.json"
        try:
            self._stored = TireModel.load(self._path) if self._path.exists() else None
        except FrozenModelError as error:
            raise FrozenModelError(f"{error}; move it away or choose another --store") from None
        beside = folder / "steering.txt"
        before = beside.read_text(encoding="utf-8", errors="replace") if beside.exists() else scale
        if self._stored and before != scale:
            raise FrozenModelError(
                f"{self._path}: was identified with delta_f {displayed(before)}, --log has it "
                f"{displayed(scale)}: give the same log.toml or another --store"
            )
        write_atomically(beside, scale)
        self._newest, self._end = self._stored, Event()
        self._thread = Thread(target=self._write, args=(every,), daemon=True)
        self._thread.start()

    def stored(self) -> TireModel | None:
        return self._stored

    def offer(self, tires: TireModel | None) -> None:
        self._newest = self._newest if tires is None else tires

    def close(self) -> None:
        self._end.set()
        self._thread.join()

    def _write(self, every: float) -> None:
        written, ends = self._stored, False
        while not ends:
            ends = self._end.wait(every)
            newest = self._newest
            if newest is not None and newest is not written:
                try:
                    newest.save(self._path)
                except OSError as error:
                    say(f"{self._path} stays as it was, it cannot be written: {error.strerror}")
            written = newest
