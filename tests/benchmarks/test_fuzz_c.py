"""A minute of libFuzzer on the exported C; and a planted fault, which it finds."""

import re
from functools import cache
from pathlib import Path

import pytest

from benchmarks import fuzz_c

needs_fuzzer = pytest.mark.skipif(not fuzz_c.has_fuzzer(), reason=fuzz_c.MISSING)
STEPS = {"identifier": 150_000, "tracker": 30_000}
NAMES = [f"{kind}/{law}" for law in fuzz_c.LAWS for kind in STEPS]
NAMES += [f"identifier/{law}" for law in fuzz_c.SENSING]


@pytest.fixture(scope="module")
def package_of():
    """A function that gives what is fuzzed by its name, and builds it once."""

    @cache
    def package(name):
        return fuzz_c.subject(name if name.startswith("identifier") else f"{name}/{fuzz_c.SHORT}")

    return package


@pytest.mark.heavy
@needs_fuzzer
@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_found(name, package_of, tmp_path):
    steps = STEPS[name.split("/")[0]]
    outcome = fuzz_c.fuzz(fuzz_c.build(package_of(name), tmp_path), steps, seed=2)
    assert outcome.found == ""
    assert outcome.steps == steps == sum(outcome.statuses)
    assert outcome.statuses[0] > steps / 10  # there is driving among it
    assert sum(outcome.statuses[2:]) > steps / 50  # and there are refusals


@pytest.mark.heavy
@needs_fuzzer
@pytest.mark.parametrize(
    ("name", "file", "pattern", "replacement", "complaint"),
    [
        ("tracker/axle", "src/tireid_mpc.c", r"!is_number\(in\)", "false", "BROKEN|runtime error"),
        ("tracker/axle", "src/tireid_mpc_numbers.c", r"beyond == 0U", "true", "BROKEN|runtime"),
        (
            "identifier/axle",
            "src/tireid.c",
            r"\[at\] >= TIREID_C\(0.0\)",
            "[at + 9999] > 0",
            "ERROR|runtime",
        ),
    ],
)
def test_a_planted_fault_is_found(
    name, file, pattern, replacement, complaint, package_of, tmp_path
):
    subject = package_of(name)
    planted = re.sub(pattern, replacement, subject.files[file])
    assert planted != subject.files[file]
    files = {**subject.files, file: planted}
    outcome = fuzz_c.fuzz(fuzz_c.build(subject._replace(files=files), tmp_path), 3_000_000, seed=2)
    assert outcome.steps == 0
    assert re.search(complaint, outcome.found), outcome.found


def test_without_libfuzzer_it_is_said_what_to_install(monkeypatch, capsys):
    monkeypatch.setattr(fuzz_c, "has_fuzzer", lambda: False)
    assert fuzz_c.main([]) == 2
    assert "libclang-rt-dev" in capsys.readouterr().err


def test_harnesses_read_public_headers_only():
    for harness in fuzz_c.HARNESSES.glob("*_fuzz.c"):
        included = re.findall(r'#include "(.*)"', Path(harness).read_text(encoding="utf-8"))
        assert set(included) <= {"reader.h", "tireid.h", "tireid_mpc.h", "tireid_mpc_params.h"}
