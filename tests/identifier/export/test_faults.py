"""Hostile input under AddressSanitizer and UBSan."""

import re
from pathlib import Path

import pytest

HOSTILE = (Path(__file__).parent / "hostile.c").read_text()
SANITIZED = (
    "-std=c99 -O1 -g -ffp-contract=off -fsanitize=address,undefined -fno-sanitize-recover=all"
)
SOURCES = ["src/tireid.c", "src/tireid_equations.c", "hostile.c"]


def build(folder, run, compiler, single):
    (folder / "hostile.c").write_text(
        HOSTILE.replace("@name@", "tireid").replace("@NAME@", "TIREID")
    )
    flags = [*SANITIZED.split(), f"-DTIREID_SINGLE={single}", "-Iinclude", "-Isrc"]
    answer = run(compiler, *flags, *SOURCES, "-lm", "-o", "hostile", cwd=folder)
    if "cannot find" in answer.stderr and "san" in answer.stderr:
        pytest.skip(f"needs the sanitizers of {compiler}")
    assert answer.returncode == 0, answer.stderr
    return folder / "hostile"


@pytest.mark.parametrize("law", ["integral", "axle"])
@pytest.mark.parametrize("single", [0, 1])
def test_a_million_hostile_samples_find_nothing(law, single, packages, write, run):
    program = build(write(packages[law]), run, "gcc", single)
    answer = run(str(program))
    assert (answer.returncode, answer.stderr) == (0, ""), answer.stdout + answer.stderr
    counts = {name: int(n) for name, n in re.findall(r"(\w+) (\d+)", answer.stdout)}
    assert sum(counts.values()) == 1_000_000
    assert counts["ok"] > 100_000
    assert counts["bad_input"] > 50_000


@pytest.mark.parametrize(
    ("guard", "complaint"),
    [
        ("tireid_accepts(params, input)", "not finite|beyond the limit|changed the state"),
        ("tireid_believes(params, &next, &out)", "not finite|beyond the limit"),
    ],
)
def test_without_a_guard_the_alarm_rings(guard, complaint, packages, write, run):
    folder = write(packages["integral"])
    source = folder / "src" / "tireid.c"
    text = source.read_text()
    assert guard in text
    without = text.replace(guard, "true").replace(
        "tireid_status tireid_step(",
        "bool (*const kept)(const tireid_params *, const tireid_input *) = tireid_accepts;\n"
        "bool (*const kept_too)(const tireid_params *, const tireid_values *,"
        " const tireid_output *) = tireid_believes;\n\ntireid_status tireid_step(",
        1,
    )
    if guard.startswith("tireid_accepts"):  # a second guard alone still keeps the state
        without = without.replace("tireid_believes(params, &next, &out)", "true")
    source.write_text(without)
    answer = run(str(build(folder, run, "gcc", 0)))
    assert answer.returncode != 0
    assert re.search(complaint, answer.stdout), answer.stdout
