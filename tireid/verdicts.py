"""A verdict as commands print it: lines, a table of what was learnt, the exit code, a section."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from codegen.escape import visible
from identifier.day import Day
from identifier.measured import NOT_IDENTIFIABLE, as_printed, with_doubt
from identifier.tire_model import AXLES, Axle, TireModel, stored_verdict
from identifier.verdict import Number, Verdict
from identifier.verdict.verdict import BEYOND_KNOWN, LARGEST_MODEL_ERROR, PERCENT
from models.recordings import Recording
from tireid.output import text_table
from tireid.progress import complain
from tireid.report import (
    Block,
    Cell,
    Headline,
    Marked,
    Note,
    Section,
    Table,
    Tone,
    printed,
    sentence,
)

Verdicts = Mapping[str, Verdict]  # by the name of the drive
_HEADER = ("", "front", "is", "rear", "is")


def _numbers_by_title(verdict: Verdict) -> dict[str, dict[Axle, Number]]:
    """Return the numbers of a verdict by title with the unit that is printed, and by axle."""
    rows: dict[str, dict[Axle, Number]] = {}
    for number in as_printed(verdict.numbers):
        rows.setdefault(f"{number.title} [{number.unit}]", {})[number.axle] = number
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
        f"sensors of {visible(name)}, ± with the tires fixed: {day.line}"
        for name, day in named_days(model, recordings)
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
    caption = (
        "Errors of the sensors, estimated from the motion with the tires fixed, and subtracted."
    )
    return [Section("Sensors of each log", [Table(caption, ["log", *titles], rows)])]


def tone_of(verdict: Verdict) -> Tone:
    """Return the color of a verdict: green, red, or amber where the drive cannot judge."""
    return "good" if verdict.valid else "bad" if verdict.judged else "doubt"


def verdict_headline(verdict: Verdict) -> Headline:
    """Return the verdict as the first number of a report."""
    reason = "the model reproduces the measured motion" if verdict.valid else verdict.against
    return Headline(verdict.word, f"the verdict: {reason}", tone_of(verdict))


def of_answer(verdict: Verdict, numbers: Sequence[Headline]) -> list[Headline]:
    """Return numbers of a report as the verdict leaves them: of a refused answer none is right.

    Those that are neither bad nor in doubt are grey there.
    """
    if verdict.valid:
        return list(numbers)
    spoken = ("bad", "doubt")
    return [one if one.tone in spoken else one._replace(tone="refused") for one in numbers]


def model_error_headline(verdict: Verdict) -> list[Headline]:
    """Return the share of the force that the motion shows and the model misses, as a number.

    There is none where too little is driven.
    """
    errors = verdict.model_error
    if errors is None:
        return []
    front, rear = (f"{PERCENT * share:.1f}" for share in errors)
    limit = f"limit {PERCENT * LARGEST_MODEL_ERROR:.0f} %"
    meaning = f"model error over the force in the motion, front / rear ({limit})"
    tone: Tone = "" if all(share <= LARGEST_MODEL_ERROR for share in errors) else "bad"
    return [Headline(f"{front} / {rear} %", meaning, tone)]


def verdicts_headline(verdicts: Verdicts, meaning: str) -> list[Headline]:
    """Return how many of several verdicts are valid, as a number of a report, if there are any."""
    words = [verdict.word for verdict in verdicts.values()]
    valid, refused = words.count("valid"), words.count("NOT VALID")
    tone: Tone = "good" if valid == len(words) else "bad" if refused else "doubt"
    return [Headline(f"{valid} of {len(verdicts)}", meaning, tone)] * bool(verdicts)


def known_headline(model: TireModel) -> list[Headline]:
    """Return the largest identified slip of a model, as a number of a report, where it has one."""
    if model.known_slip is None:
        return []
    front, rear = (with_doubt(float(slip)) for slip in np.degrees(model.known_slip))
    return [Headline(f"{front} / {rear}°", "identified slip range, front / rear")]


def verdict_notes(verdict: Verdict, where: str = "") -> list[Note]:
    """Return the findings as notes of a report.   where : the drive that they are about."""
    return [
        Note(
            printed(one.line.removeprefix("note: ")),
            "bad" if one.refuses else "doubt" if one.silent else "",
            where,
        )
        for one in verdict.findings
        if one.code != BEYOND_KNOWN  # which a report says of all drives in one note
    ]


def verdicts_notes(verdicts: Verdicts) -> list[Note]:
    """Return the findings of verdicts on several drives, each with the name of the drive."""
    return [note for name, one in verdicts.items() for note in verdict_notes(one, name)]


def verdict_section(verdict: Verdict, model: TireModel) -> Section:
    """Return the section of a report that holds a verdict; its findings are the notes above."""
    rows: list[list[Cell]] = [
        [title, *(_marked_number(verdict, by_axle.get(axle)) for axle in AXLES)]
        for title, by_axle in _numbers_by_title(verdict).items()
    ]
    rows += [[f"{fact.title} [{fact.unit}]", *fact.words] for fact in model.facts()]
    caption = (
        "Estimates, ± one standard deviation with the model error on this log. Grey was not "
        "identified; struck through is not valid."
    )
    lines = (verdict.headline, *verdict.unobservable)
    blocks: list[Block] = [
        Table(caption, ("", *AXLES), rows),
        "The frozen model is replayed over the drive and must reproduce the force in the motion, "
        "at each axle.",
        *map(sentence, lines),
    ]
    return Section("Verdict", blocks)


def stored_notes(path: Path | str) -> list[Note]:
    """Return what speaks against a stored model without a valid verdict when it was learnt."""
    text = f"{path} has no valid verdict on its identification drive: see its summary.json"
    return [Note(text, "doubt")] * (stored_verdict(path) is False)


def warn_of(verdict: Verdict, what: str) -> None:
    """Say on standard error where what is about to be used is not valid."""
    if verdict.judged and not verdict.valid:
        first = next(finding for finding in verdict.findings if finding.refuses)
        complain(f"warning: {what} is not valid: {first.line.removeprefix('not valid: ')}")
