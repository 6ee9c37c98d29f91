"""<name>.json: everything that went into a package, what is in it, and their hashes."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from codegen.escape import c_string
from codegen.template import Words
from identifier.axle import AxleDesign
from identifier.axle.design import NOT_CERTIFIED
from identifier.design import Design
from identifier.export.fold import FoldedStep
from identifier.export.signals import Signal
from identifier.method import Method
from identifier.model_format import vehicle_numbers

FORMAT = "tireid package 1"


def ingredients(folded: FoldedStep, *, single: bool) -> dict[str, Any]:
    """Return everything that a package is made of, ready for JSON.

    Parameters
    ----------
    folded : the step.
    single : whether float is the default precision.
    """
    method = folded.method
    numbers: dict[str, Any] = (
        asdict(method) if is_dataclass(method) and not isinstance(method, type) else {}
    )
    return {
        "format": FORMAT,
        "name": folded.name,
        "tireid": tireid_version(),
        "precision": "float" if single else "double",
        "method": {"kind": type(method).__name__, **plain(numbers)},
        "certificate": certificate(method),
        "vehicle": plain(vehicle_numbers(folded.vehicle)),
        "sample_time_s": folded.dt,
        "min_speed_m_s": folded.min_speed,
        "limits": {
            "speed_m_s": folded.limits.speed,
            "yaw_rate_rad_s": folded.limits.yaw_rate,
            "steering_rad": folded.limits.steering,
            "force_N": folded.limits.force,
        },
        "inputs": [_described(signal) for signal in folded.inputs],
        "outputs": [_described(signal) for signal in folded.outputs],
        "carried": [
            {
                **_described(signal),
                "learnt": signal.name in folded.learnt,
                "shape": list(folded.carry[signal.name].shape),
                "start": plain(folded.carry[signal.name].tolist()),
            }
            for signal in folded.carried
        ],
    }


def certificate(method: Method) -> dict[str, Any]:
    """Return what is proven of a method, as the manifest says it.

    Parameters
    ----------
    method : what was exported.
    """
    if isinstance(method, AxleDesign):
        return method.certificate
    verdict = "judged by tireid check" if isinstance(method, Design) else NOT_CERTIFIED
    return {"verdict": verdict, "held_by_construction": {}}


def summary(folded: FoldedStep, content: Mapping[str, Any]) -> dict[str, str | Words]:
    """Return what texts say about a package: title, method, versions, hash, names and numbers.

    Parameters
    ----------
    folded : the step.
    content : what `ingredients` returned.
    """
    short, version = digest(content)[:12], tireid_version()
    return {
        "title": Words(f"Tire forces of the car {folded.vehicle.name}"),
        "method": type(folded.method).__name__,
        "version": version,
        "hash": short,
        "certificate": _certificate_text(folded.method),
        "version_text": c_string(f"{folded.name} {short}, tireid {version}"),
        "single": str(int(content["precision"] == "float")),
        "dt": f"{folded.dt:g}",
        "min_speed": f"{folded.min_speed:.3g}",
        "name": folded.name,
        "NAME": folded.name.upper(),
    }


def _certificate_text(method: Method) -> str:
    proven = certificate(method)
    if isinstance(method, Design):
        return (
            "Stability and error bounds of this law depend on its gains: `tireid check` on its\n"
            "design file gives the certificate. None is part of this package."
        )
    verdict, held = proven["verdict"], proven["held_by_construction"]
    lines = [f"This method is **{verdict}**: no stability margin and no error bound is proven."]
    if held:
        lines.append("What holds by construction after every sample, whatever is measured, in both")
        lines.append("precisions, of what it learns:\n")
        lines += ["| bound | |", "|---|---|", *(f"| {key} | {held[key]} |" for key in held)]
    return "\n".join(lines)


def digest(content: Any) -> str:
    """Return the SHA-256 of data as JSON, 64 hexadecimal digits.

    Parameters
    ----------
    content : ready for JSON.
    """
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def manifest_text(content: Mapping[str, Any], files: Mapping[str, str]) -> str:
    """Return <name>.json.

    Parameters
    ----------
    content : what `ingredients` returned.
    files : text of the other files by path.
    """
    hashes = {path: hashlib.sha256(text.encode()).hexdigest() for path, text in files.items()}
    data = {**content, "hash": digest(content), "files_sha256": dict(sorted(hashes.items()))}
    return json.dumps(data, indent=2) + "\n"


def plain(value: Any) -> Any:
    """Return data with plain numbers, lists and texts; infinity becomes a text.

    Parameters
    ----------
    value : any of what dataclasses of methods hold.
    """
    match value:
        case Mapping():
            return {str(key): plain(item) for key, item in value.items()}
        case np.ndarray():
            return plain(value.tolist())
        case list() | tuple():
            return [plain(item) for item in value]
        case float() | np.floating():
            return float(value) if math.isfinite(value) else str(float(value))
        case None | bool() | int() | str():
            return value
        case _:
            return str(value)


def tireid_version() -> str:
    """Return the version of tireid."""
    try:
        return version("tireid")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"


def _described(signal: Signal) -> dict[str, Any]:
    return {
        "name": signal.name,
        "size": signal.size,
        "unit": signal.unit,
        "description": signal.description,
    }
