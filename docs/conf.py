"""How the documents become a site: `make docs` executes the notebooks and keeps their outputs."""

import os
import re
import shutil
import sys
import tempfile
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
DATA = DOCS / "notebooks" / "data"  # lies beside a notebook that reads it

project = "tireid"
author = "The tireid developers"
release = version = installed("tireid")
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
myst_heading_anchors = 3
# Pages of names are made with the first of these.
source_suffix = {".rst": "restructuredtext", ".md": "myst-nb", ".ipynb": "myst-nb"}
templates_path = ["templates"]
exclude_patterns = ["templates"]
html_theme = "furo"
html_title = f"tireid {release}"
html_copy_source = False
html_show_copyright = False
html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["tireid.css"]
smartquotes = False
default_role = "literal"  # in docstrings single back-ticks are code

nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_merge_streams = True
PROFILE = Path(tempfile.mkdtemp(prefix="ipython"), "profile_default")
PROFILE.mkdir()
(PROFILE / "ipython_kernel_config.py").write_text(
    "c.IPKernelApp.log_level = 'ERROR'\nc.InlineBackend.figure_formats = {'retina'}\n"
    f"c.IPKernelApp.exec_lines = [\"__import__('shutil').copytree({str(DATA)!r}, 'data')\"]\n"
)
os.environ["IPYTHONDIR"] = str(PROFILE.parent)
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # of tireid

autosummary_generate = True
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


def skips(_app: Any, _what: str, _name: str, it: Any, *_rest: Any) -> bool | None:
    """Leave out the fields of tuples with names: their parameters say what they are."""
    return True if type(it).__name__ == "_tuplegetter" else None


def setup(app: Any) -> None:
    """Rewrite docstrings before napoleon reads them, and signatures; make pages of names anew."""
    import tireid

    sys.modules["tireid.paths"] = tireid.paths  # is `mpc.path`, found by the name of the interface
    shutil.rmtree(DOCS / "generated", ignore_errors=True)
    app.connect("autodoc-process-signature", shorten)
    app.connect("autodoc-skip-member", skips)
    app.connect("autodoc-process-docstring", describe, priority=400)
