"""Logs in pieces: a folder with a file for each message, a table with a row for each value."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from models.logs.grouped import GroupedLog, Samples, noted
from models.logs.log import Listed, LogFile, RecordingError, few, some
from models.logs.spelling import unit_in_name, without_unit
from models.logs.stamps import find_clock, in_seconds, require_times, typical_rate
from models.logs.table import Kind, Table, TableLog, kind_of
from models.logs.units import TABLES, are_same, is_given

# A table with a row for each value: what the columns of names, values and units are called.
_NAMES, _VALUES, _UNITS = (row.split() for row in TABLES["long"].values())


def open_folder(path: Path, opened: Mapping[Path, LogFile | RecordingError]) -> GroupedLog[Any]:
    """Return the logs of a folder as one, joined by their times.
    opened : its files, as logs or with why they are none.
    """
    logs = {one: log for one, log in opened.items() if not isinstance(log, RecordingError)}
    if not logs:
        why = next((f"; {one}" for one in opened.values()), "")
        raise RecordingError(f"{path}: there is no such file, it is a folder without a log{why}")
    kinds = {tuple(one.name for one in log.headings()) for log in logs.values()}
    if len(logs) > 1 and len(kinds) == 1:
        raise RecordingError(
            f"{path}: is a folder of logs with the same channels, drives and no messages of one; "
            f"name them: {some([one.name for one in logs])}"
        )
    # When the times of each count from [s]: those of the calendar from their first.
    starts = {f: log.start if isinstance(log, TableLog) else 0.0 for f, log in logs.items()}
    zero = min(starts.values(), default=0.0)
    found = [
        (file.stem, one, (log, one.name, starts[file] - zero))
        for file, log in logs.items()
        for one in log.listed()
    ]
    bad = [one.name for one, log in opened.items() if isinstance(log, RecordingError)]
    said = (f"joined by time: {some([one.name for one in logs])}", *noted("not read", bad))
    return GroupedLog(path, "a log a message", "a log", "row", found, said, _of_files, "channel")


def _of_files(requested: Sequence[tuple[Listed, Any]]) -> list[Samples]:
    files: dict[int, list[tuple[str, Any]]] = {}
    for listed, place in requested:
        files.setdefault(id(place[0]), []).append((listed.name, place))
    found = []
    for some_ in files.values():
        log, start = some_[0][1][0], some_[0][1][2]
        channels = log.read([name for _, (_, name, _) in some_])
        by_clock: dict[int, tuple[Any, dict[str, Any]]] = {}
        for (name, _), channel in zip(some_, channels, strict=True):
            by_clock.setdefault(id(channel.t), (channel.t, {}))[1][name] = channel.values
        found += [Samples(log.path.name, t + start, values) for t, values in by_clock.values()]
    return found


def long_log(table: Table) -> GroupedLog[Any] | None:
    """Return the log in a table with a row for each value: time, name, value; None of any other."""
    names, units, numeric, *_ = table.columns
    bare = ["".join(filter(str.isalpha, without_unit(one).lower())) for one in names]
    name, value, unit = (
        next((bare.index(one) for one in called if one in bare), None)
        for called in (_NAMES, _VALUES, _UNITS)
    )
    if name is None or value is None or numeric[name] or not numeric[value]:
        return None
    words = [one for one in table.first_rows(name) if one]
    others = [one if k not in (name, value) else "" for k, one in enumerate(names)]
    clock = find_clock(others, units, table.first_rows)
    if clock is None or clock.column in (name, value) or len(set(words)) == len(words):
        return None
    kinds = {clock.column: kind_of(clock), name: Kind.WORD, value: Kind.NUMBER}
    cells = table.cells(kinds | ({} if unit is None else {unit: Kind.WORD}))
    words_of, codes = cells.words[name]
    few(table.path, len(words_of), "columns", "names")
    stamps = cells.columns[clock.column]
    require_times(str(table.path), clock, stamps, cells.rows, table.place)
    t = in_seconds(clock, stamps)
    order = np.argsort(codes, kind="stable")
    edges = np.searchsorted(codes[order], np.arange(1, len(words_of)))
    written = None if unit is None else cells.words[unit]
    found = []
    for word, rows in zip(words_of, np.split(order, edges), strict=True):
        there = [written.names[k] for k in np.unique(written.codes[rows])] if written else []
        given = [one for one in there if is_given(one)] or [unit_in_name(word)]
        if not all(are_same(given[0], one) for one in given):
            raise RecordingError(
                f"{table.path}: {word} must have one unit, it has {', '.join(given)}; "
                "export it in one"
            )
        rate = typical_rate(t[rows])
        found.append(("", Listed(word, given[0], rows.size, rate), rows))
    said = (f"a row for each value: {names[name]} names it; time is {clock.words}",)
    values = cells.columns[value]

    def read(requested: Sequence[tuple[Listed, Any]]) -> list[Samples]:
        return [Samples(one.name, t[rows], {one.name: values[rows]}) for one, rows in requested]

    return GroupedLog(
        table.path, f"{table.format} of values", "a table", "row", found, said, read, "name"
    )
