"""Packages of both kinds of tires that can be handed over, alone and with their identifiers."""

import re
import shutil

import pytest

from identifier.export.package import build_package
from identifier.methods import make_method
from models.vehicle import sedan
from mpc.export.package import build_mpc_package
from mpc.export.pair import build_pair
from mpc.tires import prediction_tire
from tests.identifier.export.conftest import STRICT as STRICT
from tests.identifier.export.conftest import compiler as compiler
from tests.identifier.export.conftest import put
from tests.identifier.export.conftest import run as run
from tests.identifier.export.test_emitted import TIRES, fitted
from tests.kept import Kept

LAWS = ("integral", "axle")


@pytest.fixture(scope="session")
def pairs():
    """By law: identifier and tracker for the sedan."""
    if shutil.which("gcc") is None:
        pytest.skip("needs gcc")
    car = sedan()
    return Kept(lambda law: build_pair(build_package(make_method(law, car), car)))


@pytest.fixture(scope="session")
def packages(pairs):
    """By law, the tracker alone; "fit": that of a fit's own curve."""

    def tracker(law):
        return (
            build_mpc_package(prediction_tire(fitted(**TIRES)))
            if law == "fit"
            else pairs[law].tracker
        )

    return Kept(tracker)


@pytest.fixture
def write(tmp_path):
    """A function that writes the package of a tracker and returns its folder."""
    return lambda package: put(tmp_path, package.files)


@pytest.fixture
def write_pair(tmp_path):
    """A function that writes both packages and what joins them."""

    return lambda pair: put_pair(tmp_path, pair)


def put_pair(folder, pair):
    put(folder / "identifier", pair.identifier.files)
    put(folder / "mpc", pair.tracker.files)
    return put(folder, pair.files)


def planted(folder, file, pattern, replacement):
    """Change the text of a file of a package at one place."""
    text = (folder / file).read_text()
    changed = re.sub(pattern, replacement, text, count=1)
    assert changed != text
    (folder / file).write_text(changed)


def c_files(folder, under="src"):
    return sorted(path.relative_to(folder).as_posix() for path in (folder / under).glob("*.c"))
