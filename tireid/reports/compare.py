"""The report of `tireid compare`: which method knows the tires best where it has not learnt."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from identifier.compare.study import Comparison, ranking
from identifier.reproducibility import freeze_key
from identifier.verdict import Verdict
from tireid.commands.compare_results import remarks, summary_rows
from tireid.report import Block, Headline, Report, Section, Table, write_report
from tireid.reports.common import REPORT, drawings, origin
from tireid.verdicts import verdict_warnings, verdicts_headline


def write_compare_report(
    folder: Path,
    comparison: Comparison,
    figures: Mapping[str, Figure],
    verdicts: Mapping[str, Verdict],
    command: str,
) -> None:
    """Write the report of a comparison.

    verdicts : on what the default learns, by recording.
    """
    course, rows, said = comparison.course, summary_rows(comparison), remarks(comparison)
    captions = {
        "methods": "Errors of every method.",
        "matrix": "Identified on one recording, validated on another.",
        "side_slip": "Side slip estimated by methods without a lateral velocity.",
    }
    blocks: list[Block] = [
        Table(
            caption=f"{course.measure}, front / rear, in percent of the rms force (and N), mean "
            f"over {len(comparison.names)} recordings." + "".join(f" {line}." for line in said),
            header=rows[0],
            rows=rows[1:],
        ),
        *drawings(figures, captions),
    ]
    learnt = "recordings with a valid model of the default"
    report = Report(
        title=f"Methods compared on {course.vehicle.name}",
        summary="Each method is identified on each recording, frozen at its end and replayed on "
        "all.",
        numbers=[*verdicts_headline(verdicts, learnt, "good"), *_compare_headlines(comparison)],
        warnings=[
            *_compare_warnings(comparison),
            *(
                one
                for name, verdict in verdicts.items()
                for one in verdict_warnings(verdict, f"The default identified on {name}: ")
            ),
        ],
        sections=[
            Section(heading="Errors of the methods", blocks=blocks),
            origin(command, course.vehicle, course.recordings, seed=str(comparison.seed)),
        ],
    )
    write_report(folder / REPORT, report)


def _compare_headlines(comparison: Comparison) -> list[Headline]:
    numbers = []
    elsewhere = len(comparison.names) > 1
    for name in ranking(comparison):
        shares = comparison.shares(name)
        value = shares.other if elsewhere else shares.in_sample
        if value is not None and np.isfinite(value):
            where = "frozen, on other recordings" if elsewhere else "frozen, same drive"
            numbers.append(
                Headline(f"{value:.1f} %", f"error in % of the rms force, {name}, {where}")
            )
    return numbers[:4]


def _compare_warnings(comparison: Comparison) -> list[str]:
    vehicle = comparison.course.vehicle
    said = [f"{vehicle.estimates}."] if vehicle.estimates else []
    if comparison.course.by_motion:
        said.append(
            "Without true forces, methods are judged by the mean force in the motion over 0.3 s, "
            "sensor noise subtracted. A wrong mass scales all alike."
        )
    for name, trial in comparison.trials.items():
        at = [f"{where} at {freeze_key(t)} s" for where, t in trial.diverged_at.items()]
        if at:
            said.append(f"{name} diverged on {', '.join(at)}.")
    if len(comparison.names) == 1:
        said.append("One recording only: give a second one as validation drive.")
    return said
