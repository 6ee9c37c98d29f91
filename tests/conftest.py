"""What several tests need: recordings beside the checkout, a seeded generator, cheap figures."""

import gc
import os
import sys
from fnmatch import fnmatchcase
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from codegen import plugins
from tests.optional_tools import listen, unlisted

# The same examples in every run: no outcome hangs on one draw.
hypothesis.settings.register_profile("fixed", derandomize=True, database=None)
hypothesis.settings.load_profile("fixed")
gc.disable()  # until all is collected: what is imported until then stays
for flag in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL"):  # packages are built as from a shell
    os.environ.pop(flag, None)

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
# Of these each test takes longest: begun first, they do not keep one worker busy at the end.
LONGEST = ("tests/tireid/", "tests/benchmarks/")
ASKED = set()  # commands that the test which runs has looked for or run
listen(ASKED)


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items):
    """Of a sweep all cases are heavy but those that its mark names."""
    for item in items:
        sweep = item.get_closest_marker("sweep")
        if sweep and not any(fnmatchcase(item.callspec.id, quick) for quick in sweep.args):
            item.add_marker("heavy")
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))


def pytest_collection_finish():
    """Let garbage be looked for, but not in modules and tests again and again: they stay."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_runtest_setup():
    ASKED.clear()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Fail where a test asks for an optional tool in a file that `make bare` does not run."""
    try:
        return (yield)
    finally:
        wrong = unlisted(item.nodeid.partition("::")[0], ASKED)
        if wrong:
            pytest.fail(wrong, pytrace=False)


@pytest.fixture(scope="session")
def shared_data():
    """The folder of recordings, tire files and golden values; they are not part of the project."""
    if not SHARED_DATA.is_dir():
        pytest.skip("needs the recordings of ../shared/data, which are not part of the project")
    return SHARED_DATA


@pytest.fixture
def rng():
    return np.random.default_rng(20260101)


@pytest.fixture
def distribution(tmp_path, monkeypatch):
    """A function that puts a distribution beside tireid, as pip would write it."""
    put = []

    def installed(points, **modules):
        folder = tmp_path / "theirs-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
        (folder / "entry_points.txt").write_text(points)
        for name, text in modules.items():
            (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.syspath_prepend(str(tmp_path))
        plugins.installed.cache_clear()
        put.extend(modules)

    yield installed
    plugins.installed.cache_clear()
    for name in put:
        sys.modules.pop(name, None)


# What takes longest in a command is to draw its figures; who reads files and words need not wait.
PNG = b"\x89PNG\r\n\x1a\n"


def without_ink(patch):
    """Leave out what takes longest in a figure, for what a module's tests share, too."""
    patch.setattr("tireid.figures.style.figure_png", lambda *_, **__: PNG)


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made as ever; on paper they are empty."""
    without_ink(monkeypatch)


@pytest.fixture
def unmade(monkeypatch, undrawn):
    """As `undrawn`, and `tireid identify` makes no axes either, which take as long as learning."""
    from matplotlib.figure import Figure

    from tireid import identified

    for name in dir(identified):
        if name.endswith("_figure"):
            monkeypatch.setattr(identified, name, lambda *_, **__: Figure())


@pytest.fixture
def laid_out(monkeypatch, undrawn):
    """As `undrawn`, but a figure for paper is laid out with all that it shows, without ink."""
    from tireid.figures import style

    def empty(figure, **_):
        with style.laid_out(figure):
            figure.draw_without_rendering()
        return PNG

    monkeypatch.setattr("tireid.figures.style.figure_png", empty)
