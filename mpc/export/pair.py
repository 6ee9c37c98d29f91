"""Identifier and tracker together: both packages, what hands tires over, and a car to drive."""

from collections.abc import Mapping
from typing import NamedTuple

from codegen.template import Words, filled
from identifier.export.package import Package
from mpc.export.handover import TEMPLATES, frozen_start, handover_sources
from mpc.export.package import MpcPackage, build_mpc_package
from mpc.problem import Problem
from mpc.tires import tire_model

EXAMPLES = (
    "closed_loop.c",
    "simulated_car.c",
    "simulated_car.h",
    "lane_changes.c",
    "lane_changes.h",
)
LEARNT_PEAK = "0.15"  # m, of the example in its last pass: a few centimeters are usual
DELAY = 0.03  # s, of the export; a number of the parameters


class Pair(NamedTuple):
    """Two packages and the files beside their folders `identifier/` and `mpc/`, by path."""

    identifier: Package
    tracker: MpcPackage
    files: Mapping[str, str]


def build_pair(
    identifier: Package,
    problem: Problem | None = None,
    *,
    delay: float = DELAY,
    single: bool = False,
) -> Pair:
    """Return the tracker that goes with an identifier, one step a sample, and what joins them.

    Parameters
    ----------
    identifier : package of the identifier; its weights are the tire that is begun with.
    problem : of the tracker.
    delay : from a measurement until its command acts [s].
    single : whether float is the default precision of the tracker.

    Raises
    ------
    NoHandoverError
        Where the method learns neither a network nor axle curves.
    NoCompilerError
        Where there is no C compiler.
    """
    folded = identifier.folded
    tracker = build_mpc_package(
        tire_model(frozen_start(identifier)),
        problem,
        period=folded.dt,
        delay=delay,
        name=f"{folded.name}_mpc",
        single=single,
    )
    values: dict[str, str | Words] = {
        "name": folded.name,
        "NAME": folded.name.upper(),
        "version": identifier.about["version"],
        "vehicle": Words(folded.vehicle.name),
        "identifier_hash": identifier.about["hash"],
        "mpc_hash": tracker.about["hash"],
        "learnt_peak": LEARNT_PEAK,
    }
    files = {f"examples/{path}": filled(TEMPLATES / path, values) for path in EXAMPLES}
    files |= {path: filled(TEMPLATES / path, values) for path in ("CMakeLists.txt", "README.md")}
    return Pair(identifier, tracker, files | handover_sources(identifier, tracker))
