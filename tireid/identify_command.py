"""`tireid identify LOG --vehicle FILE --out DIR`: learn the tires of a recording, freeze them."""

import argparse
from itertools import pairwise
from pathlib import Path
from typing import Any

from identifier.defaults import LAWS, default_design
from identifier.design import Design
from identifier.design_file import read_design
from identifier.history import DivergedError, History
from identifier.identify import identify
from identifier.reproducibility import (
    AxleRmse,
    Replay,
    counted_samples,
    force_rms,
    freeze_key,
    replay,
)
from models.recordings import (
    Recording,
    check_against_vehicle,
    read_recording,
    split_log_argument,
)
from models.vehicle import Vehicle
from tireid.certificate_table import certificate_of, verdict_line
from tireid.identify_results import file_name, write_results
from tireid.output import output_folder
from tireid.progress import say


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "identify",
        help="learn tire forces from a recording, freeze the weights and test them",
        description="Learn axle forces over LOG sample by sample, freeze the weights, replay LOG "
        "and other recordings; write summary.json, weights.json, curves as CSV and figures.",
        epilog="LOG is CSV, CSV.gz or Parquet with the columns t [s], vx, vy [m/s], r [rad/s], "
        "delta_f [rad] and, where known, delta_r [rad], ay [m/s2], Fyf, Fyr [N] (or Fyf_inv, "
        "Fyr_inv: forces computed backwards from the motion), run; "
        "x forward, y left, delta and r positive to the left.",
    )
    parser.add_argument("log", metavar="LOG", help="recording; LOG:RUN names one of its runs")
    parser.add_argument("--vehicle", required=True, type=Path, metavar="FILE", help="car as TOML")
    parser.add_argument("--run", dest="run_name", metavar="NAME", help="run of LOG")
    parser.add_argument("--law", choices=LAWS, help="law of the default design (integral)")
    parser.add_argument(
        "--design", type=Path, metavar="FILE", help="design.toml, in place of the default design"
    )
    parser.add_argument(
        "--freeze", nargs="+", type=float, metavar="T", help="freeze at these times [s] (the end)"
    )
    parser.add_argument(
        "--replay", nargs="+", default=[], metavar="LOG[:RUN]", help="recordings to predict"
    )
    parser.add_argument(
        "--columns",
        nargs="+",
        default=[],
        metavar="NAME=COLUMN",
        help="read column COLUMN of the logs as NAME, for example r=yaw_rate",
    )
    parser.add_argument(
        "--no-check", action="store_true", help="accept a log that contradicts physics"
    )
    parser.add_argument("--seed", type=int, metavar="N", help="of the initial weights (0)")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="folder to write")
    parser.add_argument("--force", action="store_true", help="replace the folder if it exists")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run the command.

    Parameters
    ----------
    options : parsed arguments.
    """
    vehicle = Vehicle.from_toml(options.vehicle)
    law, design = _design(options, vehicle)
    recording = _read(options.log, options.run_name, vehicle, design, options)
    others = [_read(log, None, vehicle, design, options) for log in options.replay]
    _require_distinct([recording, *others])
    freeze_times = sorted(set(options.freeze or [float(recording.t[-1])]))
    _require_inside(freeze_times, recording)
    with output_folder(options.out, force=options.force) as folder:
        histories = [_learn(one, vehicle, law, design) for one in (recording, *others)]
        learnt = histories[0]
        frozen = {t: _replays(t, learnt, histories) for t in freeze_times}
        write_results(folder, law, learnt, histories[1:], frozen)
    print_table(histories, frozen)
    print(verdict_line(certificate_of(design, vehicle)))
    say(f"wrote {options.out}/")


def _design(options: argparse.Namespace, vehicle: Vehicle) -> tuple[str, Design]:
    """Return the name of the law and the design."""
    if options.design is None:
        law = options.law or "integral"
        return law, default_design(vehicle, law=law, seed=options.seed or 0)
    for name in ("law", "seed"):
        if getattr(options, name) is not None:
            raise ValueError(f"--{name} is for the default design: it stands in {options.design}")
    design = read_design(options.design)
    return design.law, design


def _learn(recording: Recording, vehicle: Vehicle, law: str, design: Design) -> History:
    history = identify(recording, vehicle, design)
    if history.diverged_at is not None:
        at = freeze_key(history.diverged_at)
        raise DivergedError(f"{recording.name}: the {law} law diverged at {at} s")
    say(f"learnt {law} over {recording.name}")
    return history


def _read(
    log: str, run_name: str | None, vehicle: Vehicle, design: Design, options: argparse.Namespace
) -> Recording:
    path, named = split_log_argument(log)
    if named is not None and run_name is not None and named != run_name:
        raise ValueError(f"{log} names the run {named}, --run names {run_name}: name one of them")
    check = not options.no_check
    columns = _columns(options.columns)
    recording = read_recording(
        path, run=run_name or named, dt=design.dt, check=check, columns=columns
    )
    if check:
        check_against_vehicle(recording, vehicle)
    counted_samples(recording, design.min_speed)  # refuses a car that never drives
    say(f"read {recording.name}: {recording.t.size} samples, {recording.duration:.1f} s")
    return recording


def _columns(pairs: list[str]) -> dict[str, str]:
    columns = {}
    for pair in pairs:
        name, equals, column = pair.partition("=")
        if not (name and equals and column):
            raise ValueError(f"--columns wants NAME=COLUMN, not {pair!r}")
        columns[name] = column
    return columns


def _require_distinct(recordings: list[Recording]) -> None:
    files = [file_name(recording) for recording in recordings]
    for recording, name in zip(recordings, files, strict=True):
        if files.count(name) > 1:
            raise ValueError(
                f"{recording.name} is given twice, or its files would be named as those of another "
                f"recording, {name}: every recording needs a name of its own"
            )


def _require_inside(freeze_times: list[float], recording: Recording) -> None:
    first, last = float(recording.t[0]), float(recording.t[-1])
    for t in freeze_times:
        if not first <= t <= last:
            lasts = f"{recording.name} lasts from {freeze_key(first)} to {freeze_key(last)} s"
            raise ValueError(f"--freeze {freeze_key(t)} is outside the recording: {lasts}")
    for earlier, later in pairwise(map(freeze_key, freeze_times)):
        if earlier == later:
            raise ValueError(f"--freeze {later} is given twice: the times differ too little")


def _replays(t: float, learnt: History, histories: list[History]) -> dict[str, Replay]:
    model = learnt.freeze(t)
    return {history.recording.name: replay(model, history) for history in histories}


def print_table(histories: list[History], frozen: dict[float, dict[str, Replay]]) -> None:
    """Print the errors per axle, and as a share of the force where there is truth.

    Parameters
    ----------
    histories : the online runs over all recordings.
    frozen : freeze time [s] to recording name to replay.
    """
    sizes = {history.recording.name: force_rms(history) for history in histories}
    print(f"{'frozen at':>10}  {'replayed on':40} {'front':>16} {'rear':>16}")
    for t, replays in frozen.items():
        for name, result in replays.items():
            error = result.against_truth or result.against_online
            note = "" if sizes[name] is not None else "  (against online, no truth)"
            front, rear = _cells(error, sizes[name])
            print(f"{freeze_key(t):>8} s  {name:40} {front:>16} {rear:>16}{note}")


def _cells(error: AxleRmse, size: AxleRmse | None) -> tuple[str, str]:
    """Return front and rear error, with their share of the rms force where it is known."""
    forces = (0.0, 0.0) if size is None else (size.front, size.rear)
    front, rear = (
        f"{newtons:8.4g} N{f' {100 * newtons / force:.0f} %' if force > 0.0 else '':>6}"
        for newtons, force in zip((error.front, error.rear), forces, strict=True)
    )
    return front, rear
