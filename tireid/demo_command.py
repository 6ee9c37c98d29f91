"""`tireid demo`: the whole story on the built-in car, in a minute, with a report."""

import argparse
from pathlib import Path
from typing import Any

from identifier.defaults import natural_operation
from tireid.certificate_table import certificate_text
from tireid.check_figures import draw_check
from tireid.commands import COMMANDS
from tireid.demo_drive import drive_section, drive_story, drive_text
from tireid.demo_package import FOLDER, ship, shipped_text
from tireid.demo_report import demo_sections
from tireid.demo_story import run_story
from tireid.identify_results import write_results
from tireid.output import output_folder
from tireid.paper_results import write_study
from tireid.paper_study import run_study
from tireid.paper_tables import table_text
from tireid.progress import Stopwatch, say, tell
from tireid.report import write_report

TITLE = "tireid: lateral tire forces, learnt while driving"
SUMMARY = (
    "A car drives, its tire forces are learnt from v_x, v_y, yaw rate and steering, the weights "
    "are frozen, and the frozen model is asked about drives that it has not seen; at the end it "
    "steers."
)
SEEDS = 20


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "demo",
        help=COMMANDS["demo"],
        description="Drive the built-in sedan, learn its tires, freeze them, test them on another "
        "maneuver, export them as a C package that is compiled and tested, repeat the paper's "
        "tables, and steer the car along a path on what it learnt; leaves one report.html to read.",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("tireid-demo"), metavar="DIR", help="default: %(default)s"
    )
    parser.add_argument("--force", action="store_true", help="replace the folder if it exists")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run the command.

    Parameters
    ----------
    options : parsed arguments.
    """
    watch = Stopwatch()
    with output_folder(options.out, force=options.force) as folder:
        say("1/5 driving the sedan, learning, freezing, predicting")
        story = run_story()
        folders = {name: folder / name for name in ("identify", "paper_network", "paper")}
        for one in folders.values():
            one.mkdir()
        for name, part in (("identify", story.default), ("paper_network", story.paper)):
            write_results(folders[name], part.law, part.learnt, part.others, part.frozen)
        operation, drive = natural_operation(story.design, story.car), story.paper.learnt.recording
        draw_check(
            folders["paper_network"], drive, story.car, story.design, operation, story.certificate
        )
        say("2/5 exporting what was learnt as C, compiling and testing it")
        shipped = ship(story, folder / FOLDER)
        say("3/5 the frozen-weight test of the paper")
        study = run_study(SEEDS, say)
        write_study(folders["paper"], study)
        say("4/5 driving on what was learnt")
        driven = drive_story(story, folder)
        say("5/5 writing the report")
        sections = demo_sections(story, shipped, study, folder)
        sections.append(drive_section(driven, folder))
        write_report(folder / "report.html", TITLE, sections, summary=SUMMARY)
        told = [
            *(table_text(maneuver, study) for maneuver in study.errors),
            f"{certificate_text(story.certificate, story.design.force_unit)}\n",
            f"{story.text()}\n",
            f"{shipped_text(shipped)}\n",
            drive_text(driven),
        ]
    tell("\n".join(told))
    tell(f"read {options.out / 'report.html'}  ({watch.seconds:.0f} s)")
