"""Hostile input under AddressSanitizer and UBSan."""

import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from tests.identifier.export.conftest import BUILDS, sanitized

HOSTILE = Path(__file__).parent / "hostile.c"
SOURCES = ["src/tireid.c", "src/tireid_equations.c"]


def declared(package, **changed):
    """The bounds of the axle identifier as macros, none for another method."""
    method, n = package.specialized.method, 4
    if not isinstance(method, AxleIdentifier):
        return []
    bounds = replace(method.bounds, **changed)
    prior = method.prior.covariance(package.specialized.vehicle, method.ladder)
    trace = np.trace(prior[:, :n, :n], axis1=1, axis2=2)
    widest = method.regression.widest * np.column_stack([trace, prior[:, [4, 5, 6], [4, 5, 6]]])
    rows = ",".join("{" + ",".join(f"{one!r}L" for one in row) + "}" for row in widest.tolist())
    numbers = {
        **{key.upper(): f"{value!r}L" for key, value in asdict(bounds).items()},
        "LADDER": ",".join(f"{one!r}L" for one in method.ladder),
        "WIDEST": rows,
    }
    return ["-DBOUNDED=1", *(f"-D{key}={value}" for key, value in numbers.items())]


@pytest.mark.sweep("0-integral")
@pytest.mark.parametrize("law", ["integral", "axle"])
@pytest.mark.parametrize("single", [0, 1])
def test_a_million_hostile_samples_find_nothing(law, single, packages, write, run):
    macros = [f"-DTIREID_SINGLE={single}", *declared(packages[law])]
    answer = run(sanitized(write(packages[law]), run, HOSTILE, SOURCES, macros))
    assert (answer.returncode, answer.stderr) == (0, ""), answer.stdout + answer.stderr
    counts = {name: int(n) for name, n in re.findall(r"(\w+) (\d+)", answer.stdout)}
    assert sum(counts.values()) == 1_000_000
    assert counts["ok"] > 100_000
    assert counts["bad_input"] > 50_000
    assert counts["stale"] > 50_000


@pytest.mark.sweep("*tireid_accepts*")
@pytest.mark.parametrize(
    ("guard", "complaint"),
    [
        ("tireid_accepts(params, input)", "not finite|beyond the limit|changed the weights"),
        ("tireid_believes(params, sum, &out)", "not finite|beyond the limit"),
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
        "bool (*const kept_too)(const tireid_params *, tireid_real,"
        " const tireid_output *) = tireid_believes;\n\ntireid_status tireid_step(",
        1,
    )
    if guard.startswith("tireid_accepts"):  # a second guard alone still keeps the state
        without = without.replace("tireid_believes(params, sum, &out)", "true")
    source.write_text(without)
    answer = run(sanitized(folder, run, HOSTILE, SOURCES, ["-DTIREID_SINGLE=0"], BUILDS))
    assert answer.returncode != 0
    assert re.search(complaint, answer.stdout), answer.stdout
