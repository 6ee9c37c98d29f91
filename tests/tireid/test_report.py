"""The report: one file that needs no other, escapes what it is given, and is whole or not there."""

import re
from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from tireid.figures import figure_png
from tireid.report import Paragraph, Picture, Section, Table, report_html, write_report

VOID = {"meta", "img"}
PNG = figure_png(Figure(figsize=(1.0, 1.0)), resolution=20)
SECTIONS = [
    Section(heading="What & why", blocks=[Paragraph(text="a < b <script>alert(1)</script>")]),
    Section(
        heading="Results",
        blocks=[
            Table(
                caption='Errors of "axles"',
                header=["law", "RMSE [kN]"],
                rows=[["integral", 0.33856], ["other", "0.4 (0.3 to 0.5)"], ["diverged", None]],
            ),
            Picture(image=PNG, caption='Forces "over" time'),
            Picture(image=PNG, caption="Slip <angle>"),
        ],
    ),
]


class Outline(HTMLParser):
    """What a browser would see: elements in order, links, texts; complains of a wrong nesting."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text += data


def outline(page: str) -> Outline:
    parser = Outline()
    parser.feed(page)
    assert parser.open == []
    return parser


def outside_references(page: str) -> list[str]:
    """Everything that a page would fetch: sources and links that are not in the page itself."""
    found = re.findall(r"""(?:src|href|data|action)\s*=\s*["']?([^"'\s>]+)""", page)
    found += re.findall(r"url\(([^)]*)\)|@import\s+(\S+)", page)
    return [str(one) for one in found if not str(one).startswith(("data:image/png;base64,", "#"))]


def test_report_needs_nothing_but_itself() -> None:
    page = report_html("A title", SECTIONS)
    assert outside_references(page) == []
    assert "http" not in page and "<script" not in page and "<link" not in page
    images = [attributes["src"] for tag, attributes in outline(page).tags if tag == "img"]
    assert [b64decode(str(image).split(",")[1]) for image in images] == [PNG, PNG]


def test_a_reference_to_another_file_would_be_seen() -> None:
    for planted in ('<img src="a.png">', "<a href='http://b'>", "<style>@import c;</style>"):
        assert outside_references(planted)


def test_report_says_everything_it_was_given_and_nothing_as_markup() -> None:
    parser = outline(report_html("A <title>", SECTIONS, summary="In & short"))
    for text in (
        "A <title>",
        "In & short",
        "What & why",
        "a < b <script>alert(1)</script>",
        'Table 1. Errors of "axles"',
        'Figure 1. Forces "over" time',
        "Figure 2. Slip <angle>",
        "RMSE [kN]",
        "0.3386",
        "0.4 (0.3 to 0.5)",
    ):
        assert text in parser.text
    tags = [tag for tag, _ in parser.tags]
    assert "script" not in tags and "angle" not in tags


def test_contents_lead_to_every_section() -> None:
    tags = outline(report_html("T", SECTIONS)).tags
    links = [str(attributes["href"])[1:] for tag, attributes in tags if tag == "a"]
    assert links == [attributes["id"] for tag, attributes in tags if tag == "h2"]
    assert len(links) == len(SECTIONS)


def test_columns_of_numbers_are_aligned_right_and_gaps_are_dashes() -> None:
    table = Table(caption="c", header=["a", "b"], rows=[["x", -1.5], ["y", float("nan")]])
    page = report_html("T", [Section(heading="h", blocks=[table])])
    assert '<td>x</td><td class="number">\N{MINUS SIGN}1.5</td>' in page
    assert '<td>y</td><td class="number">\N{EN DASH}</td>' in page


def test_rows_that_do_not_fit_and_pictures_that_are_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must have 2 cells, it has 1"):
        Table(caption="c", header=["a", "b"], rows=[["x"]])
    (tmp_path / "a.png").write_text("not a picture")
    with pytest.raises(ValueError, match="must be a PNG"):
        Picture(image=tmp_path / "a.png", caption="c")
    with pytest.raises(FileNotFoundError):
        Picture(image=tmp_path / "missing.png", caption="c")


def test_a_film_is_embedded_as_what_it_is() -> None:
    film = Picture(image=b"GIF89a and more", caption="c")
    page = report_html("t", [Section(heading="h", blocks=[film])])
    (image,) = (attributes["src"] for tag, attributes in outline(page).tags if tag == "img")
    assert str(image).startswith("data:image/gif;base64,")
    assert b64decode(str(image).split(",")[1]) == film.image


def test_report_replaces_the_old_one_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "report.html"
    write_report(path, "First", SECTIONS)
    first = path.read_text(encoding="utf-8")
    assert first == report_html("First", SECTIONS)

    def fail(self: Path, target: Path) -> Path:
        raise OSError("disk full")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_report(path, "Second", SECTIONS)
    assert path.read_text(encoding="utf-8") == first
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_a_table_without_rows_still_names_all_its_columns() -> None:
    table = Table(caption="c", header=["a", "b", "c"], rows=[])
    html = report_html("t", [Section(heading="s", blocks=[table])])
    assert re.findall(r'<th scope="col"[^>]*>(\w)</th>', html) == ["a", "b", "c"]
