"""Axle force over slip on the drive: what the tires did, what the tracker believed, the truth."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mpc.loop import Drive
from tireid.figures.drive_look import tire_look
from tireid.figures.panels import AXLES, legend_above
from tireid.figures.style import PAGE, SKY, new_figure, styled
from tireid.figures.tire_curve import TireCurve, axle_slip
from tireid.figures.units import drawable, force_range, force_unit_of

REACH = 1.25  # curves go on this far beyond the slip of the drive


@styled
def drive_tires_figure(drive: Drive, curves: Sequence[TireCurve]) -> Figure:
    """Draw the forces of a drive as a cloud, and the curves that trackers believed.

    Parameters
    ----------
    drive : the drive.
    curves : steady forces of the tires to compare.
    """
    unit = force_unit_of(drive.axle_force)
    alpha, force = np.rad2deg(axle_slip(drive)), drive.axle_force / unit.newtons
    reach = REACH * float(np.abs(alpha).max())
    shown = [np.abs(np.rad2deg(curve.alpha)) <= reach for curve in curves]
    within = [c.force[part] / unit.newtons for c, part in zip(curves, shown, strict=True)]
    steep = [f for c, f in zip(curves, within, strict=True) if not c.label.startswith("linear")]
    low, high = force_range(force, *steep)
    figure = new_figure(PAGE, 3.3)
    panels = figure.subplots(1, 2, sharey=True)
    for axle, (axes, name) in enumerate(zip(panels, AXLES, strict=True)):
        axes.plot(
            alpha[:, axle],
            force[:, axle],
            linestyle="",
            marker=".",
            markersize=3.0,
            markeredgewidth=0.0,
            color=SKY,
            alpha=0.6,
            label="this drive, true forces",
        )
        for curve, part, values in zip(curves, shown, within, strict=True):
            axes.plot(
                np.rad2deg(curve.alpha[part]),
                drawable(values[:, axle], (low, high)),
                label=curve.label,
                **tire_look(curve.label),
            )
        axes.set(
            title=name,
            xlabel=rf"slip angle $\alpha_{'fr'[axle]}$ [deg]",
            xlim=(-reach, reach),
            ylim=(low, high),
        )
        axes.xaxis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10]))
    panels[0].set_ylabel(f"lateral force [{unit.name}]")
    legend_above(figure, columns=1 + len(curves) if len(curves) < 5 else 3)
    return figure
