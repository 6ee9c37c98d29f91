"""`tireid drive --out DIR`: steer a car along a path, told of the tires that were learnt."""

import argparse
import math
import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from identifier.method import vehicle_numbers
from identifier.tire_model import TireModel
from models.faults import KINDS, SIZED, FaultError, SensorFault
from models.files import digest
from models.schema import require_few
from models.vehicle import Vehicle
from mpc.loop import CarSensors, FaultySensors
from mpc.path import BUILT_IN
from tireid.animation import FORMATS, require_ffmpeg
from tireid.commands import COMMANDS
from tireid.commands.drive_results import NO_FILM, drive_table, known_curves, write_drives
from tireid.commands.drive_runs import (
    FROZEN,
    LEARNING,
    LINEAR,
    ORACLE,
    PERIOD,
    PLANTS,
    TIRES,
    Conditions,
    SpeedWish,
    make_setup,
    named_path,
    run_drive,
)
from tireid.commands.drive_source import DURATION, frozen_tires
from tireid.commands.options import add_network_arguments
from tireid.output import output_folder
from tireid.progress import say, tell

PERCENT, METERS, KILOMETERS = "%", "m/s", "km/h"
# Words of `tireid drive` that are more than a name: how fast, and where the road is slippery.

PLAIN = 1.5  # a number without a unit up to here is a share of the grip


def parse_speed(text: str) -> SpeedWish:
    """Return what --speed says.

    Parameters
    ----------
    text : 90% or 0.9 of the grip, 17m/s or 60km/h.

    Raises
    ------
    ValueError
        Where it is none of these, or not a speed for a car.
    """
    found = re.fullmatch(r"\s*([-+.\deE]+?)\s*(%|m/s|km/h)?\s*", text)
    try:
        value = float(found[1]) if found else math.nan
    except ValueError:
        value = math.nan
    unit = found[2] if found else None
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"--speed wants a share of the grip or a speed (90%, 17m/s), not {text!r}")
    if unit is None and value > PLAIN:
        raise ValueError(f"--speed {text} has no unit: write {text}%, {text}m/s or {text}km/h")
    if unit in (METERS, KILOMETERS):
        speed = value / (3.6 if unit == KILOMETERS else 1.0)
        if not 3.0 <= speed <= 100.0:
            raise ValueError(f"--speed must be 3 to 100 m/s, it is {speed:.3g} m/s")
        return SpeedWish(None, speed)
    share = value / (100.0 if unit == PERCENT else 1.0)
    if not 0.05 <= share <= PLAIN:
        raise ValueError(f"--speed must be 5 to 150 % of the grip, it is {100.0 * share:.3g} %")
    return SpeedWish(share, None)


def parse_drop(text: str) -> tuple[float, float]:
    """Return the place [m] and the friction from there on [-] of --mu-drop S:MU.

    Parameters
    ----------
    text : such as 60:0.5.

    Raises
    ------
    ValueError
        Where it is not such a pair, or the numbers are not those of a road.
    """
    place, colon, friction = text.partition(":")
    try:
        s, mu = float(place), float(friction)
    except ValueError:
        s = mu = math.nan
    if not colon or math.isnan(s) or math.isnan(mu):
        raise ValueError(f"--mu-drop wants S:MU, arc length [m] and friction, not {text!r}")
    if not (math.isfinite(s) and s >= 0.0):
        raise ValueError(f"--mu-drop: the place must not be negative, it is {s:g} m")
    return s, require_friction("--mu-drop", mu)


def parse_fault(text: str) -> SensorFault:
    """Return what --fault says of a sensor.

    Parameters
    ----------
    text : CHANNEL:KIND:START:DURATION[:SIZE], such as v_y:biased:3:inf:0.5.

    Raises
    ------
    ValueError
        Where it is not of that form, or not a fault that a sensor of the loop can have.
    """
    words = text.split(":")
    try:
        channel, kind, *numbers = words
        start, duration, *size = map(float, numbers)
        (most,) = size or [0.0]
    except ValueError:
        raise ValueError(
            f"--fault wants CHANNEL:KIND:START:DURATION[:SIZE], times in s, not {text!r}"
        ) from None
    try:
        fault = SensorFault(channel=channel, kind=kind, start=start, duration=duration, size=most)
        FaultySensors(CarSensors(), [fault])  # refuses what is no channel
    except FaultError as error:
        raise ValueError(f"--fault {text}: {error}") from None
    if kind in SIZED and not size:
        raise ValueError(f"--fault {text}: {kind} needs a size")
    return fault


def require_friction(word: str, mu: float) -> float:
    """Return a friction over that of the tire's measurement, if a road can have it.

    Parameters
    ----------
    word : that it was given by.
    mu : the friction [-].

    Raises
    ------
    ValueError
        Where no road has it.
    """
    if not 0.05 <= mu <= 1.5:
        raise ValueError(f"{word}: friction must be 0.05 to 1.5, it is {mu:g}")
    return mu


# The words of `tireid drive` made into a case, and a case told in words and numbers.

ALL = "all"
LONGEST_DELAY = 100.0  # ms


def labels_of(words: Sequence[str]) -> list[str]:
    """Return the tires in order, each once; all begins with the frozen ones.

    Parameters
    ----------
    words : names of tires, or all.
    """
    wanted = [FROZEN, LINEAR, ORACLE, LEARNING] if ALL in words else list(words)
    return list(dict.fromkeys(wanted))


def conditions_of(options: argparse.Namespace) -> Conditions:
    """Return what is to be driven.

    Parameters
    ----------
    options : parsed arguments.

    Raises
    ------
    ValueError
        Where a word or a file is not right.
    """
    if options.seed < 0:
        raise ValueError(f"--seed must not be negative, it is {options.seed}")
    if not 0.0 < options.laps <= 100.0:
        raise ValueError(f"--laps must be positive and at most 100, it is {options.laps:g}")
    path = named_path(options.path)
    if options.laps != 1.0 and not path.closed:
        raise ValueError(f"--laps is for a closed path, {path.name} is not")
    _require_one_source(options)
    setup = make_setup(
        path,
        vehicle=options.vehicle,
        plant=options.plant,
        mu=require_friction("--mu", options.mu),
        drops=[parse_drop(text) for text in options.mu_drop],
        wish=parse_speed(options.speed),
    )
    hours = options.laps * setup.time_at(setup.path.s[-2]) / 3600.0
    require_few(ValueError, f"--path {path.name}", hours, "hours", "hours of driving")
    return Conditions(
        setup=setup,
        delay=_periods(options.delay),
        noise=options.noise,
        seed=options.seed,
        laps=options.laps,
        faults=tuple(parse_fault(text) for text in options.fault),
    )


def _periods(delay: float) -> int:
    periods = delay / (1e3 * PERIOD)
    if not (0.0 <= delay <= LONGEST_DELAY and abs(periods - round(periods)) < 1e-9):
        raise ValueError(
            f"--delay must be 0 to {LONGEST_DELAY:g} ms in steps of {1e3 * PERIOD:g} ms, it is "
            f"{delay:g}"
        )
    return round(periods)


def _require_one_source(options: argparse.Namespace) -> None:
    given = [name for name in ("weights", "network", "paper") if getattr(options, name)]
    if len(given) > 1:
        raise ValueError(f"give only one of {', '.join('--' + name for name in given)}")


def headline(conditions: Conditions) -> str:
    """Return a case in one line.

    Parameters
    ----------
    conditions : of the drives.
    """
    setup = conditions.setup
    v = setup.speeds()
    speed = f"{v.min():.1f} m/s" if np.ptp(v) < 0.05 else f"{v.min():.1f} to {v.max():.1f} m/s"
    wish = setup.wish.share
    share = "" if wish is None else f", {100.0 * wish:.0f} % of a grip of {setup.grip:.1f} m/s²"
    drops = "".join(f", {mu:g} from {s:g} m on" for s, mu in setup.drops)
    noise = "sensor noise" if conditions.noise else "no noise"
    noise += "".join(f", {fault}" for fault in conditions.faults)
    return (
        f"{setup.path.name} at {speed}{share}; friction {setup.mu:g}{drops}; "
        f"{setup.plant} {setup.vehicle.name}, {1e3 * PERIOD * conditions.delay:g} ms delay, "
        f"{noise}, seed {conditions.seed}"
    )


def inputs_of(
    conditions: Conditions, labels: Sequence[str], source: str, learnt: TireModel | None
) -> dict[str, Any]:
    """Return all that goes into drives, ready for JSON.

    Parameters
    ----------
    conditions : of the drives.
    labels : what the trackers are told.
    source : where the frozen tires come from.
    learnt : the frozen tires.
    """
    setup = conditions.setup
    v = setup.speeds()
    return {
        "path": setup.path.name,
        "path_hash": digest([setup.path.X.tolist(), setup.path.Y.tolist()]),
        "length_m": setup.path.length,
        "closed": setup.path.closed,
        "laps": conditions.laps,
        "speed": {"share": setup.wish.share, "m_s": setup.wish.speed},
        "speed_m_s": {"min": float(v.min()), "max": float(v.max())},
        "grip_m_s2": setup.grip,
        "mu": setup.mu,
        "mu_drops": [{"s_m": s, "mu": mu} for s, mu in setup.drops],
        "tires": list(labels),
        "frozen": source,
        "weights_hash": None if learnt is None else digest(learnt.to_dict()),
        "plant": setup.plant,
        "vehicle": vehicle_numbers(setup.vehicle),
        "chassis": _chassis(setup.vehicle),
        "delay_ms": 1e3 * PERIOD * conditions.delay,
        "period_ms": 1e3 * PERIOD,
        "noise": conditions.noise,
        "faults": [_finite(asdict(fault)) for fault in conditions.faults],
        "seed": conditions.seed,
    }


def _finite(numbers: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers with null for what has no end, which JSON cannot say."""
    return {key: None if value == math.inf else value for key, value in numbers.items()}


def _chassis(vehicle: Vehicle) -> dict[str, Any]:
    """Return the chassis, with a hash in place of the file of its tire."""
    chassis = vehicle.require_chassis()
    tire = None if chassis.tire is None else digest(Path(chassis.tire).read_text(errors="replace"))
    return {**asdict(chassis), "tire": tire}


NOT_COMPLETED = 1
EPILOG = (
    "Without --weights or --network, frozen tires are learnt first: the same car drives on an "
    f"open field for {DURATION:g} s, steered at random and ever harder until it slides, and what "
    "the identifier knows at the end steers. linear is the tire of the vehicle file, oracle the "
    "true tire of the plant, learning begins with what is frozen and goes on learning while it "
    "drives. "
    "Exit code 0 where the first of the cars reached the end of the path, else 1."
)


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "drive",
        help=COMMANDS["drive"],
        description="Learn the tires on one drive, freeze them, and let a model predictive tracker "
        "that is told of them steer the car along a path; write summary.json, every signal as "
        "CSV, figures and a film.",
        epilog=EPILOG,
    )
    parser.add_argument(
        "--path",
        default="iso-3888-2",
        metavar="NAME|FILE.csv",
        help=f"{', '.join(BUILT_IN)}, or way-points with the columns X_m, Y_m (%(default)s)",
    )
    parser.add_argument(
        "--speed",
        default="90%",
        metavar="WHAT",
        help="share of the grip that the tightest bend takes (90%%), or a speed (17m/s, 60km/h); "
        "constant on an open path; a share on a closed one brakes for bends (%(default)s)",
    )
    parser.add_argument("--mu", type=float, default=1.0, help="friction of the road (%(default)s)")
    parser.add_argument(
        "--mu-drop",
        action="append",
        default=[],
        metavar="S:MU",
        help="friction from arc length S [m] on, known to nobody but oracle; may be repeated",
    )
    parser.add_argument(
        "--tires",
        nargs="+",
        choices=(*TIRES, ALL),
        default=[FROZEN],
        metavar="NAME",
        help=f"what the tracker is told: {', '.join(TIRES)}, or {ALL}; the first leads ({FROZEN})",
    )
    parser.add_argument("--weights", type=Path, metavar="FILE", help="frozen model, as identified")
    parser.add_argument(
        "--paper", action="store_true", help="learn with the paper's network and law instead"
    )
    parser.add_argument("--vehicle", type=Path, metavar="FILE", help="car as TOML (the sedan)")
    parser.add_argument(
        "--plant",
        choices=PLANTS,
        default=PLANTS[0],
        metavar="NAME",
        help=f"what is driven: {', '.join(PLANTS)}; the last two need the extra commonroad "
        "(%(default)s)",
    )
    parser.add_argument(
        "--delay",
        type=float,
        default=20.0,
        metavar="MS",
        help="from a measurement until its command acts, a multiple of 10 ms (%(default)g)",
    )
    parser.add_argument(
        "--noise",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="of the sensors (on)",
    )
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="CHANNEL:KIND:START:DURATION[:SIZE]",
        help=f"a sensor that breaks on the path, times in s (v_y:biased:3:inf:0.5); kinds: "
        f"{', '.join(KINDS)}; may be repeated",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of noise and learning")
    parser.add_argument(
        "--laps", type=float, default=1.0, metavar="N", help="of a closed path (%(default)g)"
    )
    parser.add_argument(
        "--film",
        choices=(*FORMATS, NO_FILM),
        default=FORMATS[0],
        metavar="NAME",
        help=f"{', '.join(FORMATS)} (by ffmpeg) or {NO_FILM} (%(default)s)",
    )
    add_network_arguments(parser, "steer on this frozen network")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="folder to write")
    parser.add_argument("--force", action="store_true", help="replace the folder if it exists")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 0 where the first car reached the end of the path, else 1.

    Parameters
    ----------
    options : parsed arguments.
    """
    labels = labels_of(options.tires)
    conditions = conditions_of(options)
    setup = conditions.setup
    if options.film == "mp4":
        require_ffmpeg()
    with output_folder(options.out, force=options.force) as folder:
        say(headline(conditions))
        if ORACLE in labels:
            setup.oracle()  # what cannot be is said before the car drives
        source, learnt = frozen_tires(options, labels, conditions)
        if learnt is not None:
            learnt.save(folder / "weights.json")
        runs = [run_drive(label, conditions, learnt) for label in labels]
        inputs = inputs_of(conditions, labels, source, learnt)
        write_drives(
            folder,
            runs,
            known_curves(runs, setup, learnt),
            inputs=inputs,
            drops=setup.drops,
            film=options.film,
        )
        told = f"{headline(conditions)}\ntires: {source}\n{drive_table(runs)}"
    tell(told)
    say(f"wrote {options.out}/")
    return 0 if runs[0].scores.completed else NOT_COMPLETED
