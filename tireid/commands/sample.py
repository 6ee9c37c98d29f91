"""`tireid sample LOG.csv`: a drive to learn from, of the built-in plant, where there is no log."""

import argparse
import json
import shlex
import socket
import time
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from models.logs.foreign import reason_of
from models.recordings import Recording, write_recording
from models.recordings.choice import column_of
from tireid.commands.options import (
    add_force,
    add_options,
    add_seed,
    add_vehicle,
    host_and_port,
    read_vehicle,
    seed_of,
)
from tireid.driving.learn import sample_recording
from tireid.output import require_free
from tireid.progress import say

_PAUSE = 1.0  # s between two drives, as of a car that is put back: a gap for who listens
_SENT = ("t", "v_x", "v_y", "r", "delta_f", "a_y")  # by the names of columns


def declare(new: Any) -> None:
    parser = new(
        description="Write the sensor signals of a simulated car on an open field, steered at "
        "random and ever harder until it slides, with the true axle forces: a log for tireid "
        "identify. With --udp it is sent sample by sample, for tireid live.",
    )
    text = "file to write, .csv or .csv.gz"
    parser.add_argument("log", nargs="?", type=Path, metavar="LOG", help=text)
    text = "send the drive as JSON packets in real time, again and again, in place of LOG"
    add_options(parser, str, {"--udp HOST:PORT": text})
    add_vehicle(parser)
    parser.add_argument(
        "--car", type=Path, metavar="FILE", help="also write the car as TOML, for --vehicle"
    )
    add_seed(parser, "steering and noise")
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    if (options.log is None) == (options.udp is None):
        raise ValueError("give either LOG, a file to write, or --udp HOST:PORT, where to send")
    if options.log and not options.log.name.lower().endswith((".csv", ".csv.gz")):
        raise ValueError(f"{options.log}: the name must end in .csv or .csv.gz")
    to = host_and_port(options.udp, "--udp") if options.udp else None
    for path in filter(None, (options.log, options.car)):
        require_free(path, force=options.force)
    vehicle = read_vehicle(options)
    recording = sample_recording(vehicle, seed=seed_of(options))
    if options.log is not None:
        write_recording(recording, options.log)
        say(f"wrote {options.log}: {len(recording)} samples, {recording.duration:.1f} s")
    if options.car is not None:
        vehicle.to_toml(options.car, overwrite=options.force)
        say(f"wrote {options.car}: {vehicle.name}")
    if to is not None:
        car = shlex.quote(str(options.car or options.vehicle or "car.toml"))
        say(
            f"sending {recording.name} to {options.udp}, a JSON packet of "
            f"{', '.join(map(column_of, _SENT))} "
            f"each {recording.dt:g} s, until Ctrl-C; in another terminal: tireid live "
            f"udp://:{to[1]} --vehicle {car} --serve 127.0.0.1:8765"
        )
        try:
            with suppress(KeyboardInterrupt):
                _send(recording, to)
        except OSError as error:
            what = f"--udp {options.udp}: nothing can be sent there ({reason_of(error)})"
            raise ValueError(f"{what}; give another, as 127.0.0.1:9000") from None


def _send(recording: Recording, to: tuple[str, int]) -> None:
    """Send packets in their own time, for ever: t goes on rising from one drive to the next."""
    rows = np.stack([getattr(recording, name) for name in _SENT], axis=1).tolist()
    names = [column_of(name) for name in _SENT]
    whole, begun = recording.duration + _PAUSE, time.monotonic()
    with socket.socket(
        socket.AF_INET6 if ":" in to[0] else socket.AF_INET, socket.SOCK_DGRAM
    ) as out:
        for drive in count():
            for t, *values in rows:
                t += whole * drive
                time.sleep(max(begun + t - time.monotonic(), 0.0))
                packet = dict(zip(names, (round(t, 6), *values), strict=True))
                out.sendto(json.dumps(packet).encode(), to)
