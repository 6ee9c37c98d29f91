"""The demo's drives on what it learnt, and what it learnt as a C package, set beside Python."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from codegen import find_compiler
from identifier.export.compiled import CompiledPackage
from identifier.run import identify
from mpc.path import BUILT_IN
from tireid.commands.demo_story import Story
from tireid.driving.results import SCORES, Drives, headline, known_blocks, score_rows
from tireid.driving.runs import FROZEN, LEARNING, LINEAR, ORACLE, Conditions
from tireid.driving.setup import Setup, SpeedWish
from tireid.exporting import Exported, Verdict, export, self_test
from tireid.figures.film import FORMATS
from tireid.report import Block, Headline, Paragraph, Picture, Section, Table
from tireid.reports.common import READ, drawing

LANE_CHANGE, _SLIPPERY = "drive", "drive_slippery"  # folders beside the report
_FILM = FORMATS[0]
_CASES = {  # path, share of the grip, drops of friction [m] and to what, tires; in a number's words
    LANE_CHANGE: (
        "iso-3888-2",
        0.9,
        (),
        (FROZEN, LINEAR, ORACLE),
        "in the lane change at 90 % of the grip",
    ),
    _SLIPPERY: (
        "slalom",
        0.57,
        ((110.0, 0.5),),
        (LEARNING, FROZEN, LINEAR),
        "where friction drops to half",
    ),
}
NOT_DRIVEN = "No C compiler (gcc) was found: the tracker cannot be built, the car did not drive."


class Driven(NamedTuple):
    """Drives along one path, and their figures."""

    drives: Drives
    figures: Mapping[str, Figure]


def drive_story(story: Story, folder: Path) -> dict[str, Driven]:
    """Drive the cases of the demo and write what `tireid drive` writes; nothing without a
    compiler.
    """
    found: dict[str, Driven] = {}
    for name, (path, share, drops, labels, _) in _CASES.items() if find_compiler() else ():
        wish = SpeedWish(share, None)
        setup = Setup(path=BUILT_IN[path](), vehicle=story.car, mu=1.0, drops=drops, wish=wish)
        conditions = Conditions(setup=setup, delay=2, noise=True, seed=0, laps=1.0)
        source = "frozen ones identified on the slalom"
        drives = Drives.driven(conditions, labels, story.axle.model, source)
        (folder / name).mkdir()
        found[name] = Driven(drives, drives.write(folder / name, _FILM))
    return found


def drive_text(driven: Mapping[str, Driven]) -> str:
    blocks = [one.drives.text() for one in driven.values()]
    return "\n\n".join(["Driving on the identified tires:", *blocks]) if blocks else NOT_DRIVEN


def drive_section(driven: Mapping[str, Driven], folder: Path) -> Section:
    heading = "The car drives on the identified tires"
    if not driven:
        return Section(heading=heading, blocks=[Paragraph(text=NOT_DRIVEN)])
    slippery = driven[_SLIPPERY]
    blocks: list[Block] = [
        Paragraph(
            text="A model predictive tracker steers the car around the cones. It plans 2 s ahead, "
            "100 times a second, with noisy sensors and 20 ms of delay. In the middle of the "
            "slalom the friction drops to half, which is the limit of this path, and no tracker "
            "gets this friction. One tracker goes on identifying: its tire is replaced where "
            "recent innovations require it and the new one explains the last seconds better. The "
            "others keep the tires that were frozen before, or the linear ones."
        ),
        Picture(
            image=folder / _SLIPPERY / f"drive.{_FILM}",
            caption="The drive of the learning car; outlines are the others.",
            read=READ["film"],
        ),
        *_scores(slippery, "Deviation and the rest along the path."),
        *known_blocks(slippery.drives.runs, slippery.figures),
        Paragraph(
            text="The lane change of ISO 3888-2 at 90 % of the lateral acceleration that the tires "
            "can give: with the frozen model the tracker drives as well as with the true tires. "
            f"The film is {LANE_CHANGE}/drive.{_FILM}."
        ),
        *_scores(driven[LANE_CHANGE], "Deviation and the rest along the lane change."),
    ]
    return Section(heading=heading, blocks=blocks)


def _scores(one: Driven, caption: str) -> list[Block]:
    case = f"{headline(one.drives.conditions)}."
    return [
        Table(caption=case, header=SCORES, rows=score_rows(one.drives.runs)),
        drawing(one.figures["errors"], caption, READ["errors"]),
    ]


def drive_numbers(driven: Mapping[str, Driven]) -> list[Headline]:
    numbers = []
    for name, one in driven.items():
        first, second = one.drives.runs[:2]
        off = f"{first.scores.rms_e_y_m:.3f} / {second.scores.rms_e_y_m:.3f} m"
        meaning = f"rms off the path {_CASES[name][-1]}, {first.label} / {second.label} tires"
        numbers.append(Headline(off, meaning))
    return numbers


FOLDER = "package"
NOT_BUILT = (
    "No C compiler (gcc) was found: the package was written, but neither compiled nor tested."
)


class _Check(NamedTuple):
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
    """What was exported, and its builds here: none without a compiler."""

    exported: Exported
    checks: Sequence[_Check]


def ship(story: Story, folder: Path) -> Shipped:
    """Export what the axle identifier learnt, as `tireid export` does, compile it and test it."""
    learnt, model = story.axle.runs[0], story.axle.model
    exported = export(learnt.method, folder, start=model, vehicle=story.car)
    name, checks = exported.package.specialized.name, list[_Check]()
    if find_compiler() is not None:
        expected = identify(learnt.recording, story.car, learnt.method, model).axle_force
        for precision, single in (("double", False), ("float", True)):
            verdict = self_test(folder, name, single=single)
            assert verdict is not None
            run = CompiledPackage.from_folder(folder, single=single).run(learnt.recording)
            difference = float(np.abs(run.axle_force - expected).max())
            refused = int(np.count_nonzero(run.status))
            checks.append(_Check(precision, verdict, difference, refused, len(run.status)))
    return Shipped(exported, checks)


def shipped_text(shipped: Shipped) -> str:
    lines = [f"As a C package ({FOLDER}/, hash {shipped.exported.package.about['hash']}):"]
    lines += [
        f"  {check.precision:8} self-test {check.verdict.verdict}; over the slalom within "
        f"{check.difference:.2g} N of Python, {check.refused} samples refused"
        for check in shipped.checks
    ] or [f"  {NOT_BUILT}"]
    costs = [one for one in shipped.exported.costs if one.single]
    lines += [f"  {one.processor}, {one.precision}: {one.words}" for one in costs]
    return "\n".join(lines)


def package_section(shipped: Shipped) -> Section:
    name = shipped.exported.package.specialized.name
    intro = (
        "The axle identifier, beginning with the weights of this drive, is written as a C99 "
        f"package to the folder {FOLDER}/ beside this report: library, example, self-test and "
        f"README with its costs, every symbol begins with {name}_. It is what tireid export "
        "writes; here it is compiled, tested and run over the slalom, beside Python."
    )
    lines = (intro, *shipped_text(shipped).splitlines())
    blocks = [Paragraph(text=line) for line in lines]
    return Section(heading="The identifier as C for a controller", blocks=blocks)
