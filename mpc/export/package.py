"""The package of a tracker: C sources, self-test, build file, README and manifest, by path."""

from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.escape import c_string
from codegen.template import Values, Words, filled
from identifier.export.manifest import digest, manifest_text, plain, tireid_version
from identifier.export.package import NAME, PackageNameError
from identifier.model_format import vehicle_numbers
from mpc.export.numbers import initializers, params_of, plain_params
from mpc.export.vectors import Vectors, record, vectors_header
from mpc.problem import Problem
from mpc.realtime import Status, Tracker
from mpc.realtime.c_source import c_sources
from mpc.realtime.tracker import TOLERANCE as SOLVER_TOLERANCE
from mpc.tires import TireModel

TEMPLATES = Path(__file__).parent / "c"
UNTOLD = ("weights", "speeds", "gains")  # in the manifest; the gains have a table of their own
FORMAT = "tireid mpc package 1"
# Largest differences of the steering that the self-test allows [rad]. In double compilers differ by
# nothing; float solves each problem to a tolerance of its own.
TOLERANCE_DOUBLE, TOLERANCE_SINGLE = 1e-9, 1e-3


class MpcPackage(NamedTuple):
    """A package before it is written.

    name : prefix of every symbol.   tire : of the prediction.   problem : what is minimized.
    params : the numbers that it begins with, of `mpc.realtime.layout.params_type`.
    files : texts by path.   vectors : of the self-test.   about : title, version, hash, as text.
    """

    name: str
    tire: TireModel
    problem: Problem
    params: NDArray[np.void]
    files: Mapping[str, str]
    vectors: Vectors
    about: Values


def build_mpc_package(
    tire: TireModel,
    problem: Problem | None = None,
    *,
    period: float = 0.01,
    delay: float = 0.0,
    name: str = "tireid_mpc",
    single: bool = False,
) -> MpcPackage:
    """Return the package of a tracker; the same input gives the same bytes.

    Parameters
    ----------
    tire : of the prediction, with its car.
    problem : what to minimize.
    period : between two steps [s].
    delay : from a measurement until its command acts [s].
    name : beginning of every symbol and file name.
    single : whether float is the default precision.

    Raises
    ------
    PackageNameError
        Where the name is not one of C in lower case.
    NoCompilerError
        Where there is no C compiler, which the self-test is computed with.
    ValueError
        Where a number is out of its range.
    """
    if not NAME.fullmatch(name.removesuffix("_mpc")):
        raise PackageNameError(
            f"name must be lower-case letters, digits and _, at most 31, not {name!r}"
        )
    tracker = Tracker(tire, problem, period=period, delay=delay)
    params = params_of(tracker)
    content = _ingredients(tracker, params, name, single=single)
    about = _summary(tracker, content)
    files = c_sources(
        tire.structure, horizon=tracker.problem.horizon, name=name, single=single, about=about
    )
    vectors = record(tracker)
    values = {
        **about,
        "about_numbers": _about_numbers(tracker),
        "numbers": initializers(params),
        "solver_double": f"{float(params['tolerance'])!r}",
        "solver_single": f"{SOLVER_TOLERANCE[True]!r}",
        "tolerance_double": f"{TOLERANCE_DOUBLE:g}",
        "tolerance_single": f"{TOLERANCE_SINGLE:g}",
        "single_option": "ON" if single else "OFF",
    }
    files |= {
        f"include/{name}_params.h": filled(TEMPLATES / "params.h", values),
        f"src/{name}_params.c": filled(TEMPLATES / "params.c", values),
        f"tests/test_{name}.c": filled(TEMPLATES / "test.c", values),
        "tests/vectors.h": vectors_header(vectors),
    }
    sources = sorted(path for path in files if path.startswith("src/") and path.endswith(".c"))
    values["sources"] = "\n".join(f"  {path}" for path in sources)
    files |= {"CMakeLists.txt": filled(TEMPLATES / "CMakeLists.txt", values)}
    files |= {f"{name}.json": manifest_text(content, files)}
    return MpcPackage(name, tire, tracker.problem, params, files, vectors, about)


def mpc_readme(package: MpcPackage, about_figures: str) -> str:
    """Return the README of a package.

    Parameters
    ----------
    package : what it describes.
    about_figures : what it costs, as Markdown.
    """
    p = plain_params(package.params)
    rows = "".join(
        f"| `{name}` | {_in_words(value)} |\n" for name, value in p.items() if name not in UNTOLD
    )
    return filled(
        TEMPLATES / "README.md",
        {
            "numbers_table": rows,
            "gains_table": "".join(
                f"| {speed:.3g} | {' | '.join(f'{gain:.3g}' for gain in row)} |\n"
                for speed, row in zip(p["speeds"], p["gains"], strict=True)
            ),
            "samples": str(len(package.vectors.measured)),
            "tolerance_double": f"{TOLERANCE_DOUBLE:g}",
            "tolerance_single": f"{TOLERANCE_SINGLE:g}",
            "figures": about_figures,
            **package.about,
        },
    )


def _in_words(value: Any) -> str:
    values = value if isinstance(value, list) else [value]
    return ", ".join(f"{number:.6g}" for number in values)


def _ingredients(
    tracker: Tracker, params: NDArray[np.void], name: str, *, single: bool
) -> dict[str, Any]:
    tire, problem = tracker.tire, tracker.problem
    structure = tire.structure
    numbers = (
        asdict(structure)
        if is_dataclass(structure) and not isinstance(structure, type)
        else {"text": repr(structure)}
    )
    return {
        "format": FORMAT,
        "name": name,
        "tireid": tireid_version(),
        "precision": "float" if single else "double",
        "tire": {"kind": type(structure).__name__, **plain(numbers)},
        "vehicle": plain(vehicle_numbers(tire.vehicle)),
        "problem": plain(asdict(problem)),
        "period_s": tracker.period,
        "delay_s": tracker.delay,
        "params": plain(plain_params(params)),
        "statuses": {status.name: int(status) for status in Status},
    }


def _summary(tracker: Tracker, content: Mapping[str, Any]) -> dict[str, str | Words]:
    short, version, name = digest(content)[:12], tireid_version(), content["name"]
    times = tracker.times
    return {
        "title": Words(f"Path tracking of the car {tracker.tire.vehicle.name}"),
        "tire": content["tire"]["kind"],
        "version": version,
        "hash": short,
        "version_text": c_string(f"{name} {short}, tireid {version}"),
        "single": str(int(content["precision"] == "float")),
        "name": name,
        "NAME": name.upper(),
        "horizon": str(tracker.problem.horizon),
        "dt": f"{tracker.problem.dt:g}",
        "period": f"{tracker.period:g}",
        "delay": f"{tracker.delay:g}",
        "first_stage": f"{times[1]:g}",
    }


def _about_numbers(tracker: Tracker) -> Words:
    return Words(
        f"Those of the export: the car {tracker.tire.vehicle.name}, period {tracker.period:g} s, "
        f"delay {tracker.delay:g} s."
    )
