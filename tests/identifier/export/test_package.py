"""A package: no warnings, no foreign symbols, the same bytes, built and tested by its own files."""

import hashlib
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from identifier.export.package import build_package, readme
from identifier.methods import METHODS, make_method
from identifier.paper.network import Network
from identifier.run import identify
from models.recordings import write_recording
from models.vehicle import sedan
from tests.identifier.export.conftest import (
    BANKED,
    STRICT,
    require_no_fast_math,
    require_own_symbols,
    require_silence,
)
from tests.rivals import rival
from tests.shipped import Shipped

CAR = sedan()
MISRA_FINDINGS = 2  # may only become fewer: one operator ##, one macro for users alone


@pytest.mark.parametrize("law", ["integral", "axle", "inertial"])
def test_every_number_of_the_weights_is_looked_at_before_they_are_taken(law, packages):
    """The structure is read as one array: not one number less, and the last one too."""
    run = Shipped.of(packages[law])
    weights = run.weights
    assert run.takes(weights)
    for name, value in weights.items():
        for place in np.ndindex(value.shape):
            for bad in (np.nan, np.inf, -np.inf):
                spoilt = {**weights, name: value.copy()}
                spoilt[name][place] = bad
                assert not run.takes(spoilt)


@pytest.mark.sweep("clang-0-integral")
@pytest.mark.parametrize("law", ["integral", "axle", BANKED, "inertial"])
@pytest.mark.parametrize("single", [0, 1])
def test_no_compiler_has_anything_to_say(law, single, compiler, packages, write, run):
    folder = write(packages[law])
    define = f"-DTIREID_SINGLE={single}"
    sources = ["src/tireid.c", "src/tireid_equations.c", "examples/main.c", "tests/test_tireid.c"]
    require_silence(folder, run, compiler, sources, define, "-Iinclude", "-Isrc")


def test_the_warnings_are_on(compiler, packages, write, run):
    folder = write(packages["integral"])
    source = folder / "src" / "tireid.c"
    source.write_text(source.read_text() + "static float half(double x) { return x / 2; }\n")
    answer = run(compiler, *STRICT, "-Iinclude", "-Isrc", "-c", "src/tireid.c", cwd=folder)
    assert answer.returncode != 0


@pytest.mark.sweep("gcc-integral")
@pytest.mark.parametrize("law", ["integral", "axle", "lagged_ekf", "inertial"])
def test_symbols_begin_with_the_name_and_nothing_is_called_but_roots_and_copies(
    law, compiler, write, run
):
    folder = write(build_package(make_method(law, CAR), CAR, name="left"))
    sources = ("src/left.c", "src/left_equations.c")
    require_own_symbols(folder, run, compiler, sources, "left")


def test_fast_math_is_refused(compiler, packages, write, run):
    folder = write(packages["integral"])
    for flag in ("-Ofast", "-ffast-math", "-ffinite-math-only"):
        require_no_fast_math(folder, run, compiler, ["src/tireid.c"], flag)


@pytest.mark.heavy
def test_misra_findings_do_not_grow(packages, write, run):
    folder = write(packages["integral"])
    answer = run(
        *["cppcheck", "--addon=misra", "--std=c99", "-DTIREID_SINGLE=1", "-Iinclude", "-Isrc"],
        "src/tireid.c",
        "src/tireid_equations.c",
        cwd=folder,
    )
    if "misra" not in answer.stderr:
        pytest.skip("needs the MISRA addon of cppcheck")
    findings = set(re.findall(r"^(\S+:\d+):.*\[(misra-\S+)\]$", answer.stderr, re.M))
    assert len(findings) == MISRA_FINDINGS, sorted(findings)


@pytest.mark.sweep("axle")
@pytest.mark.parametrize("law", ["integral", "axle", "lagged_ekf"])
def test_the_same_input_gives_the_same_bytes(law, packages):
    one, two = packages[law], build_package(make_method(law, CAR), CAR)
    assert one.files == two.files
    assert readme(one, "") == readme(two, "")


def test_everything_that_goes_in_changes_the_hash(packages):
    design, axle = make_method("integral", CAR), make_method("axle", CAR)
    found = [
        packages["axle"], build_package(axle, CAR, with_a_y=True), packages["integral"],
        build_package(design, CAR, single=True), build_package(design, CAR, name="other"),
        build_package(replace(design, seed=1), CAR),
        build_package(replace(design, gains=replace(design.gains, rho_W=0.0)), CAR),
        build_package(design, replace(CAR, mass=CAR.mass + 1.0)),
        build_package(replace(design, network=Network(hidden=11)), CAR),
    ]  # fmt: skip
    assert len({package.about["hash"] for package in found}) == len(found)


def test_the_manifest_tells_all_that_went_in(packages):
    files = packages["integral"].files
    manifest = json.loads(files["tireid.json"])
    design = make_method("integral", CAR)
    assert manifest["method"]["gains"]["eta_W"] == design.gains.eta_W
    assert manifest["vehicle"]["mass"] == CAR.mass
    for path, hashed in manifest["files_sha256"].items():
        assert hashlib.sha256(files[path].encode()).hexdigest() == hashed
    assert manifest["hash"].startswith(packages["integral"].about["hash"])
    start = {one["name"]: np.array(one["start"]) for one in manifest["carried"]}
    np.testing.assert_array_equal(
        start["V"], design.network.initial_weights(np.random.default_rng(0)).V
    )


@pytest.mark.heavy
@pytest.mark.parametrize("law", ["integral", "axle"])
@pytest.mark.parametrize("single", ["OFF", "ON"])
def test_cmake_builds_and_the_self_test_passes(law, single, packages, write, run, slalom, tmp_path):
    folder = write(packages[law])
    answer = run("cmake", "-B", "build", f"-DTIREID_SINGLE={single}", cwd=folder)
    assert answer.returncode == 0, answer.stderr
    assert run("cmake", "--build", "build", cwd=folder).returncode == 0
    assert run("ctest", "--test-dir", "build", cwd=folder).returncode == 0
    log = tmp_path / "log.csv"
    write_recording(slalom, log)
    answer = run(str(folder / "build" / "tireid_example"), str(log))
    forces = np.loadtxt(answer.stdout.splitlines()[1:], delimiter=",")
    assert forces.shape == (slalom.t.size, 4)
    error = forces[2000:, 1:3] - slalom.axle_force[2000:]
    assert np.sqrt((error**2).mean()) < 0.2 * np.sqrt((slalom.axle_force[2000:] ** 2).mean())


@pytest.mark.sweep("gcc-*")
@pytest.mark.parametrize(
    ("file", "right", "wrong"),
    [
        ("src/tireid_equations.c", r"next->z\[0\] = \(", "next->z[0] = -("),
        ("tests/tireid_vectors.h", r"(?<=\{ )(?=-?[1-9]\d{2,}\.)", "1"),  # in one force
    ],
    ids=["sign", "vector"],
)
def test_the_self_test_sees_a_wrong_sign_and_a_wrong_vector(
    file, right, wrong, packages, write, run, compiler
):
    folder = write(packages["integral"])
    text, count = re.subn(right, wrong, (folder / file).read_text(), count=1)
    assert count == 1
    (folder / file).write_text(text)
    sources = ["src/tireid.c", "src/tireid_equations.c", "tests/test_tireid.c"]
    run(compiler, "-std=c99", "-Iinclude", *sources, "-lm", "-o", "self_test", cwd=folder)
    answer = run(str(folder / "self_test"))
    assert answer.returncode == 1
    assert "FAILED: forces are those of the vectors" in answer.stdout


STEPS = [name for name in METHODS if name not in ("linear", "fit")]  # a fit takes a whole log


@pytest.mark.sweep("axle")
@pytest.mark.parametrize("law", [*STEPS, rival("linear_kf")])
def test_every_method_passes_its_own_test_without_a_warning(law, packages, write, run):
    folder = write(packages[law])
    library = ["src/tireid.c", "src/tireid_equations.c"]
    sources = [*library, "tests/test_tireid.c"]
    told = []
    for single in (0, 1):
        example = [*STRICT, f"-DTIREID_SINGLE={single}", "-Iinclude", "examples/main.c"]
        answer = run("gcc", *example, "-fsyntax-only", cwd=folder)
        assert (answer.returncode, answer.stderr) == (0, "")
        flags = [*STRICT, f"-DTIREID_SINGLE={single}", "-Iinclude", "-o", "self_test"]
        answer = run("gcc", *flags, *sources, "-lm", cwd=folder)
        assert (answer.returncode, answer.stderr) == (0, "")
        answer = run(str(folder / "self_test"))
        assert answer.returncode == 0, answer.stdout
        told.append(answer.stdout)
    assert "largest difference of a force: 0 N" in told[0]  # the bits of CasADi
    assert "largest difference of a force: 0 N" not in told[1]


def example(folder, run, log):
    """What the example prints, one row a sample."""
    sources = ["src/tireid.c", "src/tireid_equations.c", "examples/main.c"]
    run("gcc", "-std=c99", "-Iinclude", *sources, "-lm", "-o", "example", cwd=folder)
    return run(str(folder / "example"), str(log))


def test_the_example_tells_side_slip_from_a_log_without_a_lateral_velocity(
    packages, write, run, slalom
):
    folder = write(packages["inertial"])
    log = folder / "log.csv"
    names = {"t": "t", "ay": "a_y", "vx": "v_x", "r": "r", "delta_f": "delta_f"}
    table = np.column_stack([getattr(slalom, signal) for signal in names.values()])
    np.savetxt(log, table, delimiter=",", header=",".join(names), comments="")
    told = example(folder, run, log).stdout.splitlines()
    assert told[0] == "t,Fyf,Fyr,vy,vy_sd,side_slip_observable,status"
    rows = np.loadtxt(told[1:], delimiter=",")
    expected = identify(replace(slalom, v_y=None), CAR, make_method("inertial", CAR))
    for column, port in enumerate(("v_y", "v_y_sd", "side_slip_observable"), start=3):
        np.testing.assert_allclose(rows[:, column], expected.outputs[port].ravel(), atol=1e-8)
    assert (rows[:, -1] == 0).all() and rows[2000:, 5].mean() > 0.5


@pytest.mark.sweep("inertial-*")
@pytest.mark.parametrize(
    ("law", "columns", "missing"),
    [
        ("axle", "t,vx,r,delta_f,ay", "vy"),
        ("inertial", "t,vx,r,delta_f", "ay"),
        (BANKED, "t,vx,vy,r,delta_f", "ay"),
    ],
)
def test_the_example_says_which_column_is_missing(law, columns, missing, packages, write, run):
    folder = write(packages[law])
    (folder / "log.csv").write_text(f"{columns}\n")
    answer = example(folder, run, folder / "log.csv")
    assert answer.returncode == 2
    assert answer.stderr == f"tireid_example: the log has no column {missing}\n"


@pytest.mark.parametrize(("library", "app"), [(0, 0), (1, 1), (0, 1), (1, 0)])
def test_another_precision_than_that_of_the_library_does_not_link(
    library, app, compiler, packages, write, run
):
    folder = write(packages["integral"])
    options, sources = ("-std=c99", "-Iinclude", "-Isrc"), ("tireid.c", "tireid_equations.c")
    for source, single in (*((f"src/{one}", library) for one in sources), ("examples/main.c", app)):
        built = run(compiler, *options, f"-DTIREID_SINGLE={single}", "-c", source, cwd=folder)
        assert built.returncode == 0, built.stderr
    linked = run(compiler, "tireid.o", "tireid_equations.o", "main.o", "-lm", cwd=folder)
    assert (linked.returncode == 0) == (library == app)
    assert library == app or "tireid_init" in linked.stderr


def test_a_project_of_its_own_can_use_the_package(packages, write, run):
    folder = write(packages["integral"])
    project = folder / "project"
    project.mkdir()
    (project / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.13)\nproject(app CXX C)\n"
        f"add_subdirectory({folder} tires)\nadd_executable(app main.cpp)\n"
        "target_link_libraries(app PRIVATE tireid::tireid)\n"
    )
    (project / "main.cpp").write_text(
        '#include "tireid.h"\nint main() { tireid_state s; return tireid_init(&s); }\n'
    )
    assert run("cmake", "-B", "build", cwd=project).returncode == 0
    assert run("cmake", "--build", "build", cwd=project).returncode == 0
    assert run(str(project / "build" / "app")).returncode == 0
