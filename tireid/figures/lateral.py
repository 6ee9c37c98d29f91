"""Lateral velocity where nothing measures it: the truth, what was told, and the band around it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mpc.loop import Drive
from tireid.figures.drive import ARC
from tireid.figures.style import BLUE, GREY, ONLINE, PAGE, TRUTH, legend_above, new_figure, styled

BAND = 2.0  # standard deviations
MILLI = 1e3


@styled
def drive_lateral_figure(drive: Drive) -> Figure:
    """Draw the v_y that was told over the true one, and its error, each with the band of two sigma.

    Parameters
    ----------
    drive : of a car whose v_y was told.
    """
    told, band = drive.told["v_y"], BAND * drive.told["v_y_sd"]
    inertial = drive.told["inertial_v_y"]
    figure = new_figure(PAGE, 3.6)
    above, below = figure.subplots(2, 1, sharex=True)
    shade: Mapping[str, Any] = {
        "color": BLUE,
        "alpha": 0.2,
        "linewidth": 0.0,
        "label": "told, two sigma",
    }
    told_look: Mapping[str, Any] = {**ONLINE, "label": "told"}
    alone: Mapping[str, Any] = {
        "color": GREY,
        "linewidth": 0.8,
        "label": "inertial identifier alone",
    }
    above.fill_between(drive.s, told - band, told + band, **shade)
    above.plot(drive.s, inertial, **alone)
    above.plot(drive.s, drive.v_y, **TRUTH)
    above.plot(drive.s, told, **told_look)
    above.set_ylabel("$v_y$\n[m/s]")
    below.fill_between(drive.s, -MILLI * band, MILLI * band, **shade)
    below.plot(drive.s, MILLI * (inertial - drive.v_y), **alone)
    below.plot(drive.s, MILLI * (told - drive.v_y), **told_look)
    reach = 1.2 * MILLI * float(np.max(np.maximum(band, np.abs(told - drive.v_y))))
    below.set(ylabel="error of it\n[mm/s]", xlabel=ARC, ylim=(-reach, reach))
    below.set_xlim(0.0, float(drive.s[-1]))
    figure.align_ylabels([above, below])
    legend_above(figure)
    return figure
