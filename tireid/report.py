"""A report: headline numbers, text, tables and figures in ONE HTML file that needs nothing else.

Pictures are embedded, drawings as SVG that stays crisp; a figure fills the window when clicked
on, by its own anchor. Styles are inline, without scripts or links to other files, so that it can be
mailed, archived and printed.
"""

import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Literal, NamedTuple

from codegen.escape import html
from models.files import write_atomically

SIGNATURES = {  # of files, by their kind
    b"\x89PNG\r\n\x1a\n": "png",
    b"GIF89a": "gif",
    b"RIFF": "webp",
    b"<?xml": "svg+xml",
}
STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2rem 1.25rem 4rem; max-width: 54rem;
  background: #fff; color: #1a1a1a;
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .5rem; }
h2 { font-size: 1.3rem; line-height: 1.3; margin: 2.6rem 0 .6rem; padding-top: .8rem;
  border-top: 1px solid #ddd; }
h3 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
p { margin: .7rem 0; max-width: 44rem; overflow-wrap: break-word; }
p.summary { font-size: 1.1rem; color: #444; }
dl.numbers { display: grid; grid-template-columns: repeat(auto-fit, minmax(11rem, 1fr)); gap: .8rem;
  margin: 1.4rem 0; }
dl.numbers div { padding: .7rem .9rem; background: #f6f5f2; border-radius: 6px; }
dl.numbers dt { font-size: .85rem; line-height: 1.35; color: #444; }
dl.numbers dd { margin: 0 0 .15rem; font-size: 1.35rem; font-weight: 600; line-height: 1.25;
  font-variant-numeric: tabular-nums; }
dl.numbers div { display: flex; flex-direction: column; }
dl.numbers dt { order: 1; }
dl.numbers div.good { background: #dff1e4; box-shadow: inset 0 0 0 2px #2f7d4f; }
dl.numbers div.good dd { color: #1d5c37; }
dl.numbers div.doubt { background: #fdecc8; box-shadow: inset 0 0 0 2px #b35c00; }
dl.numbers div.doubt dd { color: #8a4600; }
dl.numbers div.bad { background: #b3261e; }
dl.numbers div.bad dd, dl.numbers div.bad dt { color: #fff; }
td .bad { color: #b3261e; font-weight: 600; }
.unknown, .refused { color: #767676; }
.struck { color: #767676; text-decoration: line-through; }
dl.numbers div.refused dd { color: #767676; }
dl.numbers dd.pair { font-size: 1.1rem; }
dl.numbers small, td small { display: block; font-weight: 400; white-space: normal; }
dl.numbers small { font-size: .8rem; line-height: 1.3; }
ul.warnings { margin: 1.2rem 0; padding: .7rem 1rem .7rem 2rem; border-left: 4px solid #b35c00;
  background: #fdf3e7; border-radius: 0 6px 6px 0; }
ul.warnings li { overflow-wrap: break-word; }
ul.warnings li.bad { color: #b3261e; font-weight: 600; }
ul.refusals { border-color: #b3261e; background: #fdeceb; }
p.fine { padding: .5rem 1rem; border-left: 4px solid #2f7d4f; background: #eef6f0; }
details { margin: 2.6rem 0; border-top: 1px solid #ddd; }
details > summary { cursor: pointer; padding-top: .8rem; }
details > summary h2 { display: inline; border: 0; margin: 0; padding: 0; }
nav { margin: 1.5rem 0; padding: .8rem 1.2rem; background: #f6f5f2; border-radius: 6px; }
nav ol { margin: 0; padding-left: 1.4rem; }
a { color: #00588c; text-decoration: none; }
a:hover { text-decoration: underline; }
figure { margin: 1.6rem 0; }
figure img { display: block; width: 100%; height: auto; }
figcaption { margin-top: .5rem; font-size: .9rem; color: #444; max-width: 44rem; }
figcaption b { color: #1a1a1a; }
figcaption i.read { display: block; color: #5b5b5b; }
a.enlarge { display: block; cursor: zoom-in; }
a.close { display: none; }
figure:target { position: fixed; inset: 0; z-index: 9; margin: 0; padding: 3rem 1rem 1rem;
  background: #fff; overflow: auto; }
figure:target div.scroll { overflow: visible; }
figure:target img { width: 100%; min-width: 75rem; }
figure:target figcaption { max-width: none; }
figure:target a.enlarge { cursor: default; }
figure:target a.close { display: block; position: fixed; top: .6rem; right: 1rem; z-index: 10;
  padding: .35rem .9rem; background: #00588c; color: #fff; border-radius: 6px; }
figure.table figcaption { margin: 0 0 .5rem; }
div.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums;
  border-top: 2px solid #1a1a1a; border-bottom: 2px solid #1a1a1a; }
th, td { padding: .35rem .8rem; text-align: left; vertical-align: top; }
thead th { border-bottom: 1px solid #1a1a1a; vertical-align: bottom; }
tbody tr + tr td { border-top: 1px solid #e6e6e6; }
table.verbatim td { overflow-wrap: anywhere; }
td:first-child { min-width: 8rem; }
td.number, th.number { text-align: right; }
td.number { white-space: nowrap; }
@media screen and (max-width: 36rem) { body { padding: 1.2rem .9rem 3rem; }
  h1 { font-size: 1.5rem; }
  dl.numbers { grid-template-columns: 1fr 1fr; } dl.numbers dd { font-size: 1.15rem; }
  th, td { padding: .3rem .5rem; } }
@media print { @page { margin: 18mm 16mm; } body { padding: 0; max-width: none; font-size: 10pt; }
  h2 { break-after: avoid; } figure, tr { break-inside: avoid; } div.scroll { overflow: visible; }
  details > * { display: block; } a.close { display: none !important; }
  figure:target { position: static; } figure:target img { min-width: 0; }
  figure img { width: auto; max-width: 100%; max-height: 115mm; }
  nav { background: none; border: 1px solid #ddd; } a { color: inherit; } }
"""

# What something is worth. Of a headline: good (green), doubt (amber), bad (red). Of a number:
# unknown (grey), of a refused answer refused (grey) or, where its own axle is, struck through.
Tone = Literal["", "good", "doubt", "bad", "unknown", "refused", "struck"]


class Marked(NamedTuple):
    """A text with what it is worth, and a note below it that is never struck; all plain text."""

    text: str
    tone: Tone = ""
    note: str = ""


Cell = str | float | Marked | None

# What texts say in ASCII, as it is printed in a book.
LETTERS = {
    "xi_hat": "ξ̂",
    "xi_tilde": "ξ̃",
    "xi": "ξ",
    "eta": "η",
    "rho": "ρ",
    "lambda": "λ",
    "theta": "θ",
}
INDEXED = re.compile(r"\b(v_x|v_y|a_x|a_y|e_y|l_f|l_r|A_d|T_freeze)\b")
RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def printed(text: str) -> str:
    """Return a text of our own with Greek letters and raised exponents in place of ASCII."""
    words = re.compile(rf"\b({'|'.join(LETTERS)})(?=\d?\b)")
    greek = words.sub(lambda found: LETTERS[found[1]], text)
    raised = re.sub(r"\^(-?\d+)", lambda found: found[1].translate(RAISED), greek)
    return raised.replace("`", "").replace("->", "→").replace("+-", "±")


class Headline(NamedTuple):
    """A number that a hurried reader looks for: with its unit, and what it is, plain text.

    value : the number, or those of several axles, a line each.
    """

    value: str | Sequence[Marked]
    meaning: str
    tone: Tone = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Paragraph:
    """Running text."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table with a caption; units belong into the header.

    Parameters
    ----------
    rows : cells by row; numbers are given four digits, None and what is not finite becomes a dash.
    verbatim : whether cells are to be read letter by letter, as commands are.

    Raises
    ------
    ValueError
        Where a row has more or fewer cells than the header.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A picture with a caption.

    Parameters
    ----------
    image : the SVG, PNG, GIF or WebP itself, or the path of its file.

    Raises
    ------
    ValueError
        Where the image is none of them.
    OSError
        Where its file cannot be read.
    """

    image: bytes | Path
    caption: str
    read: str = ""

    def __post_init__(self) -> None:
        data = self.image.read_bytes() if isinstance(self.image, Path) else self.image
        if not data.startswith(tuple(SIGNATURES)):
            raise ValueError(f"the picture {self.caption!r} must be SVG, PNG, GIF or WebP")
        object.__setattr__(self, "image", data)


@dataclass(frozen=True, slots=True, kw_only=True)
class Subheading:
    """A heading inside a section."""

    text: str


Block = Paragraph | Table | Picture | Subheading


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a report under one heading.

    Parameters
    ----------
    blocks : paragraphs, tables, pictures and smaller headings in order.
    folded : whether only the heading is seen until a reader opens it.
    """

    heading: str
    blocks: Sequence[Block]
    folded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """All that a page says.

    Parameters
    ----------
    summary : what a hurried reader should know, plain text.
    numbers : what stands at the top, with units; none where there is nothing to count.
    lead : what is looked at first, above the warnings.
    warnings : what speaks against the results, plain text; what is marked bad refuses them. None
        where nothing was looked at.
    """

    title: str
    sections: Sequence[Section]
    summary: str = ""
    numbers: Sequence[Headline] = ()
    lead: Sequence[Block] = ()
    warnings: Sequence[str | Marked] | None = None


FINE = "No warnings."


def report_html(report: Report) -> str:
    """Return a report as one HTML page; tables and figures are numbered through."""
    title, sections = report.title, report.sections
    tables, figures = count(1), count(1)

    def written(block: Block) -> str:
        if isinstance(block, Table):
            return _table(block, next(tables))
        if isinstance(block, Picture):
            return _picture(block, next(figures))
        tag = "h3" if isinstance(block, Subheading) else "p"
        return f"<{tag}>{_inline(block.text)}</{tag}>"

    lead = [written(block) for block in report.lead]
    entries, parts = [], []
    for number, section in enumerate(sections, start=1):
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
        f"<title>{html(title)}</title>",
        f"<style>{STYLE}</style>",
        "</head>",
        "<body>",
        f"<h1>{html(title)}</h1>",
    ]
    if report.summary:
        head.append(f'<p class="summary">{_inline(report.summary)}</p>')
    head += _numbers(report.numbers) + lead + _warnings(report.warnings)
    contents = ['<nav aria-label="Contents">', "<ol>", *entries, "</ol>", "</nav>"]
    return "\n".join([*head, *contents, *parts, "</body>", "</html>"]) + "\n"


def write_report(path: Path, report: Report) -> None:
    """Write a report; the file is complete or as it was before."""
    write_atomically(path, report_html(report))


def _inline(text: str) -> str:
    """Return text for the page, with the indices of our letters lowered."""
    return INDEXED.sub(
        lambda found: "<i>{}</i><sub>{}</sub>".format(*found[1].split("_")), html(text)
    )


def _numbers(numbers: Sequence[Headline]) -> list[str]:
    if not numbers:
        return []
    cards = []
    for value, meaning, tone in numbers:
        parts = [Marked(value)] if isinstance(value, str) else value
        pair = ' class="pair"' if len(parts) > 1 else ""
        told = "".join(f"<dd{pair}>{_marked(one)}</dd>" for one in parts)
        cards.append(f"<div{_class(tone)}><dt>{_inline(meaning)}</dt>{told}</div>")
    return ['<dl class="numbers">', *cards, "</dl>"]


def _class(tone: Tone) -> str:
    return f' class="{tone}"' if tone else ""


def _marked(one: Marked) -> str:
    """Return a text with its worth as markup."""
    text = f"<span{_class(one.tone)}>{_inline(one.text)}</span>" if one.tone else _inline(one.text)
    return text + (f'<small class="unknown">{_inline(one.note)}</small>' if one.note else "")


def _warnings(warnings: Sequence[str | Marked] | None) -> list[str]:
    if warnings is None:
        return []
    if not warnings:
        return [f'<p class="fine">{FINE}</p>']
    marked = [one if isinstance(one, Marked) else Marked(one) for one in warnings]
    refused = any(one.tone == "bad" for one in marked)
    lines = [f"<li{_class(one.tone)}>{_inline(one.text)}</li>" for one in marked]
    return [f'<ul class="warnings{" refusals" if refused else ""}">', *lines, "</ul>"]


def _table(table: Table, number: int) -> str:
    columns = list(zip(*table.rows, strict=True)) or [()] * len(table.header)
    words = table.verbatim
    opening = '<table class="verbatim">' if words else "<table>"
    numeric = [any(_is_number(cell) for cell in column) and not words for column in columns]
    kinds = [' class="number"' if right else "" for right in numeric]
    header = "".join(
        f'<th scope="col"{kind}>{_inline(name)}</th>'
        for name, kind in zip(table.header, kinds, strict=True)
    )
    lines = [
        '<figure class="table">',
        f"<figcaption><b>Table {number}.</b> {_inline(table.caption)}</figcaption>",
        f'<div class="scroll">{opening}\n<thead><tr>{header}</tr></thead>\n<tbody>',
    ]
    for row in table.rows:
        written = [html(_text(one)) if words else _marked(_of(one)) for one in row]
        cells = (f"<td{kind}>{one}</td>" for one, kind in zip(written, kinds, strict=True))
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return "\n".join([*lines, "</tbody>\n</table></div>", "</figure>"])


def _picture(picture: Picture, number: int) -> str:
    assert isinstance(picture.image, bytes)
    caption, data = _inline(picture.caption), b64encode(picture.image).decode("ascii")
    (kind,) = (name for start, name in SIGNATURES.items() if picture.image.startswith(start))
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


def _is_number(cell: Cell) -> bool:
    """Tell whether a cell is a number or a text that begins with one: "0.43 (0.41 to 0.45)"."""
    cell = cell.text if isinstance(cell, Marked) else cell
    if not isinstance(cell, str):
        return cell is not None
    first = cell.split(" ", 1)[0].replace("\N{MINUS SIGN}", "-")
    try:
        float(first)
    except ValueError:
        return False
    return True


def _text(cell: Cell) -> str:
    if cell is None:
        return "\N{EN DASH}"
    if isinstance(cell, str | Marked):
        return cell if isinstance(cell, str) else cell.text
    if isinstance(cell, int):
        return str(cell)
    finite = abs(cell) < float("inf")
    return f"{cell:.4g}".replace("-", "\N{MINUS SIGN}") if finite else "\N{EN DASH}"
