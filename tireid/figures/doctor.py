"""What the doctor looks at: the force of each axle over its slip angle, as told and as repaired."""

import numpy as np
from matplotlib.figure import Figure

from identifier.doctor.consistency import Motion, Reading, forces_and_slips
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid.figures.style import BLUE, GREY, PAGE, legend_above, new_figure, styled

AXLES = ("front axle", "rear axle")


@styled
def draw_diagnosis(
    recording: Recording, vehicle: Vehicle, repaired: Recording, car: Vehicle
) -> Figure:
    """Draw force over slip angle of both axles before and after a repair.

    Parameters
    ----------
    recording, vehicle : as they were told.
    repaired, car : with the repair; the same where there is none.
    """
    figure = new_figure(PAGE, 2.9)
    panels = figure.subplots(1, 2)
    shown = [("as logged", GREY, recording, vehicle)]
    if repaired is not recording:
        shown.append(("repaired", BLUE, repaired, car))
    for name, color, one, told in shown:
        motion = Motion.of(one)
        if motion is None:
            continue
        axles = forces_and_slips(motion, told, Reading())
        for panel, slip, force in zip(panels, axles.slip, axles.force, strict=True):
            panel.plot(np.degrees(slip), force, ".", color=color, markersize=2.5, label=name)
    for panel, title in zip(panels, AXLES, strict=True):
        panel.set_title(title)
        panel.set_xlabel("slip angle [deg]")
        panel.set_ylabel("force that the motion shows [load]")
        panel.axhline(0.0, color=GREY, linewidth=0.5)
    legend_above(figure)
    return figure
