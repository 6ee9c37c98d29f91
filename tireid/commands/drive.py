"""`tireid drive`: steer a car along a path on identified tires."""

import argparse
from typing import Any

from models.faults import KINDS
from mpc.path import BUILT_IN
from tireid.commands import COMMANDS
from tireid.commands import options as shared
from tireid.commands.drive_case import ALL, conditions_of, frozen_tires, labels_of
from tireid.driving import runs as driving
from tireid.driving.chosen import CHOSEN as DRIVING_CHOSEN
from tireid.driving.results import NO_FILM, Drives, headline, write_drive_report
from tireid.figures.film import FORMATS
from tireid.output import output_folder
from tireid.progress import say, tell

_NOT_COMPLETED = 1
_EPILOG = (
    "Without --weights, frozen tires are identified first: the same car drives on "
    f"an open field for {DRIVING_CHOSEN.duration:g} s, steered at random and ever harder until it "
    "slides, and the tires at the end are used. linear is the tire of the vehicle file, oracle the "
    "true tire of the plant, learning begins with the frozen tires and updates them while driving. "
    "Exit code 0 where the first of the cars reached the end of the path, else 1."
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
    given = {
        "--path NAME|FILE.csv": (
            "iso-3888-2",
            f"{', '.join(BUILT_IN)}, or way-points with the columns X_m, Y_m (%(default)s)",
        ),
        "--speed WHAT": (
            "90%",
            "share of the grip that the tightest bend takes, or a speed (17m/s, 60km/h); "
            "constant on an open path; a share on a closed one brakes for bends (%(default)s)",
        ),
    }
    shared.add_options(parser, str, given)
    text = "friction from arc length S [m] on, known to oracle only; may be repeated"
    parser.add_argument("--mu-drop", action="append", default=[], metavar="S:MU", help=text)
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
    numbers = {
        "--mu": (1.0, "friction of the road (%(default)s)"),
        "--delay MS": (
            20.0,
            "from a measurement until its command acts, a multiple of 10 ms (%(default)g)",
        ),
        "--caution SHARE": (
            0.0,
            "share of the tires' uncertainty that the tracker plans for: 0 none, 1 the least "
            "grip that the motion leaves possible (%(default)g)",
        ),
        "--laps N": (1.0, "of a closed path (%(default)g)"),
    }
    shared.add_options(parser, float, numbers)
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
    text = (
        f"a sensor that breaks on the path, times in s (v_y:biased:3:inf:0.5); kinds: "
        f"{', '.join(KINDS)}; may be repeated"
    )
    fault = "CHANNEL:KIND:START:DURATION[:SIZE]"
    parser.add_argument("--fault", action="append", default=[], metavar=fault, help=text)
    shared.add_seed(parser, "noise and learning")
    formats: dict[str, Any] = {"choices": (*FORMATS, NO_FILM), "default": FORMATS[0]}
    text = f"{', '.join(FORMATS)} or {NO_FILM} (%(default)s)"
    parser.add_argument("--film", metavar="NAME", help=text, **formats)
    shared.add_output(parser, "drive")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 0 where the first car reached the end of the path, else 1."""
    labels = labels_of(options.tires)
    conditions = conditions_of(options)
    setup = conditions.setup
    driving.require_compiler()
    with output_folder(options.out, force=options.force) as folder:
        say(headline(conditions))
        if driving.ORACLE in labels:
            setup.oracle()  # what cannot be is said before the car drives
        source, learnt = frozen_tires(options, labels, conditions)
        if learnt is not None:
            learnt.save(folder / "weights.json")
        drives = Drives.driven(conditions, labels, learnt, source)
        figures = drives.write(folder, options.film)
        film = None if options.film == NO_FILM else folder / f"drive.{options.film}"
        write_drive_report(folder, drives, figures, film, options.words)
        case, _, scores = drives.text().partition("\n")
    tell(f"{case}\ntires: {source}\n{scores}")
    say(f"wrote {options.out}/")
    return 0 if drives.runs[0].scores.completed else _NOT_COMPLETED
