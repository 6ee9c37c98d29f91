"""`tireid demo`: the whole story on the built-in car, in a minute, with a report."""

import argparse
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from identifier.paper_study import GAINS, NETWORK, STEPS, Study, run_study
from identifier.tire_model import TireModel
from identifier.verdict import Verdict
from tireid import report as page
from tireid.commands import COMMANDS, certificate_table, demo_parts
from tireid.commands import options as shared
from tireid.commands.check import draw_check
from tireid.commands.demo_story import FREEZE, SPEED, STORY, Story, run_story
from tireid.commands.paper import (
    MEANING,
    MEASURES_MEAN,
    settings,
    study_table,
    table_text,
    write_study,
)
from tireid.figures.forces import side_by_side_figure
from tireid.figures.paper import SCHEME
from tireid.output import output_folder
from tireid.progress import Progress, Stopwatch, tell
from tireid.reports.common import READ, REPORT, drawing, origin
from tireid.reports.identify import (
    curve_drawing,
    identify_headlines,
    identify_warnings,
    learnt_blocks,
)
from tireid.verdicts import (
    missed_headline,
    number_headlines,
    verdict_headline,
    verdict_section,
    verdict_warnings,
)

_REFERENCE = (
    'Hong and Choi, "Integral Error-Based Adaptive Neural Identifier for Nonlinear Lateral Tire '
    'Forces"'
)


def _demo_report(
    story: Story,
    shipped: demo_parts.Shipped,
    study: Study,
    driven: Mapping[str, demo_parts.Driven],
    figures: Mapping[str, Mapping[str, Figure]],
    folder: Path,
    command: str,
) -> page.Report:
    """Return the report: the product first, the paper's study folded."""
    model, runs, verdict = story.axle.model, story.axle.runs, story.axle.verdict
    return page.Report(
        title=_TITLE,
        summary=_SUMMARY,
        numbers=[
            verdict_headline(verdict),
            *missed_headline(verdict),
            *number_headlines(verdict),
            *identify_headlines(story.axle),
            *demo_parts.drive_numbers(driven),
        ],
        warnings=[*verdict_warnings(verdict), *identify_warnings(model, runs)],
        sections=[
            verdict_section(verdict),
            demo_parts.drive_section(driven, folder),
            _learn(figures["identify"], model, verdict),
            _predict(story),
            demo_parts.package_section(shipped),
            _paper_study(story, study, figures["paper"]),
            origin(command, story.car, [run.recording for run in runs]),
        ],
    )


def _learn(figures: Mapping[str, Figure], model: TireModel, verdict: Verdict) -> page.Section:
    return page.Section(
        heading="Identified tires",
        blocks=[
            page.Paragraph(
                text="The car is a double-track model of a mid-size sedan: roll, load transfer, "
                "tire relaxation and combined slip on Magic Formula tires, integrated at 1 ms. It "
                f"drives a slalom at {SPEED:g} m/s. The identifier gets what any log has, "
                "speed, lateral velocity, yaw rate and steering at 100 Hz with sensor noise; it "
                "gets no force."
            ),
            page.Paragraph(
                text="Each axle has a force curve of slip, a sum of tanh units that is odd and "
                "saturates. Slip is lagged by the relaxation of the tire, which is identified "
                "too, and moved by the sway of the body. The curves are identified by recursive "
                "least squares from motion alone; where nothing was excited the prior remains. "
                "It works sample by sample, in a car too; tireid identify makes one estimate of "
                "a whole log."
            ),
            curve_drawing(figures, verdict),
            *learnt_blocks("the axle identifier", model, figures)[1:],
            drawing(
                figures["forces"],
                "Axle forces: online above, and below replayed with the weights frozen at "
                f"{FREEZE:g} s.",
                READ["forces"],
            ),
        ],
    )


def _predict(story: Story) -> page.Section:
    columns = ["frozen", "of rms"]
    blocks: list[page.Block] = [
        page.Paragraph(
            text="The same frozen weights predict two other maneuvers, not used for "
            "identification: beside them the paper's network and law, identified on the same "
            "slalom with gains from the phase margin of their loop."
        ),
        page.Table(
            caption="RMSE of the axle force, both axles together [kN], and the frozen error as a "
            "share of the rms force.",
            header=["drive", "axle, online", *columns, "paper, online", *columns],
            rows=[[row[0].replace("_", " "), *row[1:]] for row in story.rows()],
        ),
    ]
    methods = {
        "axle identifier (curves of slip)": story.axle,
        "paper (network, integral law)": story.paper,
    }
    for run in story.axle.runs[1:]:
        name = run.recording.name
        figure = side_by_side_figure({title: one.replays[name] for title, one in methods.items()})
        caption = f"Both methods, frozen after the slalom, on the {name.replace('_', ' ')}."
        blocks.append(drawing(figure, caption, READ["replay"]))
    return page.Section(heading="Prediction of validation drives", blocks=blocks)


def _paper_study(story: Story, study: Study, figures: Mapping[str, Figure]) -> page.Section:
    seeds = len(study.errors["slalom"]["integral"])
    certified = certificate_table.verdict_line(story.certificate)
    captions = {
        "slalom": f"Table II of the paper beside ours, RMSE of the axle force [kN]: median and "
        f"quartiles of {seeds} seeds.",
        "step_steer": "Table I of the paper beside ours, RMSE of the axle force [kN].",
    }
    blocks: list[page.Block] = [
        page.Paragraph(
            text="The paper's network, its gains from the phase margin of their loop, beside the "
            "axle identifier above: figures, certificate and bounds are in the folder "
            f"paper_network. {page.printed(certified).capitalize()}."
        ),
        page.Picture(
            image=SCHEME.with_suffix(".svg"),
            caption="The identifier, as Fig. 1 of the paper; orange is what the laws differ in, "
            "and where a freeze cuts.",
        ),
        page.Paragraph(
            text=f"{_REFERENCE} freezes the weights at an instant and replays the past with "
            "them: a law that follows the instant forgets earlier driving. "
            f"{page.printed(MEASURES_MEAN)}"
        ),
    ]
    for maneuver, caption in captions.items():
        blocks.append(study_table(maneuver, study, caption))
        if f"{maneuver}_errors" in figures:  # a law that diverged on every seed has none
            what = "The table as a picture; hollow marks are the paper's values."
            blocks.append(drawing(figures[f"{maneuver}_errors"], what))
    said = (MEANING, settings(GAINS, NETWORK).splitlines()[0])
    blocks += [page.Paragraph(text=page.printed(one)) for one in said]
    return page.Section(heading="The paper's study", blocks=blocks, folded=True)


_TITLE = "tireid: lateral tire forces, identified while driving"
_SUMMARY = (
    "tireid identifies the tire forces of a driven car from speed, lateral velocity, yaw rate "
    "and steering. The frozen model then predicts validation drives and steers the car."
)
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


def add_parser(commands: Any) -> None:
    parser = commands.add_parser(
        "demo",
        help=COMMANDS["demo"],
        description="Drive the built-in sedan, learn its tires, freeze them, test them on another "
        "maneuver, export them as a C package that is compiled and tested, repeat the paper's "
        "tables, and steer the car along a path on the identified tires; leaves one report.html to "
        "read.",
    )
    shared.add_output(parser, "demo")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    watch = Stopwatch()
    with output_folder(options.out, force=options.force) as folder:
        work = Progress("demo", _PARTS, long=True)
        story = run_story(partial(work.begin(_LEARNING).step, 2 * len(STORY)))
        folders = {name: folder / name for name in ("identify", "paper_network", "paper")}
        for one in folders.values():
            one.mkdir()
        figures: dict[str, Mapping[str, Figure]] = {
            "identify": story.axle.write(folders["identify"]),
            "paper_network": story.paper.write(folders["paper_network"]),
        }
        operation = story.design.operation(story.car)
        draw_check(folders["paper_network"], story.paper.runs[0], operation, story.certificate)
        work.begin(_EXPORTING)
        shipped = demo_parts.ship(story, folder / demo_parts.FOLDER)
        study = run_study(SEEDS, partial(work.begin(_TESTING).step, STEPS))
        figures["paper"] = write_study(folders["paper"], study)
        work.begin(_DRIVING)
        driven = demo_parts.drive_story(story, folder)
        work.begin(_REPORTING)
        report = _demo_report(story, shipped, study, driven, figures, folder, options.words)
        page.write_report(folder / REPORT, report)
        columns = [
            *(table_text(maneuver, study) for maneuver in study.errors),
            f"{certificate_table.certificate_text(story.certificate, story.design.force_unit)}\n",
            f"{story.text()}\n",
            f"{demo_parts.shipped_text(shipped)}\n",
            demo_parts.drive_text(driven),
        ]
    tell("\n".join(columns))
    tell(f"read {options.out / 'report.html'}  ({watch.seconds:.0f} s)")
