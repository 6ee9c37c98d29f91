"""A verdict as commands tell it: lines, a table of what was learnt, the exit code, a section."""

import math
from collections.abc import Mapping
from pathlib import Path

from codegen.escape import visible
from identifier.stored import stored_verdict
from identifier.verdict import Number, Verdict
from tireid.output import text_table
from tireid.progress import complain
from tireid.report import Block, Headline, Paragraph, Section, Table, printed

HEADER = ("", "front", "is", "rear", "is")


def number_cells(number: Number) -> tuple[str, str]:
    """Return a number with its doubt, and what it is worth, as text.

    Parameters
    ----------
    number : of a verdict.
    """
    return with_doubt(number.value, number.sd), number.state


def with_doubt(value: float, sd: float | None) -> str:
    """Return a value to the digits that its standard deviation leaves, as in "0.0123 ± 0.0045".

    Parameters
    ----------
    sd : two digits of it are told; None where it is not known.
    """
    if sd is None or not (math.isfinite(value) and math.isfinite(sd) and sd > 0.0):
        return f"{value:.4g}"
    digits = 1 - math.floor(math.log10(float(f"{sd:.1e}")))
    places = max(digits, 0)
    return f"{round(value, digits):.{places}f} ± {round(sd, digits):.{places}f}"


def number_rows(verdict: Verdict) -> list[list[str]]:
    """Return the numbers of a verdict by title: front, its state, rear, its state.

    Parameters
    ----------
    verdict : with numbers of both axles.
    """
    rows: dict[str, dict[str, Number]] = {}
    for number in verdict.numbers:
        rows.setdefault(f"{number.title} [{number.unit}]", {})[number.axle] = number
    return [
        [
            title,
            *(
                cell
                for axle in ("front", "rear")
                for cell in (number_cells(by_axle[axle]) if axle in by_axle else ("", ""))
            ),
        ]
        for title, by_axle in rows.items()
    ]


def verdict_text(verdict: Verdict, *, numbers: bool = True) -> str:
    """Return a verdict as lines of text.

    Parameters
    ----------
    numbers : whether the table of what was learnt stands above it.
    """
    table = [text_table([list(HEADER), *number_rows(verdict)])] if numbers else []
    return "\n".join([*table, *verdict.lines])


def verdicts_text(verdicts: Mapping[str, Verdict]) -> str:
    """Return what is found on several recordings, as lines of text.

    Parameters
    ----------
    verdicts : on the default method, by the name of the recording that it learnt on.
    """
    lines = []
    for name, verdict in verdicts.items():
        lines.append(f"default learnt on {visible(name)}: {verdict.headline}")
        lines += [f"  {finding.line}" for finding in verdict.findings]
    return "\n".join(lines)


def verdict_headline(verdict: Verdict) -> Headline:
    """Return the verdict as the first number of a report."""
    meaning = "it gives back the motion that was measured" if verdict.valid else verdict.against
    return Headline(
        "valid" if verdict.valid else "NOT VALID", f"the verdict on this answer: {meaning}"
    )


def verdicts_headline(verdicts: Mapping[str, Verdict]) -> list[Headline]:
    """Return on how many recordings the default is valid, as a number of a report, if any.

    Parameters
    ----------
    verdicts : on the default method, by the name of the recording that it learnt on.
    """
    if not verdicts:
        return []
    valid = sum(verdict.valid for verdict in verdicts.values())
    return [
        Headline(
            f"{valid} of {len(verdicts)}", "recordings on which what the default learnt is valid"
        )
    ]


def verdict_warnings(verdict: Verdict) -> list[str]:
    """Return the findings as warnings of a report."""
    return [printed(finding.line) for finding in verdict.findings]


def verdict_section(verdict: Verdict) -> Section:
    """Return the section of a report that holds a verdict; its findings are the warnings above."""
    blocks: list[Block] = [
        Paragraph(
            text="The frozen model is integrated over the drive and must give back the force that "
            "the motion shows, at each axle, where it learnt and where it did not. ± is one "
            "standard deviation."
        ),
        *(Paragraph(text=printed(line)) for line in (verdict.headline, *verdict.unseen)),
        Table(
            caption="What was learnt, and what it is worth.",
            header=HEADER,
            rows=number_rows(verdict),
        ),
    ]
    return Section(heading="Is it good?", blocks=blocks)


def warn_of_stored(path: Path | str) -> None:
    """Say on standard error where a stored model was found not valid when it was learnt.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    FrozenModelError
        Where the file is no such model; one line that names it.
    """
    if stored_verdict(path) is False:
        complain(f"warning: {path} was found not valid when it was learnt: see its summary.json")


def warn_of(verdict: Verdict, what: str) -> None:
    """Say on standard error where what is about to be used is not valid.

    Parameters
    ----------
    verdict : on it.
    what : is used.
    """
    if not verdict.valid:
        first = next(finding for finding in verdict.findings if finding.refuses)
        complain(f"warning: {what} is not valid: {first.line.removeprefix('not valid: ')}")
