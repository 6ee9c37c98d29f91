"""Keys of summary.json: programs read them, so that a key that comes, goes or moves is a diff.

summary_keys.json lists them by what they lie in: those of all methods, and what a method adds.
"""

from pathlib import Path

import pytest

from tests.tireid.conftest import json_of, typed

EXPECTED = Path(__file__).with_name("summary_keys.json")
NAMES = {"slalom": "LOG", "8": "TIME"}  # of the log, and when its run was frozen
LISTS = ("findings", "numbers")  # of which each entry has the same keys


def keys_of(table, above=""):
    """Paths of all keys, with the names of this log and time left out."""
    found = set()
    for key, value in table.items():
        path = f"{above}{NAMES.get(key, key)}"
        found.add(path)
        inner = value[0] if key in LISTS and value else value
        if isinstance(inner, dict):
            found |= keys_of(inner, f"{path}/")
    return found


def summary_keys(folder):
    return keys_of(json_of(folder / "summary.json"))


def listed(command, method):
    rows = [json_of(EXPECTED)[f"{command} {of}"] for of in ("all", method)]
    return {
        f"{above}/{key}".lstrip("/")
        for table in rows
        for above, keys in table.items()
        for key in keys.split()
    }


@pytest.mark.parametrize("method", ["fit", "axle", "integral"])
def test_identify_and_predict_write_the_keys_that_are_listed(method, logs, tmp_path, undrawn):
    log, out = str(logs / "slalom.csv"), tmp_path / "out"
    car = ["--vehicle", logs / "car.toml", "--accept"]
    assert typed("identify", log, *car, "--method", method, "--out", out) == 0
    assert summary_keys(out) == listed("identify", method)
    beyond = logs / "quick.csv"
    asked = ["predict", out / "weights.json", beyond, "--out", tmp_path / "p"]
    assert typed(*asked, "--accept") == 0
    assert summary_keys(tmp_path / "p") == listed("predict", method)


def test_a_key_that_moves_is_seen():
    told = {"verdict": {"valid": True, "findings": [{"code": "x"}]}, "rms": {"slalom": None}}
    assert keys_of(told) == {
        *("verdict", "verdict/valid", "verdict/findings", "verdict/findings/code"),
        *("rms", "rms/LOG"),
    }
