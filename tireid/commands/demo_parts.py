"""The demo's drives on what it learnt, and what it learnt as a C package, set beside Python."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from codegen import find_compiler
from codegen.processor import CROSS_COMPILER, EMULATOR, Cost, missing_tools
from identifier.export.compiled import CompiledPackage
from identifier.export.package import Package, build_package
from identifier.export.processor import figures_text, measure
from identifier.run import identify
from mpc.path import BUILT_IN
from tireid.animation import FORMATS
from tireid.commands.demo_story import Story
from tireid.commands.drive_results import drive_lines, headline, inputs_of, write_drives
from tireid.driving.runs import FROZEN, LEARNING, LINEAR, ORACLE, Conditions, Run, run_drive
from tireid.driving.setup import Setup, SpeedWish
from tireid.exporting import Verdict, self_test, write_files
from tireid.report import Block, Headline, Paragraph, Picture, Section, Table
from tireid.reports.common import READ, drawing
from tireid.reports.drive import SCORES, known_blocks, score_rows

LANE_CHANGE, _SLIPPERY = "drive", "drive_slippery"  # folders beside the report
FILM = FORMATS[0]
DELAY = 2  # periods of 10 ms
_SOURCE = "frozen ones learnt on the slalom"
NOT_DRIVEN = "No C compiler (gcc) was found: the tracker cannot be built, the car did not drive."


class Driven(NamedTuple):
    """Drives along one path: what they were like, what came of them, and its figures."""

    conditions: Conditions
    runs: Sequence[Run]
    figures: Mapping[str, Figure]


def drive_story(story: Story, folder: Path) -> dict[str, Driven]:
    """Drive the cases of the demo and write what `tireid drive` writes; nothing without a
    compiler.
    """
    if find_compiler() is None:
        return {}
    lane_change = _setup(story, "iso-3888-2", 0.9, ())
    slippery = _setup(story, "slalom", 0.57, ((110.0, 0.5),))
    return {
        LANE_CHANGE: _drive(story, lane_change, (FROZEN, LINEAR, ORACLE), folder / LANE_CHANGE),
        _SLIPPERY: _drive(story, slippery, (LEARNING, FROZEN, LINEAR), folder / _SLIPPERY),
    }


def drive_text(driven: dict[str, Driven]) -> str:
    """Return what came of the drives, as lines of text."""
    blocks = [f"{headline(one.conditions)}\n{drive_lines(one.runs)}" for one in driven.values()]
    return "\n\n".join(["Driving on what was learnt:", *blocks]) if blocks else NOT_DRIVEN


def drive_section(driven: dict[str, Driven], folder: Path) -> Section:
    heading = "The car drives on what it learnt"
    if not driven:
        return Section(heading=heading, blocks=[Paragraph(text=NOT_DRIVEN)])
    lane, slippery = driven[LANE_CHANGE], driven[_SLIPPERY]
    blocks: list[Block] = [
        Paragraph(
            text="A model predictive tracker steers the car around the cones. It plans 2 s ahead, "
            "100 times a second, with noisy sensors and 20 ms of delay. In the middle of the "
            "slalom the friction drops to half, which takes all that is left, and nobody tells "
            "the car. One tracker goes on learning: it is told of another tire where the last "
            "moments say so, and where what is learnt explains the last seconds better. The "
            "others keep the tires that were frozen before, or the linear ones."
        ),
        Picture(
            image=folder / _SLIPPERY / f"drive.{FILM}",
            caption="The drive of the learning car; outlines are the others.",
            read=READ["film"],
        ),
        _scores(slippery),
        drawing(slippery.figures["errors"], "Deviation and the rest along the path.",
                READ["errors"]),
        *known_blocks(slippery.runs, slippery.figures),
        Paragraph(
            text="The lane change of ISO 3888-2 at 90 % of the lateral acceleration that the tires "
            "can give: told of the frozen model the tracker drives as well as one that is told of "
            f"the true tires. The film is {LANE_CHANGE}/drive.{FILM}."
        ),
        _scores(lane),
        drawing(lane.figures["errors"], "Deviation and the rest along the lane change.",
                READ["errors"]),
    ]  # fmt: skip
    return Section(heading=heading, blocks=blocks)


def _scores(one: Driven) -> Table:
    caption = f"{headline(one.conditions)}."
    return Table(caption=caption, header=SCORES, rows=score_rows(one.runs))


def drive_numbers(driven: dict[str, Driven]) -> list[Headline]:
    said = {
        LANE_CHANGE: "in the lane change at 90 % of the grip",
        _SLIPPERY: "where friction drops to half",
    }
    return [
        Headline(
            " / ".join(f"{run.scores.rms_e_y_m:.3f}" for run in one.runs[:2]) + " m",
            f"rms off the path {said[name]}, {one.runs[0].label} / {one.runs[1].label} tires",
        )
        for name, one in driven.items()
    ]


def _setup(story: Story, path: str, share: float, drops: tuple[tuple[float, float], ...]) -> Setup:
    return Setup(
        path=BUILT_IN[path](), vehicle=story.car, mu=1.0, drops=drops, wish=SpeedWish(share, None)
    )


def _drive(story: Story, setup: Setup, labels: Sequence[str], folder: Path) -> Driven:
    learnt = story.axle.model
    conditions = Conditions(setup=setup, delay=DELAY, noise=True, seed=0, laps=1.0)
    runs = [run_drive(label, conditions, learnt) for label in labels]
    folder.mkdir()
    inputs = inputs_of(conditions, labels, _SOURCE, learnt)
    figures = write_drives(folder, conditions, runs, learnt, inputs, FILM)
    return Driven(conditions, runs, figures)


FOLDER = "package"
NOT_BUILT = (
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
    """Export what the axle identifier learnt, compile it and test it."""
    learnt, model = story.axle.runs[0], story.axle.model
    package = build_package(learnt.design, story.car, model)
    costs = measure(package)
    write_files(folder, package, figures_text(costs), costs)
    checks: list[Check] = []
    if find_compiler() is not None:
        expected = identify(learnt.recording, story.car, learnt.design, model).axle_force
        for single in (False, True):
            verdict = self_test(folder, package.specialized.name, single=single)
            assert verdict is not None
            run = CompiledPackage.from_folder(folder, single=single).run(learnt.recording)
            difference = float(np.abs(run.axle_force - expected).max())
            precision, refused = "float" if single else "double", np.count_nonzero(run.status)
            checks.append(Check(precision, verdict, difference, int(refused), len(run.status)))
    return Shipped(package, checks, costs)


def shipped_text(shipped: Shipped) -> str:
    """Return what came of the package, as lines of text."""
    about = shipped.package.about
    lines = [f"As a C package ({FOLDER}/, hash {about['hash']}):"]
    lines += [
        f"  {check.precision:8} self-test {check.verdict.verdict}; over the slalom within "
        f"{check.difference:.2g} N of Python, {check.refused} samples refused"
        for check in shipped.checks
    ] or [f"  {NOT_BUILT}"]
    lines += [
        f"  {cost.processor}, {cost.precision}: {cost.words}"
        for cost in shipped.costs
        if cost.single
    ]
    return "\n".join(lines)


def package_section(shipped: Shipped) -> Section:
    name, about = shipped.package.specialized.name, shipped.package.about
    blocks: list[Paragraph | Table] = [
        Paragraph(
            text="The axle identifier, beginning with what it has just learnt, is written as a C99 "
            f"package to the folder {FOLDER}/ beside this report: library, example, self-test and "
            f"README, every symbol begins with {name}_; hash {about['hash']}. It is what "
            "tireid export writes."
        )
    ]
    checks = [
        [one.precision, test.verdict, test.difference, f"{one.difference:.2g}", of]
        for one in shipped.checks
        for test, of in [(one.verdict, f"{one.refused} of {one.samples}")]
    ]
    if checks:
        caption = (
            "The package, compiled and run on this machine: its self-test, and the slalom again "
            "beside Python, which begins with the same model."
        )
        header = ["precision", "self-test", "its vectors", "from Python [N]", "refused"]
        blocks.append(Table(caption=caption, header=header, rows=checks))
    else:
        blocks.append(Paragraph(text=NOT_BUILT))
    if shipped.costs:
        caption = f"What a step costs, {CROSS_COMPILER} -O2 in {EMULATOR}."
        header = ["processor", "precision", "instructions", "flash [B]", "RAM [B]", "stack [B]"]
        rows = [
            [one.processor, one.precision, *(f"{n}" for n in numbers)]
            for one in shipped.costs
            for numbers in [(one.replay.instructions, one.flash, one.ram, one.replay.stack)]
        ]
        blocks.append(Table(caption=caption, header=header, rows=rows))
    else:
        missing = ", ".join(missing_tools())
        blocks.append(Paragraph(text=f"Costs on Arm are not measured, missing: {missing}."))
    return Section(heading="What was learnt becomes C for a controller", blocks=blocks)
