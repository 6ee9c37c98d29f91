"""Words from data inside a language: one function each, after which they are words and no more.

Names of cars, of recordings and of files come from outside. Wherever they enter a text that a
program reads, they pass the function of that program's language. What does not print (controls,
ends of lines, marks that turn the direction of writing, halves of pairs) is shown as an escape, so
that no name breaks a line, rings a bell or hides what follows it.
"""

import html as standard_html
import unicodedata
from typing import Any

MARKDOWN = frozenset("\\`*_{}[]<>#|~!&$@")  # what means something inside a paragraph or a table
LONGEST_DISPLAYED = 60  # characters of a value in a message


def visible(text: str, *, keep: str = "") -> str:
    r"""Return text with escapes, as `\x1b`, in place of all that does not print."""
    return "".join(
        one
        if one in keep or one.isprintable() or unicodedata.category(one) == "Zs"
        else one.encode("unicode_escape").decode("ascii")
        for one in text
    )


def displayed(value: Any) -> str:
    """Return a value as a message shows it: short, on one line, without controls."""
    if isinstance(value, int) and value.bit_length() > 128:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, dict | list | tuple):
        return f"a {'table' if isinstance(value, dict) else 'list'} of {len(value)}"
    text = repr(value[: LONGEST_DISPLAYED + 1] if isinstance(value, str | bytes) else value)
    return visible(text if len(text) <= LONGEST_DISPLAYED else f"{text[:LONGEST_DISPLAYED]}...")


def c_comment(text: str) -> str:
    """Return text for the inside of a C comment between /* and */, with a blank on either side.
    text : any; it can neither end the comment nor seem to begin another.
    """
    inside = visible(text)
    for pair in ("*/", "/*", "//", "??"):  # ?? begins a trigraph, of which ??/ is a backslash
        while pair in inside:
            inside = inside.replace(pair, " ".join(pair))
    return inside


def c_string(text: str) -> str:
    """Return text for the inside of a C string literal, which then holds it in UTF-8.
    text : any; halves of surrogate pairs are shown as escapes.
    """
    data = text.encode("utf-8", "backslashreplace")
    return "".join(
        chr(byte) if 0x20 <= byte < 0x7F and byte not in b'"\\?' else f"\\{byte:03o}"
        for byte in data
    )


def cmake_comment(text: str) -> str:
    """Return text for a line comment of CMake, behind the # and a space.
    text : any; it stays on its line and begins no bracket.
    """
    return visible(text).replace("[", "(").replace("]", ")")


def markdown(text: str) -> str:
    """Return text for a paragraph or a table of Markdown.
    text : any; it is shown as it stands, without marks, links, formulas or HTML.
    """
    return "".join(f"&#{ord(one)};" if one in MARKDOWN else one for one in visible(text))


def html(text: str) -> str:
    """Return text for an element or a quoted attribute of HTML.
    text : any; ends of lines stay.
    """
    return standard_html.escape(visible(text, keep="\n"))


def mathtext(text: str) -> str:
    """Return text for a label of a figure, where a dollar begins no formula."""
    return visible(text).replace("$", r"\$")


def terminal(text: str) -> str:
    """Return text for a person's terminal, which it cannot command; ends of lines stay."""
    return visible(text, keep="\n")
