"""The same bits everywhere: two compilers here, two processors in QEMU, CasADi itself."""

import shutil

import numpy as np
import pytest

from codegen.processor import PROCESSORS, missing_tools, replay
from identifier.export.compiled import samples_of
from identifier.export.package import run_in_virtual_machine
from identifier.export.processor import recording_program
from tests.identifier.export.conftest import BANKED
from tests.kept import Kept
from tests.shipped import Shipped, Status

needs_arm = pytest.mark.skipif(bool(missing_tools()), reason=f"needs {', '.join(missing_tools())}")
LAWS = ("integral", "axle", BANKED, "inertial")


def run(files, rows, where, **words):
    return replay(recording_program("tireid", files, rows), where, **words)


@pytest.fixture(scope="module")
def here(packages, drives):
    """By law and precision, what gcc makes of the slalom on this machine."""
    if shutil.which("gcc") is None:
        pytest.skip("needs gcc")

    def replay(key):
        law, single = key
        return run(packages[law].files, drives[law], "gcc", single=single)

    return Kept(replay)


@pytest.mark.sweep("False-integral")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("single", [False, True])
def test_clang_computes_the_bits_of_gcc(law, single, here, packages, drives):
    if shutil.which("clang") is None:
        pytest.skip("needs clang")
    found = run(packages[law].files, drives[law], "clang", single=single)
    assert found.hash == here[law, single].hash
    assert found.faults == here[law, single].faults


@pytest.mark.sweep("-O3 -march=native")
@pytest.mark.parametrize("flags", ["-O0", "-O3", "-O3 -march=native", "-O2 -fno-trapping-math"])
def test_optimization_does_not_change_a_bit(flags, here, packages, samples):
    words = ["-std=c99", "-ffp-contract=off", *flags.split()]
    found = run(packages["integral"].files, samples, "gcc", single=True, flags=words)
    assert found.hash == here["integral", True].hash


@pytest.mark.heavy
@needs_arm
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("processor", PROCESSORS, ids=[p.name for p in PROCESSORS])
def test_the_processor_computes_the_bits_of_this_machine(
    processor, law, single, here, packages, drives
):
    found = run(packages[law].files, drives[law], processor, single=single, corrected=True)
    assert found.hash == here[law, single].hash
    assert found.steps == len(drives[law])
    assert found.faults == here[law, single].faults


@needs_arm
def test_one_bit_of_one_weight_would_be_noticed(here, packages, samples):
    files = dict(packages["integral"].files)
    place = "src/tireid_equations.c"
    first = "learnt->V[9][3] = "
    assert files[place].count(first) >= 1
    files[place] = files[place].replace(first, f"{first}(TIREID_C(1.0) + TIREID_C(1.2e-7)) * ", 1)
    found = run(files, samples, PROCESSORS[0], single=True)
    assert found.hash != here["integral", True].hash


def test_precisions_differ(here):
    assert here["integral", False].hash != here["integral", True].hash


@pytest.mark.sweep(
    "True-inertial", "False-inertial", "False-axle, with*", "True-axle", "*-integral"
)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("gaps", [False, True])
def test_c_computes_the_bits_of_casadi_in_double(law, gaps, packages, slalom):
    inputs = [port.name for port in packages[law].specialized.inputs]
    rows = samples_of(slalom, inputs)
    if gaps:
        rows[:5, 0], rows[1000:1020, 4], rows[2000:2200, 2] = np.inf, np.nan, 1e308
        if "a_y" in inputs:
            rows[500:600, 5], rows[1500:1700:3, 5] = np.nan, -np.inf
        if law == "inertial":
            rows[300:2600, 1], rows[2700:2800, 1] = np.nan, 1e308
    shipped = assert_the_bits_of_casadi(packages[law], rows)
    assert ((shipped.status >= Status.BAD_INPUT).sum() == 225) == gaps


def assert_the_bits_of_casadi(package, rows):
    run = Shipped.of(package, single=False)
    shipped = run.run_samples(rows)
    told, state = run_in_virtual_machine(package.specialized, rows)
    np.testing.assert_array_equal(shipped.axle_force, told[:, :2])
    np.testing.assert_array_equal(np.column_stack(list(shipped.outputs.values())), told)
    for name, value in run.weights.items():
        np.testing.assert_array_equal(value, state[name].reshape(value.shape))
    return shipped


@pytest.mark.sweep("axle")
@pytest.mark.parametrize("law", LAWS)
def test_float_is_within_a_tenth_of_a_newton_over_45_s(law, packages, slalom):
    double, single = (
        Shipped.of(packages[law], single=choice).run(slalom) for choice in (False, True)
    )
    assert 0.0 < np.abs(double.axle_force - single.axle_force).max() <= 0.1
    if law == "inertial":
        apart = np.abs(double.outputs["v_y"] - single.outputs["v_y"])
        assert 0.0 < (apart / double.outputs["v_y_sd"]).max() < 1e-3
