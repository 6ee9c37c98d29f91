"""Packages of the paper's identifier and of the default method, and 45 s of driving."""

import shutil
import subprocess

import numpy as np
import pytest

from identifier.export.compiled import samples_of
from identifier.export.package import build_package
from identifier.methods import make_method
from models.maneuvers import Slalom
from models.plant import Plant
from models.vehicle import sedan

STRICT = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Wdouble-promotion",
    "-Werror",
]


@pytest.fixture(scope="session")
def packages():
    """By law: the paper's network, and the method that tireid learns by."""
    car = sedan()
    return {law: build_package(make_method(law, car), car) for law in ("integral", "axle")}


@pytest.fixture(scope="session")
def slalom():
    """45 s of a slalom of the sedan."""
    maneuver = Slalom(
        amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=44.99
    )
    return Plant(sedan()).simulate(maneuver, speed=20.0).recording()


@pytest.fixture(scope="session")
def samples(slalom):
    """The slalom as rows, with a halt and a fault in between."""
    rows = samples_of(slalom)
    rows[2000:2020, 0] = 0.3
    rows[2500, 1] = np.nan
    return rows


def put(folder, files):
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


@pytest.fixture
def write(tmp_path):
    """A function that writes a package and returns its folder."""
    return lambda package: put(tmp_path, package.files)


@pytest.fixture
def run():
    """A function that runs a command and returns its answer, whatever its exit code."""

    def ran(*command, cwd=None):
        if shutil.which(command[0]) is None:
            pytest.skip(f"needs {command[0]}")
        return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)

    return ran


@pytest.fixture(params=["gcc", "clang"])
def compiler(request):
    if shutil.which(request.param) is None:
        pytest.skip(f"needs {request.param}")
    return request.param
