"""Whatever lies beside a script, tireid is run with its own packages, or says what hides them."""

import subprocess
import sys

import pytest

SEDAN = "import tireid as ti; print(ti.sedan().name)"
# The other process unpickles a car before it has imported anything of tireid.
SPAWNED = """
import dataclasses, os
import tireid as ti
from identifier.compare.work import fresh_processes
os.environ.pop("OPENBLAS_NUM_THREADS", None)
with fresh_processes(2) as pool:
    assert pool.submit(os.getenv, "OPENBLAS_NUM_THREADS").result() == "1"  # a thread a process
    assert "OPENBLAS_NUM_THREADS" not in os.environ
    print(*(found["name"] for found in pool.map(dataclasses.asdict, [ti.sedan()])))
"""


def put_strangers(folder):
    """Write files and folders of the names of tireid's packages; whoever imports one fails."""
    for name in ("models", "identifier"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text(f"raise SystemExit('{name} is a stranger')\n")
    for name in ("codegen", "models", "mpc"):
        (folder / f"{name}.py").write_text(f"raise SystemExit('{name}.py is a stranger')\n")


def run_in(folder, *words):
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("code", [SEDAN, SPAWNED], ids=["here", "spawned"])
@pytest.mark.parametrize("how", ["-c", "a script"])
def test_strangers_of_the_same_names_are_not_imported(tmp_path, code, how):
    put_strangers(tmp_path)
    (tmp_path / "script.py").write_text(
        "if __name__ == '__main__':\n" + "".join(f"    {line}\n" for line in code.splitlines())
    )
    ran = run_in(tmp_path, *(["-c", code] if how == "-c" else ["script.py"]))
    assert (ran.stdout, ran.stderr) == ("sedan\n", "")


def test_the_command_finds_its_own_packages_too(tmp_path):
    put_strangers(tmp_path)
    ran = run_in(tmp_path, "-m", "tireid", "init", "car.toml")
    assert ran.returncode == 0, ran.stderr
    assert "mass" in (tmp_path / "car.toml").read_text()


@pytest.mark.parametrize("file", ["models.py", "codegen/__init__.py"])
def test_a_stranger_that_was_imported_first_is_named(tmp_path, file):
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text("")
    name = file.partition("/")[0].removesuffix(".py")
    ran = run_in(tmp_path, "-c", f"import {name}, tireid")
    place = tmp_path / file.partition("/")[0]
    assert ran.stderr.splitlines()[-1] == (
        f"ImportError: {place} hides the package '{name}' of tireid, as it was imported first: "
        "rename it"
    )
