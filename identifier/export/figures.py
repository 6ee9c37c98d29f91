"""Flash, RAM, stack and instructions of a package, measured where the tools for Arm are there."""

import json
from collections.abc import Sequence
from typing import NamedTuple

from identifier.export.package import Package
from identifier.export.processor import (
    CROSS_COMPILER,
    EMULATOR,
    PROCESSORS,
    Replay,
    compiler_version,
    missing_tools,
    replay_on,
    size_on,
)
from identifier.export.vectors import synthetic_samples


class Cost(NamedTuple):
    """What a package costs on a processor.

    flash : code and constants [bytes].   replay : what a replay tells.
    static_ram : data that may change and is not the caller's [bytes].
    """

    processor: str
    single: bool
    flash: int
    replay: Replay
    static_ram: int = 0

    @property
    def ram(self) -> int:
        """Static data, state and parameters of one instance [bytes]."""
        return self.static_ram + self.replay.state + self.replay.params


def measure(package: Package) -> list[Cost]:
    """Return what a package costs on every processor, float and double; empty without the tools.

    Parameters
    ----------
    package : the package.
    """
    if missing_tools():
        return []
    name, samples = package.folded.name, synthetic_samples(package.folded)
    costs = []
    for processor in PROCESSORS:
        for single in (True, False):
            size = size_on(processor, name, package.files, single=single)
            replay = replay_on(processor, name, package.files, samples, single=single)
            costs.append(Cost(processor.name, single, size.flash, replay, size.static_ram))
    return costs


def figures_text(costs: list[Cost]) -> str:
    """Return the costs as Markdown.

    Parameters
    ----------
    costs : from `measure`.
    """
    if not costs:
        return f"Not measured: {', '.join(missing_tools())} could not be found."
    head = (
        "| processor | precision | flash [B] | RAM: static + state + params [B] "
        "| stack of a step [B] | instructions a step, mean | largest |\n"
        "|---|---|---|---|---|---|---|\n"
    )
    rows = "".join(
        f"| {cost.processor} | {'float' if cost.single else 'double'} | {cost.flash} | "
        f"{cost.static_ram} + {cost.replay.state} + {cost.replay.params} | {cost.replay.stack} | "
        f"{cost.replay.instructions} | {cost.replay.most_instructions} |\n"
        for cost in costs
    )
    return (
        f"{head}{rows}\n{compiler_version(CROSS_COMPILER)}, -O2; instructions\nand stack by "
        f"{EMULATOR} over the samples of the self-test. Each instance has a state of its\nown; "
        "parameters may be shared, or lie in flash."
    )


def with_figures(manifest: str, costs: Sequence[Cost]) -> str:
    """Return <name>.json with the costs; its hashes are of the rest.

    Parameters
    ----------
    manifest : text of the JSON file.
    costs : from `measure`.
    """
    figures = [
        {
            "processor": cost.processor,
            "precision": "float" if cost.single else "double",
            "compiler": compiler_version(CROSS_COMPILER),
            "flash_B": cost.flash,
            "ram_B": cost.ram,
            "static_ram_B": cost.static_ram,
            "state_B": cost.replay.state,
            "params_B": cost.replay.params,
            "stack_B": cost.replay.stack,
            "instructions_mean": cost.replay.instructions,
            "instructions_largest": cost.replay.most_instructions,
        }
        for cost in costs
    ]
    return json.dumps({**json.loads(manifest), "figures": figures}, indent=2) + "\n"
