"""Hostile measurements and weights that change while driving, under AddressSanitizer and UBSan."""

import re
from pathlib import Path

import pytest

from models.vehicle import sedan
from mpc.export.package import build_mpc_package
from mpc.problem import Problem
from mpc.tires import prediction_tire
from tests.identifier.export.conftest import BUILDS, RUNS, sanitized
from tests.mpc.export.conftest import LAWS, c_files, planted

HOSTILE = Path(__file__).parent / "hostile.c"


def build(folder, run, steps, optimized=RUNS):
    macros = ["-DTIREID_MPC_SINGLE=0", f"-DSTEPS={steps}L"]
    return sanitized(folder, run, HOSTILE, c_files(folder), macros, optimized)


@pytest.mark.heavy
@pytest.mark.parametrize("steps", [1000, 3000])
@pytest.mark.parametrize("law", LAWS)
def test_thousands_of_hostile_measurements_find_nothing(law, steps, packages, write, run):
    answer = run(build(write(packages[law]), run, steps))
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
    answer = run(build(folder, run, 500, BUILDS))
    assert answer.returncode != 0
    if complaint:
        assert re.search(complaint, answer.stdout), answer.stdout + answer.stderr
    else:
        assert "runtime error" in answer.stderr
