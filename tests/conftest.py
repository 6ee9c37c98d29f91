"""What several tests need: recordings beside the checkout, a seeded generator, figures that cost
little; what is heavy.
"""

import gc
import os
import time
import tomllib
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import pytest

from tests.optional_tools import listen, unlisted

gc.disable()  # until all is collected: what is imported until then stays
for flag in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL"):  # packages are built as from a shell
    os.environ.pop(flag, None)

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
# Of these each test takes longest: begun first, they do not keep one worker busy at the end.
LONGEST = ("tests/tireid/", "tests/benchmarks/")
ASKED: set[str] = set()  # commands that the test which runs has looked for or run
listen(ASKED)
HEAVY = tomllib.loads(Path(__file__).with_name("heavy.toml").read_text(encoding="utf-8"))["heavy"]


def kept(case: str, entry: dict) -> str | None:
    """The pattern by which a case of a heavy test stays quick, if one does."""
    return next((pattern for pattern in entry.get("keep", ()) if fnmatchcase(case, pattern)), None)


def sort_out(items, entries) -> list[str]:
    """Mark what is heavy; return the entries, and patterns of them, that nothing in a file meets.

    Files without a test are left out: they are skipped where a package is missing.
    """
    by_name = {entry["test"]: entry for entry in entries}
    files = {item.nodeid.partition("::")[0] for item in items}
    unmet = {
        (name, pattern)
        for name, entry in by_name.items()
        for pattern in (None, *entry.get("keep", ()))
        if name.partition("::")[0] in files
    }
    for item in items:
        name, _, case = item.nodeid.partition("[")
        if name in by_name:
            pattern = kept(case.removesuffix("]"), by_name[name])
            unmet.discard((name, pattern))
            if pattern is None:
                item.add_marker(pytest.mark.heavy)
    return sorted(name if pattern is None else f"{name}: {pattern}" for name, pattern in unmet)


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(config, items):
    unmet = sort_out(items, HEAVY)
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))
    if unmet and config.args == config.getini("testpaths") and not config.option.keyword:
        raise pytest.UsageError("tests/heavy.toml names what is not there: " + ", ".join(unmet))


def pytest_collection_finish():
    """Let garbage be looked for, but not in modules and tests again and again: they stay."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_runtest_setup(item):
    """Leave out what is heavy and begins after a moment that was told, and say so."""
    ASKED.clear()
    until = os.environ.get("TIREID_HEAVY_UNTIL")
    if until and item.get_closest_marker("heavy") and time.time() > float(until):
        pytest.skip("no time is left for what is heavy: `make heavy` runs it")


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
def shared_data() -> Path:
    """The folder of recordings, tire files and golden values; they are not part of the project."""
    if not SHARED_DATA.is_dir():
        pytest.skip("needs the recordings of ../shared/data, which are not part of the project")
    return SHARED_DATA


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260101)


# What takes longest in a command is to draw its figures; who reads files and words need not wait.
PNG, SVG = b"\x89PNG\r\n\x1a\n", b"<?xml"


def without_ink(patch) -> None:
    """Leave out what takes longest in a figure, for what a module's tests share, too."""
    patch.setattr("tireid.figures.style.figure_png", lambda *_, **__: PNG)
    patch.setattr("tireid.figures.style.figure_svg", lambda _: SVG)


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made as ever; on paper and on the page they are empty."""
    without_ink(monkeypatch)


@pytest.fixture
def unmade(monkeypatch, undrawn):
    """As `undrawn`, and `tireid identify` makes no axes either, which take as long as learning."""
    from matplotlib.figure import Figure

    from tireid import identified

    for name in dir(identified):
        if name.endswith("_figure") and name != "save_figure":
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
