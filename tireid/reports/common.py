"""What every report.html shares: how to read a figure, and what is needed to compute it again.

The order is always: headline numbers, what speaks against them, what was found with its figures and
how to read each, and where it came from.
"""

import platform
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path

from codegen.arrays import LONG, blocks
from identifier.frozen import vehicle_numbers
from models.files import digest, digest_of_bytes
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid import __version__
from tireid.report import Images, Picture, Section, Table

with Path(__file__).with_name("read.toml").open("rb") as file:
    READ: dict[str, str] = tomllib.load(file)  # how to read each figure, in one line


def drawings(figures: Images, captions: Mapping[str, str]) -> list[Picture]:
    """Return the figures that there are of some, by their captions."""
    return [
        Picture(figures[name], text, READ[name])
        for name, text in captions.items()
        if name in figures
    ]


def _recording_digest(recording: Recording) -> str:
    """Return twelve characters that stand for the signals of a recording and its true forces.

    Of more than `LONG` samples bytes are counted, of fewer their decimals.
    """
    names = ("t", "v_x", "logged_v_y", "r", "delta_f", "delta_r", "a_y", "axle_force")
    signals = [getattr(recording, name) for name in names]
    parts = [part for part in signals if part is not None]
    if len(recording) <= LONG:
        return digest([part.tolist() for part in parts])
    return digest_of_bytes(
        signal[part].astype("<f8").tobytes() for signal in parts for part in blocks(len(signal))
    )


def origin(
    command: str, vehicle: Vehicle, recordings: Iterable[Recording], **others: str
) -> Section:
    """Return what is needed to compute a report again."""
    given = list(recordings)
    rows = [
        ["command", command],
        ["tireid", __version__],
        ["Python, machine", f"{platform.python_version()}, {platform.system()} on "
         f"{platform.machine()}"],
        ["car", f"{vehicle.name}, hash {digest(vehicle_numbers(vehicle))}"],
        *(
            [
                "recording",
                f"{one.name}: {len(one)} samples, {one.duration:.4g} s, hash "
                f"{_recording_digest(one)}",
            ]
            for one in given
        ),
        *(["how it was read", f"{one.name}: {note}"] for one in given for note in one.notes),
        *([name.replace("_", " "), value] for name, value in others.items()),
    ]  # fmt: skip
    table = Table(
        "What went in; equal hashes are equal numbers.",
        ["what", "value"],
        rows,
        verbatim=True,
    )
    return Section("To compute it again", [table])
