"""`tireid paper`: Tables I and II and Figs. 2-5 of the paper, beside ours, with a third column."""

import argparse
from pathlib import Path
from typing import Any

from models.doors import require_few
from tireid.commands import COMMANDS
from tireid.output import output_folder
from tireid.paper_results import study_text, write_study
from tireid.paper_study import run_study
from tireid.progress import say, tell


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "paper",
        help=COMMANDS["paper"],
        description="Repeat the paper's step steer and slalom on the built-in plant with both laws "
        "and the control 'instantaneous at eta/lambda'; write tables and figures.",
    )
    parser.add_argument("--seeds", type=int, default=20, help="seeds of the weights (%(default)s)")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="folder to write")
    parser.add_argument("--force", action="store_true", help="replace the folder if it exists")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run the command.

    Parameters
    ----------
    options : parsed arguments.
    """
    if options.seeds < 1:
        raise ValueError(f"--seeds must be at least 1, it is {options.seeds}")
    require_few(ValueError, "--seeds", options.seeds, "runs", "runs")
    with output_folder(options.out, force=options.force) as folder:
        study = run_study(options.seeds, say)
        write_study(folder, study)
        told = study_text(study)
    tell(told)
    say(f"wrote {options.out}/")
