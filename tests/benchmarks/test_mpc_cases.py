"""A driving benchmark measures what a user gets: the numbers of `tireid drive`, to the bit."""

import json

import pytest

from benchmarks.mpc_cases import TIRES, Case, driven, share_of_limit
from codegen import find_compiler
from tireid.cli import main

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")


@pytest.mark.heavy
@pytest.mark.parametrize("tires", TIRES)
def test_a_case_is_what_the_command_drives(tires, tmp_path, undrawn):
    found = driven(Case("iso-3888-2", share_of_limit(90.0, 0.5), 0.5, tires, seed=3))
    out = tmp_path / "out"
    # The words of a user, written out here: nothing but what `tireid drive --help` lists.
    words = ["--path", "iso-3888-2", "--speed", "0.4311g", "--mu", "0.5", "--seed", "3"]
    label = {"paper": "frozen", "axle": "frozen"}.get(tires, tires)
    words += ["--tires", label, "--film", "none", "--out", str(out)]
    status = main(["drive", *words, *(["--paper"] if tires == "paper" else [])])
    summary = json.loads((out / "summary.json").read_text())
    assert summary["rms_e_y_m"] == found.rms
    assert summary["peak_e_y_m"] == found.peak
    assert summary["completed"] is found.completed is (status == 0)
    assert summary["inputs"]["delay_ms"] == 20.0
