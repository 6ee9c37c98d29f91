"""The same bits everywhere: two compilers, every level of optimization, a Cortex-M7 in QEMU."""

import shutil
from functools import cache

import pytest

from codegen.compiler import wide_vectors
from codegen.processor import Cost, missing_tools, replay, with_figures
from mpc.export.processor import PROCESSOR, mpc_figures_text, time_here, vectors_program

CASES = [("axle", True), ("fit", False), ("fit", True), ("integral", False)]
needs_arm = pytest.mark.skipif(bool(missing_tools()), reason=f"needs {', '.join(missing_tools())}")


def run(package, where, **words):
    return replay(vectors_program(package, steps=20), where, **words)


@pytest.fixture(scope="module")
def here(packages):
    """By law and precision, what gcc makes of the vectors on this machine."""
    return cache(lambda law, single: run(packages[law], "gcc", single=single))


@pytest.mark.heavy
@pytest.mark.parametrize(("law", "single"), CASES)
def test_clang_computes_the_bits_of_gcc(law, single, here, packages):
    if shutil.which("clang") is None:
        pytest.skip("needs clang")
    found = run(packages[law], "clang", single=single)
    assert found.hash == here(law, single).hash


@pytest.mark.heavy
def test_wide_vectors_compute_the_same_bits(here, packages):
    words = ["-std=c99", "-O3", "-ffp-contract=off", *wide_vectors()]
    assert run(packages["axle"], "gcc", single=False, flags=words).hash == here("axle", False).hash


@pytest.mark.heavy
@needs_arm
@pytest.mark.parametrize(("law", "single"), CASES)
def test_the_processor_computes_the_bits_of_this_machine_within_its_means(
    law, single, here, packages
):
    found = run(packages[law], PROCESSOR, single=single)
    assert found.hash == here(law, single).hash
    assert found.steps == 20
    assert 3e5 < found.instructions <= found.most_instructions < 6e6
    assert 500 < found.stack < 4096
    assert found.work < 120_000
    cost = Cost(PROCESSOR.name, "gcc 12", single, 20_000, found)
    text = mpc_figures_text([cost], time_here(packages[law]))
    assert f"| {found.instructions} |" in text
    assert '"stack_B"' in with_figures(packages[law].files["tireid_mpc.json"], [cost])
