"""The report: one file that needs no other, escapes what it is given, and is whole or not there."""

import re
from base64 import b64decode
from itertools import product
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from models.vehicle import sedan
from tests.pages import faults_of, outline
from tests.tireid.conftest import learn_words, typed
from tireid.figures.style import figure_png
from tireid.report import (
    Headline,
    Marked,
    Note,
    Picture,
    Report,
    Section,
    Table,
    merged,
    origin,
    report_html,
    write_report,
)

PNG = figure_png(Figure(figsize=(1.0, 1.0)), resolution=20)
SECTIONS = [
    Section("What & why", ["a < b <script>alert(1)</script>"]),
    Section(
        "Results",
        [
            Table(
                'Errors of "axles"',
                ["law", "RMSE [kN]"],
                [["integral", 0.33856], ["other", "0.4 (0.3 to 0.5)"], ["diverged", None]],
            ),
            Picture(PNG, 'Forces "over" time'),
            Picture(PNG, "Slip <angle>"),
        ],
    ),
]


def page_of(title, sections, summary="", **more):
    return report_html(Report(title=title, sections=sections, summary=summary, **more))


def outside_references(page):
    """Everything that a page would fetch: sources and links that are not in the page itself."""
    found = re.findall(r"""(?:src|href|data|action)\s*=\s*["']?([^"'\s>]+)""", page)
    found += re.findall(r"url\(([^)]*)\)|@import\s+(\S+)", page)
    return [str(one) for one in found if not str(one).startswith(("data:image/png;base64,", "#"))]


def test_report_needs_nothing_but_itself():
    page = page_of("A title", SECTIONS)
    assert outside_references(page) == []
    assert "http" not in page and "<script" not in page and "<link" not in page
    images = [attributes["src"] for tag, attributes in outline(page).tags if tag == "img"]
    assert [b64decode(str(image).split(",")[1]) for image in images] == [PNG, PNG]


def test_a_reference_to_another_file_would_be_seen():
    for planted in ('<img src="a.png">', "<a href='http://b'>", "<style>@import c;</style>"):
        assert outside_references(planted)


def test_report_says_everything_it_was_given_and_nothing_as_markup():
    parser = outline(page_of("A <title>", SECTIONS, summary="In & short"))
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


def test_columns_of_numbers_are_aligned_right_and_gaps_are_dashes():
    table = Table("c", ["a", "b"], [["x", -1.5], ["y", float("nan")]])
    page = page_of("T", [Section("h", [table])])
    assert 'data-of="a">x</td><td data-of="b" class="number">\N{MINUS SIGN}1.5</td>' in page
    assert 'data-of="a">y</td><td data-of="b" class="number">\N{EN DASH}</td>' in page


def test_rows_that_do_not_fit_and_pictures_that_are_none_are_refused(tmp_path):
    with pytest.raises(ValueError, match="must have 2 cells, it has 1"):
        Table("c", ["a", "b"], [["x"]])
    (tmp_path / "a.png").write_text("not a picture")
    with pytest.raises(ValueError, match="must be SVG, PNG"):
        Picture(tmp_path / "a.png", "c")
    with pytest.raises(FileNotFoundError):
        Picture(tmp_path / "missing.png", "c")


def test_what_something_is_worth_is_seen():
    rows = [["stiffness", Marked("127 ± 5", "struck", "not <valid>")], ["b", "cannot judge"]]
    page = report_html(
        Report(
            title="t",
            sections=[Section("h", [Table("c", ["", "front"], rows)])],
            numbers=[Headline("NOT VALID", "the verdict", "bad")],
            lead=[Picture(PNG, "Cannot judge. The curve")],
            notes=["b", Note("not valid: a", "bad")],
        )
    )
    assert '<div class="bad"><dt>the verdict</dt><dd><span class="bad">NOT VALID' in page
    struck = '<span class="struck">127 ±\N{NO-BREAK SPACE}5</span><small class="unknown">not &lt;'
    assert struck in page
    assert page.count('<span class="doubt">') == 2, "in the caption and the table"
    assert '<div class="notes refusals">\n<ul>\n<li class="bad">not valid: a</li>\n<li>b' in page
    assert page.index("NOT VALID") < page.index("Figure 1.") < page.index("<li>b")
    assert faults_of(page) == []


def test_a_finding_of_several_axles_and_drives_is_one_note_and_few_stand_above_the_sections():
    said = [
        Note(f"{axle} axle: {share} % of the samples slip too far", where=drive)
        for drive, shares in (("a", (3, 9)), ("b", (69, 9)))
        for axle, share in zip(("front", "rear"), shares, strict=True)
    ]
    (one,) = merged([*said, *said])
    assert one.text == "front / rear axle: 3 / 9 and 69 / 9 % of the samples slip too far"
    assert one.where == "a and b"
    notes = [*said, "second", "third", "fourth", "fifth", Note("refused", "bad"), "second"]
    page = page_of("T", SECTIONS, notes=notes)
    above, folded = page.split("<details>\n<summary>3 more notes</summary>")
    assert above.count("<li") - above.count("<li><a") == 3
    assert above.index("refused") < above.index("front / rear") < above.index("second")
    assert "fourth" in folded and folded.index("fifth") < folded.index("<section>")


def test_report_replaces_the_old_one_whole(tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    write_report(tmp_path, Report(title="First", sections=SECTIONS))
    first = path.read_text(encoding="utf-8")
    assert first == page_of("First", SECTIONS)

    def fail(self, target):
        raise OSError("disk full")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_report(tmp_path, Report(title="Second", sections=SECTIONS))
    assert path.read_text(encoding="utf-8") == first
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('href="#place-2"', 'href="#place-9"', "leads nowhere: #place-9"),
        ('id="figure-2"', 'id="figure-1"', "id twice: figure-1"),
        ('alt="Slip &lt;angle&gt;"', 'alt=" "', "a picture without words"),
        ("In &amp; short", "In `short`", "a back-tick"),
    ],
)
def test_a_fault_of_a_page_would_be_seen(old, new, fault):
    page = page_of("T", SECTIONS, summary="In & short")
    assert old in page
    assert fault in faults_of(page.replace(old, new))


def test_commands_are_written_letter_by_letter_and_our_letters_with_their_index():
    rows = [["command", "tireid drive --fault v_y:biased:3:inf:0.5"]]
    table = Table("of v_y", ["a", "b"], rows, verbatim=True)
    page = page_of("T", [Section("h", [table])])
    assert "--fault v_y:biased:3:inf:0.5</td>" in page
    assert "of <i>v</i><sub>y</sub>" in page


def test_a_film_and_a_drawing_are_embedded_as_what_they_are():
    for content, kind in ((b"<?xml and more", "svg+xml"), (b"GIF89a and more", "gif")):
        picture = Picture(content, "c", "how")
        parser = outline(page_of("t", [Section("h", [picture])]))
        (image,) = (attributes["src"] for tag, attributes in parser.tags if tag == "img")
        assert str(image).startswith(f"data:image/{kind};base64,")
        assert b64decode(str(image).split(",")[1]) == content
        assert "how" in parser.text


def test_no_table_is_cut_in_a_window_or_on_a_telephone(tab, logs, tmp_path):
    name, long = "drive_of_a_car_" * 4, "0.0123 ± 0.0045 m/s"
    tables = [
        Table("c", [f"a title of the column {k}" for k in range(7)], [[name, *[long] * 6]]),
        Table("d", ["", "front", "rear"], [["W" * 60, Marked(long, "unknown", "not known"), 1.0]]),
        Table("e", ["what", "value"], [["command", f"tireid {'/a/path' * 30}"]], verbatim=True),
    ]
    write_report(tmp_path, Report(title="T", sections=[Section("h", tables)], notes=[name] * 9))
    assert typed(*learn_words(logs), "--replay", logs / "quick.csv", "--out", tmp_path / "out") == 0
    cut = "[...document.querySelectorAll('div.scroll')].filter(e => e.scrollWidth > "
    for folder, width in product((tmp_path, tmp_path / "out"), (1200, 500)):
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        tab.call("Emulation.setDeviceMetricsOverride", **size)
        tab.call("Page.navigate", url=(folder / "report.html").as_uri())
        tab.wait("document.readyState === 'complete' && document.querySelector('table') !== null")
        assert tab.value(f"{cut} e.clientWidth).map(e => e.textContent).join()") == ""
        assert tab.value("document.documentElement.scrollWidth") <= width


def test_a_car_has_one_hash_with_its_chassis_and_without_it():
    with_it, without = (origin("x", car, []) for car in (sedan(), sedan().without_chassis()))
    assert with_it == without
