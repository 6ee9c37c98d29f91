"""Text is read and written in UTF-8, whatever the machine prefers."""

import ast

import pytest

from tests.sources import nodes_of, texts_of

PLACES = ("codegen", "models", "identifier", "mpc", "tireid", "examples", "benchmarks")


def without_encoding(source):
    """Lines that open, read or write text and leave the encoding to the machine."""
    lines = []
    for node in nodes_of(source):
        if not isinstance(node, ast.Call):
            continue
        method = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        function = node.func.id if isinstance(node.func, ast.Name) else ""
        opened = "open" in (method, function) and _is_text(node)
        said = any(keyword.arg == "encoding" for keyword in node.keywords)
        if not said and (opened or method in ("read_text", "write_text")):
            lines.append(node.lineno)
    return lines


def _is_text(call):
    """Whether an `open` is of a text: one whose mode is known, and has no b."""
    path = isinstance(call.func, ast.Attribute)
    modes = [keyword.value for keyword in call.keywords if keyword.arg == "mode"]
    modes += call.args[0 if path else 1 :][:1]
    if not modes:
        return not call.args or not path  # path.open(), open(path): "r"
    return isinstance(modes[0], ast.Constant) and str(modes[0].value) in ("r", "w", "a", "x", "rt")


@pytest.mark.parametrize("place", PLACES)
def test_no_text_is_in_the_encoding_of_the_machine(place):
    for path, text in texts_of(place).items():
        assert without_encoding(text) == [], path


def test_the_rule_catches_what_leaves_it_to_the_machine():
    for planted in (
        "path.write_text('x')",
        "(folder / 'a').read_text()",
        "path.open()",
        "path.open('w', newline='')",
        "open(path)",
        "open(path, 'r')",
    ):
        assert without_encoding(planted) == [1], planted
    for right in (
        "path.write_text('x', encoding='utf-8')",
        "path.open('rb')",
        "os.open(path, os.O_RDWR)",
        "gzip.open(path, 'rb')",
        "open(path, 'wb')",
        "path.open(encoding='utf-8')",
    ):
        assert without_encoding(right) == [], right
