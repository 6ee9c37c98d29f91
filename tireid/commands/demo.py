"""`tireid demo`: the whole story on the built-in car, in a minute, with a report."""

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from codegen import find_compiler
from identifier.export.compiled import CompiledPackage
from identifier.paper_study import GAINS, NETWORK, STEPS, Study, run_study
from identifier.run import identify
from models.vehicle import GRAVITY
from mpc.path import BUILT_IN
from tireid.commands import certificate_table
from tireid.commands import options as shared
from tireid.commands.check import draw_check
from tireid.commands.demo_story import SPEED, STORY, Story, run_story
from tireid.commands.paper import (
    MEANING,
    MEASURES_MEAN,
    compared,
    settings,
    study_table,
    table_text,
    write_study,
)
from tireid.driving.results import (
    SCORES,
    Drives,
    errors_caption,
    film_picture,
    headline,
    known_blocks,
    score_rows,
)
from tireid.driving.runs import FROZEN, LEARNING, LINEAR, ORACLE, Conditions
from tireid.driving.setup import Setup, SpeedWish
from tireid.exporting import Exported, export, self_test
from tireid.figures.film import FORMATS
from tireid.figures.paper import SCHEME
from tireid.identified import Results
from tireid.progress import Progress, tell
from tireid.report import (
    Block,
    Headline,
    Images,
    Picture,
    Report,
    Section,
    Table,
    drawings,
    origin,
    printed,
    write_report,
)
from tireid.reports.captions import comparison_caption, slip_caption
from tireid.reports.identify import curve_drawing, identify_notes, learnt_blocks, replay_picture
from tireid.verdicts import model_error_headline, verdict_headline, verdict_notes, verdict_section

LANE_CHANGE, _SLIPPERY = "drive", "drive_slippery"  # folders beside the report
_FILM = FORMATS[0]
_CASES = {  # path, a_y in bends [g], drops of friction [m] and to what, tires
    LANE_CHANGE: ("iso-3888-2", 0.79, (), (FROZEN, LINEAR, ORACLE)),
    _SLIPPERY: ("slalom", 0.5, ((110.0, 0.5),), (LEARNING, FROZEN, LINEAR)),
}
NOT_DRIVEN = "No C compiler (gcc) was found: the tracker cannot be built, the car did not drive."


class Driven(NamedTuple):
    """Drives along one path, and their figures."""

    drives: Drives
    figures: Images


_Cases = Mapping[str, Driven]


def drive_story(story: Story, folder: Path) -> dict[str, Driven]:
    """Drive the cases of the demo and write what `tireid drive` writes; nothing without a
    compiler.
    """
    found: dict[str, Driven] = {}
    for name, (path, a_y, drops, labels) in _CASES.items() if find_compiler() else ():
        wish = SpeedWish(a_y=a_y * GRAVITY)
        setup = Setup(BUILT_IN[path](), story.car, 1.0, drops, wish)
        conditions = Conditions(setup=setup, delay=2, noise=True, seed=0, laps=1.0)
        source = "frozen ones identified on the slalom"
        drives = Drives.driven(conditions, labels, story.axle.model, source)
        (folder / name).mkdir()
        found[name] = Driven(drives, drives.write(folder / name, _FILM))
    return found


def drive_text(driven: _Cases) -> str:
    blocks = [one.drives.text() for one in driven.values()]
    return "\n\n".join(["Driving on the identified tires:", *blocks]) if blocks else NOT_DRIVEN


def drive_section(driven: _Cases, folder: Path) -> Section:
    heading = "The car drives on the identified tires"
    if not driven:
        return Section(heading, [NOT_DRIVEN])
    slippery = driven[_SLIPPERY]
    blocks: list[Block] = [
        (
            "A model predictive tracker steers the car around the cones. It plans 2 s ahead, "
            "100 times a second, with noisy sensors and 20 ms of delay. In the slalom friction "
            "drops to half; no tracker gets it. The learning one replaces its tire where "
            "innovations require it, the others keep frozen or linear tires."
        ),
        film_picture(folder / _SLIPPERY / f"drive.{_FILM}", slippery.drives.runs),
        *_scores(slippery),
        *known_blocks(slippery.drives, slippery.figures),
        (
            "The lane change of ISO 3888-2 at 0.79 g, nine tenths of what the tires can give; its "
            f"film is {LANE_CHANGE}/drive.{_FILM}."
        ),
        *_scores(driven[LANE_CHANGE]),
    ]
    return Section(heading, blocks)


def _scores(one: Driven) -> list[Block]:
    return [
        Table(f"{headline(one.drives.conditions)}.", SCORES, score_rows(one.drives.runs)),
        *drawings(one.figures, {"errors": errors_caption(one.drives)}),
    ]


def drive_numbers(driven: _Cases) -> list[Headline]:
    """Return how much nearer to the slippery path the first tires are than the second."""
    if _SLIPPERY not in driven:
        return []
    first, second = driven[_SLIPPERY].drives.runs[:2]
    off = f"{first.scores.rms_e_y_m:.3f} / {second.scores.rms_e_y_m:.3f} m"
    meaning = f"rms off the path where friction drops, {first.label} / {second.label} tires"
    return [Headline(off, meaning)]


FOLDER = "package"
NOT_BUILT = (
    "No C compiler (gcc) was found: the package was written, but neither compiled nor tested."
)


class Shipped(NamedTuple):
    """What was exported, and its builds here: none without a compiler."""

    exported: Exported
    checks: Sequence[str]


def ship(story: Story, folder: Path) -> Shipped:
    """Export what the axle identifier learnt, as `tireid export` does, compile it and test it."""
    learnt, model = story.axle.runs[0], story.axle.model
    exported = export(learnt.method, folder, start=model, vehicle=story.car)
    name, checks = exported.package.specialized.name, list[str]()
    if find_compiler() is not None:
        expected = identify(learnt.recording, story.car, learnt.method, model).axle_force
        for precision, single in (("double", False), ("float", True)):
            verdict = self_test(folder, name, single=single)
            assert verdict is not None
            run = CompiledPackage.from_folder(folder, single=single).run(learnt.recording)
            difference = np.abs(run.axle_force - expected).max()
            checks.append(
                f"{precision:8} self-test {verdict.verdict}; over the slalom within "
                f"{difference:.2g} N of Python, {np.count_nonzero(run.status)} samples refused"
            )
    return Shipped(exported, checks)


def shipped_text(shipped: Shipped) -> str:
    lines = [f"As a C package ({FOLDER}/, hash {shipped.exported.package.about['hash']}):"]
    lines += [f"  {check}" for check in shipped.checks or [NOT_BUILT]]
    costs = [one for one in shipped.exported.costs if one.single]
    lines += [f"  {one.processor}, {one.precision}: {one.words}" for one in costs]
    return "\n".join(lines)


def package_section(shipped: Shipped) -> Section:
    name = shipped.exported.package.specialized.name
    intro = (
        "The axle identifier with the weights of this drive, as tireid export writes it: a C99 "
        f"package in {FOLDER}/ beside this report, whose symbols begin with {name}_. Here it is "
        "compiled, tested and run over the slalom."
    )
    lines = (intro, *shipped_text(shipped).splitlines())
    return Section("The identifier as C for a controller", lines)


_REFERENCE = (
    'Hong and Choi, "Integral Error-Based Adaptive Neural Identifier for Nonlinear Lateral Tire '
    'Forces"'
)


def _demo_report(
    story: Story,
    shipped: Shipped,
    study: Study,
    driven: _Cases,
    figures: Mapping[str, Images],
    folder: Path,
    command: str,
) -> Report:
    """Return the report: the product first, the paper's study folded."""
    model, runs, verdict = story.axle.model, story.axle.runs, story.axle.verdict
    return Report(
        title="tireid: lateral tire forces, identified while driving",
        summary="tireid identifies the tire forces of a driven car from speed, lateral velocity, "
        "yaw rate and steering. The frozen model then predicts validation drives and steers the "
        "car.",
        numbers=[
            verdict_headline(verdict),
            *model_error_headline(verdict),
            *drive_numbers(driven),
        ],
        notes=[*verdict_notes(verdict), *identify_notes(model, runs)],
        sections=[
            verdict_section(verdict, model),
            drive_section(driven, folder),
            _learn(story.axle, figures["identify"]),
            _predict(story, figures["identify"]),
            package_section(shipped),
            _paper_study(story, study, figures["paper"]),
            origin(command, story.car, [run.recording for run in runs]),
        ],
    )


def _learn(found: Results, figures: Images) -> Section:
    learnt, verdict = found.runs[0], found.verdict
    return Section(
        "Identified tires",
        [
            (
                "The car is a double-track model of a mid-size sedan on Magic Formula tires, in a "
                f"slalom at {SPEED:g} m/s. The identifier gets speed, lateral velocity, yaw rate "
                "and steering at 100 Hz with sensor noise; it gets no force."
            ),
            (
                "Each axle has an odd, saturating force curve of lagged slip. Recursive least "
                "squares identify it sample by sample; where nothing was excited the prior "
                "remains. tireid identify makes one estimate of a whole log."
            ),
            curve_drawing(figures, verdict, slip_caption(found.model, learnt.recording)),
            *learnt_blocks(found, figures)[1:],
            replay_picture(found, figures, "forces", learnt.recording.name),
        ],
    )


def _predict(story: Story, figures: Images) -> Section:
    columns = [
        f"{who}, {what}" for who in ("axle", "paper") for what in ("online", "frozen", "of rms")
    ]
    blocks: list[Block] = [
        (
            "The same frozen weights predict two maneuvers that were not used for "
            "identification. Beside them: the paper's network, identified on the same slalom."
        ),
        Table(
            "RMSE of the axle force, both axles together [kN], and the frozen error as a "
            "share of the rms force.",
            ["drive", *columns],
            [[row[0].replace("_", " "), *row[1:]] for row in story.rows()],
        ),
    ]
    blocks += [replay_picture(story.axle, figures, f"replay_{name}", name) for name in [*STORY][1:]]
    return Section("Prediction of validation drives", blocks)


def _paper_study(story: Story, study: Study, figures: Images) -> Section:
    certified = certificate_table.verdict_line(story.certificate)
    blocks: list[Block] = [
        (
            "The paper's network, its gains from the phase margin of their loop, beside the "
            "axle identifier above: figures, certificate and bounds are in the folder "
            f"paper_network. {printed(certified).capitalize()}."
        ),
        Picture(
            SCHEME.with_suffix(".svg"),
            "The identifier, as Fig. 1 of the paper; orange is what the laws differ in, "
            "and where a freeze cuts.",
        ),
        (
            f"{_REFERENCE} freezes the weights at an instant and replays the past with "
            "them: a law that follows the instant forgets earlier driving. "
            f"{printed(MEASURES_MEAN)}"
        ),
    ]
    for maneuver in study.errors:
        blocks.append(study_table(maneuver, study))
        if f"{maneuver}_errors" in figures:  # a law that diverged on every seed has none
            caption = printed(comparison_caption(*compared(study, maneuver)))
            blocks.append(Picture(figures[f"{maneuver}_errors"], caption))
    said = (MEANING, settings(GAINS, NETWORK).splitlines()[0])
    blocks += [printed(one) for one in said]
    return Section("The paper's study", blocks, folded=True)


SEEDS = 20
_LEARNING, _EXPORTING = "driving the sedan, learning, predicting", "as C, compiled and tested"
_TESTING, _DRIVING = "the frozen-weight test of the paper", "driving on the identified tires"
_REPORTING = "writing the report"
_PARTS = {
    _LEARNING: 15.0,
    _EXPORTING: 20.0,
    _TESTING: 20.0,
    _DRIVING: 40.0,
    _REPORTING: 2.0,
}  # about s


def declare(new: Any) -> None:
    parser = new(
        description="Drive the built-in sedan, learn its tires, freeze them, test them on another "
        "maneuver, export them as a C package that is compiled and tested, repeat the paper's "
        "tables, and steer the car along a path on the identified tires; leaves one report.html to "
        "read.",
    )
    shared.add_output(parser, "demo")


def run(options: argparse.Namespace) -> None:
    with shared.folder_of(options) as folder:
        work = Progress("demo", _PARTS, long=True)
        story = run_story(partial(work.begin(_LEARNING).step, 2 * len(STORY)))
        for name in ("identify", "paper_network", "paper"):
            (folder / name).mkdir()
        figures: dict[str, Images] = {
            "identify": story.axle.write(folder / "identify"),
            "paper_network": story.paper.write(folder / "paper_network"),
        }
        operation = story.design.operation(story.car)
        draw_check(folder / "paper_network", story.paper.runs[0], operation, story.certificate)
        work.begin(_EXPORTING)
        shipped = ship(story, folder / FOLDER)
        study = run_study(SEEDS, partial(work.begin(_TESTING).step, STEPS))
        figures["paper"] = write_study(folder / "paper", study)
        work.begin(_DRIVING)
        driven = drive_story(story, folder)
        work.begin(_REPORTING)
        report = _demo_report(story, shipped, study, driven, figures, folder, options.words)
        write_report(folder, report)
        columns = [
            *(table_text(maneuver, study) for maneuver in study.errors),
            f"{certificate_table.certificate_text(story.certificate, story.design.force_unit)}\n",
            f"{story.text()}\n",
            f"{shipped_text(shipped)}\n",
            drive_text(driven),
        ]
    tell(*columns)
    tell(f"read {options.out / 'report.html'}  ({work.seconds:.0f} s)")
