"""`tireid drive`: steer a car along a path, told of the tires that were learnt."""

import argparse
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from identifier.frozen import vehicle_numbers
from identifier.tire_model import TireModel
from models.faults import KINDS
from models.files import digest
from models.vehicle import Vehicle
from mpc.path import BUILT_IN
from tireid.animation import FORMATS, SHOWN, require_ffmpeg
from tireid.commands import COMMANDS
from tireid.commands import options as shared
from tireid.commands.drive_case import ALL, conditions_of, frozen_tires, labels_of
from tireid.commands.drive_results import NO_FILM, drive_lines, known_curves, write_drives
from tireid.driving import runs as driving
from tireid.driving.learn import DURATION
from tireid.driving.setup import PERIOD, PLANT
from tireid.output import output_folder
from tireid.progress import say, tell
from tireid.reports.drive import write_drive_report


def headline(conditions: driving.Conditions) -> str:
    """Return a case in one line."""
    setup = conditions.setup
    v = setup.speeds()
    speed = f"{v.min():.1f} m/s" if np.ptp(v) < 0.05 else f"{v.min():.1f} to {v.max():.1f} m/s"
    wish = setup.wish.share
    share = "" if wish is None else f", {100.0 * wish:.0f} % of a grip of {setup.grip:.1f} m/s²"
    drops = "".join(f", {mu:g} from {s:g} m on" for s, mu in setup.drops)
    noise = "sensor noise" if conditions.noise else "no noise"
    noise += f", caution {conditions.caution:g}" if conditions.caution > 0.0 else ""
    noise += ", no v_y" if conditions.kind == driving.IMU else ""
    noise += f", weave of {conditions.dither:g} m" if conditions.dither > 0.0 else ""
    noise += "".join(f", {fault}" for fault in conditions.faults)
    return (
        f"{setup.path.name} at {speed}{share}; friction {setup.mu:g}{drops}; "
        f"{PLANT} {setup.vehicle.name}, {1e3 * PERIOD * conditions.delay:g} ms delay, "
        f"{noise}, seed {conditions.seed}"
    )


def inputs_of(
    conditions: driving.Conditions, labels: Sequence[str], source: str, learnt: TireModel | None
) -> dict[str, Any]:
    """Return all that goes into drives, ready for JSON."""
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
        "plant": PLANT,
        "vehicle": vehicle_numbers(setup.vehicle),
        "chassis": _chassis(setup.vehicle),
        "delay_ms": 1e3 * PERIOD * conditions.delay,
        "period_ms": 1e3 * PERIOD,
        "noise": conditions.noise,
        **({"sensors": conditions.kind} if conditions.kind != driving.FULL else {}),
        **({"dither_m": conditions.dither} if conditions.dither > 0.0 else {}),
        **({"caution": conditions.caution} if conditions.caution > 0.0 else {}),
        "faults": [_finite(asdict(fault)) for fault in conditions.faults],
        "seed": conditions.seed,
    }


def _finite(numbers: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers with null for what has no end, which JSON cannot say."""
    return {key: None if value == math.inf else value for key, value in numbers.items()}


def _chassis(vehicle: Vehicle) -> dict[str, Any]:
    """Return the chassis, with a hash in place of the file of its tire."""
    chassis = vehicle.require_chassis()
    tire = (
        None
        if chassis.tire is None
        else digest(Path(chassis.tire).read_text(errors="replace", encoding="utf-8"))
    )
    return {**asdict(chassis), "tire": tire}


_NOT_COMPLETED = 1
_EPILOG = (
    "Without --weights or --network, frozen tires are identified first: the same car drives on "
    f"an open field for {DURATION:g} s, steered at random and ever harder until it slides, and "
    "the tires at the end are used. linear is the tire of the vehicle file, oracle the true tire "
    "of the plant, learning begins with the frozen tires and updates them while driving. Exit "
    "code 0 where the first of the cars reached the end of the path, else 1."
)


def add_parser(commands: Any) -> None:
    parser = commands.add_parser(
        "drive",
        help=COMMANDS["drive"],
        description="Learn the tires on one drive, freeze them, and let a model predictive "
        "tracker with them steer the car along a path; write report.html, summary.json, every "
        "signal as CSV, figures and a film.",
        epilog=_EPILOG,
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
        help="friction from arc length S [m] on, known to oracle only; may be repeated",
    )
    parser.add_argument(
        "--tires",
        nargs="+",
        choices=(*driving.TIRES, ALL),
        default=[driving.FROZEN],
        metavar="NAME",
        help=f"tires that the tracker plans with: {', '.join(driving.TIRES)}, or {ALL}; "
        f"the first leads ({driving.FROZEN})",
    )
    shared.add_weights(parser, "the frozen tires, as identified")
    shared.add_method(parser)
    shared.add_vehicle(parser)
    parser.add_argument(
        "--delay",
        type=float,
        default=20.0,
        metavar="MS",
        help="from a measurement until its command acts, a multiple of 10 ms (%(default)g)",
    )
    parser.add_argument(
        "--noise", action=argparse.BooleanOptionalAction, default=True, help="of the sensors (on)"
    )
    parser.add_argument(
        "--sensors",
        choices=driving.SENSORS,
        default=driving.FULL,
        metavar="NAME",
        help="full: v_y is measured; imu: yaw rate and a_y of an inertial unit on the body (0.003 "
        "rad/s and 0.1 m/s² of noise, biases of 0.001 and 0.05), wheel speed (0.03 m/s), steering, "
        "position (2 cm) and heading (0.1 degrees) of a localization, and no v_y: an identifier "
        "estimates it while driving (%(default)s)",
    )
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="CHANNEL:KIND:START:DURATION[:SIZE]",
        help=f"a sensor that breaks on the path, times in s (v_y:biased:3:inf:0.5); kinds: "
        f"{', '.join(KINDS)}; may be repeated",
    )
    parser.add_argument(
        "--dither",
        type=float,
        default=0.0,
        metavar="M",
        help="largest weave about the path, for excitation; with learning tires it fades as "
        "their uncertainty falls (%(default)g: off)",
    )
    parser.add_argument(
        "--caution",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="share of the tires' uncertainty that the tracker plans for: 0 none, 1 the least "
        "grip that the motion leaves possible (%(default)g)",
    )
    shared.add_seed(parser, "noise and learning")
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
    shared.add_network_arguments(parser, "steer on this frozen network")
    shared.add_output(parser, "drive")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 0 where the first car reached the end of the path, else 1."""
    labels = labels_of(options.tires)
    conditions = conditions_of(options)
    setup = conditions.setup
    if options.film == "mp4":
        require_ffmpeg()
    driving.require_compiler()
    with output_folder(options.out, force=options.force) as folder:
        say(headline(conditions))
        if driving.ORACLE in labels:
            setup.oracle()  # what cannot be is said before the car drives
        source, learnt = frozen_tires(options, labels, conditions)
        if learnt is not None:
            learnt.save(folder / "weights.json")
        runs = [driving.run_drive(label, conditions, learnt) for label in labels]
        inputs = inputs_of(conditions, labels, source, learnt)
        figures = write_drives(
            folder,
            runs,
            known_curves(runs, setup, learnt),
            inputs=inputs,
            drops=setup.drops,
            film=options.film,
            faults=conditions.faults,
        )
        write_drive_report(
            folder,
            runs,
            inputs,
            figures,
            headline=headline(conditions),
            film=folder / f"drive.{options.film}" if options.film in SHOWN else None,
            command=options.words,
        )
        told = f"{headline(conditions)}\ntires: {source}\n{drive_lines(runs)}"
    tell(told)
    say(f"wrote {options.out}/")
    return 0 if runs[0].scores.completed else _NOT_COMPLETED
