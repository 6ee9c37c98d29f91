"""`tireid drive --out DIR`: steer a car along a path, told of the tires that were learnt."""

import argparse
from pathlib import Path
from typing import Any

from models.faults import KINDS
from mpc.path import BUILT_IN
from tireid.animation import FORMATS, require_ffmpeg
from tireid.commands import COMMANDS
from tireid.drive_case import ALL, conditions_of, headline, inputs_of, labels_of
from tireid.drive_learn import DURATION
from tireid.drive_results import NO_FILM, write_drives
from tireid.drive_runs import FROZEN, ORACLE, TIRES, run_drive
from tireid.drive_setup import PLANTS
from tireid.drive_source import frozen_tires
from tireid.drive_table import drive_table
from tireid.drive_tires import known_curves
from tireid.network_option import add_network_arguments
from tireid.output import output_folder
from tireid.progress import say, tell

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
