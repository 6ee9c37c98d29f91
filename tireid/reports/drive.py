"""The report of `tireid drive`: how far off the path, on what knowledge of the tires."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from models.files import digest
from mpc.handover.rules import Verdict
from mpc.loop.record import estimate_scores
from tireid.driving.results import SCORES, Drives, headline, score_rows
from tireid.driving.runs import Run
from tireid.driving.setup import PERIOD
from tireid.report import Block, Headline, Picture, Report, Section, Table, printed, write_report
from tireid.reports.common import READ, REPORT, drawings, origin


def write_drive_report(
    folder: Path, drives: Drives, figures: Mapping[str, Figure], film: Path | None, command: str
) -> None:
    """Write the report of drives along one path."""
    runs = drives.runs
    first = runs[0]
    report = Report(
        title=f"{first.drive.path.name} on {first.label} tires",
        summary=f"{headline(drives.conditions)}.",
        numbers=_drive_headlines(runs),
        warnings=_drive_warnings(runs),
        sections=[
            Section(heading="How the car drove", blocks=_drive_blocks(runs, figures, film)),
            Section(heading="The tracker's tires", blocks=known_blocks(runs, figures)),
            Section(
                heading="Timing",
                blocks=drawings(figures, {"solve_times": "How long a step took."}),
            ),
            origin(
                command,
                first.drive.vehicle,
                (),
                tires=drives.source,
                all_inputs=f"hash {digest(drives.inputs)}, listed in summary.json",
            ),
        ],
    )
    write_report(folder / REPORT, report)


def _drive_headlines(runs: Sequence[Run]) -> list[Headline]:
    first = runs[0].scores
    numbers = [
        Headline(
            f"{first.rms_e_y_m:.3f} m",
            f"rms deviation from the path, {runs[0].label}{_end(runs[0])}",
            "" if first.completed else "bad",
        ),
        Headline(f"{first.peak_e_y_m:.3f} m", f"largest deviation, {runs[0].label}"),
    ]
    numbers += [
        Headline(
            f"{run.scores.rms_e_y_m:.3f} m",
            f"rms deviation, {run.label}{_end(run)}",
            "" if run.scores.completed else "bad",
        )
        for run in runs[1:]
    ]
    given = estimate_scores(runs[0].drive)
    if given is not None:
        numbers.append(
            Headline(
                f"{given.rms_error_deg:.2f}°",
                f"rms error of the estimated side slip, of {given.rms_deg:.2f}°",
            )
        )
    median, p99 = first.solve_ms["median"], first.solve_ms["p99"]
    numbers.append(Headline(f"{median:.2g} / {p99:.2g} ms", "a step: median / 99 of 100"))
    return numbers


def _end(run: Run) -> str:
    return "" if run.scores.completed else f", who {run.drive.ending}"


def _drive_warnings(runs: Sequence[Run]) -> list[str]:
    said = []
    for run in runs:
        scores = run.scores
        if not scores.completed:
            where = float(run.drive.s[-1])
            said.append(f"{run.label}: {run.drive.ending} at {where:.0f} m; its numbers end there.")
        if scores.failures:
            counted = ", ".join(f"{n} {name}" for name, n in scores.failures.items())
            said.append(f"{run.label}: steps of the tracker failed: {counted}.")
        if scores.solve_ms["p99"] > 1e3 * PERIOD:
            said.append(f"{run.label}: one step in a hundred takes longer than the period.")
        said += [
            f"{run.label} at {t:.2f} s: {printed(text)}."
            for t, text in run.drive.notes
            if _bad(text)
        ]
    return said


def _bad(text: str) -> bool:
    return text.startswith(Verdict.FAULT.value) or "dead reckoning" in text


def _drive_blocks(
    runs: Sequence[Run], figures: Mapping[str, Figure], film: Path | None
) -> list[Block]:
    blocks: list[Block] = [
        Table(caption="Scores of the drives.", header=SCORES, rows=score_rows(runs))
    ]
    if film is not None:
        caption = f"The drive on {runs[0].label} tires; outlines are the other cars."
        blocks.append(Picture(image=film, caption=caption, read=READ["film"]))
    captions = {
        "path": "The path from above.",
        "errors": "Deviation, heading, acceleration and speed along the path.",
        "steering": "Steering command.",
    }
    return [*blocks, *drawings(figures, captions)]


def known_blocks(runs: Sequence[Run], figures: Mapping[str, Figure]) -> list[Block]:
    """Return what trackers believed of the tires, and what they were given on the way."""
    captions = {
        "tires": "Forces of the first drive, and the tire models of the trackers.",
        "lateral": "Lateral velocity, which no sensor measured: the truth and the estimate.",
    }
    blocks: list[Block] = [*drawings(figures, captions)]
    notes = [[run.label, f"{t:.2f}", printed(text)] for run in runs for t, text in run.drive.notes]
    if notes:
        header = ["tires", "time [s]", "what"]
        blocks.append(Table(caption="Decisions along the way.", header=header, rows=notes))
    return blocks
