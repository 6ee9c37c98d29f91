"""`tireid demo`: the whole story on the built-in car, in a minute, with a report."""

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from identifier.paper_study import GAINS, NETWORK, STEPS, Study, run_study
from tireid.commands import COMMANDS
from tireid.commands.certificate_table import (
    HEADER,
    advised,
    certificate_rows,
    certificate_text,
    notes,
    verdict_line,
)
from tireid.commands.check import draw_check
from tireid.commands.demo_parts import (
    FOLDER,
    Shipped,
    drive_section,
    drive_story,
    drive_text,
    package_section,
    ship,
    shipped_text,
)
from tireid.commands.demo_story import FREEZE, PREDICT, SPEED, Story, run_story
from tireid.commands.identify_results import write_results
from tireid.commands.options import add_output
from tireid.commands.paper import (
    MEANING,
    MEASURES_MEAN,
    SCHEME,
    header,
    rows,
    settings,
    table_text,
    write_study,
)
from tireid.figures import figure_png, side_by_side_figure
from tireid.output import output_folder
from tireid.progress import Progress, Stopwatch, tell
from tireid.report import Paragraph, Picture, Section, Table, write_report

# The demo's report: what was driven, learnt, frozen and predicted, in order.

REFERENCE = (
    'Hong and Choi, "Integral Error-Based Adaptive Neural Identifier for Nonlinear Lateral Tire '
    'Forces"'
)


def demo_sections(story: Story, shipped: Shipped, study: Study, folder: Path) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    story : the noisy drives, learnt by both methods.
    shipped : what was learnt, as a C package.
    study : the paper's study.
    folder : with the figures in identify/, paper_network/ and paper/.
    """
    default, network, tables = (folder / n for n in ("identify", "paper_network", "paper"))
    return [
        _drive(default),
        _learn(default),
        _predict(story),
        package_section(shipped),
        _certify(story, network),
        _network(story, network, tables / SCHEME),
        _slalom(study, tables),
        _step(study, tables),
    ]


def _drive(learning: Path) -> Section:
    return Section(
        heading="A car is driven",
        blocks=[
            Paragraph(
                text="The car is a double-track model of a mid-size sedan: roll, load transfer, "
                "tire relaxation and combined slip on Magic Formula tires, integrated at 1 ms. It "
                f"drives a slalom at {SPEED:g} m/s. The identifier sees what any log has, v_x, "
                "v_y, r and steering at 100 Hz with sensor noise; it never sees a force."
            ),
            Picture(image=learning / "inputs.png", caption="What the identifier is given."),
        ],
    )


def _certify(story: Story, learning: Path) -> Section:
    certificate, unit = story.certificate, story.design.force_unit
    return Section(
        heading="The gains of the paper's law are judged before it learns",
        blocks=[
            Paragraph(
                text="The certificate follows from the gains, the network and how hard the car is "
                f"driven, not from a run. {verdict_line(certificate).capitalize()}."
            ),
            Table(
                caption="Properties of the learning loop at the worst regressor; those without a "
                "limit are stated, not judged.",
                header=list(HEADER),
                rows=certificate_rows(certificate, unit),
            ),
            *(Paragraph(text=f"{e.title}: {e.status}; {e.advice}.") for e in advised(certificate)),
            *(Paragraph(text=f"Note: {remark}.") for remark in notes(certificate)),
            Picture(
                image=learning / "locus.png",
                caption="Poles of the sampled loop at any gain, and at the gain of the design.",
            ),
            Picture(
                image=learning / "bounds.png",
                caption="Proven bounds on the error norm, and the error that happened.",
            ),
        ],
    )


def _learn(default: Path) -> Section:
    return Section(
        heading="Tire forces are learnt while it drives",
        blocks=[
            Paragraph(
                text="Each axle has a force curve of slip, a sum of tanh units that is odd and "
                "saturates. Slip is lagged by the relaxation of the tire, which is learnt too, and "
                "moved by the sway of the body. The curves are learnt by recursive least squares "
                "from motion alone; what was never excited keeps what is believed of any tire."
            ),
            Picture(
                image=default / "forces.png",
                caption="Axle forces: online above, and below replayed with the weights frozen at "
                f"{FREEZE:g} s.",
            ),
            Picture(
                image=default / "slip.png",
                caption="The same forces over slip angle (sign of the paper: positive slip pushes "
                "to the left), and the curve behind them. Forces form loops since tires relax and "
                "the body sways. Slip that the model does not know is shaded.",
            ),
            Picture(
                image=default / "learnt.png",
                caption="What is learnt, in the numbers of a tire: each settles when excited.",
            ),
        ],
    )


def _predict(story: Story) -> Section:
    blocks: list[Paragraph | Table | Picture] = [
        Paragraph(
            text="Reproducing the drive that was learnt is the easier half. The same frozen "
            "weights predict two other maneuvers, beside them the paper's network and law, learnt "
            "on the same slalom with gains from the phase margin of their loop."
        ),
        Table(
            caption="RMSE of the axle force, both axles together [kN], and the frozen error as a "
            "share of the rms force.",
            header=[
                "drive",
                "default, online",
                "frozen",
                "of rms",
                "paper, online",
                "frozen",
                "of rms",
            ],
            rows=story.rows(),
        ),
    ]
    for history in story.default.others:
        name = history.recording.name
        said = name.replace("_", " ")
        figure = side_by_side_figure(story.side_by_side(name))
        caption = f"Both methods, frozen after the slalom, asked about the {said}."
        blocks.append(Picture(image=figure_png(figure), caption=caption))
    return Section(heading="The frozen model is asked about drives it has not seen", blocks=blocks)


def _network(story: Story, network: Path, scheme: Path) -> Section:
    design, gains = story.design, story.design.gains
    return Section(
        heading="The paper's network on the same slalom",
        blocks=[
            Paragraph(
                text="At every sample an observer predicts the motion; its error drives the "
                "weights of a network of "
                f"{design.network.hidden} hidden units, which corrects the linear tire. The law is "
                "the integral law of the paper: "
                f"A_d = {gains.A_d[0][0]:.4g} I 1/s, lambda = {gains.forgetting:.4g} 1/s, eta1 = "
                f"{gains.eta_W:.4g} 1/s^4, eta2 = {gains.eta_V:.4g} 1/(kN^2 s^4), rho1 = "
                f"{gains.rho_W:.4g} and rho2 = {gains.rho_V:.4g} 1/(kN s^2)."
            ),
            Picture(
                image=scheme,
                caption="The identifier, as Fig. 1 of the paper; orange is what the laws differ "
                "in, and where a freeze cuts.",
            ),
            Picture(
                image=network / "forces.png",
                caption="Axle forces: online above, and below replayed with the weights frozen at "
                f"{FREEZE:g} s.",
            ),
            Picture(image=network / "slip.png", caption="The same forces over slip angle."),
            Picture(image=network / "error.png", caption="Norm of the observer's error."),
            Picture(image=network / "weights.png", caption="Weights of the network."),
        ],
    )


def _slalom(study: Study, tables: Path) -> Section:
    return Section(
        heading="The frozen-weight reproducibility test: slalom",
        blocks=[
            Paragraph(
                text=f"{REFERENCE} freezes the weights at an instant and replays the past with "
                "them: a law that follows the instant forgets what it learnt before. "
                f"{MEASURES_MEAN}"
            ),
            Table(
                caption=f"Table II of the paper beside ours, RMSE of the axle force [kN]: median "
                f"and quartiles of {len(study.errors['slalom']['integral'])} seeds.",
                header=header(),
                rows=rows("slalom", study),
            ),
            Paragraph(text=MEANING),
            Picture(
                image=tables / "slalom_errors.png",
                caption="The table as a picture; hollow marks are the paper's values.",
            ),
            Picture(
                image=tables / "fig4_slalom_instantaneous.png",
                caption="Instantaneous law, as Fig. 4 of the paper (seed of median error); all "
                "errors count from the onset on.",
            ),
            Picture(
                image=tables / "fig5_slalom_integral.png",
                caption="Integral law, as Fig. 5 of the paper (seed of median error).",
            ),
            Picture(
                image=tables / "control_slalom_instantaneous_scaled.png",
                caption="The control: instantaneous law at eta/lambda (seed of median error).",
            ),
            Paragraph(text=settings(GAINS, NETWORK).splitlines()[0]),
        ],
    )


def _step(study: Study, tables: Path) -> Section:
    return Section(
        heading="The frozen-weight reproducibility test: step steer",
        blocks=[
            Paragraph(
                text="The step is held from 29 s on and goes back to half its angle at 36 s. By "
                "the paper's measure the order of the laws is the reverse of the slalom's; against "
                "truth it is not: what the integral law said online on the ramp was further from "
                "the truth than what its frozen weights say of it. After 36 s, at "
                "an angle that was not learnt, all of them miss more than the linear tire."
            ),
            Table(
                caption="Table I of the paper beside ours, RMSE of the axle force [kN].",
                header=header(),
                rows=rows("step_steer", study),
            ),
            Picture(
                image=tables / "fig2_step_steer_instantaneous.png",
                caption="Instantaneous law, as Fig. 2 of the paper.",
            ),
            Picture(
                image=tables / "fig3_step_steer_integral.png",
                caption="Integral law, as Fig. 3 of the paper.",
            ),
        ],
    )


TITLE = "tireid: lateral tire forces, learnt while driving"
SUMMARY = (
    "A car drives, its tire forces are learnt from v_x, v_y, yaw rate and steering, the weights "
    "are frozen, and the frozen model is asked about drives that it has not seen; at the end it "
    "steers."
)
SEEDS = 20
LEARNING, EXPORTING = "driving the sedan, learning, predicting", "as C, compiled and tested"
TESTING, DRIVING = "the frozen-weight test of the paper", "driving on what was learnt"
REPORTING = "writing the report"
PARTS = {LEARNING: 15.0, EXPORTING: 20.0, TESTING: 20.0, DRIVING: 40.0, REPORTING: 2.0}  # about s


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "demo",
        help=COMMANDS["demo"],
        description="Drive the built-in sedan, learn its tires, freeze them, test them on another "
        "maneuver, export them as a C package that is compiled and tested, repeat the paper's "
        "tables, and steer the car along a path on what it learnt; leaves one report.html to read.",
    )
    add_output(parser, "demo")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run the command.

    Parameters
    ----------
    options : parsed arguments.
    """
    watch = Stopwatch()
    with (
        output_folder(options.out, force=options.force) as folder,
        Progress("demo", PARTS, long=True) as work,
    ):
        story = run_story(partial(work.begin(LEARNING).step, 2 * (1 + len(PREDICT))))
        folders = {name: folder / name for name in ("identify", "paper_network", "paper")}
        for one in folders.values():
            one.mkdir()
        for name, part in (("identify", story.default), ("paper_network", story.paper)):
            write_results(folders[name], part.law, part.learnt, part.others, part.frozen)
        operation, drive = story.design.operation(story.car), story.paper.learnt.recording
        draw_check(
            folders["paper_network"], drive, story.car, story.design, operation, story.certificate
        )
        work.begin(EXPORTING)
        shipped = ship(story, folder / FOLDER)
        study = run_study(SEEDS, partial(work.begin(TESTING).step, STEPS))
        write_study(folders["paper"], study)
        work.begin(DRIVING)
        driven = drive_story(story, folder)
        work.begin(REPORTING)
        sections = demo_sections(story, shipped, study, folder)
        sections.append(drive_section(driven, folder))
        write_report(folder / "report.html", TITLE, sections, summary=SUMMARY)
        told = [
            *(table_text(maneuver, study) for maneuver in study.errors),
            f"{certificate_text(story.certificate, story.design.force_unit)}\n",
            f"{story.text()}\n",
            f"{shipped_text(shipped)}\n",
            drive_text(driven),
        ]
    tell("\n".join(told))
    tell(f"read {options.out / 'report.html'}  ({watch.seconds:.0f} s)")
