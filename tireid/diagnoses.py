"""A diagnosis as commands print it: table, lines, section of a report, and the repair's file."""

import argparse
import math
from dataclasses import replace
from pathlib import Path

from identifier.doctor import Diagnosis, Finding
from identifier.doctor.diagnosis import WITHOUT_V_Y
from identifier.doctor.finding import HARDLY
from identifier.doctor.samples import NOT_MEASURED
from identifier.measured import with_doubt
from identifier.verdict import Verdict
from identifier.verdict.verdict import Objection
from models.recordings import LogMap, Recording, Repair
from models.recordings.reader import repair_text
from models.vehicle import Vehicle
from tireid.output import text_table
from tireid.report import (
    Block,
    Headline,
    Note,
    Picture,
    Report,
    Section,
    Table,
    Tone,
    origin,
    printed,
    write_report,
)

_HEADER = ("found", "size", "confidence", "repair")
NAMES = {  # of findings by their code, where the code is not the word
    "acceleration_sensor_x": "accelerometer ahead of the c.g.",
    "center_of_gravity": "center of gravity stated too far back",
    "clock": "clock jumps",
    "clock_unit": "clock in ms",
    "computed": "computed, not measured",
    "copied": "computed, not measured",
    "dropout": "drops to zero",
    "factor": "scaled",
    "held": "repeats old values",
    "jitter": "samples late at random",
    "lag": "low-passed",
    "other_car": "another car",
    "sideslip": "sideslip angle",
    "sign": "wrong sign",
    "steering_ratio": "angle of the steering wheel, ratio",
    "straight": "hardly any corner",
    "unit": "wrong unit",
    "v_y_reads": "reads wrong by",
    "velocity_sensor_angle": "velocity sensor turned",
    "velocity_sensor_x": "velocity sensor ahead of the c.g.",
    "yaw_inertia": "yaw inertia, times the right one",
    "zero": "reads exactly 0 again and again",
}

# With which no answer is right
_GROSS = ("unit", "sign", "sideslip", "steering_ratio", *NOT_MEASURED)
_OF_ALL_FORCES = ("factor", "v_x")  # nor with this: it scales all forces, which no verdict sees


def add_repair(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument(
        "--repair",
        nargs="?",
        const=Path("log.toml"),
        type=Path,
        metavar="FILE",
        help=f"repair what is sure, {what} FILE (log.toml)",
    )


def _finding_rows(diagnosis: Diagnosis) -> list[list[str]]:
    return [
        [
            " ".join(word for word in (one.channel, NAMES.get(one.code, one.code)) if word),
            _size_text(one),
            one.percent + (", sure" if one.sure else ""),
            "none" if one.repair is None else repair_text(one.repair),
        ]
        for one in diagnosis.findings
    ]


def _size_text(finding: Finding) -> str:
    """Return the size of a finding to the digits that its deviation leaves, with its unit."""
    if math.isnan(finding.size):
        return ""
    scale, unit = {"s": (1e3, "ms"), "rad": (math.degrees(1.0), "deg")}.get(
        finding.unit, (1.0, finding.unit)
    )
    if finding.unit == "s" and abs(finding.size) >= 1.0:
        scale, unit = 1.0, "s"
    doubt = None if math.isnan(finding.deviation) else scale * finding.deviation
    return f"{with_doubt(scale * finding.size, doubt)} {unit}".strip()


def diagnosis_text(diagnosis: Diagnosis, *, unobservable: bool = True) -> str:
    count, said = len(diagnosis.findings), diagnosis.lines(unobservable=unobservable)
    if count == 0:
        return "\n".join(["doctor: nothing found", *said])
    table = text_table([_HEADER, *_finding_rows(diagnosis)])
    return "\n".join([f"doctor: {count} finding{'s' * (count > 1)}", table, *said])


def unsure_text(diagnosis: Diagnosis, path: Path) -> str:
    """Return why nothing was repaired, and how to do it by hand in a log.toml."""
    likely = (one for one in diagnosis.findings if one.confidence >= HARDLY)
    repairs = [repair_text(one.repair) for one in likely if one.repair]
    said = f"no sure repair: with {path} the log stays as it is"
    if not repairs:
        return said
    return (
        f"{said}. Each repair has a rival that fits nearly as well, or rests on one that has. By "
        f"hand: write what you measured under [repair] in {path}: {'; '.join(repairs)}"
    )


def _tone_of(diagnosis: Diagnosis) -> Tone:
    """Return what a diagnosis says of a log: good, in doubt, or bad where a finding matters."""
    if not diagnosis.healthy:
        return "bad"
    return "doubt" if diagnosis.findings else "good"


def diagnosis_notes(diagnosis: Diagnosis, verdict: Verdict | None = None) -> list[Note]:
    """Return the findings as notes of a report.   verdict : says some of them already."""
    if verdict is None:
        found = diagnosis.findings
        return [Note(printed(one.text), "bad" if one.matters else "") for one in found]
    said = {word for one in verdict.findings for word in (one.code, one.text)}
    texts = {f"doctor: {one.text}": one.code for one in diagnosis.findings}
    return [Note(printed(text)) for text, code in texts.items() if not said & {text, code}]


def diagnosis_section(diagnosis: Diagnosis, heading: str = "Doctor") -> Section:
    rows = [[*map(printed, row)] for row in _finding_rows(diagnosis)]
    blocks: list[Block] = [
        (
            "Faults of the log, or of its declared car, from the log alone. ± is one "
            "standard deviation."
        )
    ]
    if rows:
        blocks.append(Table("What was found; the notes above say what it means.", _HEADER, rows))
    else:
        blocks.append("Nothing was found.")
    if diagnosis.unobservable:
        lines = [printed(line).partition(": ")[::2] for line in diagnosis.unobservable]
        blocks.append(Table("What this log cannot verify.", ("what", "why"), lines))
    return Section(heading, blocks)


def doctor_text(diagnosis: Diagnosis, repair: Repair, path: Path | None) -> str:
    """Return what was found, and what of it was taken out, as lines of text.

    path : of --repair, None where it was not asked for.
    """
    lines = [diagnosis_text(diagnosis, unobservable=False)]
    if diagnosis.unobservable[:1] == (WITHOUT_V_Y,):
        lines.append(f"not observable: {WITHOUT_V_Y}")
    if repair:
        lines.append(f"repaired, in identification and replay: {repair_text(repair)}")
    elif path is not None:
        lines.append("no sure repair")
    elif diagnosis.repair:
        lines.append("sure findings are repaired with --repair")
    return "\n".join(lines)


def with_doctor(verdict: Verdict, diagnosis: Diagnosis, repair: Repair) -> Verdict:
    """Return a verdict that does not pass over what the doctor is sure of.

    A unit, a sign, a ratio or a factor of v_x that is surely wrong refuses the answer; another sure
    size is noted. Nothing that `repair` took out of the log speaks against it.
    """
    said = (
        []
        if repair
        else [
            Objection(
                "doctor",
                None,
                f"doctor: {one.text}",
                one.code in _GROSS or (one.code, one.channel) == _OF_ALL_FORCES,
            )
            for one in diagnosis.findings
            if one.sure or one.code in NOT_MEASURED
        ]
    )
    ordered = sorted([*verdict.findings, *said], key=lambda one: not one.refuses)
    return replace(verdict, findings=tuple(ordered)) if said else verdict


def write_doctor_report(
    folder: Path,
    recording: Recording,
    vehicle: Vehicle,
    diagnosis: Diagnosis,
    after: Diagnosis | None,
    figure: Picture,
    command: str,
) -> None:
    """Write the report of a diagnosis.

    after : that of the repaired log, None where nothing was repaired.
    """
    sections = [diagnosis_section(diagnosis), Section("Tire curves", [figure])]
    if after is not None:
        sections.append(diagnosis_section(after, heading="After the repair"))
    count = len(diagnosis.findings)
    numbers = [
        Headline(
            str(count),
            f"finding{'s' * (count != 1)} in the log or the car's file",
            _tone_of(diagnosis),
        ),
        Headline(str(sum(one.sure for one in diagnosis.findings)), "of them sure, with a repair"),
    ]
    if after is not None:
        left = str(len(after.findings))
        numbers.append(Headline(left, "left after the repair", _tone_of(after)))
    report = Report(
        title=f"Diagnosis of {recording.name}",
        summary=f"{recording.duration:.4g} s of driving of {vehicle.name}.",
        numbers=numbers,
        notes=diagnosis_notes(diagnosis),
        sections=[*sections, origin(command, vehicle, [recording])],
    )
    write_report(folder, report)


def write_repair(path: Path, given: LogMap, diagnosis: Diagnosis) -> None:
    """Write how a log is read with what is sure taken out of it."""
    replace(given, repair=given.repair.then(diagnosis.repair)).to_toml(path)
