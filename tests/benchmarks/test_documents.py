"""Tables of documents are what the scripts make of their records, and say how old those are."""

import re

import pytest

from benchmarks import documents
from benchmarks.documents import records, written
from benchmarks.run_all import BENCHMARKS
from benchmarks.targets import Table

RECORD = {"date": "2026-01-02", "code": "abc", "missed": ["time (<= 1 s)"], "values": {"time": 2.0}}
TEXT = "Laps.\n\n<!-- table circuit -->\nold\n<!-- end -->\n\nMore.\n"


@pytest.fixture(autouse=True)
def a_script(monkeypatch):
    """A benchmark `circuit` with one table."""

    def tables(values):
        return {"circuit": Table(("lap", "time [s]"), [["first", f"{values['time']:.1f}"]])}

    real = documents._tables
    monkeypatch.setattr(
        documents, "_tables", lambda name: tables if name == "circuit" else real(name)
    )
    real_code = documents._code
    monkeypatch.setattr(
        documents, "_code", lambda name: "abc" if name == "circuit" else real_code(name)
    )


def test_a_table_is_written_whole_with_its_date_and_what_it_missed():
    new = written(TEXT, {"circuit": RECORD})
    assert "| lap | time [s] |\n| --- | --- |\n| first | 2.0 |\n" in new
    assert "`circuit.py`, 2026-01-02. Targets missed: time (<= 1 s)." in new
    assert "old" not in new and new.endswith("<!-- end -->\n\nMore.\n")
    assert written(new, {"circuit": RECORD}) == new


def test_a_table_says_that_its_record_is_older_than_the_code_or_that_there_is_none():
    older = written(TEXT, {"circuit": RECORD | {"code": "other"}})
    assert "`circuit.py`, 2026-01-02; **the code has changed since**." in older
    assert "Not recorded yet: `python -m benchmarks.run_all --record --only circuit`." in written(
        TEXT, {}
    )


def test_check_finds_a_table_that_differs_from_its_record(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text(TEXT)
    monkeypatch.setattr(documents, "ROOT", tmp_path)
    monkeypatch.setattr(documents, "documents", lambda: [page])
    monkeypatch.setattr(documents, "records", lambda: {"circuit": RECORD})
    assert documents.main(["--check"]) == 1
    assert page.read_text() == TEXT
    assert documents.main([]) == 0
    assert documents.main(["--check"]) == 0


def test_every_record_is_of_a_script_and_every_table_of_a_document_has_one():
    assert set(records()) <= set(BENCHMARKS)
    named = set()
    for path in documents.documents():
        text = path.read_text(encoding="utf-8")
        named |= {name.partition("/")[0] for name in re.findall(r"<!-- table ([\w/]+) -->", text)}
        assert text.count("<!-- table ") == len(documents.PLACE.findall(text)), path
    assert named - {"summary", "paper"} == set(BENCHMARKS)


def test_the_tables_of_the_documents_are_those_of_the_records():
    assert documents.main(["--check"]) == 0, "`make numbers` writes them"
