"""The wheel, in a folder of its own: it runs there, and a project outside sees its types."""

import importlib
import importlib.util
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.test_own_packages import SEDAN, SPAWNED, put_strangers

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("codegen", "models", "identifier", "mpc", "tireid")
LIBRARIES = ("numpy", "casadi", "scipy", "control", "matplotlib", "PIL")
NEEDED = ("hatchling", "pip", "mypy")
OUTSIDE = """import numpy as np
import tireid as ti

car: ti.Vehicle = ti.sedan()
log: ti.Recording = ti.read_recording("log.csv")
run = ti.identify(log, car, ti.AxleIdentifier.for_vehicle(car))
tire: ti.TireModel = run.freeze()
one: float = tire.force(0.05, "front")
many = tire.force(np.linspace(-0.1, 0.1, 11), axle="rear")
reveal_type(many)
reveal_type(run)
reveal_type(tire.stiffness)
reveal_type(ti.replay(log, tire).against_truth)
reveal_type(ti.certify(ti.PaperIdentifier.for_vehicle(car), car).verdict)
reveal_type(ti.drive(ti.paths.iso_3888_2(), car, tire).scores)
reveal_type(ti.__version__)
"""
REVEALED = (
    "numpy.ndarray",
    "tireid.run.Run",
    "numpy.ndarray",
    "identifier.reproducibility.AxleRmse | None",
    "Literal['not certified']",
    "mpc.loop.record.Scores",
    "str",
)
WRONG = """import tireid as ti

tire: int = ti.TireModel.load("tire.json")
ti.identify("log.csv", ti.sedan())
ti.sedan().mas
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The Python of an environment that holds the wheel, and what it needs, but not the source."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        pytest.skip(f"building the wheel needs {', '.join(missing)} in this environment")
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    done = subprocess.run(
        [*build, "--wheel-dir", str(folder), str(ROOT)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    environment = folder / "env"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True)
    python = environment / "bin" / "python"
    told = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        capture_output=True,
        text=True,
        check=True,
    )
    packages = Path(told.stdout.strip())
    with zipfile.ZipFile(wheel) as file:
        file.extractall(packages)
    # What it needs lies where it lies here; files .pth there, of editable installs, do not count.
    homes = {Path(importlib.import_module(name).__file__ or "").parents[1] for name in LIBRARIES}
    (packages / "dependencies.pth").write_text("".join(f"{home}\n" for home in sorted(homes)))
    return python, packages


def run_in(folder, *command):
    words = [str(word) for word in command]
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(words, cwd=folder, env=own, capture_output=True, text=True)


def test_every_package_says_that_it_is_typed(installed):
    _, packages = installed
    for name in PACKAGES:
        assert (packages / name / "py.typed").is_file(), name


def test_the_wheel_runs_from_another_folder(installed, tmp_path):
    python, packages = installed
    code = (
        "import tireid as ti, pathlib; home = pathlib.Path(ti.__file__).parents[1]; "
        "print(home, ti.sedan().name, ti.paths.iso_3888_2().closed)"
    )
    done = run_in(tmp_path, python, "-c", code)
    assert done.stdout.split() == [str(packages), "sedan", "False"], done.stderr
    assert run_in(tmp_path, python, "-m", "tireid").stdout.startswith("usage: tireid")


@pytest.mark.parametrize("code", [SEDAN, SPAWNED], ids=["here", "spawned"])
def test_the_wheel_runs_beside_strangers_of_its_packages_names(installed, tmp_path, code):
    python, packages = installed
    put_strangers(tmp_path)
    done = run_in(tmp_path, python, "-c", f"{code}\nprint(ti.__file__)")
    assert done.stdout.split() == ["sedan", f"{packages}/tireid/__init__.py"], done.stderr


@pytest.mark.heavy
def test_a_project_outside_sees_the_types(installed, tmp_path):
    python, _ = installed
    (tmp_path / "mine.py").write_text(OUTSIDE)
    (tmp_path / "wrong.py").write_text(WRONG)
    mypy = [sys.executable, "-m", "mypy", "--strict", "--python-executable", python]
    done = run_in(tmp_path, *mypy, "mine.py", "wrong.py")
    lines = done.stdout.splitlines()
    revealed = [line for line in lines if "Revealed type" in line]
    assert len(revealed) == len(REVEALED), done.stdout + done.stderr
    for line, expected in zip(revealed, REVEALED, strict=True):
        assert expected in line, line
    errors = [line for line in lines if ": error:" in line]
    assert [line.split(":")[:2] for line in errors] == [
        ["wrong.py", "3"],
        ["wrong.py", "4"],
        ["wrong.py", "5"],
    ], done.stdout
