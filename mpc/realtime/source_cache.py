"""The text of a tracker in one file, kept between runs: a second start generates nothing."""

import hashlib
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path

import casadi as ca

from codegen.cache import keep, kept
from mpc.realtime.c_source import c_sources, one_file
from mpc.tires.structure import PredictionTire

NAME = "mpc"
PACKAGES = ("codegen", "models", "identifier", "mpc")  # whose text makes the text


def tracker_source(structure: PredictionTire, horizon: int, *, single: bool) -> str:
    """Return the C of a tracker, generated or found again by everything that it depends on.

    Parameters
    ----------
    structure : of the prediction tire.
    horizon : number of stages.
    single : whether to compute in float.
    """
    if not is_dataclass(structure):
        return _generated(structure, horizon, single)
    kind = type(structure)
    parts = [f"{field.name}={getattr(structure, field.name)!r}" for field in fields(structure)]
    about = [_generator(), f"{kind.__module__}.{kind.__qualname__}", *parts, horizon, single]
    digest = hashlib.sha256("\0".join(map(str, about)).encode()).hexdigest()[:20]
    found = kept(f"tracker-{digest}", ".c")
    if found is not None:
        return found.read_text(encoding="utf-8")
    text = _generated(structure, horizon, single)
    keep(f"tracker-{digest}", ".c", text.encode())
    return text


def _generated(structure: PredictionTire, horizon: int, single: bool) -> str:
    about = {"title": "The tracker", "version": "", "version_text": NAME}
    files = c_sources(structure, horizon=horizon, name=NAME, about=about)
    return one_file(files, name=NAME, single=single)


@cache
def _generator() -> str:
    """Return a hash of the code that generates, its templates, and the version of CasADi."""
    digest = hashlib.sha256(ca.CasadiMeta.version().encode())
    root = Path(__file__).parents[2]
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*")):
            if path.suffix in (".py", ".c", ".h"):
                digest.update(path.read_bytes())
    return digest.hexdigest()
