"""A report: headline numbers, text, tables and figures in ONE HTML file that needs nothing else.

Pictures are embedded; a figure fills the window when clicked on, by its own anchor. Styles are
inline, without links to other files, so that it can be mailed, archived and printed. The script of
`zoom.py` is inline too; without it the pictures stand alone.

The order is always: at most three headline numbers, the notes that would change a decision, what
was found with its figures and how to read each, and where it came from.
"""

import math
import platform
import re
import tomllib
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import count
from pathlib import Path
from typing import Literal, NamedTuple

from codegen.arrays import LONG, blocks
from codegen.escape import html
from identifier.frozen import vehicle_numbers
from models.files import digest, digest_of_bytes, write_atomically
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid import __version__
from tireid.zoom import Drawn, Zoom, plots_html

_SIGNATURES = {  # of files, by their kind
    b"\x89PNG\r\n\x1a\n": "png",
    b"GIF89a": "gif",
    b"RIFF": "webp",
    b"<?xml": "svg+xml",
}
_STYLE = Path(__file__).with_suffix(".css").read_text(encoding="utf-8")
with Path(__file__).with_name("read.toml").open("rb") as file:
    READ: dict[str, str] = tomllib.load(file)  # how to read each figure, in one line

# What something is worth. Of a headline: good (green), doubt (amber), bad (red). Of a number:
# unknown (grey), of a refused answer refused (grey) or, where its own axle is, struck through.
Tone = Literal["", "good", "doubt", "bad", "unknown", "refused", "struck"]


class Note(NamedTuple):
    """A sentence that speaks against a result.

    tone : bad refuses the result, doubt says that nobody can judge it.   where : drive it is about.
    """

    text: str
    tone: Tone = ""
    where: str = ""


class Marked(NamedTuple):
    """A text with what it is worth, and a note below it that is never struck; all plain text."""

    text: str
    tone: Tone = ""
    note: str = ""


Cell = str | float | Marked | None
Images = Mapping[str, bytes]  # figures, by the name of their file

# What texts say in ASCII, as it is printed in a book.
_LETTERS = {
    "xi_hat": "ξ̂",
    "xi_tilde": "ξ̃",
    "xi": "ξ",
    "eta": "η",
    "rho": "ρ",
    "lambda": "λ",
    "theta": "θ",
}
_WORDS: dict[str, Tone] = {"NOT VALID": "bad", "Cannot judge": "doubt", "cannot judge": "doubt"}
_WORD = re.compile("|".join(_WORDS))  # of a verdict, colored wherever it stands
_VARIES = r"\d+(?:\.\d+)?(?: / \d+(?:\.\d+)?)*"  # numbers: notes that differ in these are one
_VARIES_BY_AXLE = rf"{_VARIES}|\bfront\b|\brear\b"
_NOTES = 3  # that stand above the first section, those that would change a decision
_WIDE = 4  # columns from which a narrow screen gets a line for each cell
# In the cells of tables: after what a name may go on in the next line, and where a number may not.
_BREAKS = re.compile(r"(_|\w{16})")
_JOINED = re.compile(r"(?<=±) |(?<=\d) (?=%|m|N|k|s\b)")
_INDEXED = re.compile(r"\b(v_x|v_y|a_x|a_y|e_y|l_f|l_r|A_d|T_freeze)\b")
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def printed(text: str) -> str:
    """Return a text of our own with Greek letters and raised exponents in place of ASCII."""
    words = re.compile(rf"\b({'|'.join(_LETTERS)})(?=\d?\b)")
    greek = words.sub(lambda found: _LETTERS[found[1]], text)
    raised = re.sub(r"\^(-?\d+)", lambda found: found[1].translate(_RAISED), greek)
    return raised.replace("`", "").replace("->", "→").replace("+-", "±")


def sentence(line: str) -> str:
    """Return a line of a command's output as a sentence of a report."""
    text = printed(line)
    return f"{text[:1].upper()}{text[1:]}."


class Headline(NamedTuple):
    """A number that a hurried reader decides by: with its unit, and what it is, plain text."""

    value: str
    meaning: str
    tone: Tone = ""


@dataclass(frozen=True, slots=True)
class Table:
    """A table with a caption; units belong into the header.

    rows : cells by row; numbers are given four digits, None and what is not finite becomes a dash.
    verbatim : whether cells are to be read letter by letter, as commands are.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    verbatim: bool = False

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise ValueError(
                    f"a row of the table {self.caption!r} must have {len(self.header)} cells, "
                    f"it has {len(row)}"
                )


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture with a caption.

    image : the SVG, PNG, GIF or WebP itself, or the path of its file.
    """

    image: bytes | Path
    caption: str
    read: str = ""

    def __post_init__(self) -> None:
        data = self.image.read_bytes() if isinstance(self.image, Path) else self.image
        if not data.startswith(tuple(_SIGNATURES)):
            raise ValueError(f"the picture {self.caption!r} must be SVG, PNG, GIF or WebP")
        object.__setattr__(self, "image", data)


Block = str | Table | Picture  # running text is a str


class Section(NamedTuple):
    """A part of a report under one heading.

    blocks : paragraphs, tables and pictures in order.
    folded : whether only the heading is seen until a reader opens it.
    """

    heading: str
    blocks: Sequence[Block]
    folded: bool = False


class Report(NamedTuple):
    """All that a page says.

    summary : what a hurried reader should know, plain text.
    numbers : the three that decide, with units; others belong into a table.
    lead : what is looked at first, above the notes.
    notes : what speaks against the results, plain text.
    """

    title: str
    sections: Sequence[Section]
    summary: str = ""
    numbers: Sequence[Headline] = ()
    lead: Sequence[Block] = ()
    notes: Sequence[str | Note] = ()


def report_html(report: Report) -> str:
    """Return a report as one HTML page; tables and figures are numbered through."""
    title = html(report.title)
    tables, figures = count(1), count(1)
    zooms, spare = dict[str, Zoom](), dict[str, Zoom]()

    def written(block: Block) -> str:
        if isinstance(block, Table):
            return _table(block, next(tables))
        if isinstance(block, Picture):
            number = next(figures)
            if isinstance(block.image, Drawn) and block.image.zoom:
                (spare if block.image.spare else zooms)[f"figure-{number}"] = block.image.zoom
            return _picture(block, number)
        return f"<p>{_inline(block)}</p>"

    lead = [written(block) for block in report.lead]
    entries, parts = [], []
    for number, section in enumerate(report.sections, start=1):
        heading = _inline(section.heading)
        entries.append(f'<li><a href="#section-{number}">{heading}</a></li>')
        named = f'<h2 id="section-{number}">{number}. {heading}</h2>'
        folded = section.folded
        parts.append(f"<details>\n<summary>{named}</summary>" if folded else f"<section>\n{named}")
        parts += [written(block) for block in section.blocks]
        parts.append("</details>" if folded else "</section>")
    head = [
        "<!DOCTYPE html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title>",
        f"<style>\n{_STYLE}</style>",
        "</head>",
        "<body>",
        f"<h1>{title}</h1>",
        f'<p class="summary">{_inline(report.summary)}</p>',
    ]
    head += _numbers(report.numbers) + lead + _notes(report.notes)
    contents = ['<nav aria-label="Contents">', "<ol>", *entries, "</ol>", "</nav>"]
    body = [*head, *contents, *parts, plots_html(zooms, spare)]
    return "\n".join([*body, "</body>", "</html>"]) + "\n"


def write_report(folder: Path, report: Report) -> None:
    write_atomically(folder / "report.html", report_html(report))


def _inline(text: str) -> str:
    """Return text for the page: indices of our letters lowered, words of a verdict colored."""
    lowered = _INDEXED.sub(
        lambda found: "<i>{}</i><sub>{}</sub>".format(*found[1].split("_")), html(text)
    )
    return _WORD.sub(lambda found: f'<span class="{_WORDS[found[0]]}">{found[0]}</span>', lowered)


def _numbers(numbers: Sequence[Headline]) -> list[str]:
    if not numbers:
        return []
    cards = [
        f"<div{_class(tone)}><dt>{_inline(meaning)}</dt><dd>{_inline(value)}</dd></div>"
        for value, meaning, tone in numbers
    ]
    return ['<dl class="numbers">', *cards, "</dl>"]


def _class(tone: Tone) -> str:
    return f' class="{tone}"' if tone else ""


def _marked(one: Marked) -> str:
    """Return a text with its worth as markup."""
    text = f"<span{_class(one.tone)}>{_inline(one.text)}</span>" if one.tone else _inline(one.text)
    return text + (f'<small class="unknown">{_inline(one.note)}</small>' if one.note else "")


def _as_one(notes: Iterable[Note], varies: str, key: Callable[[Note], str]) -> list[list[Note]]:
    """Return notes that say the same but for what varies, together."""
    found: dict[tuple[str, ...], list[Note]] = {}
    for one in notes:
        found.setdefault((one.tone, key(one), re.sub(varies, "#", one.text)), []).append(one)
    return list(found.values())


def _listed(words: Iterable[str], last: str = " and ", between: str = ", ") -> str:
    """Return words in one: a, b and c; those that are all alike once."""
    *others, end = words
    return end if {*others} <= {end} else between.join(others) + last + end


def _text_of(notes: Sequence[Note], varies: str, *signs: str) -> str:
    parts = zip(*(re.split(f"({varies})", one.text) for one in notes), strict=True)
    return "".join(_listed(part, *signs) for part in parts)


def merged(notes: Iterable[str | Note]) -> list[Note]:
    """Return notes with each finding once: axles and drives of the same in one, refusals first."""
    given = (one if isinstance(one, Note) else Note(one) for one in notes)
    of_drives = [
        some[0]._replace(text=_text_of(some, _VARIES_BY_AXLE, " / ", " / "))
        for some in _as_one(dict.fromkeys(given), _VARIES_BY_AXLE, lambda one: one.where)
    ]
    found = [
        Note(_text_of(some, _VARIES), some[0].tone, _listed(one.where for one in some))
        for some in _as_one(of_drives, _VARIES, lambda one: str(bool(one.where)))
    ]
    return sorted(found, key=lambda one: ("bad", "doubt", "").index(one.tone))


def _notes(notes: Sequence[str | Note]) -> list[str]:
    found = merged(notes)
    lines = [
        f"<li{_class(tone)}>{_inline(f'{where}: {text}' if where else text)}</li>"
        for text, tone, where in found
    ]
    first, rest = lines[:_NOTES], lines[_NOTES:]
    if not lines:
        return ['<p class="fine">No notes.</p>']
    refused = any(one.tone == "bad" for one in found)
    folded = f"{len(rest)} more note{'s' * (len(rest) > 1)}"
    more = ["<details>", f"<summary>{folded}</summary>", "<ul>", *rest, "</ul>", "</details>"]
    opening = f'<div class="notes{" refusals" if refused else ""}">'
    return [opening, "<ul>", *first, "</ul>", *(more if rest else []), "</div>"]


def _table(table: Table, number: int) -> str:
    columns = list(zip(*table.rows, strict=True)) or [()] * len(table.header)
    words = table.verbatim
    kind = "verbatim" if words else "wide" if len(table.header) >= _WIDE else "narrow"
    numeric = [_numbers_in(column) and not words for column in columns]
    kinds = [' class="number"' if right else "" for right in numeric]
    header = "".join(
        f'<th scope="col"{kind}>{_inline(name)}</th>'
        for name, kind in zip(table.header, kinds, strict=True)
    )
    lines = [
        '<figure class="table">',
        f"<figcaption><b>Table {number}.</b> {_inline(table.caption)}</figcaption>",
        f'<div class="scroll"><table class="{kind}">\n<thead><tr>{header}</tr></thead>\n<tbody>',
    ]
    for row in table.rows:
        written = [html(_text(one)) if words else _in_cell(_marked(_of(one))) for one in row]
        cells = (
            f'<td data-of="{html(name)}"{kind}>{one}</td>'
            for name, one, kind in zip(table.header, written, kinds, strict=True)
        )
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return "\n".join([*lines, "</tbody>\n</table></div>", "</figure>"])


def _in_cell(markup: str) -> str:
    return _BREAKS.sub(r"\1<wbr>", _JOINED.sub("\N{NO-BREAK SPACE}", markup))


def _picture(picture: Picture, number: int) -> str:
    assert isinstance(picture.image, bytes)
    caption, data = _inline(picture.caption), b64encode(picture.image).decode("ascii")
    (kind,) = (name for start, name in _SIGNATURES.items() if picture.image.startswith(start))
    read = f'<i class="read">{_inline(picture.read)}</i>' if picture.read else ""
    return "\n".join(
        [
            f'<div id="place-{number}"></div>',
            f'<figure id="figure-{number}">',
            f'<div class="scroll"><a class="enlarge" href="#figure-{number}">',
            f'<img src="data:image/{kind};base64,{data}" alt="{html(picture.caption)}"></a></div>',
            f"<figcaption><b>Figure {number}.</b> {caption}{read}</figcaption>",
            f'<a class="close" href="#place-{number}">Back</a>',
            "</figure>",
        ]
    )


def _of(cell: Cell) -> Marked:
    return cell if isinstance(cell, Marked) else Marked(_text(cell))


def _numbers_in(column: Sequence[Cell]) -> bool:
    """Return whether at least half of the cells that are not empty are numbers."""
    given = [cell for cell in column if cell is not None and _text(cell) not in ("", "-")]
    return bool(given) and 2 * sum(map(_is_number, given)) >= len(given)


def _is_number(cell: Cell) -> bool:
    """Return whether a cell is a number or a text that begins with one: "0.43 (0.41 to 0.45)"."""
    first = _text(cell).split(" ", 1)[0].replace("\N{MINUS SIGN}", "-")
    try:
        float(first)
    except ValueError:
        return isinstance(cell, float)  # one that is not finite
    return True


def _text(cell: Cell) -> str:
    if isinstance(cell, Marked):
        return cell.text
    if isinstance(cell, str | int):
        return str(cell)
    if cell is None or not math.isfinite(cell):
        return "\N{EN DASH}"
    return f"{cell:.4g}".replace("-", "\N{MINUS SIGN}")


def drawings(figures: Images, captions: Mapping[str, str]) -> list[Picture]:
    """Return the figures that there are of some, by their captions."""
    return [
        Picture(figures[name], text, READ[name])
        for name, text in captions.items()
        if name in figures
    ]


def _recording_digest(recording: Recording) -> str:
    """Return twelve characters that stand for the signals of a recording and its true forces.

    Of more than `LONG` samples bytes are counted, of fewer their decimals.
    """
    names = ("t", "v_x", "logged_v_y", "r", "delta_f", "delta_r", "a_y", "axle_force")
    parts = [part for name in names if (part := getattr(recording, name)) is not None]
    if len(recording) <= LONG:
        return digest([part.tolist() for part in parts])
    return digest_of_bytes(
        signal[part].astype("<f8").tobytes() for signal in parts for part in blocks(len(signal))
    )


def origin(
    command: str, vehicle: Vehicle, recordings: Iterable[Recording], **others: str
) -> Section:
    """Return what is needed to compute a report again."""
    given = list(recordings)
    rows = [
        ["command", command],
        ["date", date.today().isoformat()],
        ["tireid", __version__],
        ["Python, machine", f"{platform.python_version()}, {platform.system()} on "
         f"{platform.machine()}"],
        ["car", f"{vehicle.name}, hash {digest(vehicle_numbers(vehicle.without_chassis()))}"],
        *(
            [
                "recording",
                f"{one.name}: {len(one)} samples, {one.duration:.4g} s, hash "
                f"{_recording_digest(one)}",
            ]
            for one in given
        ),
        *(["how it was read", f"{one.name}: {note}"] for one in given for note in one.notes),
        *([name.replace("_", " "), value] for name, value in others.items()),
    ]  # fmt: skip
    caption = "What went in; equal hashes are equal numbers."
    return Section("To compute it again", [Table(caption, ["what", "value"], rows, verbatim=True)])
