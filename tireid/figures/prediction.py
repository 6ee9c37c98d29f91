"""A frozen model on a recording that it did not learn from, and what it misses there."""

import numpy as np
from matplotlib.figure import Figure

from identifier.history import History
from identifier.reproducibility import Replay
from tireid.figures.panels import AXLES, TIME, Window, legend_above, note, shown, time_window
from tireid.figures.style import FROZEN, ONLINE, PAGE, TRUTH, new_figure, styled
from tireid.figures.units import drawable, force_range, force_unit_of


@styled
def prediction_figure(
    replay: Replay, online: History | None = None, *, window: Window = None
) -> Figure:
    """Draw a frozen model on a recording it did not learn from, with what it misses below.

    The residual is the frozen force minus the true force, or minus the online force where there is
    no truth; with neither there is no residual.

    Parameters
    ----------
    replay : the replay.
    online : an online run over the same recording, drawn where there is no truth.
    window : first and last time to show [s]; None shows all.

    Raises
    ------
    ValueError
        Where the online run is of another recording, or the window holds no sample.
    """
    recording, truth = replay.recording, replay.recording.axle_force
    if online is not None and online.axle_force.shape != replay.axle_force.shape:
        raise ValueError(
            f"the replay is of {recording.name}, the online run of {online.recording.name}"
        )
    ends = time_window(recording.t, window)
    part = shown(recording.t, ends)
    t = recording.t[part]
    curve, known = TRUTH, truth
    if truth is None and online is not None:
        curve, known = ONLINE, online.axle_force
    reference = replay.axle_force[part] if known is None else known[part]
    unit = force_unit_of(reference)
    frozen = replay.axle_force[part] / unit.newtons
    reference = reference / unit.newtons
    limits = force_range(reference, frozen)
    residual = frozen - reference
    missed_limits = force_range(reference[:0], np.clip(residual, *limits))

    ratios = [2.0] if known is None else [2.0, 1.0]
    figure = new_figure(PAGE, 1.0 + sum(ratios))
    panels = figure.subplots(
        len(ratios), 2, sharex=True, sharey="row", squeeze=False, height_ratios=ratios
    )
    error = replay.against_truth
    for axle, name in enumerate(AXLES):
        upper = panels[0, axle]
        upper.set(xlim=ends, ylim=limits, title=name)
        if known is not None:
            upper.plot(t, drawable(reference[:, axle], limits), **curve)
            missed = drawable(residual[:, axle], missed_limits)
            panels[1, axle].axhline(0.0, color=curve["color"], linewidth=0.6)
            panels[1, axle].plot(t, missed, color=FROZEN["color"], linewidth=0.9)
            panels[1, axle].set_ylim(missed_limits)
        upper.plot(t, drawable(frozen[:, axle], limits), **FROZEN)
        if error is not None:
            note(upper, f"RMSE {unit.format(error, axle)}")
        elif known is not None:
            note(upper, f"RMSE to online {unit.format(replay.against_online, axle)}")
        panels[-1, axle].set_xlabel(TIME)
    panels[0, 0].set_ylabel(f"lateral force [{unit.name}]")
    if known is not None:
        panels[1, 0].set_ylabel(f"residual [{unit.name}]")
    legend_above(figure)
    return figure
