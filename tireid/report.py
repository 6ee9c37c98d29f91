"""A report: sections of text, tables and figures in ONE HTML file that needs nothing else.

Pictures are embedded, styles are inline, there are no scripts and no links to other files, so that
the file can be mailed, archived and printed.
"""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from codegen.escape import html
from models.files import write_atomically

SIGNATURES = {b"\x89PNG\r\n\x1a\n": "png", b"GIF89a": "gif"}  # of files, by their kind
STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2rem 1.25rem 4rem; max-width: 54rem;
  background: #fff; color: #1a1a1a;
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .5rem; }
h2 { font-size: 1.3rem; line-height: 1.3; margin: 2.6rem 0 .6rem; padding-top: .8rem;
  border-top: 1px solid #ddd; }
p { margin: .7rem 0; max-width: 44rem; overflow-wrap: break-word; }
p.summary { font-size: 1.1rem; color: #444; }
nav { margin: 1.5rem 0; padding: .8rem 1.2rem; background: #f6f5f2; border-radius: 6px; }
nav ol { margin: 0; padding-left: 1.4rem; }
a { color: #00588c; text-decoration: none; }
a:hover { text-decoration: underline; }
figure { margin: 1.6rem 0; }
figure img { display: block; width: 100%; height: auto; }
figcaption { margin-top: .5rem; font-size: .9rem; color: #444; max-width: 44rem; }
figcaption b { color: #1a1a1a; }
figure.table figcaption { margin: 0 0 .5rem; }
div.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums;
  border-top: 2px solid #1a1a1a; border-bottom: 2px solid #1a1a1a; }
th, td { padding: .35rem .8rem; text-align: left; vertical-align: top; }
thead th { border-bottom: 1px solid #1a1a1a; vertical-align: bottom; }
tbody tr + tr td { border-top: 1px solid #e6e6e6; }
td:first-child { min-width: 8rem; }
td.number, th.number { text-align: right; }
td.number { white-space: nowrap; }
@media screen and (max-width: 36rem) { body { padding: 1.2rem .9rem 3rem; }
  h1 { font-size: 1.5rem; } div.scroll img { min-width: 34rem; }
  th, td { padding: .3rem .5rem; } }
@media print { @page { margin: 18mm 16mm; } body { padding: 0; max-width: none; font-size: 10pt; }
  h2 { break-after: avoid; } figure, tr { break-inside: avoid; } div.scroll { overflow: visible; }
  figure img { width: auto; max-width: 100%; max-height: 115mm; }
  nav { background: none; border: 1px solid #ddd; } a { color: inherit; } }
"""

Cell = str | float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Paragraph:
    """Running text.

    Parameters
    ----------
    text : plain text, no markup.
    """

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table with a caption; units belong into the header.

    Parameters
    ----------
    caption : what the table shows, plain text.
    header : title of each column.
    rows : cells by row; numbers are given four digits, None and what is not finite becomes a dash.

    Raises
    ------
    ValueError
        Where a row has more or fewer cells than the header.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]

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
    image : the PNG or GIF itself, or the path of its file.
    caption : what the picture shows, plain text.

    Raises
    ------
    ValueError
        Where the image is neither.
    OSError
        Where its file cannot be read.
    """

    image: bytes | Path
    caption: str

    def __post_init__(self) -> None:
        data = self.image.read_bytes() if isinstance(self.image, Path) else self.image
        if not data.startswith(tuple(SIGNATURES)):
            raise ValueError(f"the picture {self.caption!r} must be a PNG or a GIF")
        object.__setattr__(self, "image", data)


Block = Paragraph | Table | Picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a report under one heading.

    Parameters
    ----------
    heading : plain text.
    blocks : paragraphs, tables and pictures in order.
    """

    heading: str
    blocks: Sequence[Block]


def report_html(title: str, sections: Sequence[Section], *, summary: str = "") -> str:
    """Return a report as one HTML page; tables and figures are numbered through.

    Parameters
    ----------
    title : of the report, plain text.
    sections : its parts in order.
    summary : what a hurried reader should know, plain text.
    """
    entries, parts = [], []
    tables = figures = 0
    for number, section in enumerate(sections, start=1):
        heading = html(section.heading)
        entries.append(f'<li><a href="#section-{number}">{heading}</a></li>')
        parts.append(f'<section>\n<h2 id="section-{number}">{number}. {heading}</h2>')
        for block in section.blocks:
            if isinstance(block, Table):
                tables += 1
                parts.append(_table(block, tables))
            elif isinstance(block, Picture):
                figures += 1
                parts.append(_picture(block, figures))
            else:
                parts.append(f"<p>{html(block.text)}</p>")
        parts.append("</section>")
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
    if summary:
        head.append(f'<p class="summary">{html(summary)}</p>')
    contents = ['<nav aria-label="Contents">', "<ol>", *entries, "</ol>", "</nav>"]
    return "\n".join([*head, *contents, *parts, "</body>", "</html>"]) + "\n"


def write_report(path: Path, title: str, sections: Sequence[Section], *, summary: str = "") -> None:
    """Write a report; the file is complete or as it was before.

    Parameters
    ----------
    path : the HTML file.
    title : of the report, plain text.
    sections : its parts in order.
    summary : what a hurried reader should know, plain text.
    """
    write_atomically(path, report_html(title, sections, summary=summary))


def _table(table: Table, number: int) -> str:
    columns = list(zip(*table.rows, strict=True)) or [()] * len(table.header)
    numeric = [any(_is_number(cell) for cell in column) for column in columns]
    kinds = [' class="number"' if right else "" for right in numeric]
    header = "".join(
        f'<th scope="col"{kind}>{html(name)}</th>'
        for name, kind in zip(table.header, kinds, strict=True)
    )
    lines = [
        '<figure class="table">',
        f"<figcaption><b>Table {number}.</b> {html(table.caption)}</figcaption>",
        f'<div class="scroll"><table>\n<thead><tr>{header}</tr></thead>\n<tbody>',
    ]
    for row in table.rows:
        cells = (f"<td{k}>{html(_text(cell))}</td>" for cell, k in zip(row, kinds, strict=True))
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return "\n".join([*lines, "</tbody>\n</table></div>", "</figure>"])


def _picture(picture: Picture, number: int) -> str:
    assert isinstance(picture.image, bytes)
    caption, data = html(picture.caption), b64encode(picture.image).decode("ascii")
    (kind,) = (name for start, name in SIGNATURES.items() if picture.image.startswith(start))
    return "\n".join(
        [
            "<figure>",
            '<div class="scroll">',
            f'<img src="data:image/{kind};base64,{data}" alt="{caption}"></div>',
            f"<figcaption><b>Figure {number}.</b> {caption}</figcaption>",
            "</figure>",
        ]
    )


def _is_number(cell: Cell) -> bool:
    """Tell whether a cell is a number or a text that begins with one: "0.43 (0.41 to 0.45)"."""
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
    if isinstance(cell, str):
        return cell
    if isinstance(cell, int):
        return str(cell)
    finite = abs(cell) < float("inf")
    return f"{cell:.4g}".replace("-", "\N{MINUS SIGN}") if finite else "\N{EN DASH}"
