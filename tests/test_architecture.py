"""The page of the architecture leads to files and names that are there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
STATION = re.compile(r"^- `([\w/.]+)`: (.*?)(?=^- |\n\n)", re.MULTILINE | re.DOTALL)
NAME = re.compile(r"`(?:[\w.]*\.|in->)?(\w+)`")


def stations(title):
    """Return the files of a way, and the names that the page gives in each."""
    text = PAGE.split(f"## {title}\n", 1)[1].split("\n## ", 1)[0] + "\n\n"
    return [(path, NAME.findall(words)) for path, words in STATION.findall(text)]


@pytest.mark.parametrize(
    ("title", "files"),
    [
        ("How delta_f goes from the CSV to the tires", 9),
        ("How a fit reaches the tracker and C", 10),
    ],
)
def test_a_way_is_as_long_as_it_says_and_its_names_are_in_its_files(title, files):
    way = stations(title)
    assert len(way) == files
    for path, names in way:
        text = (ROOT / path).read_text(encoding="utf-8")
        missing = [name for name in names if not re.search(rf"\b{name}\b", text)]
        assert not missing, f"{path} has no {missing}"


def test_every_file_and_module_that_the_page_names_is_there():
    for path in re.findall(r"`((?:[\w-]+/)+[\w.]+)`", PAGE):
        assert (ROOT / path).exists(), path
