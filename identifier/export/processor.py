"""What the package of an identifier costs on Arm processors, and the same bits elsewhere."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from codegen.arrays import Array
from codegen.processor import PROCESSORS, Cost, Program, cost_on, cost_table, missing_tools
from identifier.export.c_source import PREFIX
from identifier.export.package import Package, synthetic_samples

REPLAYED = Path(__file__).parent / "target" / "replayed.h"


def recording_program(name: str, files: Mapping[str, str], samples: Array) -> Program:
    """Return a recording that is replayed through a package.
    samples : (n, k) in the order of the inputs, SI.
    """
    rows = np.ascontiguousarray(samples, dtype="<f8").tobytes()
    return Program(name, PREFIX, files, REPLAYED, rows)


def measure(package: Package, progress: Callable[[float], None] | None = None) -> list[Cost]:
    """Return what a package costs on every processor, float and double; empty without the tools."""
    if missing_tools():
        return []
    samples = synthetic_samples(package.specialized)
    program = recording_program(package.specialized.name, package.files, samples)
    costs: list[Cost] = []
    for processor in PROCESSORS:
        for single in (True, False):
            costs.append(cost_on(program, processor, single=single))
            if progress is not None:
                progress(len(costs) / (2 * len(PROCESSORS)))
    return costs


def figures_text(costs: Sequence[Cost]) -> str:
    return cost_table(
        costs,
        "the samples of the self-test. Each instance has a state of its\nown; parameters may be "
        "shared, or lie in flash.",
    )
