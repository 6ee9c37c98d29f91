"""How a text file is laid out, understood from its beginning.

Loggers put sample rates, venues and comments before the table; name columns in a line, in a
comment or in a section; put units in the names, in a line of their own or nowhere; and set cells
apart by commas, semicolons, tabs, bars or blanks, with decimal points or commas. All that is given
by the cells: whatever makes most of the last lines of the beginning numbers is how it was written,
and upwards from there the first line that is not numbers is the header, or its units.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from codegen.escape import displayed
from models.logs.log import RecordingError, few
from models.logs.spelling import is_unit, is_units_row, unit_in_name
from models.logs.stamps import nanoseconds
from models.logs.table import Columns
from models.logs.units import PER_SECOND, TABLES, quantities, time_unit

_ROWS = 400  # of data that tell what columns are
_TAIL = 40  # last lines of them that tell how cells are written
_MANY = 300  # cells of a line that tell how all are written
_CLEAR = 0.9  # share of cells that a way of reading must make numbers to be sure
_RATES = (1.0, 1e5)  # [Hz], least and most
_LONGEST_INSTANT = 60  # characters

HEAD, _LINES = 1 << 18, 1500  # bytes and lines that are looked at
BLANKS = " "  # the delimiter of columns that any number of blanks and tabs set apart
_DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", BLANKS: "blanks"}
COMMENT = ("#", "%", "//")
_PADDING = " \t,;|\"'"  # that a spreadsheet leaves of an empty line
_ONES = "1" + " ".join(_DELIMITERS)  # of a line in which every cell is 1, if any is
MISSING = ("", *TABLES["header"]["missing"].split())

_DOT = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eEdD][-+]?\d+)?")  # D: of Fortran
_COMMA = re.compile(r"[-+]?(?:\d+|\d*,\d+)(?:[eEdD][-+]?\d+)?")
_MINUS = re.compile("[\u2212\u2013\u00ad\uff0d](?=[.,]?\\d)")  # that a text processor makes of "-"
_WIDE = re.compile("(?<=\\d)[\u00a0\u2009\u202f\u2007](?=\\d{3}(?!\\d))")  # between thousands
_BLANK = re.compile("[\u00a0\u2009\u202f\u2007]")
_POINTS = re.compile(r"[-+]?\d{1,3}(?:\.\d{3})+(?:,\d*)?")  # 1.234.567,8
_COMMAS = re.compile(r"[-+]?\d{1,3}(?:,\d{3})+(?:\.\d*)?")  # 1,234,567.8
_FORTRAN = re.compile(r"[-+]?[\d.,]+[dD][-+]?\d+")
_NO_DIGITS = TABLES["header"]["numbers"].split()
_MAYBE_INSTANT = re.compile(r"(?=.*\d).*[-:/.]\w.*")
# A rate or an interval of samples that a preamble tells: "Sample Rate","100.000","Hz".
_GIVEN_RATE = re.compile(
    r"(?i)(?:sampl\w*[ _]*(?:rate|freq\w*)|abtast(?:rate|frequenz)|\bfs\b"
    r"|(?:log|logging|data)[ _]*rate)"
    r"[^\d\n]{0,20}(\d+(?:\.\d+)?)(?:\W{0,5}(k?hz|sps|1/s)\b)?"
    r"|(?:rate|freq\w*)[^\d\n]{0,20}(\d+(?:\.\d+)?)\W{0,5}(k?hz|sps)\b"
)
_GIVEN_STEP = re.compile(
    r"(?i)(?:(?:sampl\w*|time)[ _]*(?:interval|period|time|step)|abtastzeit"
    r"|delta[ _]?[xt]\b|\bd[tx]\b)"
    r"[^\d\n]{0,20}(\d*\.?\d+(?:e-?\d+)?)(?:\W{0,5}(ms|us|s|sec)\b)?"
)
# RaceCapture describes a channel in one cell: "Speed"|"mph"|0.0|150.0|10, its range and rate.
_DESCRIBED = re.compile(r'"?(?P<name>[^"|]+)"?\|"?(?P<unit>[^"|]*)"?(?:\|[-+.\deE]*){1,3}')
# A channel that is described by lines, not by its column: "Channel : Speed", "Ch 1 = Speed [km/h]".
_LISTED = re.compile(
    r"\W*(?:(?:channel|ch|signal|column|col|kanal|spalte|name|field|parameter)(?: ?name| ?\d+)?"
    r"|(?P<unit>units?|einheit)(?: ?\d+)?)\s*[:=]\s*(?P<what>.*\S)\s*",
    re.I,
)
_TITLE = re.compile(r"(?:channels|signals|columns|names|fields|units|header)\s*[:=]\s*", re.I)
_CONTROLS = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_QUOTED = re.compile(r'["\r\n\x00]')  # what a reader of CSV does more with than to split
_LONGEST_CELL = csv.field_size_limit()  # characters


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Where the table of a text file is, and how its cells are written.
    encoding : name of a Python codec; "utf-8" may turn out to be cp1252 further down.
    delimiter : one character, " " for any number of blanks and tabs.
    first : line of the first row of data, from 1; one beyond the header where there is none.
    decimal : "." or ",".   thousands : what sets thousands apart, "" where nothing does.
    again : lines of header and units, which may come again further down and are no data then.
    rows : cells of the first rows of data.
    made_by : the logger or program whose format it is, "" where nothing tells.
    """

    encoding: str
    delimiter: str
    columns: Columns
    first: int
    decimal: str = "."
    thousands: str = ""
    again: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    made_by: str = ""


class _Line(NamedTuple):
    """A line of the beginning: its number from 1, and its cells where they are asked for."""

    number: int
    text: str
    delimiter: str

    @property
    def cells(self) -> tuple[str, ...]:
        return cells_of(self.text, self.delimiter)


class _Way(NamedTuple):
    """A way of reading cells, and how well it goes: which share of them become numbers."""

    delimiter: str
    decimal: str
    thousands: str
    width: int
    share: float


def find_layout(
    path: Path, head: bytes, whole: bool, unnamed: Mapping[int, tuple[str, ...]]
) -> Layout:
    """Return the layout of a text file.
    whole : whether they are all of it.
    unnamed : names of columns without a header, by their number.
    """
    encoding = _encoding(path, head)
    text = _decoded(path, head, encoding)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if not whole and len(lines) > 1:
        lines = lines[:-1]  # which is cut
    elif not whole:
        raise RecordingError(f"{path}: line 1 is longer than {HEAD} characters, no header is")
    if not any(line.strip() for line in lines):
        raise RecordingError(f"{path}: is empty")
    begun = next(k for k, line in enumerate(lines) if line.strip())
    lines = lines[: begun + _LINES]
    if lines[begun].startswith(_PI_TOOLBOX):
        _require_one_block(path, lines)
    section = _sections(lines)
    if section is not None:
        return _racelogic(path, lines, encoding, section)
    filled = [line for line in lines if line.strip() and not line.lstrip().startswith(COMMENT)]
    way = _way(filled[-_TAIL:])
    if way is None:
        return _no_data(path, lines, encoding)
    few(path, way.width, "columns", "columns")
    table = [_Line(k, line, way.delimiter) for k, line in enumerate(lines, start=1)]
    return _table(path, table, way, encoding, unnamed.get(way.width))


_MAKERS = TABLES["header"]["makers"]
_PI_TOOLBOX, _BLOCK = "PiToolboxVersionedASCIIDataSet", "{ChannelBlock}"


def _require_one_block(path: Path, lines: list[str]) -> None:
    """Refuse channels at rates of their own, one below the other, as Pi Toolbox can write them."""
    begun = [k for k, line in enumerate(lines) if line.strip() == _BLOCK]
    names = [lines[k + 1].split("\t") for k in begun if k + 1 < len(lines)]
    if len(begun) > 1 or any(len(one) == 2 for one in names):
        raise RecordingError(
            f"{path}: line {begun[-1] + 1} begins a {_BLOCK} of one channel: each has its own; "
            "export all channels in one block, at one rate"
        )


def _encoding(path: Path, head: bytes) -> str:
    for marks, name in (
        ((codecs.BOM_UTF8,), "utf-8-sig"),
        ((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE), "utf-32"),
        ((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE), "utf-16"),
    ):
        if head.startswith(marks):
            return name
    if b"\0" in head:
        for start, name in ((1, "utf-16-le"), (0, "utf-16-be")):
            high, low = head[start::2], head[1 - start :: 2]
            if high.count(0) > 0.8 * len(high) and 0 not in low:
                return name
        raise RecordingError(f"{path}: is a binary file (it has NUL bytes); no reader knows it")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
        return "utf-8"
    except UnicodeDecodeError:
        return "cp1252"


def _decoded(path: Path, head: bytes, encoding: str) -> str:
    """Return the beginning as text; its last character may be cut."""
    try:
        errors = "replace" if encoding == "cp1252" else "strict"  # five of its bytes are nothing
        text = codecs.getincrementaldecoder(encoding)(errors).decode(head)
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"{path}: is not a text file in {encoding.upper()} (byte {error.start})"
        ) from None
    text = typed(text)
    control = _CONTROLS.search(text.rstrip("\x1a"))  # which ends texts of DOS
    if control:
        raise RecordingError(
            f"{path}: is not a text file (line {text.count(chr(10), 0, control.start()) + 1} has "
            f"the character {ord(control[0]):#04x}), and no reader of binary files knows it"
        )
    return text


def typed(text: str) -> str:
    """Return a text with the signs of a keyboard: minus, blanks, thousands without any."""
    return text if text.isascii() else _BLANK.sub(" ", _WIDE.sub("", _MINUS.sub("-", text)))


def of_fortran(cell: str) -> str:
    """Return a number with the exponent that Python reads: "1.25D+01" as "1.25E+01"."""
    return cell.replace("D", "E").replace("d", "e") if _FORTRAN.fullmatch(cell) else cell


def cells_of(line: str, delimiter: str) -> tuple[str, ...]:
    """Return the cells of one line, the line itself where it has none.
    delimiter : one character, " " for any number of blanks and tabs.
    """
    if delimiter == BLANKS:
        line = " ".join(line.split())
    if line and len(line) <= _LONGEST_CELL and not _QUOTED.search(line):
        return tuple(cell.strip() for cell in line.split(delimiter))
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), []))
    except csv.Error:
        return (line,)


# Which way of reading makes numbers of the last lines.


def _is_number(cell: str, decimal: str, thousands: str = "") -> bool:
    """Return whether a cell is a number, a time, or nothing, in this way of writing."""
    pattern = _DOT if decimal == "." else _COMMA
    if pattern.fullmatch(cell) or _is_instant(cell):
        return True
    if thousands:
        return bool((_COMMAS if thousands == "," else _POINTS).fullmatch(cell))
    return cell.lower() in _NO_DIGITS


def _is_instant(cell: str) -> bool:
    maybe = len(cell) < _LONGEST_INSTANT and _MAYBE_INSTANT.fullmatch(cell) is not None
    return maybe and nanoseconds(cell) is not None


def _way(tail: list[str]) -> _Way | None:
    """Return how cells are written; None where hardly any is a number in any way."""
    best: _Way | None = None
    for delimiter in _DELIMITERS:
        rows = [cells_of(line, delimiter) for line in tail]
        width, often = Counter(map(len, rows)).most_common(1)[0] if rows else (0, 0)
        if width < 2:
            continue
        cells = [cell for row in rows if len(row) == width for cell in row[:_MANY] if cell]
        for decimal, thousands in ((".", ""), (",", ""), (".", ","), (",", ".")):
            if thousands == delimiter and not any(thousands in cell for cell in cells):
                continue
            right = sum(_is_number(cell, decimal, thousands) for cell in cells)
            share = right / max(len(cells), 1) * often / len(rows)
            if share > 0.0 and (best is None or share > best.share + 1e-9):
                best = _Way(delimiter, decimal, thousands, width, share)
                if share >= 1.0:  # none is better
                    return best
    return best if best is not None and best.share > 0.2 else None


@cache
def _numbers(delimiter: str, decimal: str) -> re.Pattern[str]:
    """Return what a line of nothing but numbers looks like."""
    cell = (_DOT if decimal == "." else _COMMA).pattern
    apart = r"\s+" if delimiter == BLANKS else f" *{re.escape(delimiter)} *"
    return re.compile(rf" *{cell}(?:{apart}{cell})* *")


def _numbers_in(line: _Line, way: _Way) -> int:
    cells = [cell for cell in line.cells[:_MANY] if cell]
    return sum(_is_number(cell, way.decimal, way.thousands) for cell in cells)


def _is_data(line: _Line, way: _Way, full: int) -> bool:
    """Return whether a line is of numbers, at least half of its cells that are filled.
    full : numbers that lines have; so many do where most cells are words.
    """
    if _numbers(way.delimiter, way.decimal).fullmatch(line.text) and line.text.strip(_ONES):
        return True  # as most lines are: nothing but numbers, not all of them 1, which is a unit
    cells = line.cells
    right = _numbers_in(line, way)
    enough = 2 * right >= max(sum(map(bool, cells[:_MANY])), 1)
    wordy = len(cells) == way.width and right >= max(full, 2)
    return (enough or wordy) and not is_units_row(cells)


# From the data upwards to header and units.


def _table(
    path: Path, lines: list[_Line], way: _Way, encoding: str, unnamed: tuple[str, ...] | None
) -> Layout:
    zone, first = _listed(lines, way) or _header_zone(lines, way)
    if unnamed and all(len(_uncommented(line, way)) != way.width for line in zone):
        zone = [_Line(1, way.delimiter.join(unnamed), way.delimiter)]
    if not zone:
        raise RecordingError(
            f"{path}: there is no header, line {lines[first].number} is data already; the first "
            f"row must name the columns"
        )
    names_line, units_line = _named(zone, way)
    names = list(_uncommented(names_line, way))
    units = list(_uncommented(units_line, way)) if units_line is not None else []
    width = way.width
    if len(names) == width - 1 and all(
        len(line.cells) != width or not line.cells[-1] for line in lines[first:]
    ):
        names.append("")  # rows end in a delimiter
    if way.delimiter == "," and len(names) * 2 in (width, width + 1):
        raise RecordingError(
            f"{path}: line {lines[first].number} has {width} cells, the header has {len(names)}: "
            "decimal commas cannot be distinguished from commas between cells; export with "
            "semicolons"
        )
    while len(names) > width and (not names[-1] or names[-1] == "Comment") and len(names) > 1:
        names.pop()  # the header alone ends in a delimiter, or in LabVIEW's Comment
    if not units:
        labels = (line.cells for line in zone if line.text.startswith("Y_Unit_Label"))
        units = ["", *next(labels, ("",))[1:]]
    described = [found for name in names if (found := _DESCRIBED.fullmatch(name))]
    if not any(units) and len(described) == len(names):
        names, units = ([one[of] for one in described] for of in ("name", "unit"))
    units = (units + [""] * len(names))[: len(names)]
    units = [
        unit.strip("[](){} ") or unit_in_name(name) for name, unit in zip(names, units, strict=True)
    ]
    again = (names_line.text,) if units_line is None else (names_line.text, units_line.text)
    rows = (line.cells for line in lines[first:])
    data = tuple(islice((row for row in rows if len(row) == len(names)), _ROWS))
    start = " ".join(line.text for line in lines[:first][:8]).lower()
    made_by = next((maker for words, maker in _MAKERS.items() if words in start), "")
    sure = "sure" if way.share > _CLEAR else "likely" if way.share > 0.6 else "a guess"
    words = [
        _encoding_word(encoding),
        f"cells apart by {_DELIMITERS[way.delimiter]} ({sure})",
        "decimal comma" if way.decimal == "," else "decimal point",
    ]
    words += [f"thousands apart by {displayed(way.thousands)}"] * bool(way.thousands)
    words += [f"{made_by} export"] * bool(made_by)
    words += [f"names in line {names_line.number}"]
    if units_line is not None:
        words.append(f"units in line {units_line.number}")
    elif any(units):
        words.append("units in the names")
    rate = _given_rate([line.text for line in lines[: names_line.number - 1]])
    numeric = _numeric(data, names, way)
    return Layout(
        encoding=encoding,
        delimiter=way.delimiter,
        columns=Columns(tuple(names), tuple(units), numeric, tuple(words), rate),
        first=lines[first].number,
        decimal=way.decimal,
        thousands=way.thousands,
        again=again,
        rows=data,
        made_by=made_by,
    )


def _given_rate(preamble: Sequence[str]) -> float:
    """Return the samples per second that a preamble tells [Hz]; 0 where it tells none."""
    for line in preamble:
        if found := _GIVEN_RATE.search(line):
            kilo = (found[2] or found[4] or "").lower().startswith("k")
            rate = float(found[1] or found[3]) * (1e3 if kilo else 1.0)
        elif found := _GIVEN_STEP.search(line):
            step = float(found[1])
            rate = PER_SECOND[time_unit(found[2] or "s")] / step if step else 0.0
        else:
            continue
        if _RATES[0] <= rate <= _RATES[1]:
            return rate
    return 0.0


def _listed(lines: list[_Line], way: _Way) -> tuple[list[_Line], int] | None:
    """Return names and units that stand above the data one below the other, as lines, and the index
    of the first data; None where they do not: "Channel : Speed", below it "Unit : km/h".

    Of one name less than columns the first column is the time.
    """
    listed: list[list[str]] = []
    last = 0
    for line in lines:
        if (found := _LISTED.fullmatch(line.text)) and (listed or not found["unit"]):
            last = line.number
            if found["unit"]:
                listed[-1][1] = found["what"]
            else:
                listed.append([found["what"], ""])
    if len(listed) < 2 or way.width - len(listed) not in (0, 1):
        return None
    listed = [["Time", ""]] * (way.width - len(listed)) + listed
    rows = (k for k in range(last, len(lines)) if len(lines[k].cells) == way.width)
    first = next((k for k in rows if _is_data(lines[k], way, 0)), None)
    names, units = (
        way.delimiter.join(map('"{}"'.format, some)) for some in zip(*listed, strict=True)
    )
    zone = [_Line(last, text, way.delimiter) for text in (units, names)]
    return None if first is None else (zone[not any(one[1] for one in listed) :], first)


def _header_zone(lines: list[_Line], way: _Way) -> tuple[list[_Line], int]:
    """Return the lines above the data, the nearest first, and the index of the first data."""
    above = [k for k, line in enumerate(lines) if line.text.strip(_PADDING)]
    counts = sorted(_numbers_in(lines[k], way) for k in above[-_TAIL:])
    full = counts[len(counts) // 2]
    first = None
    zone: list[int] = []
    for place in range(len(above) - 1, -1, -1):
        line = lines[above[place]]
        if _is_data(line, way, full) and not line.text.lstrip().startswith(COMMENT):
            first = above[place]
            continue
        if first is None:
            continue
        higher = [lines[k] for k in above[max(0, place - 40) : place]]
        alike = sum(
            len(one.cells) == way.width
            and _is_data(one, way, full)
            and 2 * _numbers_in(one, way) >= full  # not "Duration,30,,," of a padded preamble
            for one in higher
        )
        if alike >= 2 and way.width > 2:
            continue  # a spoiled row, a comment, or the header once more: there is data above
        zone = above[: place + 1][::-1]
        break
    if first is None:
        first = above[-1]
    return [lines[k] for k in zone], first


def _uncommented(line: _Line, way: _Way) -> tuple[str, ...]:
    bare = line.text.strip()
    bare = bare.lstrip("#%/").strip() if bare.startswith(COMMENT) else bare
    bare = _TITLE.sub("", bare, count=1) if _TITLE.match(bare) else bare
    return line.cells if bare == line.text.strip() else cells_of(bare, way.delimiter)


def _named(zone: list[_Line], way: _Way) -> tuple[_Line, _Line | None]:
    """Return the lines of names and of units, of those above the data, the nearest first."""
    fitting = [line for line in zone[:6] if way.width - 1 <= len(_uncommented(line, way))]
    units = next((line for line in fitting[:3] if is_units_row(_uncommented(line, way))), None)
    if units is None or len(fitting) == 1:
        return (*fitting, zone[0])[0], None  # of another width: the first row of data is refused
    at = fitting.index(units)
    if at + 1 < len(fitting) and units.number - fitting[at + 1].number <= 3:
        return fitting[at + 1], units
    return (fitting[at - 1], units) if at else (units, None)


def _numeric(data: Sequence[Sequence[str]], names: Sequence[str], way: _Way) -> tuple[bool, ...]:
    """Return which columns hold numbers: those in which no cell, or few of them, are words."""
    found = []
    for column in range(len(names)):
        cells = [row[column] for row in data]
        filled = [cell for cell in cells if cell.lower() not in MISSING]
        right = sum(_is_number(cell, way.decimal, way.thousands) for cell in filled)
        times = (_is_instant(cell) and not _DOT.fullmatch(cell) for cell in filled)
        marked = (":" in cell or cell.count("-") == 2 for cell in filled)
        numeric = 2 * right >= len(filled) and not (all(marked) or all(times))
        # Without a name it is what follows the delimiter that rows end in.
        found.append(numeric if filled else names[column] != "")
    return tuple(found)


def _encoding_word(encoding: str) -> str:
    return f"text in {encoding.removesuffix('-sig').upper()}"


def _no_data(path: Path, lines: list[str], encoding: str) -> Layout:
    """Return the layout of a header alone, or above rows that are several lines each."""
    number, text = next((k, line) for k, line in enumerate(lines, start=1) if line.strip())
    delimiter = max(_DELIMITERS, key=lambda one: text.count(one) if one != BLANKS else 0)
    names = cells_of(text, delimiter)
    few(path, len(names), "columns", "columns")
    after = cells_of(lines[number], delimiter) if number < len(lines) else ()
    under = len(after) == len(names) and is_units_row(after)
    words = (_encoding_word(encoding), f"names in line {number}")
    units = tuple(unit_in_name(name) for name in names)
    columns = Columns(names, units, (True,) * len(names), words)
    first = number + 1 + under
    return Layout(
        encoding=encoding, delimiter=delimiter, columns=columns, first=first, again=(text,)
    )


# Racelogic VBOX: [header], [channel units], [column names], [data], each a section.

_OF_THE_BOX = TABLES["header"]["box"]  # columns, with the units that they have there


def _sections(lines: list[str]) -> dict[str, int] | None:
    """Return the line that begins each section, from 0; None where there is no [data]."""
    found = {
        line.strip().strip("[]").lower(): k
        for k, line in enumerate(lines)
        if "[" in line and re.fullmatch(r"\s*\[[\w ]+\]\s*", line)
    }
    return found if "data" in found and "column names" in found else None


def _racelogic(path: Path, lines: list[str], encoding: str, at: dict[str, int]) -> Layout:
    names = tuple(" ".join(lines[at["column names"] + 1 : at["data"]]).split())
    if not names:
        raise RecordingError(
            f"{path}: [column names], line {at['column names'] + 1}, must be followed by the names"
        )
    units = [""] * len(names)
    if "header" in at:  # the channels in the same order, some with their unit as last word
        after = [k for k in at.values() if k > at["header"]]
        titles = [one.strip() for one in lines[at["header"] + 1 : min(after)] if one.strip()]
        if len(titles) == len(names):
            last = [one.rpartition(" ")[2] if " " in one else "" for one in titles]
            units = [word if is_unit(word) else "" for word in last]
    if "channel units" in at:
        units = _with_channel_units(lines, at, names, units)
    known = (_OF_THE_BOX.get(name.lower(), "") for name in names)
    units = [
        one if one == "hhmmss" else unit or one for one, unit in zip(known, units, strict=True)
    ]
    first = at["data"] + 1
    data = [cells for line in lines[first:] if len(cells := cells_of(line, BLANKS)) == len(names)]
    way = _way([line for line in lines[first:] if line.strip()][-_TAIL:])
    decimal = "." if way is None else way.decimal
    point = "decimal comma" if decimal == "," else "decimal point"
    words = (_encoding_word(encoding), "Racelogic VBOX sections (sure)", point)
    return Layout(
        encoding=encoding,
        delimiter=BLANKS,
        columns=Columns(names, tuple(units), (True,) * len(names), words),
        first=first + 1,
        decimal=decimal,
        rows=tuple(data[:_ROWS]),
        made_by="Racelogic VBOX",
    )


def _with_channel_units(
    lines: list[str], at: dict[str, int], names: Sequence[str], units: Sequence[str]
) -> list[str]:
    """Return units with those of [channel units], a line for each of the last columns.

    None of them where one is not what the name or title of its column says.
    """
    end = min((k for k in at.values() if k > at["channel units"]), default=len(lines))
    listed = [one.strip() for one in lines[at["channel units"] + 1 : end] if one.strip()]
    extra = len(names) - len(listed)
    if extra < 0 or any(name.lower() in _OF_THE_BOX for name in names[extra:]):
        return list(units)
    given = [unit if is_unit(unit) else "" for unit in listed]
    for name, title, unit in zip(names[extra:], units[extra:], given, strict=True):
        said = title or unit_in_name(name)
        if said and unit and quantities(said) != quantities(unit):
            return list(units)
    return [*units[:extra], *(a or b for a, b in zip(units[extra:], given, strict=True))]
