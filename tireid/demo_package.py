"""What the demo learnt as a C package: written, compiled, self-tested, set beside Python."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from codegen import find_compiler
from identifier.export.compiled import CompiledPackage
from identifier.export.figures import Cost, figures_text, measure
from identifier.export.package import Package, build_package
from identifier.export.processor import CROSS_COMPILER, EMULATOR, missing_tools
from identifier.identify import identify
from tireid.demo_story import FREEZE, Story
from tireid.exporting import write_files
from tireid.report import Paragraph, Section, Table
from tireid.self_test import Verdict, self_test

FOLDER = "package"
NO_COMPILER = (
    "No C compiler (gcc) was found: the package was written, but neither compiled nor tested."
)


class Check(NamedTuple):
    """A build of the package on this machine.

    precision : float or double.   verdict : of its self-test.   difference : largest of a force
    from the one that Python computes over the slalom [N].   refused, samples : of the slalom.
    """

    precision: str
    verdict: Verdict
    difference: float
    refused: int
    samples: int


class Shipped(NamedTuple):
    """The package, its builds here (none without a compiler) and its costs on Arm (or none)."""

    package: Package
    checks: Sequence[Check]
    costs: Sequence[Cost]


def ship(story: Story, folder: Path) -> Shipped:
    """Export what the default method learnt, compile it and test it.

    Parameters
    ----------
    story : the drives and what was learnt.
    folder : an empty folder for the package.

    Raises
    ------
    SelfTestError
        Where the package does not compile or does not pass.
    """
    learnt = story.default.learnt
    model = learnt.freeze(FREEZE)
    package = build_package(learnt.design, story.car, model)
    costs = measure(package)
    write_files(folder, package, figures_text(costs), costs)
    checks: list[Check] = []
    if find_compiler() is not None:
        expected = identify(learnt.recording, story.car, learnt.design, model).axle_force
        for single in (False, True):
            verdict = self_test(folder, package.folded.name, single=single)
            assert verdict is not None
            run = CompiledPackage.from_folder(folder, single=single).run(learnt.recording)
            difference = float(np.abs(run.axle_force - expected).max())
            precision, refused = "float" if single else "double", np.count_nonzero(run.status)
            checks.append(Check(precision, verdict, difference, int(refused), len(run.status)))
    return Shipped(package, checks, costs)


def shipped_text(shipped: Shipped) -> str:
    """Return what came of the package, as lines of text.

    Parameters
    ----------
    shipped : the package.
    """
    about = shipped.package.about
    lines = [f"As a C package ({FOLDER}/, hash {about['hash']}):"]
    lines += [
        f"  {check.precision:8} self-test {check.verdict.verdict}; over the slalom within "
        f"{check.difference:.2g} N of Python, {check.refused} samples refused"
        for check in shipped.checks
    ] or [f"  {NO_COMPILER}"]
    lines += [
        f"  {cost.processor}, {_precision(cost)}: {cost.replay.instructions} instructions a step, "
        f"{cost.flash} B flash, {cost.replay.stack} B stack"
        for cost in shipped.costs
        if cost.single
    ]
    return "\n".join(lines)


def package_section(shipped: Shipped) -> Section:
    """Return the section of the report.

    Parameters
    ----------
    shipped : the package.
    """
    name, about = shipped.package.folded.name, shipped.package.about
    blocks: list[Paragraph | Table] = [
        Paragraph(
            text="The default method, beginning with what it has just learnt, is written as a C99 "
            f"package to the folder {FOLDER}/ beside this report: library, example, self-test and "
            f"README, every symbol begins with {name}_; hash {about['hash']}. It is what "
            "`tireid export` writes."
        )
    ]
    if shipped.checks:
        blocks.append(
            Table(
                caption="The package, compiled and run on this machine: its self-test, and the "
                "slalom again beside Python, which begins with the same model.",
                header=["precision", "self-test", "its vectors", "from Python [N]", "refused"],
                rows=[
                    [
                        check.precision,
                        check.verdict.verdict,
                        check.verdict.difference,
                        f"{check.difference:.2g}",
                        f"{check.refused} of {check.samples}",
                    ]
                    for check in shipped.checks
                ],
            )
        )
    else:
        blocks.append(Paragraph(text=NO_COMPILER))
    if shipped.costs:
        blocks.append(
            Table(
                caption=f"What a step costs, {CROSS_COMPILER} -O2 in {EMULATOR}.",
                header=[
                    "processor",
                    "precision",
                    "instructions",
                    "flash [B]",
                    "RAM [B]",
                    "stack [B]",
                ],
                rows=[
                    [
                        cost.processor,
                        _precision(cost),
                        f"{cost.replay.instructions}",
                        f"{cost.flash}",
                        f"{cost.replay.state + cost.replay.params}",
                        f"{cost.replay.stack}",
                    ]
                    for cost in shipped.costs
                ],
            )
        )
    else:
        missing = ", ".join(missing_tools())
        blocks.append(Paragraph(text=f"Costs on Arm are not measured, missing: {missing}."))
    return Section(heading="What was learnt becomes C for a controller", blocks=blocks)


def _precision(cost: Cost) -> str:
    return "float" if cost.single else "double"
