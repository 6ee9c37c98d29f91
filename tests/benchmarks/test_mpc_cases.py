"""A driving benchmark measures what a user gets: the numbers of `tireid drive`, to the bit."""

import json

import pytest

from benchmarks.mpc_cases import TIRES, Case, learnt_before, run
from codegen import find_compiler
from tireid.cli import main

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")


@pytest.mark.heavy
@pytest.mark.parametrize("tires", TIRES)
def test_a_case_is_what_the_command_drives(tires, tmp_path, undrawn):
    case = Case("iso-3888-2", 0.9, 0.5, tires, seed=3)
    learnt_before.cache_clear()
    found = run(case).scores
    out = tmp_path / "out"
    # The words of a user, written out here: nothing but what `tireid drive --help` lists.
    words = ["--path", "iso-3888-2", "--speed", "90%", "--mu", "0.5", "--seed", "3"]
    label = {"paper": "frozen", "axle": "frozen"}.get(tires, tires)
    words += ["--tires", label, "--film", "none", "--out", str(out)]
    status = main(["drive", *words, *(["--paper"] if tires == "paper" else [])])
    summary = json.loads((out / "summary.json").read_text())
    assert summary["rms_e_y_m"] == found.rms_e_y_m
    assert summary["peak_e_y_m"] == found.peak_e_y_m
    assert summary["completed"] is found.completed is (status == 0)
    assert summary["inputs"]["delay_ms"] == 20.0


@pytest.mark.heavy
def test_another_path_is_driven_on_the_same_learnt_tire(tmp_path, undrawn):
    out = tmp_path / "out"
    words = ["--path", "slalom", "--speed", "50%", "--seed", "4", "--film", "none"]
    assert main(["drive", *words, "--out", str(out)]) == 0
    wanted = json.loads((out / "weights.json").read_text())
    model = json.loads(json.dumps(learnt_before(1.0, 4).to_dict()))
    assert wanted["W"] == model["W"] if "W" in wanted else wanted == model
