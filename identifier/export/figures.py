"""Flash, RAM, stack and instructions of a package, measured where the tools for Arm are there."""

from typing import NamedTuple

from identifier.export.package import Package
from identifier.export.processor import (
    CROSS_COMPILER,
    EMULATOR,
    PROCESSORS,
    Replay,
    compiler_version,
    flash_size,
    missing_tools,
    replay_on,
)
from identifier.export.vectors import synthetic_samples


class Cost(NamedTuple):
    """What a package costs on a processor: flash [bytes] and what a replay tells."""

    processor: str
    single: bool
    flash: int
    replay: Replay


def measure(package: Package) -> list[Cost]:
    """Return what a package costs on every processor, float and double; empty without the tools.

    Parameters
    ----------
    package : the package.
    """
    if missing_tools():
        return []
    name, samples = package.folded.name, synthetic_samples(package.folded)
    return [
        Cost(
            processor.name,
            single,
            flash_size(processor, name, package.files, single=single),
            replay_on(processor, name, package.files, samples, single=single),
        )
        for processor in PROCESSORS
        for single in (True, False)
    ]


def figures_text(costs: list[Cost]) -> str:
    """Return the costs as Markdown.

    Parameters
    ----------
    costs : from `measure`.
    """
    if not costs:
        return f"Not measured: {', '.join(missing_tools())} could not be found."
    head = (
        "| processor | precision | flash [B] | RAM of an instance [B] | stack of a step [B] | "
        "instructions a step, mean | largest |\n|---|---|---|---|---|---|---|\n"
    )
    rows = "".join(
        f"| {cost.processor} | {'float' if cost.single else 'double'} | {cost.flash} | "
        f"{cost.replay.state + cost.replay.params} | {cost.replay.stack} | "
        f"{cost.replay.instructions} | {cost.replay.most_instructions} |\n"
        for cost in costs
    )
    return (
        f"{head}{rows}\n{compiler_version(CROSS_COMPILER)}, -O2, over the samples of the "
        f"self-test; instructions and stack by {EMULATOR}. RAM is state and parameters; the latter "
        "may lie in flash. The first step after `_init` may take its sample twice.\n"
    )
