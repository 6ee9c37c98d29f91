"""Packages of the paper's identifier, the default method and the inertial one; 45 s of driving."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from identifier.axle.band import BandCalibration
from identifier.export.compiled import samples_of
from identifier.export.package import build_package
from identifier.methods import make_method
from models.vehicle import sedan
from tests.identifier.conftest import slalom_of
from tests.kept import Kept

STRICT = [
    "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion",
    "-Werror",
]  # fmt: skip
TWO = ("integral", "axle")
BANKED = "axle, with a_y and band"
CALIBRATION = BandCalibration(
    factors=np.array([[0.5, 0.7, 1.2, 0.9, 2.0, 1.0], [1.5, 1.2, 0.8, 0.7, 1.1, 3.0]]),
    speeds=np.array([[1.1, 0.9, 1.0, 0.8], [0.7, 1.3, 1.2, 1.0]]),
    color=np.array([3.0, 12.0]),
    speed=19.0,
    noise=np.array([0.03, 0.02, 0.001]),
)


@pytest.fixture(scope="session")
def packages():
    """By law, also of the default that reads a_y and tells its band."""
    car = sedan()

    def make(law):
        if law == BANKED:
            return banded(car, with_a_y=True)
        return build_package(make_method(law, car), car)

    return Kept(make)


def banded(car, **options):
    """A package of the default that tells its band, which somebody has calibrated."""
    axle = make_method("axle", car)
    start = replace(axle.frozen(car, axle.setup(car).carry), calibration=CALIBRATION)
    return build_package(axle, car, start, with_band=True, **options)


@pytest.fixture(scope="session")
def slalom():
    return slalom_of(44.99)


@pytest.fixture(scope="session")
def samples(slalom):
    """The slalom as rows, with a halt and a fault in between."""
    return with_faults(samples_of(slalom), at=1)


def with_faults(rows, at):
    rows[2000:2020, 0] = 0.3
    rows[2500, at] = np.nan
    return rows


@pytest.fixture(scope="session")
def drives(packages, slalom, samples):
    """By law, the slalom as rows of its inputs, with a halt and a fault, a_y and v_y in parts."""

    def make(law):
        if law in TWO:
            return samples
        specialized = packages[law].specialized
        rows = samples_of(slalom, [port.name for port in specialized.inputs])
        rows = with_faults(rows, at=2)
        rows[1950:1990:2, 5], rows[2150:2200, 5], rows[2350:2360, 5] = np.nan, np.inf, 1e30
        if specialized.tells_v_y:
            rows[:2250, 1] = np.nan
            rows[2300:2330, 1], rows[2380:2400, 1], rows[2400:, 1] = 1e4, -np.inf, np.nan
        return rows[1900:2600]

    return Kept(make)


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


ALLOWED = {"sqrt", "sqrtf", "floor", "floorf", "memcpy", "memset"}


def require_silence(folder, run, compiler, sources, *flags):
    """No compiler has anything to say of these files."""
    for source in sources:
        answer = run(compiler, *STRICT, "-O2", *flags, "-c", source, cwd=folder)
        assert (answer.returncode, answer.stderr) == (0, ""), source


def require_own_symbols(folder, run, compiler, sources, name, allowed=ALLOWED):
    """No data that changes; symbols begin with a name, and others are of what is allowed."""
    flags = ["-std=c99", "-O2", "-fno-stack-protector", "-Iinclude", "-Isrc", "-c", "-o", "x.o"]
    for source in sources:
        assert run(compiler, *flags, source, cwd=folder).returncode == 0
        lines = run("nm", "x.o", cwd=folder).stdout.splitlines()
        symbols = [line.split()[-2:] for line in lines]
        assert not [word for kind, word in symbols if kind in "dDbBC"], "data that changes"
        own = {word for kind, word in symbols if kind in "TR"}
        assert own and all(word.startswith(f"{name}_") for word in own)
        foreign = {word for kind, word in symbols if kind == "U"}
        assert {word for word in foreign if not word.startswith(f"{name}_")} <= allowed


def require_no_fast_math(folder, run, compiler, sources, flag):
    for source in sources:
        answer = run(compiler, flag, "-Iinclude", "-Isrc", "-c", source, cwd=folder)
        assert answer.returncode != 0
        assert "guards against NaN" in answer.stderr


SANITIZED = "-std=c99 -g -ffp-contract=off -fsanitize=address,undefined -fno-sanitize-recover=all"
RUNS, BUILDS = "-O1", "-O0"  # many steps wait for the program, an alarm for the compiler


def sanitized(folder, run, hostile, sources, macros, optimized=RUNS):
    """Build a program of hostile input under AddressSanitizer and UBSan, and return its path."""
    (folder / "hostile.c").write_text(hostile.read_text())
    words = [*SANITIZED.split(), optimized, *macros, "-Iinclude", "-Isrc", *sources, "hostile.c"]
    answer = run("gcc", *words, "-lm", "-o", "hostile", cwd=folder)
    if "cannot find" in answer.stderr and "san" in answer.stderr:
        pytest.skip("needs the sanitizers of gcc")
    assert answer.returncode == 0, answer.stderr
    return str(folder / "hostile")


@pytest.fixture(params=["gcc", "clang"])
def compiler(request):
    if shutil.which(request.param) is None:
        pytest.skip(f"needs {request.param}")
    return request.param
