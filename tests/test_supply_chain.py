"""What is installed is what the lock lists, and the parts list says so."""

import hashlib
import json
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from models.extras import EXTRAS
from tests.sources import texts_of
from tests.test_imports import ORDER, imported

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOWEST = runpy.run_path(str(ROOT / ".ci" / "lowest.py"))
LOCKS = {"requirements.lock": [], "requirements-test.lock": ["test"]}
ENTRY = re.compile(r"^([a-z0-9._-]+)==(\S+)", re.M)


def wanted(extras):
    """Names and lowest versions that the project asks for."""
    texts = LOWEST["requirements"](PROJECT, list(extras))
    return [re.fullmatch(r"([\w.-]+)>=([\d.]+)", text).groups() for text in texts]


def number(version):
    return tuple(int(part) for part in re.findall(r"\d+", version)[:3])


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_holds_all_that_is_asked_for_with_hashes_and_no_address(lock):
    text = (ROOT / lock).read_text()
    for name, bound in wanted(LOCKS[lock]):
        versions = [version for found, version in ENTRY.findall(text) if found == name]
        assert versions, name
        assert all(number(version) >= number(bound) for version in versions)
    for block in re.split(r"\n(?=[a-z0-9])", text):
        assert re.search(r"--hash=sha256:[0-9a-f]{64}", block), block
    assert not re.search(r"https?:|file:|--index|--find-links|--extra", text)


def releases(changelog, citation):
    """Version and date of the newest release of the changelog, and those of the citation."""
    newest = re.search(r"^## \[(\d[^]]*)\] - (\S+)$", changelog, re.M).groups()
    fields = dict(re.findall(r"^(version|date-released): (\S+)$", citation, re.M))
    return newest, (fields["version"], fields["date-released"])


def test_project_changelog_and_citation_name_the_same_release():
    changelog, citation = (ROOT / "CHANGELOG.md").read_text(), (ROOT / "CITATION.cff").read_text()
    newest, cited = releases(changelog, citation)
    assert newest == cited and cited[0] == PROJECT["version"]
    stale = citation.replace(f"version: {cited[0]}", "version: 0.0.1")
    assert releases(changelog, stale)[1] == ("0.0.1", cited[1])


def test_every_package_that_is_imported_is_declared():
    texts = [text for package in ORDER for text in texts_of(package).values()]
    names = {name.split(".")[0] for text in texts for name in imported(text)}
    declared = {name.replace("-", "_") for name, _ in wanted(PROJECT["optional-dependencies"])}
    declared |= {"PIL", "foxglove"}  # of pillow and foxglove-sdk
    assert {"pillow", "foxglove_sdk"} <= declared
    known = set(sys.stdlib_module_names) | declared
    assert {"casadi", "scipy"} <= names
    assert names - known - {*ORDER} == set()


def test_the_parts_list_holds_the_lock():
    words = [sys.executable, str(ROOT / "sbom.py")]
    answers = [subprocess.run(words, capture_output=True, text=True, check=True) for _ in range(2)]
    assert answers[0].stdout == answers[1].stdout
    parts = json.loads(answers[0].stdout)
    assert (parts["bomFormat"], parts["specVersion"]) == ("CycloneDX", "1.6")
    lock = (ROOT / "requirements.lock").read_text()
    listed = {(one["name"], one["version"]) for one in parts["components"]}
    charts = next(one for one in parts["components"] if one["name"] == "uplot")  # in the wheel
    script = (ROOT / "tireid/uplot/uPlot.iife.min.js").read_bytes()
    assert charts["hashes"][0]["content"] == hashlib.sha256(script).hexdigest()
    assert f"(v{charts['version']})".encode() in script[:100]
    assert "tireid/uplot/LICENSE" in PROJECT["license-files"]
    assert listed == {*ENTRY.findall(lock), ("uplot", charts["version"])}
    hashes = {h["content"] for one in parts["components"] if one != charts for h in one["hashes"]}
    assert hashes == set(re.findall(r"sha256:([0-9a-f]{64})", lock))
    names = {one["bom-ref"]: one["name"] for one in parts["components"]}
    needs = {
        names.get(one["ref"], "tireid"): {names[ref] for ref in one["dependsOn"]}
        for one in parts["dependencies"]
    }
    assert needs["tireid"] == {name for name, _ in wanted([])} | {"uplot"}
    assert "numpy" in needs["scipy"]


def test_a_dependency_without_a_lower_bound_is_refused():
    lowest = LOWEST["lowest"]
    assert lowest(PROJECT, ["onnx"])[0] == "casadi==3.8.2"
    assert lowest(PROJECT, [])[0] == "casadi==3.7.0"
    with pytest.raises(SystemExit, match="no lower bound"):
        lowest({"dependencies": ["numpy"], "optional-dependencies": {}}, [])


@pytest.mark.parametrize("extra", EXTRAS)
def test_what_a_message_says_to_install_is_the_whole_extra(extra):
    told = {re.fullmatch(r"'?([\w-]+).*", library)[1] for library in EXTRAS[extra]}
    extras = [extra]
    texts = LOWEST["requirements"]({**PROJECT, "dependencies": []}, extras)
    assert told == {re.match(r"[\w-]+", text)[0] for text in texts}
