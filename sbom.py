"""The parts list of the wheel, CycloneDX 1.6, made from the lock when the wheel is built.

It lies in the wheel as `*.dist-info/sboms/tireid.cdx.json` (PEP 770): what tireid needs to run, in
the versions and with the hashes that it was tested with. `python sbom.py` prints it.
"""

import hashlib
import json
import re
import tomllib
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ImportError:  # printed without the builder
    BuildHookInterface = object

ROOT = Path(__file__).parent
NAMESPACE = uuid.UUID("a7f1b7a4-3f5c-5a5e-9b0e-5c1d6a6b7c11")  # of serial numbers of tireid
ENTRY = re.compile(r"^(?P<name>[a-z0-9._-]+)==(?P<version>[^\s;\\]+)\s*(?:;\s*(?P<when>[^\\\n]+))?")


def locked(text: str) -> Iterator[dict[str, Any]]:
    """Yield the components of a lock: name, version, where they are needed, hashes, who needs them.

    Parameters
    ----------
    text : of a lock as pip reads it, with hashes.
    """
    for block in re.split(r"\n(?=[a-z0-9])", text):
        entry = ENTRY.match(block)
        if entry is None:
            continue
        name, version = entry["name"], entry["version"]
        needed_by = re.findall(r"^    #\s+(?:via\s+)?([a-z0-9._-]+)(?: \(.*\))?$", block, re.M)
        yield {
            "type": "library",
            "bom-ref": f"pkg:pypi/{name}@{version}",
            "name": name,
            "version": version,
            "purl": f"pkg:pypi/{name}@{version}",
            "hashes": [
                {"alg": "SHA-256", "content": digest}
                for digest in re.findall(r"--hash=sha256:([0-9a-f]{64})", block)
            ],
            "properties": [
                *([{"name": "marker", "value": entry["when"].strip()}] if entry["when"] else []),
                *({"name": "needed by", "value": one} for one in needed_by),
            ],
        }


def bundled() -> dict[str, Any]:
    """Return the component that lies in the wheel itself: the library of charts in pages."""
    script = (ROOT / "tireid/uplot/uPlot.iife.min.js").read_bytes()
    version = script.partition(b"(v")[2].partition(b")")[0].decode()
    return {
        "type": "library",
        "bom-ref": f"pkg:npm/uplot@{version}",
        "name": "uplot",
        "version": version,
        "purl": f"pkg:npm/uplot@{version}",
        "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(script).hexdigest()}],
        "licenses": [{"license": {"id": "MIT"}}],
        "properties": [{"name": "needed by", "value": "tireid"}],
    }


def parts_list() -> dict[str, Any]:
    """Return the parts list of the project, ready for JSON; the same lock gives the same bytes."""
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    parts = [*locked(lock), bundled()]
    own = f"pkg:pypi/{project['name']}@{project['version']}"
    direct = {re.split(r"[<>=\[ ]", text)[0].lower() for text in project["dependencies"]} | {
        "uplot"
    }
    needs = {own: sorted(p["bom-ref"] for p in parts if p["name"] in direct)}
    for part in parts:
        callers = [p["value"] for p in part["properties"] if p["name"] == "needed by"]
        for caller in (p for p in parts if p["name"] in callers):
            needs.setdefault(caller["bom-ref"], []).append(part["bom-ref"])
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(NAMESPACE, own + lock)}",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": own,
                "name": project["name"],
                "version": project["version"],
                "purl": own,
                "licenses": [{"license": {"id": project["license"]}}],
            }
        },
        "components": parts,
        "dependencies": [
            {"ref": ref, "dependsOn": sorted(needs.get(ref, []))}
            for ref in (own, *(part["bom-ref"] for part in parts))
        ],
    }


class CustomBuildHook(BuildHookInterface):  # type: ignore[misc]  # hatchling tells no types
    """Puts the parts list into the wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write the parts list and name it to the builder.

        Parameters
        ----------
        version : "standard" or "editable".
        build_data : what the builder goes on with.
        """
        if version == "editable":
            return
        path = ROOT / "build" / "tireid.cdx.json"
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(parts_list(), indent=1) + "\n", encoding="utf-8")
        build_data["sbom_files"].append(str(path))


if __name__ == "__main__":
    print(json.dumps(parts_list(), indent=1))
