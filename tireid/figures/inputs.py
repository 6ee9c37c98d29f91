"""What the identifier was given: speed, steering and motion of a recording over time."""

import numpy as np
from matplotlib.figure import Figure

from models.recordings import Recording
from tireid.figures.panels import TIME, Window, legend_beside, shown, time_window
from tireid.figures.style import BLUE, ORANGE, PAGE, new_figure, styled


@styled
def inputs_figure(recording: Recording, *, window: Window = None) -> Figure:
    """Draw the signals of a recording; rear steering and a_y only where there are any.

    Parameters
    ----------
    recording : what to draw.
    window : first and last time to show [s]; None shows all.

    Raises
    ------
    ValueError
        Where the window holds no sample.
    """
    ends = time_window(recording.t, window)
    part = shown(recording.t, ends)
    signals = {
        "$v_x$ [m/s]": recording.v_x,
        "steering [deg]": np.rad2deg(recording.delta_f),
        "$v_y$ [m/s]": recording.v_y,
        "$r$ [deg/s]": np.rad2deg(recording.r),
    }
    if recording.a_y is not None:
        signals["$a_y$ [m/s²]"] = recording.a_y

    figure = new_figure(PAGE, 0.5 + 1.05 * len(signals))
    panels = figure.subplots(len(signals), 1, sharex=True)
    panels[0].set_xlim(ends)
    for axes, (label, values) in zip(panels, signals.items(), strict=True):
        axes.plot(recording.t[part], values[part], color=BLUE, linewidth=0.9, label=label)
        axes.set_ylabel(label)
        span = float(np.ptp(values[part]))
        middle = float(values[part].min()) + span / 2
        if span < 0.05 * abs(middle):  # a speed that is held shows as held
            axes.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))
    if np.any(recording.delta_r):
        steering = panels[1]
        steering.lines[0].set_label(r"front $\delta_f$")
        steering.plot(
            recording.t[part],
            np.rad2deg(recording.delta_r[part]),
            color=ORANGE,
            linewidth=0.9,
            label=r"rear $\delta_r$",
        )
        legend_beside(steering)
    panels[-1].set_xlabel(TIME)
    figure.align_ylabels()
    return figure
