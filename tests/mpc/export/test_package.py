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
from tests.mpc.export.conftest import LAWS, STRICT, c_files, planted

CAR = sedan()
SHORT = Problem(horizon=8)
ALLOWED = {"sqrt", "sqrtf", "floor", "floorf", "memcpy", "memset", "memmove"}


@pytest.mark.heavy
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("single", [0, 1])
def test_no_compiler_has_anything_to_say(law, single, compiler, packages, write, run):
    folder = write(packages[law])
    flags = [*STRICT, "-O2", f"-DTIREID_MPC_SINGLE={single}", "-Iinclude", "-Isrc", "-c"]
    for source in [*c_files(folder), *c_files(folder, "tests")]:
        answer = run(compiler, *flags, source, cwd=folder)
        assert (answer.returncode, answer.stderr) == (0, ""), source


@pytest.mark.heavy
def test_symbols_begin_with_the_name_and_nothing_is_called_but_roots_and_copies(
    compiler, write, run
):
    folder = write(build_mpc_package(prediction_tire(CAR), SHORT, name="left_mpc"))
    flags = ["-std=c99", "-O2", "-fno-stack-protector", "-Iinclude", "-Isrc", "-c", "-o", "x.o"]
    for source in c_files(folder):
        assert run(compiler, *flags, source, cwd=folder).returncode == 0
        lines = run("nm", "x.o", cwd=folder).stdout.splitlines()
        symbols = [line.split()[-2:] for line in lines]
        assert not [name for kind, name in symbols if kind in "dDbBC"], "data that changes"
        own = {name for kind, name in symbols if kind in "TR"}
        foreign = {name for kind, name in symbols if kind == "U"}
        assert own
        assert all(name.startswith("left_mpc_") for name in own)
        assert {name for name in foreign if not name.startswith("left_mpc_")} <= ALLOWED


@pytest.mark.sweep("gcc--ffast-math", "clang--Ofast", "*finite*")
@pytest.mark.parametrize("flag", ["-Ofast", "-ffast-math", "-ffinite-math-only"])
def test_fast_math_is_refused(flag, compiler, packages, write, run):
    folder = write(packages["integral"])
    for source in c_files(folder):
        answer = run(compiler, flag, "-Iinclude", "-Isrc", "-c", source, cwd=folder)
        assert answer.returncode != 0
        assert "guards against NaN" in answer.stderr


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


def self_test(folder, run, compiler="gcc", single=0):
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


@pytest.mark.sweep("gcc-axle")
@pytest.mark.parametrize("law", LAWS)
def test_steering_is_bit_for_bit_that_of_python_in_double(law, compiler, packages, write, run):
    answer = self_test(write(packages[law]), run, compiler)
    assert answer.returncode == 0, answer.stdout
    assert "largest difference of the steering: 0 rad" in answer.stdout


@pytest.mark.sweep("clang-axle")
@pytest.mark.parametrize("law", LAWS)
def test_float_passes_the_self_test(law, compiler, packages, write, run):
    answer = self_test(write(packages[law]), run, compiler, single=1)
    assert answer.returncode == 0, answer.stdout
    assert "largest difference of the steering: 0 rad" not in answer.stdout


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
