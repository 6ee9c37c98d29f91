"""A verdict as commands print it: lines, a table of what was learnt, the exit code, a section."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from codegen.escape import visible
from identifier.day import Day
from identifier.measured import NOT_IDENTIFIABLE, printed_unit, with_doubt
from identifier.tire_model import AXLES, Axle, TireModel, stored_verdict
from identifier.verdict import Number, Verdict
from identifier.verdict.verdict import LARGEST_MODEL_ERROR, PERCENT
from models.recordings import Recording
from tireid.output import text_table
from tireid.progress import complain
from tireid.report import Block, Cell, Headline, Marked, Section, Table, Tone, printed

Verdicts = Mapping[str, Verdict]  # by the name of the drive
_HEADER = ("", "front", "is", "rear", "is")


def _numbers_by_title(verdict: Verdict) -> dict[str, dict[Axle, Number]]:
    """Return the numbers of a verdict by title with the unit that is printed, and by axle."""
    rows: dict[str, dict[Axle, Number]] = {}
    for number in verdict.numbers:
        rows.setdefault(f"{number.title} [{printed_unit(number.unit)}]", {})[number.axle] = number
    return rows


def _marked_number(verdict: Verdict, number: Number | None) -> Marked:
    """Return a number of a verdict as a report shows it: grey what was not identified.

    Grey are all numbers of an answer that is not valid, struck those of the axle that refuses it.

    number : one of them; None leaves its place empty.
    """
    if number is None:
        return Marked("")
    if not number.identified:
        return Marked(number.words, "unknown", NOT_IDENTIFIABLE)
    if not number.judged:
        return Marked(number.words, "refused", "not judged")
    if not number.valid:
        return Marked(number.words, "struck", "not valid")
    return Marked(number.words, "" if verdict.valid else "refused")


def verdict_text(verdict: Verdict, *, numbers: bool = True) -> str:
    rows = [
        [title]
        + [
            cell
            for one in map(by_axle.get, AXLES)
            for cell in (("", "") if one is None else (one.words, one.state))
        ]
        for title, by_axle in _numbers_by_title(verdict).items()
    ]
    table = [text_table([_HEADER, *rows])] if numbers else []
    return "\n".join([*table, *verdict.lines])


def verdicts_text(verdicts: Verdicts, what: str) -> str:
    """Return verdicts on several drives, by the name of each, as lines of text.

    what : was done on each of them.
    """
    lines = []
    for name, verdict in verdicts.items():
        given = "; ".join(line for line in (verdict.headline, verdict.model_error_line) if line)
        lines.append(f"{what} {visible(name)}: {given}")
        lines += [f"  {finding.line}" for finding in verdict.findings]
    return "\n".join(lines)


def named_days(model: TireModel, recordings: Iterable[Recording]) -> list[tuple[str, Day]]:
    """Return the errors of the sensors of each log and day that are taken off, by its name."""
    return [
        (f"{one.name} from {one.t[first]:.4g} s on" if len(days) > 1 else one.name, day)
        for one in recordings
        for days in [model.days(one)]
        for first, day in days
    ]


def sensors_text(model: TireModel, recordings: Iterable[Recording]) -> str:
    """Return the same, a line each."""
    return "\n".join(
        f"sensors of {visible(name)}: {day.line}" for name, day in named_days(model, recordings)
    )


def sensors_section(model: TireModel, recordings: Iterable[Recording]) -> list[Section]:
    """Return the same as a section of a report; none of a model that finds none."""
    days = named_days(model, recordings)
    if not days:
        return []
    titles = list(dict.fromkeys(title for _, day in days for title in day.words))
    rows: list[list[Cell]] = [
        [name, *(day.words.get(title, "") for title in titles)] for name, day in days
    ]
    caption = "Errors that were found from its motion with the tires held, and taken off."
    return [Section("Sensors of each log", [Table(caption, ["log", *titles], rows)])]


def verdict_headline(verdict: Verdict, others: Sequence[str | Marked] = ()) -> Headline:
    """Return the verdict as the first number of a report: green, red; amber with notes, or open."""
    if not verdict.valid:
        meaning = f"the verdict on this answer: {verdict.against}"
        return Headline(verdict.word, meaning, "bad" if verdict.judged else "doubt")
    notes = len(verdict.findings) + len(others)
    noted = f", with {notes} note{'s' * (notes > 1)}" if notes else ""
    meaning = f"the verdict on this answer: it reproduces the measured motion{noted}"
    return Headline("valid", meaning, "doubt" if notes else "good")


def of_answer(verdict: Verdict, numbers: Sequence[Headline]) -> list[Headline]:
    """Return numbers of a report as the verdict leaves them: of a refused answer none is right.

    Those that are not bad are grey there.
    """
    if verdict.valid:
        return list(numbers)
    return [one if one.tone == "bad" else one._replace(tone="refused") for one in numbers]


def model_error_headline(verdict: Verdict) -> list[Headline]:
    """Return the share of the force that the motion shows and the model misses, as a number.

    There is none where too little is driven.
    """
    errors = verdict.model_error
    if errors is None:
        return []
    front, rear = (f"{PERCENT * share:.1f}" for share in errors)
    limit = f"limit {PERCENT * LARGEST_MODEL_ERROR:.0f} %"
    meaning = f"error over the force in the motion, front / rear ({limit})"
    tone: Tone = "" if all(share <= LARGEST_MODEL_ERROR for share in errors) else "bad"
    return [Headline(f"{front} / {rear} %", meaning, tone)]


def number_headlines(verdict: Verdict) -> list[Headline]:
    """Return stiffness, grip and relaxation length of both axles, as numbers of a report."""
    return [
        Headline(
            [_marked_number(verdict, by_axle[axle]) for axle in AXLES], f"{title}, front / rear"
        )
        for title, by_axle in _numbers_by_title(verdict).items()
        if len(by_axle) == len(AXLES)
    ]


def verdicts_headline(verdicts: Verdicts, meaning: str, fine: Tone = "") -> list[Headline]:
    """Return how many of several verdicts are valid, as a number of a report, if there are any.

    fine : what it is worth where all are.
    """
    words = [verdict.word for verdict in verdicts.values()]
    valid, refused = words.count("valid"), words.count("NOT VALID")
    tone: Tone = fine if valid == len(words) else "bad" if refused else "doubt"
    return [Headline(f"{valid} of {len(verdicts)}", meaning, tone)] * bool(verdicts)


def known_headline(model: TireModel) -> list[Headline]:
    """Return the largest identified slip of a model, as a number of a report, where it has one."""
    if model.known_slip is None:
        return []
    front, rear = (with_doubt(float(slip)) for slip in np.degrees(model.known_slip))
    return [Headline(f"{front} / {rear}°", "known up to this slip, front / rear")]


def verdict_warnings(verdict: Verdict, prefix: str = "") -> list[str | Marked]:
    """Return the findings as warnings of a report; those that refuse the answer are marked."""
    return [
        Marked(prefix + printed(finding.line), "bad" if finding.refuses else "")
        for finding in verdict.findings
    ]


def verdicts_warnings(verdicts: Verdicts, prefix: str) -> list[str | Marked]:
    """Return the findings of verdicts on several drives, each behind the name of the drive.

    prefix : in which {} stands for the name.
    """
    return [
        said
        for name, verdict in verdicts.items()
        for said in verdict_warnings(verdict, prefix.format(name))
    ]


def verdict_section(verdict: Verdict) -> Section:
    """Return the section of a report that holds a verdict; its findings are the warnings above."""
    rows: list[list[Cell]] = [
        [title, *(_marked_number(verdict, by_axle.get(axle)) for axle in AXLES)]
        for title, by_axle in _numbers_by_title(verdict).items()
    ]
    lines = (verdict.headline, verdict.model_error_line, *verdict.unobservable)
    blocks: list[Block] = [
        (
            "The frozen model is replayed over the drive and must reproduce the force in "
            "the motion, at each axle, on identification and validation drives. ± is one "
            "standard deviation."
        ),
        *(printed(line) for line in lines if line),
        Table(
            "Estimates. Grey was not identified; struck through is not valid.", ("", *AXLES), rows
        ),
    ]
    return Section("Verdict", blocks)


def stored_warning(path: Path | str) -> list[Marked]:
    """Return what speaks against a stored model that was found not valid when it was learnt."""
    if stored_verdict(path) is not False:
        return []
    text = f"{path} was not valid on its identification drive: see its summary.json"
    return [Marked(text, "bad")]


def warn_of(verdict: Verdict, what: str) -> None:
    """Say on standard error where what is about to be used is not valid."""
    if verdict.judged and not verdict.valid:
        first = next(finding for finding in verdict.findings if finding.refuses)
        complain(f"warning: {what} is not valid: {first.line.removeprefix('not valid: ')}")
