"""Axle forces over time as in the paper's Figs. 2-5: online above, frozen replays below."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from identifier.history import History
from identifier.reproducibility import Replay, freeze_key, online_error
from tireid.figures.panels import (
    AXLES,
    TIME,
    Window,
    legend_above,
    mark_freeze,
    note,
    shown,
    time_window,
)
from tireid.figures.style import FROZEN, ONLINE, PAGE, TRUTH, new_figure, styled
from tireid.figures.units import ForceUnit, drawable, force_range, force_unit_of


@styled
def force_figure(
    history: History,
    replays: Mapping[float, Replay] | None = None,
    *,
    window: Window = None,
    since: float | None = None,
) -> Figure:
    """Draw forces of front and rear axle over time: identified online, and replayed frozen.

    Above each panel stands the error, whatever the window shows: against the true force, or
    against the online force where there is no truth. That of a replay is the one it was made with;
    below it stands the paper's measure, the past against online, where both sides are known.

    Parameters
    ----------
    history : the online run.
    replays : by time of the freeze [s], replays of the same recording; one row of panels each.
    window : first and last time to show [s]; None shows all.
    since : time from which the error of the online run counts [s], as in the replays; None counts
        all.

    Raises
    ------
    ValueError
        Where a replay is of another recording, or the window holds no sample.
    """
    replays = dict(sorted((replays or {}).items()))
    recording, truth = history.recording, history.recording.axle_force
    for t_freeze, replay in replays.items():
        if replay.axle_force.shape != history.axle_force.shape:
            raise ValueError(
                f"the replay frozen at {freeze_key(t_freeze)} s is of {replay.recording.name}, "
                f"the online run of {recording.name}"
            )
    ends = time_window(recording.t, window)
    part = shown(recording.t, ends)
    t, online = recording.t[part], history.axle_force[part]
    reference = online if truth is None else truth[part]
    unit = force_unit_of(reference)
    frozen = {at: replay.axle_force[part] / unit.newtons for at, replay in replays.items()}
    limits = force_range(reference / unit.newtons, online / unit.newtons, *frozen.values())

    rows = 1 + len(replays)
    figure = new_figure(PAGE, 0.85 + 1.45 * rows)
    panels = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    error = online_error(history, since=since)
    for axle, name in enumerate(AXLES):
        for axes in panels[:, axle]:
            axes.set(xlim=ends, ylim=limits)
            if truth is not None:
                axes.plot(t, truth[part, axle] / unit.newtons, **TRUTH)
            axes.plot(t, drawable(online[:, axle] / unit.newtons, limits), **ONLINE)
        panels[0, axle].set_title(f"{name}, online")
        if history.diverged_at is not None:
            note(panels[0, axle], f"diverged at {history.diverged_at:.4g} s")
        elif error is not None:
            note(panels[0, axle], f"RMSE {unit.format(error, axle)}")
        for axes, (at, replay) in zip(panels[1:, axle], replays.items(), strict=True):
            axes.plot(t, drawable(frozen[at][:, axle], limits), **FROZEN)
            axes.set_title(f"{name}, frozen at {freeze_key(at)} s")
            note(axes, _errors(replay, unit, axle))
            mark_freeze(panels[0, axle], at, prediction=False)
            mark_freeze(axes, at, prediction=True)
        panels[-1, axle].set_xlabel(TIME)
    for axes in panels[:, 0]:
        axes.set_ylabel(f"lateral force [{unit.name}]")
    legend_above(figure)
    return figure


def _errors(replay: Replay, unit: ForceUnit, axle: int) -> str:
    against = replay.against_truth
    if against is not None:
        said = f"RMSE {unit.format(against, axle)}"
    else:
        said = f"RMSE to online {unit.format(replay.against_online, axle)}"
    sides = replay.reproduction
    if sides is None or sides.past_against_online is None:
        return said
    return f"{said}\npast to online {unit.format(sides.past_against_online, axle)}"
