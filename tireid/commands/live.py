"""`tireid live SOURCE`: the tires while the car drives, on a page, in a file, on the terminal."""

import argparse
import gc
import math
import signal
import time
from contextlib import ExitStack, closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

from identifier.measured import stiffness_words
from tireid.commands.options import (
    add_log_map,
    add_options,
    add_vehicle,
    add_weights,
    given_map,
    host_and_port,
    read_vehicle,
    stored_model,
)
from tireid.live.live import OLD, Live
from tireid.live.outputs import Outputs, Store, scale_of_steering
from tireid.live.sources import Source, open_source
from tireid.live.state import Counts, State
from tireid.progress import say, tell

_UNIX = 1e5  # s: of a clock that reads more, as a Unix time does, the first sample is 0
_EVERY = 10.0  # s between two lines while nothing changes
_GARBAGE = 700, 10, 10  # as Python has it: a run that does not end cannot gather it as others do
_ENDS = ("SIGINT", "SIGTERM", "SIGHUP")


def declare(new: Any) -> None:
    parser = new(
        description="Identify the tires while the car drives, and say what is known of them five "
        "times a second: to a browser, Foxglove and an MCAP file. Ctrl-C ends it. No car here? "
        "tireid sample --udp sends the packets of a simulated one.",
    )
    text = (
        "udp://:PORT (JSON, or a struct that log.toml describes; of this machine, of others by "
        "udp://0.0.0.0:PORT), can:CHANNEL (with a DBC file), "
        "zenoh:KEY, or a log, which is replayed in real time"
    )
    parser.add_argument("source", metavar="SOURCE", help=text)
    add_vehicle(parser, required=True)
    add_weights(parser, "tires that are served until those of this drive are known")
    text = "serve a page for a browser here, and a socket for Foxglove at the next port"
    add_options(parser, str, {"--serve HOST:PORT": text})
    table = {
        "--record FILE": "write all states to this .mcap, a new one",
        "--store FOLDER": "store the tires of the drive there, and begin with the last ones stored",
    }
    add_options(parser, Path, table)
    text = "of the replay of a log over real time; inf: as fast as possible (1)"
    add_options(parser, float, {"--speed X": (1.0, text)})
    add_log_map(parser)


def run(options: argparse.Namespace) -> None:
    if not options.speed > 0.0:
        raise ValueError(f"--speed must be positive, it is {options.speed:g}")
    serve = host_and_port(options.serve, "--serve") if options.serve else None
    record: Path | None = options.record
    if record is not None and (record.suffix.lower() != ".mcap" or record.exists()):
        raise ValueError(f"--record {record}: name a new file, one that ends in .mcap")
    tire = stored_model(options.weights)
    vehicle, log_map = read_vehicle(options, tire), given_map(options)
    with ExitStack() as signals, ExitStack() as stack:  # a second one cuts no end short
        store = Store(options.store, scale_of_steering(log_map)) if options.store else None
        if store is not None:
            stack.enter_context(closing(store))
        live = Live(vehicle, tire, resume=None if store is None else store.stored())
        source = open_source(
            options.source, log_map, live.counts, vehicle=vehicle, speed=options.speed
        )
        live.prepare(v_y=source.v_y is not False)  # before packets come, which would have to wait
        gc.collect()
        gc.freeze()  # what is there by now stays: not to be looked through while packets wait
        gc.set_threshold(*_GARBAGE)
        stack.enter_context(source)
        outputs = stack.enter_context(Outputs(serve=serve, record=record))
        for number in (getattr(signal, one) for one in _ENDS if hasattr(signal, one)):
            before = signal.signal(number, lambda *_: source.close())  # cuts no state in two
            signals.callback(signal.signal, number, before)
        for line in (source.words, *outputs.words.splitlines()):
            say(line)
        first = _follow(live, source, outputs, store)
    last = live.state()
    known = _counted(live.counts) or "nothing came" if last is None else _line(last, first)
    tell(f"{live.counts.samples} samples; {known}")


def _follow(live: Live, source: Source, outputs: Outputs, store: Store | None) -> float:
    """Pass on what is known, until the source ends or is closed; return the first time [s]."""
    newest = sent = time.monotonic()
    said, before, came, first, counts = -math.inf, None, 0, math.nan, live.counts
    for sample in source:
        now = time.monotonic()
        state = None
        if sample is not None:
            if live.measures_v_y and source.v_y is False:  # as the first sample shows
                live.prepare(v_y=False)
            state = live.feed(*sample)
        if counts.samples + counts.refused > came:
            came, newest = counts.samples + counts.refused, now
        if sample is None or (state is None and now - sent > OLD):
            state = live.state(now - newest)
        if state is not None:
            first = state.t if math.isnan(first) else first
            outputs.send(state)
            sent = now
        judged = before if state is None else (state.valid, bool(state.alarm))
        due = state or not counts.samples or now - sent > _EVERY
        if judged != before or (due and now - said > _EVERY):
            before, said = judged, now
            counted = _counted(counts) or "nothing comes"
            say(f"nothing is known yet: {counted}" if state is None else _line(state, first))
            if store is not None:
                store.offer(live.tires())
    if store is not None:
        store.offer(live.tires())
    return first


def _line(state: State, first: float) -> str:
    """Return what a driver reads of a state, in one line.   first : time of the first one [s]."""
    known = "valid" if state.valid else f"not valid: {state.reason} ({state.origin} tires)"
    parts = [f"t = {state.t - first * (first > _UNIX):.1f} s, {known}"]
    parts.append(f"stiffness {stiffness_words(state.stiffness, state.stiffness_sd)}")
    if state.friction is not None:
        parts.append(f"friction {state.friction:.2f}")
    alarm = f"ALARM: {state.alarm}" if state.alarm else ""
    return "; ".join(filter(None, [*parts, _counted(state.counts), alarm]))


def _counted(counts: Counts) -> str:
    """Return what went wrong with samples, by counts that are not zero."""
    return ", ".join(f"{n} {name}" for name, n in asdict(counts).items() if n and name != "samples")
