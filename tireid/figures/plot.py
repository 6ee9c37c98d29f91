"""`ti.plot`: a figure of what a user has."""

import numpy as np
from matplotlib.figure import Figure

from identifier.tire_model import TireModel
from models.recordings import Recording
from mpc.path.speed import SpeedProfile
from tireid.figures.forces import inputs_figure
from tireid.figures.lap import lap_figure
from tireid.figures.style import BLUE, SKY, axle_panels, force_unit_of, label_forces, styled
from tireid.figures.tires import slip_figure
from tireid.run import Run


def plot(what: Recording | Run | TireModel | SpeedProfile) -> Figure:
    """Draw signals over time, identified tires, or planned speeds on the map and over arc length.

    Parameters
    ----------
    what : of `read_recording`; of `identify`, whose tires are drawn with the samples; the tires
        alone; or of `speed_profile`.
    """
    if isinstance(what, Run):
        return slip_figure(what.tire, what.recording, what.verdict.forces)
    if isinstance(what, TireModel):
        return _tire_figure(what)
    if not isinstance(what, SpeedProfile):
        return inputs_figure(what)
    if what.planned is None:
        raise ValueError("these speeds are given: plan them by speed_profile to plot their limits")
    return lap_figure(what)


@styled
def _tire_figure(tire: TireModel) -> Figure:
    """Draw force over slip angle, front and rear, in the band where there is one."""
    (slip, known), force = tire.drawn_slip(), tire.force(tire.drawn_slip()[0])
    alpha, unit = np.degrees(slip), force_unit_of(force)
    figure, panels = axle_panels([3.2])
    for axle, axes in enumerate(panels[0]):
        if tire.band is not None:
            low, high = (end[:, axle] / unit.newtons for end in tire.band.at(slip))
            axes.fill_between(alpha, low, high, color=SKY, alpha=0.6, lw=0.0, label="band of 90 %")
        y = force[:, axle] / unit.newtons
        axes.plot(alpha, y, color=BLUE, linestyle=":", label="slip not known")
        axes.plot(alpha, np.where(known[:, axle], y, np.nan), color=BLUE, label="identified curve")
        axes.set_xlabel("slip angle [deg]")
    label_forces(panels, unit, residual=False)
    return figure
