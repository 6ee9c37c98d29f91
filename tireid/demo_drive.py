"""The car of the demo drives on what it learnt: a lane change, and a road that becomes slippery."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from codegen import find_compiler
from mpc.path import BUILT_IN
from tireid.demo_story import FREEZE, Story
from tireid.drive_case import headline, inputs_of
from tireid.drive_options import SpeedWish
from tireid.drive_results import write_drives
from tireid.drive_runs import FROZEN, LEARNING, LINEAR, ORACLE, Conditions, Run, run_drive
from tireid.drive_setup import Setup
from tireid.drive_table import drive_table
from tireid.drive_tires import known_curves
from tireid.report import Block, Paragraph, Picture, Section, Table

LANE_CHANGE, SLIPPERY = "drive", "drive_slippery"  # folders beside the report
DELAY = 2  # periods of 10 ms
SOURCE = "frozen ones learnt on the slalom"
NO_COMPILER = "No C compiler (gcc) was found: the tracker cannot be built, the car did not drive."


class Driven(NamedTuple):
    """Drives along one path: what they were like, and what came of them."""

    conditions: Conditions
    runs: Sequence[Run]


def drive_story(story: Story, folder: Path) -> dict[str, Driven]:
    """Drive the cases of the demo and write what `tireid drive` writes; nothing without a compiler.

    Parameters
    ----------
    story : what was learnt.
    folder : of the report.
    """
    if find_compiler() is None:
        return {}
    lane_change = _setup(story, "iso-3888-2", 0.9, ())
    slippery = _setup(story, "slalom", 0.57, ((110.0, 0.5),))
    return {
        LANE_CHANGE: _drive(story, lane_change, (FROZEN, LINEAR, ORACLE), folder / LANE_CHANGE),
        SLIPPERY: _drive(story, slippery, (LEARNING, FROZEN, LINEAR), folder / SLIPPERY),
    }


def drive_text(driven: dict[str, Driven]) -> str:
    """Return what came of the drives, as lines of text.

    Parameters
    ----------
    driven : by folder.
    """
    blocks = [f"{headline(one.conditions)}\n{drive_table(one.runs)}" for one in driven.values()]
    return "\n\n".join(["Driving on what was learnt:", *blocks]) if blocks else NO_COMPILER


def drive_section(driven: dict[str, Driven], folder: Path) -> Section:
    """Return the section of the report.

    Parameters
    ----------
    driven : by folder.
    folder : of the report, with the pictures.
    """
    heading = "The car drives on what was learnt"
    if not driven:
        return Section(heading=heading, blocks=[Paragraph(text=NO_COMPILER)])
    lane, slippery = folder / LANE_CHANGE, folder / SLIPPERY
    blocks: list[Block] = [
        Paragraph(
            text="A model predictive tracker steers the double-track car along the lane change of "
            "ISO 3888-2, at 90 % of the lateral acceleration that the tires can give. It plans 2 s "
            "ahead, 100 times a second, with noisy sensors and 20 ms of delay. Told of the model "
            "that was frozen after the slalom it is set beside the same tracker told of the linear "
            "tire, and of the true one."
        ),
        _table(driven[LANE_CHANGE]),
        Picture(
            image=lane / "drive.gif",
            caption="The drive on frozen tires. Outlines are the other cars; below, force over "
            f"slip of both axles and the deviation. The film is {LANE_CHANGE}/drive.gif.",
        ),
        Picture(image=lane / "errors.png", caption="Deviation, heading, acceleration and speed."),
        Picture(
            image=lane / "tires.png",
            caption="The forces of the drive, and what the trackers believe of the tires.",
        ),
        Paragraph(
            text="Then the friction drops to half in the middle of a slalom, which takes all that "
            "is left, and nobody tells the car. One tracker goes on learning: it is told of "
            "another tire where the last moments say so, and where what is learnt explains the "
            "last seconds better."
        ),
        _table(driven[SLIPPERY]),
        Picture(image=slippery / "drive.gif", caption="The drive of the learning car."),
        Picture(
            image=slippery / "errors.png",
            caption="Deviation and the rest over arc length; diamonds mark other tires.",
        ),
    ]
    return Section(heading=heading, blocks=blocks)


def _setup(story: Story, path: str, share: float, drops: tuple[tuple[float, float], ...]) -> Setup:
    return Setup(
        path=BUILT_IN[path](),
        vehicle=story.car,
        plant="double-track",
        mu=1.0,
        drops=drops,
        wish=SpeedWish(share, None),
    )


def _drive(story: Story, setup: Setup, labels: Sequence[str], folder: Path) -> Driven:
    learnt = story.default.learnt.freeze(FREEZE)
    conditions = Conditions(setup=setup, delay=DELAY, noise=True, seed=0, laps=1.0)
    runs = [run_drive(label, conditions, learnt) for label in labels]
    folder.mkdir()
    write_drives(
        folder,
        runs,
        known_curves(runs, setup, learnt),
        inputs=inputs_of(conditions, labels, SOURCE, learnt),
        drops=setup.drops,
        film="gif",
    )
    return Driven(conditions, runs)


def _table(driven: Driven) -> Table:
    rows = []
    for run in driven.runs:
        score = run.scores
        ending = "completed" if score.completed else run.drive.ending
        rms, peak = f"{score.rms_e_y_m:.3f}", f"{score.peak_e_y_m:.3f}"
        rows.append([run.label, rms, peak, ending, f"{score.solve_ms['median']:.3f}"])
    return Table(
        caption=f"{headline(driven.conditions)}.",
        header=["tires", "rms deviation [m]", "peak [m]", "end", "a step takes [ms], median"],
        rows=rows,
    )
