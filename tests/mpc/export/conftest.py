"""Packages of both kinds of tires that can be handed over, alone and with their identifiers."""

import shutil
import subprocess

import pytest

from identifier.export.package import build_package
from identifier.methods import make_method
from models.vehicle import sedan
from mpc.export.pair import build_pair
from tests.identifier.export.conftest import STRICT as STRICT  # the same flags for both

LAWS = ("integral", "axle")


@pytest.fixture(scope="session")
def pairs():
    """By law: identifier and tracker for the sedan."""
    if shutil.which("gcc") is None:
        pytest.skip("needs gcc")
    car = sedan()
    return {law: build_pair(build_package(make_method(law, car), car)) for law in LAWS}


@pytest.fixture(scope="session")
def packages(pairs):
    """By law, the tracker alone."""
    return {law: pair.tracker for law, pair in pairs.items()}


def put(folder, files):
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


@pytest.fixture
def write(tmp_path):
    """A function that writes the package of a tracker and returns its folder."""
    return lambda package: put(tmp_path, package.files)


@pytest.fixture
def write_pair(tmp_path):
    """A function that writes both packages and what joins them."""

    def written(pair):
        put(tmp_path / "identifier", pair.identifier.files)
        put(tmp_path / "mpc", pair.tracker.files)
        return put(tmp_path, pair.files)

    return written


@pytest.fixture
def run():
    """A function that runs a command and returns its answer, whatever its exit code."""

    def ran(*command, cwd=None):
        if shutil.which(command[0]) is None:
            pytest.skip(f"needs {command[0]}")
        return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)

    return ran


def c_files(folder, under="src"):
    return sorted(path.relative_to(folder).as_posix() for path in (folder / under).glob("*.c"))


@pytest.fixture(params=["gcc", "clang"])
def compiler(request):
    if shutil.which(request.param) is None:
        pytest.skip(f"needs {request.param}")
    return request.param
