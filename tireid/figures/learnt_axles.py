"""What the axle identifier has learnt over time, in the numbers an engineer reads."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from identifier.axle import AxleDesign
from identifier.axle.slip import SHORTEST
from identifier.history import History
from tireid.figures.panels import AXLES, TIME, legend_above, mark_freeze
from tireid.figures.style import GREEN, PAGE, PURPLE, new_figure, styled


@styled
def learnt_axles_figure(history: History, freeze_times: Sequence[float] = ()) -> Figure:
    """Draw cornering stiffness, relaxation length and capacity of both axles over time.

    Capacity is the force at which the learnt curve saturates, over the static load of the axle.

    Parameters
    ----------
    history : a run of the axle identifier.
    freeze_times : times at which weights were taken [s].

    Raises
    ------
    TypeError
        Where another method ran.
    """
    design, vehicle = history.design, history.vehicle
    if not isinstance(design, AxleDesign):
        raise TypeError(f"a run of the axle identifier is needed, not of {design}")
    t, W = history.recording.t, history.carried["W"][:-1]
    slope = (W / np.array(design.ladder)).sum(axis=2)
    loads = np.array(vehicle.axle_loads)
    stiff = float((slope * loads).max()) >= 1000.0
    compliance = history.carried["own"][:-1, :, 0]
    curves = {
        f"cornering stiffness\n[{'kN' if stiff else 'N'}/rad]": slope
        * loads
        / (1000.0 if stiff else 1.0),
        "relaxation length\n[m]": compliance * np.maximum(slope, 0.0)
        + SHORTEST * vehicle.wheelbase,
        "force at saturation\n[static load]": W.sum(axis=2),
    }
    figure = new_figure(PAGE, 4.4)
    panels = figure.subplots(len(curves), 1, sharex=True)
    for axes, (label, values) in zip(panels, curves.items(), strict=True):
        for axle, color in enumerate((GREEN, PURPLE)):
            axes.plot(t, values[:, axle], color=color, linewidth=1.0, label=AXLES[axle].lower())
        axes.set(ylabel=label, xlim=(t[0], t[-1]))
        axes.set_ylim(0.0, 1.1 * float(values.max()) or 1.0)
        for at in freeze_times:
            mark_freeze(axes, at, prediction=False)
    panels[-1].set_xlabel(TIME)
    legend_above(figure)
    return figure
