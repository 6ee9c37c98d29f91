"""The package: C sources, example, self-test, build file, README and manifest, as texts by path."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from codegen.template import Values, filled
from identifier.export.c_source import TEMPLATES, c_sources
from identifier.export.fold import FoldedStep, fold
from identifier.export.layout import Member, carried_members, output_members
from identifier.export.manifest import ingredients, manifest_text, summary
from identifier.export.vectors import SAMPLES, vectors, vectors_header
from identifier.export.weight_rules import ruled
from identifier.method import FrozenModel, Method
from identifier.refused import STALE_TIME
from models.vehicle import Vehicle

NAME = re.compile(r"[a-z][a-z0-9_]{0,30}")
# Largest differences of a force that the self-test allows, in parts of the limit of forces.
TOLERANCE_DOUBLE, TOLERANCE_SINGLE = 1e-8, 2e-5


class PackageNameError(ValueError):
    """A name that cannot begin the symbols of a C library."""


class Package(NamedTuple):
    """A package before it is written: its step, its files by path, title, version and hash."""

    folded: FoldedStep
    files: Mapping[str, str]
    about: Values


def build_package(
    method: Method,
    vehicle: Vehicle,
    start: FrozenModel | None = None,
    *,
    name: str = "tireid",
    single: bool = False,
) -> Package:
    """Return the package of a method for a car; the same input gives the same bytes.

    Parameters
    ----------
    method : the method with its numbers.
    vehicle : the car.
    start : weights to begin with; None begins with those of the method.
    name : beginning of every symbol and file name.
    single : whether float is the default precision.

    Raises
    ------
    PackageNameError
        Where the name is not one of C in lower case.
    UnknownOperationError
        Where the method needs an operation that has no plain C.
    ValueError
        Where stored weights are those of another structure.
    """
    if not NAME.fullmatch(name):
        raise PackageNameError(
            f"name must be lower-case letters, digits and _, at most 31, not {name!r}"
        )
    folded = fold(method, vehicle, start, name)
    content = ingredients(folded, single=single)
    about = summary(folded, content)
    files = c_sources(folded, single=single, about=about)
    files |= _other_files(folded, about, single=single)
    return Package(folded, files | {f"{name}.json": manifest_text(content, files)}, about)


def _other_files(folded: FoldedStep, about: Values, *, single: bool) -> dict[str, str]:
    name, learnt = folded.name, bool(folded.learnt)
    members = carried_members(folded)
    first = next((m.signal.name + m.first for m in members if m.learnt), "")
    rules = ruled([member for member in members if member.learnt])
    negative = {"first_rule": rules[0].signal.name + rules[0].first, **about} if rules else {}
    about_weights = {
        "first_weight": first,
        "negative_test": filled(TEMPLATES / "negative_test.c", negative) if rules else "",
        **about,
    }
    values = {
        "weights_test": filled(TEMPLATES / "weights_test.c", about_weights) if learnt else "",
        "weights_held": filled(TEMPLATES / "held_test.c", about) if learnt else "",
        "weights_call": "    test_modes(&state, &params);\n" if learnt else "",
        "tolerance_double": f"{TOLERANCE_DOUBLE * folded.limits.force:.2g}",
        "tolerance_single": f"{TOLERANCE_SINGLE * folded.limits.force:.2g}",
        "single_option": "ON" if single else "OFF",
        **about,
    }
    return {
        "CMakeLists.txt": filled(TEMPLATES / "CMakeLists.txt", values),
        "examples/main.c": filled(TEMPLATES / "main.c", values),
        f"tests/test_{name}.c": filled(TEMPLATES / "test.c", values),
        "tests/vectors.h": vectors_header(vectors(folded)),
    }


def readme(package: Package, about_figures: str) -> str:
    """Return the README of a package.

    Parameters
    ----------
    package : what it describes.
    about_figures : flash, RAM, stack and instructions, as Markdown.
    """
    folded = package.folded
    carried = carried_members(folded)
    carry_table = "".join(
        f"| `{m.path}` | {_shape(m)} | {m.signal.unit} | {m.signal.description} |\n"
        for m in carried
    )
    modes = _modes(folded)
    tolerance = TOLERANCE_DOUBLE * folded.limits.force, TOLERANCE_SINGLE * folded.limits.force
    equations = package.files[f"src/{folded.name}_equations.h"]
    called = [f"`{word}`" for word in ("sqrt", "fabs", "floor") if f" {word}(x)" in equations]
    return filled(
        TEMPLATES / "README.md",
        {
            "input_table": _table([Member(s, (1, 1), False) for s in folded.inputs]),
            "output_table": _table(output_members(folded)),
            "carry_table": carry_table,
            "modes": modes,
            "implausible_row": _implausible_row(folded),
            "stale_time": f"{STALE_TIME:g}",
            **_about_gaps(folded),
            "libraries": f"{', '.join(called) or 'nothing'} of `<math.h>`, copies of structures",
            "samples": str(SAMPLES),
            "tolerance_double": f"{tolerance[0]:.2g}",
            "tolerance_single": f"{tolerance[1]:.2g}",
            "figures": about_figures,
            **package.about,
        },
    )


def _modes(folded: FoldedStep) -> str:
    if not folded.learnt:
        return "This method estimates a signal: there are no weights to read, set or freeze."
    name = folded.name
    learnt = ", ".join(folded.learnt)
    return (
        f"`{name}_set_adaptation(&state, false)` freezes what is learnt ({learnt});\n"
        "observers and filters go on, so that it may be switched on again at any time. "
        f"`{name}_get_weights` and\n`{name}_set_weights` store it and bring it back, "
        f"`{name}_reset` begins anew with it, `{name}_init`\nforgets it."
    )


def _implausible_row(folded: FoldedStep) -> str:
    """Return what is done with a sample that no car can be in, where the method judges that."""
    if folded.believed is not None:
        return (
            "| 2 `IMPLAUSIBLE` | no car can be there, or get there within a sample | of the last "
            "sample that was believed, zero where that lasts | hold | yes |\n"
        )
    if folded.parts.where_false is not None:
        return "| 2 `IMPLAUSIBLE` | no car can be there | zero | hold | yes |\n"
    return ""


def _about_gaps(folded: FoldedStep) -> dict[str, str]:
    """Return what becomes of forces while samples are refused, and of the state after it."""
    if folded.believed is not None:
        return {
            "refused_forces": "of the last sample that was believed, zero where that lasts",
            "after_gap": "After a moment the step rests, and restarts with the next good sample.",
        }
    return {
        "refused_forces": "as before",
        "after_gap": "With the next good sample observers and filters begin anew, and what was "
        "learnt stays.",
    }


def _table(members: Sequence[Member]) -> str:
    return "".join(
        f"| `{m.signal.name}` | {m.signal.unit} | {m.signal.description} |\n" for m in members
    )


def _shape(member: Member) -> str:
    return " x ".join(str(size) for size in member.dimensions) or "1"
