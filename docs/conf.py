"""How the documents become a site: `make docs`."""

import json
import re
from importlib.metadata import version as installed
from typing import Any

project = "tireid"
author = "The tireid developers"
release = version = installed("tireid")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_heading_anchors = 3
source_suffix = {".md": "markdown", ".ipynb": "notebook"}
html_theme = "furo"
html_title = "tireid"
html_copy_source = False
html_show_copyright = False
smartquotes = False
default_role = "literal"  # in docstrings single back-ticks are code

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_attr_annotations = False  # the signature has them
python_maximum_signature_line_length = 88
nitpick_ignore_regex = [(r"py:.*", r".*")]  # types of other packages have no page here

ARRAY = "~numpy.ndarray[tuple[~typing.Any, ...], ~numpy.dtype[~numpy.float64]]"
ENTRY = re.compile(r"^([\w*]+(?:, [\w*]+)*) : (.*)$")


def describe(_app: Any, _what: str, _name: str, _it: Any, _options: Any, lines: list[str]) -> None:
    """Put the words of "name : words" below the name: the type is in the signature."""
    section, out = "", []
    for k, line in enumerate(lines):
        if k + 1 < len(lines) and re.fullmatch(r"-{3,}", lines[k + 1]):
            section = line
        entry = ENTRY.match(line) if section == "Parameters" else None
        out += [entry[1], f"    {entry[2]}"] if entry else [line]
    lines[:] = [line.replace("|", r"\|") for line in out]


def shorten(*event: Any) -> tuple[str | None, ...]:
    """Say Array, as the code does, where the signature spells it out."""
    return tuple(text.replace(ARRAY, "Array") if text else None for text in event[-2:])


def markdown_of(notebook: str) -> str:
    """Return a notebook, without outputs, as Markdown."""
    texts = []
    for cell in json.loads(notebook)["cells"]:
        text = "".join(cell["source"])
        texts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    return "\n\n".join(texts) + "\n"


def setup(app: Any) -> None:
    """Rewrite docstrings before napoleon reads them, and signatures; read notebooks."""
    from myst_parser.parsers.sphinx_ import MystParser

    class NotebookParser(MystParser):
        """Reads a notebook as the Markdown that it holds."""

        supported = ("notebook",)

        def parse(self, inputstring: str, document: Any) -> None:
            super().parse(markdown_of(inputstring), document)

    app.add_source_parser(NotebookParser)
    app.connect("autodoc-process-signature", shorten)
    app.connect("autodoc-process-docstring", describe, priority=400)
