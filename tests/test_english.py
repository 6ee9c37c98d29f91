"""What a user reads has the words of the field, in short sentences."""

import ast
import json
import re
import statistics
from pathlib import Path

import pytest

from tests.sources import nodes_of, tree_of
from tests.test_documentation import interface

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("codegen", "models", "identifier", "mpc", "tireid")
SOURCES = [path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))]
PAGES = [
    ROOT / "README.md",
    *(page for name in ("docs", *PACKAGES) for page in sorted((ROOT / name).rglob("*.md"))),
    *sorted((ROOT / "docs").rglob("*.ipynb")),
    ROOT / "tireid" / "reports" / "read.toml",
    ROOT / "models" / "data" / "template.toml",
]
MEDIAN = 18  # words of a sentence
WORDS = 3  # of a string that is a text
# Private words, and what an engineer writes in their place.
BETTER = {
    r"(un)?told": "declared, given, output",
    r"tells? (v_y|the)": "outputs, estimates",
    r"hears?|(un)?heard": "reads, is given",
    r"unseen": "not observable; validation drive",
    r"(gives?|gave|giving|given) back": "reproduces",
    r"stretch(es)?": "segment",
    r"farther back": "earlier",
    r"lessons?": "identification data",
    r"doors?": "entry point",
    r"an? usual|than usual": "typical",
    r"(is|are|was|were) carried": "is part of the state",
    r"(un)?learnt|(was|is|has) learned": "identified, estimated",
    r"(dis)?believe[sd]?": "assumes, plausible, valid; prior",
    r"(motion|force|log|drive)s? shows?": "in the motion, measured",
    r"(is|are|was|were|not|never) (seen|shown)|never sees?": "measured, observable",
    r"(that|which) taught": "of identification",
    r"nobody (knows?|tells?)": "unknown",
    r"without a word": "by default",
}
PRIVATE = {re.compile(rf"\b(?:{word})\b", re.I): better for word, better in BETTER.items()}


def complaints(text: str) -> list[str]:
    """Private words of a text, each with what to write."""
    return [
        f'"{found[0]}": write {better}'
        for word, better in PRIVATE.items()
        for found in word.finditer(text)
    ]


def prose(path: Path) -> str:
    """The text of a page or notebook: no code, no comments, no addresses of links."""
    page = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = json.loads(page)["cells"]
        page = "\n\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "markdown")
    if path.suffix == ".toml":
        page = re.sub(r"^(# )?\w+ =", "\n", page.replace('"', ""), flags=re.M)
    page = re.sub(r"^```.*?^```$|<!--.*?-->", "", page, flags=re.S | re.M)
    return re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "code", page))


def sentences(text: str) -> list[int]:
    """Words of each sentence; an item of a list is one or more, a table or a heading is none."""
    text = re.sub(r"^(\||#).*$", "\n\n", text, flags=re.M)
    text = re.sub(r"^\s*([-*]|\d+\.) ", "\n\n", text, flags=re.M)
    parts = re.split(r"[.!?:;]\s|\n\s*\n", text)
    return [words for part in parts if (words := len(re.findall(r"[\w'-]+", part))) > 1]


def messages(source: str) -> list[str]:
    """Texts of a source: strings with three words or more that are no docstring."""
    silent = set()
    for node in nodes_of(source):
        if isinstance(node, ast.Expr):
            silent.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            silent |= set(node.values)
    texts = [
        "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in parts)
        for node in nodes_of(source)
        if isinstance(node, ast.Constant | ast.JoinedStr) and node not in silent
        for parts in [node.values if isinstance(node, ast.JoinedStr) else [node]]
    ]
    return [one for one in texts if " " in one and len(re.findall("[a-zA-Z]{2,}", one)) >= WORDS]


def docstrings(source: str, offered: set[str]) -> list[str]:
    """Docstrings of what the interface offers, and of its public methods."""
    found = []
    for node in tree_of(source).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name in offered:
            methods = [one for one in node.body if isinstance(one, ast.FunctionDef)]
            public = [node, *(one for one in methods if not one.name.startswith("_"))]
            found += [ast.get_docstring(one) or "" for one in public]
    return found


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_page_has_the_words_of_the_field_and_short_sentences(path):
    text = prose(path)
    assert complaints(text) == []
    assert statistics.median(sentences(text) or [0]) < MEDIAN


def test_messages_have_the_words_of_the_field():
    wrong = [
        f"{path.relative_to(ROOT)}: {line} in {text!r}"
        for path in SOURCES
        for text in messages(path.read_text(encoding="utf-8"))
        for line in complaints(text)
    ]
    assert not wrong, "\n".join(wrong)


def test_docstrings_of_the_interface_have_the_words_of_the_field():
    wrong = [
        f"{path.relative_to(ROOT)}: {line}"
        for path, names in interface().items()
        for text in docstrings(path.read_text(encoding="utf-8"), names)
        for line in complaints(text)
    ]
    assert not wrong, "\n".join(wrong)


def test_a_private_word_and_a_long_sentence_are_found():
    source = 'def f(x):\n    """Learnt."""\n    raise ValueError(f"{x} was told twice", "told")\n'
    assert messages(source) == ["{} was told twice"]
    assert docstrings(source, {"f"}) == ["Learnt."]
    assert complaints("{} was told twice") == ['"told": write declared, given, output']
    assert complaints("The force is given; it has shown a peak of its own: 3 kN.") == []
    assert sentences("# Title\n\nOne two. Three four five\nsix:\n\n- seven eight\n| a | b |\n") == [
        *(2, 4),
        2,
    ]
