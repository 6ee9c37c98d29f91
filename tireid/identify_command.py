"""`tireid identify LOG --vehicle FILE --out DIR`: learn the tires of a recording, freeze them."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from identifier.defaults import LAWS, default_design
from identifier.history import DivergedError, History
from identifier.identify import identify
from identifier.reproducibility import Replay, replay
from models.recordings import (
    Recording,
    check_against_vehicle,
    read_recording,
    split_log_argument,
)
from models.vehicle import Vehicle
from tireid.identify_results import write_results
from tireid.output import output_folder
from tireid.progress import Stopwatch, say


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
    parser.add_argument("--law", choices=LAWS, default="integral", help="default: %(default)s")
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
    parser.add_argument("--seed", type=int, default=0, help="seed of the initial weights")
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
    design = default_design(vehicle, law=options.law, seed=options.seed)
    recording = _read(options.log, options.run_name, vehicle, options)
    others = [_read(log, None, vehicle, options) for log in options.replay]
    _require_distinct([recording, *others])
    freeze_times = sorted(set(options.freeze or [float(recording.t[-1])]))
    _require_inside(freeze_times, recording)
    with output_folder(options.out, force=options.force) as folder:
        watch = Stopwatch()
        learnt = identify(recording, vehicle, design)
        say(f"learnt {options.law} over {recording.name} in {1e3 * watch.seconds:.1f} ms")
        if learnt.diverged_at is not None:
            raise DivergedError(
                f"{recording.name}: the {options.law} law diverged at {learnt.diverged_at:g} s"
            )
        histories = [learnt, *(identify(other, vehicle, design) for other in others)]
        frozen = {t: _replays(t, learnt, histories) for t in freeze_times}
        write_results(folder, options.law, learnt, histories[1:], frozen)
    print_table(learnt, frozen)
    say(f"wrote {options.out}/")


def _read(
    log: str, run_name: str | None, vehicle: Vehicle, options: argparse.Namespace
) -> Recording:
    path, named = split_log_argument(log)
    if named is not None and run_name is not None and named != run_name:
        raise ValueError(f"{log} names the run {named}, --run names {run_name}: name one of them")
    check = not options.no_check
    columns = _columns(options.columns)
    recording = read_recording(path, run=run_name or named, check=check, columns=columns)
    if check:
        check_against_vehicle(recording, vehicle)
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
    names = [recording.name for recording in recordings]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{name} is given twice: every recording needs a name of its own")


def _require_inside(freeze_times: list[float], recording: Recording) -> None:
    first, last = float(recording.t[0]), float(recording.t[-1])
    for t in freeze_times:
        if not first <= t <= last:
            lasts = f"{recording.name} lasts from {first:g} to {last:g} s"
            raise ValueError(f"--freeze {t:g} is outside the recording: {lasts}")


def _replays(t: float, learnt: History, histories: list[History]) -> dict[str, Replay]:
    model = learnt.freeze(t)
    return {history.recording.name: replay(model, history) for history in histories}


def print_table(learnt: History, frozen: dict[float, dict[str, Replay]]) -> None:
    """Print the errors per axle, and as a share of the force where there is truth.

    Parameters
    ----------
    learnt : the run that the weights come from.
    frozen : freeze time [s] to recording name to replay.
    """
    print(f"{'frozen at':>10}  {'replayed on':40} {'front':>16} {'rear':>16}")
    for t, replays in frozen.items():
        for name, result in replays.items():
            error = result.against_truth or result.against_online
            truth = result.recording.axle_force
            note = "" if truth is not None else "  (against online, no truth)"
            cells = []
            for i, newtons in enumerate((error.front, error.rear)):
                share = "" if truth is None else _share(newtons, truth[:, i])
                cells.append(f"{newtons:8.4g} N{share:>6}")
            print(f"{t:8g} s  {name:40} {cells[0]:>16} {cells[1]:>16}{note}")
    del learnt


def _share(newtons: float, force: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    rms = float(np.sqrt(np.mean(force**2)))
    return f" {100 * newtons / rms:.0f} %" if rms > 0.0 else ""
