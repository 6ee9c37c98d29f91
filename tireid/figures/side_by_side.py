"""Frozen models side by side on a drive that none of them has learnt."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from identifier.reproducibility import Replay
from tireid.figures.panels import AXLES, TIME, legend_above
from tireid.figures.style import BLUE, GREEN, ORANGE, PAGE, PURPLE, TRUTH, new_figure, styled
from tireid.figures.units import drawable, force_range, force_unit_of

COLORS = (ORANGE, BLUE, GREEN, PURPLE)


@styled
def side_by_side_figure(replays: Mapping[str, Replay]) -> Figure:
    """Draw the forces of several frozen models over one drive, and what each misses.

    Parameters
    ----------
    replays : by the name in the legend, replays of one recording that has true forces.

    Raises
    ------
    ValueError
        Where the recordings differ, or there is no truth.
    """
    recordings = [replay.recording for replay in replays.values()]
    recording, truth = recordings[0], recordings[0].axle_force
    if truth is None or any(other.name != recording.name for other in recordings):
        raise ValueError("replays of one recording with true forces are needed")
    unit = force_unit_of(truth)
    t = recording.t
    drawn = [replay.axle_force / unit.newtons for replay in replays.values()]
    limits = force_range(truth / unit.newtons, *drawn)
    missed = {name: (r.axle_force - truth) / unit.newtons for name, r in replays.items()}
    margin = 1.1 * max(float(np.abs(m).max()) for m in missed.values())

    figure = new_figure(PAGE, 3.6)
    panels = figure.subplots(2, 2, sharex=True, sharey="row", height_ratios=(2, 1))
    for axle, name in enumerate(AXLES):
        upper, lower = panels[:, axle]
        upper.plot(t, truth[:, axle] / unit.newtons, **TRUTH)
        for (label, replay), color in zip(replays.items(), COLORS, strict=False):
            force = drawable(replay.axle_force[:, axle] / unit.newtons, limits)
            upper.plot(t, force, color=color, linewidth=1.1, label=label)
            lower.plot(t, missed[label][:, axle], color=color, linewidth=0.9)
        upper.set(title=name, ylim=limits, xlim=(t[0], t[-1]))
        lower.set(xlabel=TIME, ylim=(-margin, margin))
    panels[0, 0].set_ylabel(f"lateral force [{unit.name}]")
    panels[1, 0].set_ylabel(f"missed [{unit.name}]")
    legend_above(figure)
    return figure
