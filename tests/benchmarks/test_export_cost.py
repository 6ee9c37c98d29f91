"""What the cost of exported C is measured against computes the same as it does."""

import numpy as np
import pytest

from benchmarks import c_loops
from benchmarks.export_cost import LOOP, check, steps
from benchmarks.targets import Targets
from codegen import find_compiler
from identifier.export.package import build_package
from identifier.paper.design import PaperIdentifier
from models.vehicle import sedan

CAR = sedan()


@pytest.fixture(scope="module")
def package():
    if find_compiler() is None:
        pytest.skip("needs a C compiler")
    return build_package(PaperIdentifier.for_vehicle(CAR), CAR)


@pytest.fixture
def samples():
    """A slalom of 6 s that begins straight ahead, by formulas: forces need not be real."""
    t = 0.01 * np.arange(600)
    wave = np.sin(3.0 * t)
    return np.column_stack([20.0 + t, -0.3 * wave, 0.2 * wave, 0.05 * wave, 0.01 * wave])


@pytest.mark.heavy
def test_every_way_to_write_the_step_gives_the_same_forces(package, samples):
    check(steps(package), samples, Targets("export_cost"))


@pytest.mark.heavy
def test_a_hand_written_step_that_computes_something_else_is_seen(
    package, samples, monkeypatch, tmp_path
):
    text = c_loops.HAND_WRITTEN.read_text()
    wrong = tmp_path / "wrong.c"
    wrong.write_text(text.replace("keep_V * s->V[j][i] - rate", "keep_V * s->V[j][i] + rate"))
    monkeypatch.setattr(c_loops, "HAND_WRITTEN", wrong)
    with pytest.raises(AssertionError, match=LOOP):
        check(steps(package), samples, Targets("export_cost"))
