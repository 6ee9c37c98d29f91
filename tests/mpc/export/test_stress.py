"""Hostile measurements and weights that change while driving, under AddressSanitizer and UBSan."""

import re
from pathlib import Path

import pytest

from models.vehicle import sedan
from mpc.export.package import build_mpc_package
from mpc.problem import Problem
from mpc.tires import prediction_tire
from tests.mpc.export.conftest import LAWS, c_files, planted

HOSTILE = (Path(__file__).parent / "hostile.c").read_text()
SANITIZED = "-std=c99 -g -ffp-contract=off -fsanitize=address,undefined -fno-sanitize-recover=all"
SOLVES, BUILDS = "-O1", "-O0"  # thousands of solves wait for the program, an alarm for the compiler


def build(folder, run, single, steps, optimized=SOLVES):
    (folder / "hostile.c").write_text(HOSTILE)
    macros = [f"-DTIREID_MPC_SINGLE={single}", f"-DSTEPS={steps}L"]
    flags = [*SANITIZED.split(), optimized, *macros]
    words = [*flags, "-Iinclude", "-Isrc", *c_files(folder), "hostile.c", "-lm", "-o", "hostile"]
    answer = run("gcc", *words, cwd=folder)
    if "cannot find" in answer.stderr and "san" in answer.stderr:
        pytest.skip("needs the sanitizers of gcc")
    assert answer.returncode == 0, answer.stderr
    return str(folder / "hostile")


@pytest.mark.heavy
@pytest.mark.parametrize("steps", [1000, 3000])
@pytest.mark.parametrize("law", LAWS)
def test_thousands_of_hostile_measurements_find_nothing(law, steps, packages, write, run):
    answer = run(build(write(packages[law]), run, 0, steps=steps))
    assert (answer.returncode, answer.stderr) == (0, ""), answer.stdout + answer.stderr
    counts = {name: int(n) for name, n in re.findall(r"(\w+) (\d+)", answer.stdout)}
    assert counts.pop("unsolved") == 0
    assert sum(counts.values()) == steps
    assert counts["limit"] <= steps // 100
    assert counts["failed"] <= steps // 50  # infinite in all but name: 1e300 is finite
    assert all(
        counts[name] > steps // 300 for name in ("not_finite", "off_path", "off_map", "slow")
    )


@pytest.mark.sweep("*is_number*")
@pytest.mark.parametrize(
    ("file", "pattern", "replacement", "complaint"),
    [
        ("src/tireid_mpc.c", r"!is_number\(in\)", "false", "of measurement"),
        ("src/tireid_mpc.c", r"count\(state, status\);", ";", "was not counted"),
        (
            "src/tireid_mpc.c",
            r"tireid_mpc_clipped\(wanted - last, most\)",
            "((real)9 * (wanted - last)) + ((real)0 * most)",
            "changes by",
        ),
        ("include/tireid_mpc.h", r"dx\[TIREID_MPC_HORIZON \+ 1U\]", "dx[TIREID_MPC_HORIZON]", ""),
    ],
)
def test_without_a_guard_the_alarm_rings(file, pattern, replacement, complaint, write, run):
    folder = write(build_mpc_package(prediction_tire(sedan()), Problem(horizon=8)))
    planted(folder, file, pattern, replacement)
    answer = run(build(folder, run, 0, steps=500, optimized=BUILDS))
    assert answer.returncode != 0
    if complaint:
        assert re.search(complaint, answer.stdout), answer.stdout + answer.stderr
    else:
        assert "runtime error" in answer.stderr
