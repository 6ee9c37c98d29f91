"""The reports of `tireid fleet`: what a store holds, and whose tires changed."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identifier.tire_model import STIFFNESS
from tireid import __version__
from tireid.figures.fleet import curves_figure, stiffness_figure, watch_figure
from tireid.fleet.merge import Merged
from tireid.fleet.store import INDEX, LogRow
from tireid.fleet.watch import Alarm, Watch
from tireid.report import Block, Headline, Paragraph, Report, Section, Table, write_report
from tireid.reports.common import REPORT, drawing

_LISTED = 200  # rows of a table
COLUMNS = (*INDEX, "vehicle", "date", "seconds", "valid", "findings", "stiffness_front",
           "stiffness_rear")  # fmt: skip
_DRAWN = 6  # cars with an alarm that are drawn

_READ_STIFFNESS = (
    "Dots of a car lie on a level line; a step or a slope is a change of its tires, its load or a "
    "sensor. Hollow dots are rejected logs."
)
_READ_CURVES = "Each curve ends where it is known; a dotted one is the prior alone."
_READ_WATCH = (
    "Dots around zero are tires as in the baseline. A change stays away from zero by more than its "
    "bars, for as long as it lasts."
)


def write_fleet_report(
    folder: Path,
    store: str,
    rows: Sequence[LogRow],
    groups: Sequence[Merged],
    watched: Watch,
    *,
    command: str,
) -> None:
    learnt = [row for row in rows if not row.error]
    refused = [row for row in learnt if row.valid is False]
    hours = sum(row.seconds or 0.0 for row in learnt) / 3600.0
    numbers = [
        Headline(str(len(rows)), "logs"),
        Headline(f"{hours:.3g} h", "driven"),
        Headline(str(len({row.vehicle for row in rows})), "cars"),
        Headline(str(sum(not alarm.ended for alarm in watched.alarms)), "alarms that last"),
    ]
    warnings = [f"{alarm.line}." for alarm in watched.alarms if not alarm.ended]
    if refused:
        codes = Counter(code for row in refused for code in row.findings).most_common(3)
        often = ", ".join(f"{code} ({count})" for code, count in codes)
        warnings.append(f"Logs that are not valid: {len(refused)}, most often for {often}.")
    errors = [row for row in rows if row.error]
    if errors:
        warnings.append(f"{len(errors)} logs could not be used.")
    models: list[Block] = [
        _groups_table(groups),
        drawing(curves_figure(groups), "Force curves of the groups.", _READ_CURVES),
        drawing(stiffness_figure(learnt), "Cornering stiffness, log by log.", _READ_STIFFNESS),
    ]
    sections = [
        Section(heading="Merged models", blocks=models),
        Section(heading="What changed", blocks=_watch_blocks(watched)),
    ]
    if errors or refused:
        why = {row.name: row.error for row in errors}
        why |= {row.name: f"not valid: {', '.join(row.findings)}" for row in refused}
        listed = list(why.items())
        table = Table(
            caption=f"Logs that were left out{_first(len(listed))}.",
            header=["log", "why"],
            rows=listed[:_LISTED],
            verbatim=True,
        )
        sections.append(Section(heading="Logs left out", blocks=[table], folded=True))
    report = Report(
        title=f"Fleet of {store}",
        summary="The information of the logs adds up: one model for each group.",
        numbers=numbers,
        warnings=warnings,
        sections=[*sections, _origin(command, store, rows)],
    )
    write_report(folder / REPORT, report)


def write_watch_report(folder: Path, store: str, watched: Watch, *, command: str) -> None:
    lasting = [alarm for alarm in watched.alarms if not alarm.ended]
    report = Report(
        title=f"Changes in the fleet of {store}",
        summary="Each car's tires against its baseline.",
        numbers=[
            Headline(str(len(watched.seen)), "cars watched"),
            Headline(f"{watched.hours:.3g} h", "learning after their baselines"),
            Headline(str(len(lasting)), "alarms that last"),
        ],
        warnings=[f"{alarm.line}." for alarm in lasting],
        sections=[
            Section(heading="What changed", blocks=_watch_blocks(watched)),
            _origin(command, store, ()),
        ],
    )
    write_report(folder / REPORT, report)


def _watch_blocks(watched: Watch) -> list[Block]:
    driven = f"{len(watched.seen)} cars were driven beyond their baseline"
    short = f"; {len(watched.short)} were not, and are not watched yet" if watched.short else ""
    blocks: list[Block] = [Paragraph(text=f"{driven}{short}.")]
    if not watched.alarms:
        return [*blocks, Paragraph(text="No change was noticed.")]
    rows = [_alarm_row(alarm) for alarm in watched.alarms]
    blocks.append(
        Table(
            caption=f"Changes from the baseline{_first(len(rows))}.",
            header=["car", "what", "change [%]", "sd [%]", "began", "noticed", "likely"],
            rows=rows[:_LISTED],
        )
    )
    cars = list(dict.fromkeys(alarm.car for alarm in watched.alarms))
    for car in cars[:_DRAWN]:
        mine = [alarm for alarm in watched.alarms if alarm.car == car]
        figure = watch_figure(car, watched.seen[car], mine)
        blocks.append(drawing(figure, f"{car} against its baseline.", _READ_WATCH))
    return blocks


def _alarm_row(alarm: Alarm) -> list[str | float | None]:
    fields = alarm.to_dict()
    over = f"{alarm.cause}; over since {alarm.ended}" if alarm.ended else alarm.cause
    sd = 100.0 * alarm.sd[alarm.statistic]
    change = 100.0 * float(fields["change"])
    return [alarm.car, str(fields["what"]), change, sd, alarm.began, alarm.log, over]


def _groups_table(groups: Sequence[Merged]) -> Table:
    rows: list[list[str | float | None]] = []
    for one in groups:
        known = map(float, np.degrees(one.model.known_slip))
        C = [number.words for number in one.model.estimates() if number.title == STIFFNESS]
        rows.append([one.name, one.logs, one.information.seconds / 60.0, *C, *known])
    return Table(
        caption=f"Merged models{_first(len(rows))}.",
        header=["group", "logs", "learning [min]", "stiffness front [kN/rad]", "rear [kN/rad]",
                "known to, front [deg]", "rear [deg]"],
        rows=rows[:_LISTED],
    )  # fmt: skip


def _first(count: int) -> str:
    return f", the first {_LISTED} of {count}" if count > _LISTED else ""


def _origin(command: str, store: str, rows: Sequence[LogRow]) -> Section:
    settings = ", ".join(sorted({row.setting for row in rows}))
    entries = [["command", command], ["tireid", __version__], ["store", store]]
    if settings:
        entries.append(["settings of learning, hashes", settings])
    table = Table(caption="What went in.", header=["what", "value"], rows=entries, verbatim=True)
    return Section(heading="To compute it again", blocks=[table])
