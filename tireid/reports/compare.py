"""The report of `tireid compare`: which method knows the tires best where it has not learnt."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from identifier.compare.study import Comparison, ranking
from identifier.reproducibility import freeze_key
from identifier.verdict import Verdict
from tireid.report import Block, Headline, Report, Section, Table, write_report
from tireid.reports.common import REPORT, drawings, origin
from tireid.verdicts import verdict_warnings, verdicts_headline


def write_compare_report(
    folder: Path,
    comparison: Comparison,
    rows: Sequence[Sequence[str]],
    figures: Mapping[str, Figure],
    verdicts: Mapping[str, Verdict],
    *,
    remarks: Sequence[str],
    command: str,
) -> None:
    """Write the report of a comparison.

    verdicts : on what the default learns, by recording.
    """
    course, learnt = comparison.course, "recordings on which what the default learnt is valid"
    captions = {
        "methods": "Errors of every method.",
        "matrix": "Learnt on one recording, asked about another.",
        "side_slip": "Side slip as methods without a lateral velocity told it.",
    }
    blocks: list[Block] = [
        Table(
            caption=f"{course.measure}, front / rear, in percent of the rms force (and N), mean "
            f"over {len(comparison.names)} recordings." + "".join(f" {line}." for line in remarks),
            header=rows[0],
            rows=rows[1:],
        )
    ]
    blocks += drawings(figures, captions)
    report = Report(
        title=f"Methods compared on {course.vehicle.name}",
        summary="Every method learns on each recording, is frozen at its end and asked about all "
        "of them.",
        numbers=[*verdicts_headline(verdicts, learnt, "good"), *_compare_headlines(comparison)],
        warnings=[
            *_compare_warnings(comparison),
            *(
                one
                for name, verdict in verdicts.items()
                for one in verdict_warnings(verdict, f"The default learnt on {name}: ")
            ),
        ],
        sections=[
            Section(heading="Which method knows the tires", blocks=blocks),
            origin(command, course.vehicle, course.recordings, seed=str(comparison.seed)),
        ],
    )
    write_report(folder / REPORT, report)


def _compare_headlines(comparison: Comparison) -> list[Headline]:
    """Return the frozen error of the best methods on recordings that they did not learn on."""
    numbers = []
    elsewhere = len(comparison.names) > 1
    for name in ranking(comparison):
        shares = comparison.shares(name)
        value = shares.other if elsewhere else shares.in_sample
        if value is not None and np.isfinite(value):
            where = "frozen, on other recordings" if elsewhere else "frozen, where learnt"
            numbers.append(
                Headline(f"{value:.1f} %", f"of the rms force missed by {name}, {where}")
            )
    return numbers[:4]


def _compare_warnings(comparison: Comparison) -> list[str]:
    """Return what speaks against a comparison."""
    vehicle = comparison.course.vehicle
    said = [f"{vehicle.estimates}."] if vehicle.estimates else []
    if comparison.course.by_motion:
        said.append(
            "Without true forces methods are judged by the motion: by mean forces over 0.3 s, the "
            "noise of the sensors taken off. A wrong mass scales all of them alike."
        )
    for name, trial in comparison.trials.items():
        at = [f"{where} at {freeze_key(t)} s" for where, t in trial.diverged_at.items()]
        if at:
            said.append(f"{name} diverged on {', '.join(at)}.")
    if len(comparison.names) == 1:
        said.append("One recording: nothing says how a method does on a drive it did not learn on.")
    return said
