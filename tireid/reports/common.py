"""What every report.html shares: how to read a figure, and what is needed to compute it again.

The order is always: headline numbers, what speaks against them, what was found with its figures and
how to read each, and where it came from.
"""

import platform
from collections.abc import Iterable

from matplotlib.figure import Figure

from codegen.arrays import LONG, blocks
from identifier.frozen import vehicle_numbers
from models.files import digest, digest_of_bytes
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid import __version__
from tireid.figures import style
from tireid.report import Picture, Section, Table

REPORT = "report.html"

# How to read each figure, in one line.
READ = {
    "forces": "Online and frozen lie on the truth where there is one; the residual below is small "
    "against the force and shows no pattern that repeats.",
    "slip": "Points follow the curve. A loop around it is relaxation, a second branch another "
    "friction, a shift an offset of steering or lateral velocity; shaded slip is not known. The "
    "band around the curve is where nine of ten forces of other drives are to be expected.",
    "learnt": "Each number comes to rest once it was excited; steps late in the drive are a "
    "friction or a sensor that changed.",
    "doctor": "Points of a good log lie on one rising curve, each axle on its own; a cloud, a loop "
    "or a falling curve is no tire, whatever its numbers.",
    "inputs": "Is the log what you think it is: signs, gaps, noise?",
    "replay": "A drive that was not learnt; the residual is what the frozen model misses.",
    "motion": "The model lies on what the motion shows; what is missed below it is small and shows "
    "no pattern. Windows that the verdict leaves out are not drawn.",
    "friction": "Near 1 the road is that of the drive that taught. The band is wide where the "
    "tires do not slide: nobody can tell there.",
    "error": "It shrinks at first and then stays at the size of the noise.",
    "weights": "They come to rest; weights that grow to the end are those of a law that drifts.",
    "film": "The curve that is steered by and the one that was learnt are those known at that "
    "moment; shaded slip was not known then.",
    "plan_area": "The black box is the area, the dashed one what its margin leaves to the body of "
    "the car; the thick line is the center of gravity with the likely tires, thin ones with others "
    "that it may have; an arrow is the entry.",
    "plan_steering": "Above what the front wheels are asked to do, below how much of its grip each "
    "axle of the likely tires gives.",
    "plan_band": "Where the band narrows, the drive will have taught; beyond it nothing changes.",
    "path": "Outlines are the first car every few meters; the green band is the path.",
    "errors": "The deviation is near zero where the tracker knows the tires. Where there are any: "
    "diamonds mark where it plans with another tire or grip, red shades a broken sensor, dots "
    "where it was noticed.",
    "steering": "A command at its limit is a car that has no more to give.",
    "tires": "The cloud is what the tires did; a tracker is right where its curve passes through "
    "it. Below, what each curve misses of the true one.",
    "lateral": "What is told lies on the truth, its error within the band; the identifier alone "
    "knows of no position, and strays where the friction is another than it has learnt.",
    "solve_times": "All steps must end within the period, far to the left of it.",
    "methods": "Left is better; a line runs from the best recording to the worst.",
    "matrix": "Off the diagonal is what counts: learnt on one drive, asked about another.",
    "side_slip": "Estimates lie on what was recorded, where there is any, and it lies in the band "
    "but for one sample in twenty. Below, what each estimate misses.",
    "pareto": "Lower and farther left is better; the star is the default.",
}


def drawing(figure: Figure, caption: str, read: str = "") -> Picture:
    return Picture(image=style.figure_svg(figure), caption=caption, read=read)


def recording_digest(recording: Recording) -> str:
    """Return twelve characters that stand for the signals of a recording and its true forces.

    Of more than `LONG` samples bytes are counted, of fewer their decimals.
    """
    signals = (recording.t, recording.v_x, recording.logged_v_y, recording.r)
    steering = (recording.delta_f, recording.delta_r)
    truth = (recording.a_y, recording.axle_force)
    parts = [part for part in (*signals, *steering, *truth) if part is not None]
    if len(recording) <= LONG:
        return digest([part.tolist() for part in parts])
    return digest_of_bytes(
        signal[part].astype("<f8").tobytes() for signal in parts for part in blocks(len(signal))
    )


def origin(
    command: str, vehicle: Vehicle, recordings: Iterable[Recording], **others: str
) -> Section:
    """Return what is needed to compute a report again."""
    told = list(recordings)
    rows = [
        ["command", command],
        ["tireid", __version__],
        ["Python, machine", f"{platform.python_version()}, {platform.system()} on "
         f"{platform.machine()}"],
        ["car", f"{vehicle.name}, hash {digest(vehicle_numbers(vehicle))}"],
        *(
            [
                "recording",
                f"{one.name}: {len(one)} samples, {one.duration:.4g} s, hash "
                f"{recording_digest(one)}",
            ]
            for one in told
        ),
        *(["how it was read", f"{one.name}: {note}"] for one in told for note in one.notes),
        *([name.replace("_", " "), value] for name, value in others.items()),
    ]  # fmt: skip
    table = Table(
        caption="What went in; equal hashes are equal numbers.",
        header=["what", "value"],
        rows=rows,
        verbatim=True,
    )
    return Section(heading="To compute it again", blocks=[table])
