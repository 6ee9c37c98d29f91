"""Axle forces over time as in the paper's Figs. 2-5: online above, frozen replays below.

A method that learns from a whole log has replays alone.

And those that the motion shows, over slip angle, as a log is told and as the doctor repairs it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codegen.arrays import Array
from identifier.doctor.consistency import Motion, Reading, forces_and_slips
from identifier.prediction import Prediction
from identifier.reproducibility import Replay, freeze_key, online_error
from identifier.run import History
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid.figures import style
from tireid.figures.thinned import Signal, drawn_times, shown


@style.styled
def force_figure(
    history: History,
    replays: Mapping[float, Replay] | None = None,
    *,
    window: style.Window = None,
    since: float | None = None,
) -> Figure:
    """Draw forces of front and rear axle over time: identified online, and replayed frozen.

    Above each panel stands the error, whatever the window shows: against the true force, or
    against the online force where there is no truth. That of a replay is the one it was made with;
    below it stands the paper's measure, the past against online, where both sides are known. The
    lowest row shows what the online run and the last freeze miss of that force. Of a method that
    learns from a whole log there is no online run: it has neither panel nor residual.

    replays : by time of the freeze [s], replays of the same recording; one row of panels each.
    window : first and last time to show [s]; None shows all.
    since : time from which the error of the online run counts [s], as in the replays; None counts
    all.
    """
    replays = dict(sorted((replays or {}).items()))
    recording, truth = history.recording, history.recording.axle_force
    for t_freeze, replay in replays.items():
        if replay.axle_force.shape != history.axle_force.shape:
            raise ValueError(
                f"the replay frozen at {freeze_key(t_freeze)} s is of {replay.recording.name}, "
                f"the online run of {recording.name}"
            )
    ends = style.time_window(recording.t, window)
    first = int(history.online)  # rows of the online run
    curves = [history.axle_force] * first + [*(replay.axle_force for replay in replays.values())]
    part = shown(recording.t, ends, *_with_residuals(curves or [history.axle_force], truth))
    t, online = drawn_times(recording, recording.t[part]), history.axle_force[part]
    reference = online if truth is None else truth[part]
    unit = style.force_unit_of(reference)
    frozen = {at: replay.axle_force[part] / unit.newtons for at, replay in replays.items()}
    limits = style.force_range(reference / unit.newtons, online / unit.newtons, *frozen.values())

    missed = [(online / unit.newtons, style.ONLINE)] if truth is not None and first else []
    if truth is not None or first:
        missed += [(force, style.FROZEN) for force in list(frozen.values())[-1:]]
    missed = [(force - reference / unit.newtons, look) for force, look in missed]
    rows = first + len(replays)
    ratios = [1.45] * rows + [1.05] * bool(missed)
    figure = style.new_figure(style.PAGE, 0.85 + sum(ratios))
    panels = figure.subplots(
        len(ratios), 2, sharex=True, sharey="row", squeeze=False, height_ratios=ratios
    )
    error = online_error(history, since=since)
    for axle, name in enumerate(style.AXLES):
        for axes in panels[:rows, axle]:
            axes.set(xlim=ends, ylim=limits)
            if truth is not None:
                axes.plot(t, truth[part, axle] / unit.newtons, **style.TRUTH)
            if first:
                axes.plot(t, style.drawable(online[:, axle] / unit.newtons, limits), **style.ONLINE)
        if first:
            panels[0, axle].set_title(f"{name}, online")
        if history.diverged_at is not None:
            style.note(panels[0, axle], f"diverged at {history.diverged_at:.4g} s")
        elif error is not None:
            style.note(panels[0, axle], f"RMSE {unit.format(error, axle)}")
        for axes, (at, replay) in zip(panels[first:rows, axle], replays.items(), strict=True):
            axes.plot(t, style.drawable(frozen[at][:, axle], limits), **style.FROZEN)
            axes.set_title(f"{name}, {style.frozen_title(recording.t, at)}")
            style.note(axes, _errors(replay, unit, axle))
            if first:
                style.mark_freeze(panels[0, axle], at, prediction=False)
            style.mark_freeze(axes, at, prediction=True)
        if missed:
            _draw_missed(panels[-1, axle], t, [(force[:, axle], look) for force, look in missed])
            against = "online" if truth is None else "truth"
            panels[-1, axle].set_title(f"{name}, residual to {against}")
        style.label_time(panels[-1, axle], recording.t)
    for axes in panels[:rows, 0]:
        axes.set_ylabel(f"lateral force [{unit.name}]")
    if missed:
        panels[-1, 0].set_ylim(_missed_range([force for force, _ in missed], limits))
        panels[-1, 0].set_ylabel(f"residual [{unit.name}]")
    style.legend_above(figure)
    return figure


def _with_residuals(curves: Sequence[Array], known: Array | None) -> list[Signal]:
    """Return forces that are drawn, and what they miss of a known one or of the first."""
    against = curves[0] if known is None else known

    def missed(force: Array) -> Signal:
        return lambda at: force[at] - against[at]

    return [*(force.__getitem__ for force in (against, *curves)), *map(missed, curves)]


RESIDUAL: Mapping[str, Any] = {  # noise for the most part, which would make a drawing large
    "linewidth": 0.8,
    "linestyle": "-",
    "rasterized": True,
}


def _draw_missed(axes: Axes, t: Array, curves: Sequence[tuple[Array, Mapping[str, Any]]]) -> None:
    axes.axhline(0.0, color=style.GREY, linewidth=0.6)
    for missed, look in curves:
        axes.plot(t, np.clip(missed, -1e6, 1e6), **{**look, **RESIDUAL})


def _missed_range(missed: Sequence[Array], limits: tuple[float, float]) -> tuple[float, float]:
    """Return the ends of an axis of residuals, which reach no farther than the forces do."""
    return style.force_range(np.zeros(1), *(np.clip(one, *limits) for one in missed))


def _errors(replay: Replay, unit: style.ForceUnit, axle: int) -> str:
    against = replay.against_truth
    if against is not None:
        said = f"RMSE {unit.format(against, axle)}"
    elif replay.against_online is None:
        return ""
    else:
        said = f"RMSE to online {unit.format(replay.against_online, axle)}"
    sides = replay.reproduction
    if sides is None or sides.past_against_online is None:
        return said
    return f"{said}\npast to online {unit.format(sides.past_against_online, axle)}"


@style.styled
def prediction_figure(
    replay: Replay | Prediction, online: History | None = None, *, window: style.Window = None
) -> Figure:
    """Draw a frozen model on a recording it did not learn from, with what it misses below.

    The residual is the frozen force minus the true force, or minus the online force where there is
    no truth; with neither there is no residual.

    window : first and last time to show [s]; None shows all.
    """
    recording, truth = replay.recording, replay.recording.axle_force
    if online is not None and online.axle_force.shape != replay.axle_force.shape:
        raise ValueError(
            f"the replay is of {recording.name}, the online run of {online.recording.name}"
        )
    ends = style.time_window(recording.t, window)
    curve, known = style.TRUTH, truth
    if truth is None and online is not None:
        curve, known = style.ONLINE, online.axle_force
    part = shown(recording.t, ends, *_with_residuals([replay.axle_force], known))
    t = drawn_times(recording, recording.t[part])
    reference = replay.axle_force[part] if known is None else known[part]
    unit = style.force_unit_of(reference)
    frozen = replay.axle_force[part] / unit.newtons
    reference = reference / unit.newtons
    limits = style.force_range(reference, frozen)
    residual = frozen - reference
    missed_limits = _missed_range([residual], limits)

    ratios = [2.0] if known is None else [2.0, 1.0]
    figure = style.new_figure(style.PAGE, 1.0 + sum(ratios))
    panels = figure.subplots(
        len(ratios), 2, sharex=True, sharey="row", squeeze=False, height_ratios=ratios
    )
    error = replay.against_truth
    for axle, name in enumerate(style.AXLES):
        upper = panels[0, axle]
        upper.set(xlim=ends, ylim=limits, title=name)
        if known is not None:
            upper.plot(t, style.drawable(reference[:, axle], limits), **curve)
            missed = style.drawable(residual[:, axle], missed_limits)
            panels[1, axle].axhline(0.0, color=curve["color"], linewidth=0.6)
            panels[1, axle].plot(t, missed, color=style.FROZEN["color"], **RESIDUAL)
            panels[1, axle].set_ylim(missed_limits)
        upper.plot(t, style.drawable(frozen[:, axle], limits), **style.FROZEN)
        if error is not None:
            style.note(upper, f"RMSE {unit.format(error, axle)}")
        elif isinstance(replay, Replay) and known is not None and replay.against_online is not None:
            style.note(upper, f"RMSE to online {unit.format(replay.against_online, axle)}")
        style.label_time(panels[-1, axle], recording.t)
    panels[0, 0].set_ylabel(f"lateral force [{unit.name}]")
    if known is not None:
        panels[1, 0].set_ylabel(f"residual [{unit.name}]")
    style.legend_above(figure)
    return figure


_COLORS = (style.ORANGE, style.BLUE, style.GREEN, style.PURPLE)


@style.styled
def side_by_side_figure(replays: Mapping[str, Replay]) -> Figure:
    """Draw the forces of several frozen models over one drive, and what each misses."""
    recordings = [replay.recording for replay in replays.values()]
    recording, truth = recordings[0], recordings[0].axle_force
    if truth is None or any(other.name != recording.name for other in recordings):
        raise ValueError("replays of one recording with true forces are needed")
    unit = style.force_unit_of(truth)
    t = drawn_times(recording, recording.t)
    drawn = [replay.axle_force / unit.newtons for replay in replays.values()]
    limits = style.force_range(truth / unit.newtons, *drawn)
    missed = {name: (r.axle_force - truth) / unit.newtons for name, r in replays.items()}
    margin = 1.1 * max(float(np.abs(m).max()) for m in missed.values())

    figure = style.new_figure(style.PAGE, 3.6)
    panels = figure.subplots(2, 2, sharex=True, sharey="row", height_ratios=(2, 1))
    for axle, name in enumerate(style.AXLES):
        upper, lower = panels[:, axle]
        upper.plot(t, truth[:, axle] / unit.newtons, **style.TRUTH)
        for (label, replay), color in zip(replays.items(), _COLORS, strict=False):
            force = style.drawable(replay.axle_force[:, axle] / unit.newtons, limits)
            upper.plot(t, force, color=color, linewidth=1.1, label=label)
            lower.plot(t, missed[label][:, axle], color=color, **RESIDUAL)
        upper.set(title=name, ylim=limits, xlim=(t[0], t[-1]))
        lower.set(ylim=(-margin, margin))
        style.label_time(lower, t)
    panels[0, 0].set_ylabel(f"lateral force [{unit.name}]")
    panels[1, 0].set_ylabel(f"residual [{unit.name}]")
    style.legend_above(figure)
    return figure


@style.styled
def inputs_figure(recording: Recording, *, window: style.Window = None) -> Figure:
    """Draw the signals of a recording; rear steering and a_y only where there are any.

    window : first and last time to show [s]; None shows all.
    """
    ends = style.time_window(recording.t, window)
    logged = [recording.v_x, recording.delta_f, recording.delta_r, recording.r]
    logged += [one for one in (recording.v_y, recording.a_y) if one is not None]
    part = shown(recording.t, ends, *(signal.__getitem__ for signal in logged))
    t = drawn_times(recording, recording.t[part])
    signals = {
        "$v_x$ [m/s]": recording.v_x[part],
        "steering [deg]": np.rad2deg(recording.delta_f[part]),
    }
    if recording.v_y is not None:
        told = ", estimated" if recording.estimated else ""
        signals[f"$v_y$ [m/s]{told}"] = recording.v_y[part]
    signals["$r$ [deg/s]"] = np.rad2deg(recording.r[part])
    if recording.a_y is not None:
        signals["$a_y$ [m/s²]"] = recording.a_y[part]

    figure = style.new_figure(style.PAGE, 0.5 + 1.05 * len(signals))
    panels = figure.subplots(len(signals), 1, sharex=True)
    panels[0].set_xlim(ends)
    for axes, (label, values) in zip(panels, signals.items(), strict=True):
        axes.plot(t, values, color=style.BLUE, linewidth=0.9, label=label)
        axes.set_ylabel(label)
        span = float(np.ptp(values))
        middle = float(values.min()) + span / 2
        if span < 0.05 * abs(middle):  # a speed that is held shows as held
            axes.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))
    if np.any(recording.delta_r):
        steering = panels[1]
        steering.lines[0].set_label(r"front $\delta_f$")
        steering.plot(
            t,
            np.rad2deg(recording.delta_r[part]),
            color=style.ORANGE,
            linewidth=0.9,
            label=r"rear $\delta_r$",
        )
        style.legend_beside(steering)
    style.label_time(panels[-1], recording.t)
    figure.align_ylabels()
    return figure


@style.styled
def draw_diagnosis(
    recording: Recording, vehicle: Vehicle, repaired: Recording, car: Vehicle
) -> Figure:
    """Draw force over slip angle of both axles before and after a repair."""
    figure = style.new_figure(style.PAGE, 2.9)
    panels = figure.subplots(1, 2)
    shown = [("as logged", style.GREY, recording, vehicle)]
    if repaired is not recording:
        shown.append(("repaired", style.BLUE, repaired, car))
    for name, color, one, told in shown:
        motion = Motion.of(one)
        if motion is None:
            continue
        axles = forces_and_slips(motion, told, Reading())
        for panel, slip, force in zip(panels, axles.slip, axles.force, strict=True):
            panel.plot(np.degrees(slip), force, ".", color=color, markersize=2.5, label=name)
    for panel, title in zip(panels, style.AXLES, strict=True):
        panel.set_title(title)
        panel.set_xlabel("slip angle [deg]")
        panel.set_ylabel("force from the motion [load]")
        panel.axhline(0.0, color=style.GREY, linewidth=0.5)
    style.legend_above(figure)
    return figure
