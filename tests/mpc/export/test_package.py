"""The tracker's package: no warnings, no foreign symbols, the same bytes, and its self-test."""

import hashlib
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from models.vehicle import sedan
from mpc.export.package import build_mpc_package, mpc_readme
from mpc.problem import Cost, Problem
from mpc.realtime import Tracker
from mpc.tires import prediction_tire
from tests.identifier.export.conftest import (
    ALLOWED,
    require_no_fast_math,
    require_own_symbols,
    require_silence,
)
from tests.mpc.export.conftest import LAWS, STRICT, c_files, planted

CAR = sedan()
SHORT = Problem(horizon=8)


@pytest.mark.heavy
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("single", [0, 1])
def test_no_compiler_has_anything_to_say(law, single, compiler, packages, write, run):
    folder = write(packages[law])
    flags = f"-DTIREID_MPC_SINGLE={single}", "-Iinclude", "-Isrc"
    sources = [*c_files(folder), *c_files(folder, "tests")]
    require_silence(folder, run, compiler, sources, *flags)


@pytest.mark.heavy
def test_symbols_begin_with_the_name_and_nothing_is_called_but_roots_and_copies(
    compiler, write, run
):
    folder = write(build_mpc_package(prediction_tire(CAR), SHORT, name="left_mpc"))
    allowed = ALLOWED | {"memmove"}
    require_own_symbols(folder, run, compiler, c_files(folder), "left_mpc", allowed)


@pytest.mark.sweep("gcc--ffast-math", "clang--Ofast", "*finite*")
@pytest.mark.parametrize("flag", ["-Ofast", "-ffast-math", "-ffinite-math-only"])
def test_fast_math_is_refused(flag, compiler, packages, write, run):
    folder = write(packages["integral"])
    require_no_fast_math(folder, run, compiler, c_files(folder), flag)


def test_the_same_input_gives_the_same_bytes():
    one, two = (build_mpc_package(prediction_tire(CAR), SHORT) for _ in range(2))
    assert one.files == two.files
    assert mpc_readme(one, "") == mpc_readme(two, "")


@pytest.mark.heavy
def test_everything_that_goes_in_changes_the_hash():
    tire = prediction_tire(CAR)
    packages = [
        build_mpc_package(tire, SHORT),
        build_mpc_package(tire, SHORT, single=True),
        build_mpc_package(tire, SHORT, name="other_mpc"),
        build_mpc_package(tire, SHORT, period=0.02),
        build_mpc_package(tire, SHORT, delay=0.02),
        build_mpc_package(tire, replace(SHORT, cost=Cost(course=0.2))),
        build_mpc_package(tire, replace(SHORT, horizon=9)),
        build_mpc_package(tire._replace(weights=1.01 * tire.weights), SHORT),
        build_mpc_package(tire._replace(vehicle=replace(CAR, mass=CAR.mass + 1.0)), SHORT),
    ]
    assert len({package.about["hash"] for package in packages}) == len(packages)


def test_the_manifest_tells_all_that_went_in(packages):
    package = packages["axle"]
    manifest = json.loads(package.files["tireid_mpc.json"])
    assert manifest["vehicle"]["mass"] == CAR.mass
    assert manifest["problem"]["horizon"] == 40
    assert manifest["tire"]["kind"] == "LadderAxles"
    np.testing.assert_array_equal(manifest["params"]["weights"], package.tire.weights)
    for path, hashed in manifest["files_sha256"].items():
        assert hashlib.sha256(package.files[path].encode()).hexdigest() == hashed


def self_test(folder, run, compiler, single):
    sources = [*c_files(folder), *c_files(folder, "tests")]
    words = [
        *STRICT,
        "-O2",
        "-ffp-contract=off",
        f"-DTIREID_MPC_SINGLE={single}",
        "-Iinclude",
        "-Isrc",
    ]
    answer = run(compiler, *words, *sources, "-lm", "-o", "self_test", cwd=folder)
    assert answer.returncode == 0, answer.stderr
    return run(str(folder / "self_test"))


@pytest.mark.sweep("gcc-0-axle", "clang-1-axle")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("single", [0, 1])
def test_steering_is_that_of_python_in_double_bit_for_bit(
    single, law, compiler, packages, write, run
):
    answer = self_test(write(packages[law]), run, compiler, single)
    assert answer.returncode == 0, answer.stdout
    assert ("largest difference of the steering: 0 rad" in answer.stdout) == (not single)


def test_the_vectors_are_those_of_a_tracker_that_plans_and_falls_back(packages):
    package = packages["axle"]
    v = package.vectors
    counts = np.bincount(v.expected[:, 1].astype(int), minlength=9)
    assert counts[0] > 180
    assert counts[4] == counts[5] == 2  # off the path, off the map
    assert counts[6] > 0  # too slow
    tracker = Tracker(package.tire, package.problem, period=0.01, delay=0.03)
    again = [tracker.step(v.measurement(k, 40)) for k in range(len(v.measured))]
    np.testing.assert_array_equal([c.steering for c in again], v.expected[:, 0])
    np.testing.assert_array_equal([int(c.status) for c in again], v.expected[:, 1])
    believed = v.expected[:, 1] == 0
    assert 0.2 < np.abs(v.measured[believed, 0]).max() < 0.5
    assert np.abs(v.measured[believed][-30:, 0]).max() < 0.1


@pytest.mark.heavy
@pytest.mark.parametrize(
    ("file", "pattern", "replacement", "complaint"),
    [
        (
            "tests/tireid_mpc_vectors.h",
            r"(vector_output.*\n    \{ -?0\.0)",
            r"\g<1>1",
            "steering is that",
        ),
        ("src/tireid_mpc_tables.h", r"car \*/ \{ R\(1", r"\g<0>1", "steering is that"),
        ("src/tireid_mpc.c", r"!is_number\(in\)", "false", "NaN is refused"),
        ("src/tireid_mpc.c", r"(count\(state, status\);)", r"/* \1 */", "refused is counted"),
    ],
)
def test_the_self_test_sees_a_planted_error(
    file, pattern, replacement, complaint, packages, write, run
):
    folder = write(packages["integral"])
    planted(folder, file, pattern, replacement)
    words = ["-std=c99", "-O1", "-Iinclude", "-Isrc", "-o", "self_test"]
    sources = [*c_files(folder), *c_files(folder, "tests")]
    assert run("gcc", *words, *sources, "-lm", cwd=folder).returncode == 0
    answer = run(str(folder / "self_test"))
    assert answer.returncode == 1
    assert f"FAILED: {complaint}" in re.sub(r"FAILED: what is", "FAILED:", answer.stdout)
