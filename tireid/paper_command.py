"""`tireid paper`: Tables I and II and Figs. 2-5 of the paper, beside ours, with a third column."""

import argparse
from pathlib import Path
from typing import Any

from tireid.figures import comparison_figure, force_figure, save_figure
from tireid.output import output_folder, write_json
from tireid.paper_study import GAINS, LAWS, NETWORK, ONSETS, Study, run_study
from tireid.paper_tables import settings, table_text
from tireid.paper_values import PAPER
from tireid.progress import say

FIGURES = {  # number of the paper's figure, by maneuver and law
    ("step_steer", "instantaneous"): "fig2",
    ("step_steer", "integral"): "fig3",
    ("slalom", "instantaneous"): "fig4",
    ("slalom", "integral"): "fig5",
}


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "paper",
        help="Tables I and II of the paper, beside ours, over many seeds",
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
    with output_folder(options.out, force=options.force) as folder:
        study = run_study(options.seeds, say)
        write_study(folder, study)
    for maneuver in study.errors:
        print(table_text(maneuver, study))
    print(settings(GAINS, NETWORK))
    say(f"wrote {options.out}/")


def write_study(folder: Path, study: Study) -> None:
    """Write tables.json, tables.txt and the figures of a study.

    Parameters
    ----------
    folder : where to.
    study : its errors over all seeds.
    """
    tables = study.tables()
    write_json(folder / "tables.json", tables)
    text = [table_text(maneuver, study) for maneuver in tables]
    (folder / "tables.txt").write_text("\n".join([*text, settings(GAINS, NETWORK)]) + "\n")
    say("drawing figures")
    for maneuver, by_law in tables.items():
        results = {
            law: {name: (q["median"], q["q25"], q["q75"]) for name, q in columns.items()}
            for law, columns in by_law.items()
        }
        save_figure(comparison_figure(results, PAPER[maneuver]), folder / f"{maneuver}_errors.png")
        window = (ONSETS[maneuver] - 1.0, float(study.recordings[maneuver].t[-1]))
        for law in LAWS:
            trial = study.typical(maneuver, law)
            label = FIGURES.get((maneuver, law), "control")
            figure = force_figure(trial.history, trial.replays, window=window)
            save_figure(figure, folder / f"{label}_{maneuver}_{law}.png")
