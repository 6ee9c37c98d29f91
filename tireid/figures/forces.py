"""Axle forces over time: of the model beside those that are known, and as in the paper's Figs. 2-5.

And those that the motion shows, over slip angle, as a log is given and as the doctor repairs it;
and the friction of the road.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from codegen.arrays import Array, thinning
from identifier.doctor.readings import Motion, Reading, forces_and_slips
from identifier.prediction import Prediction
from identifier.reproducibility import Replay, freeze_key, online_error
from identifier.run import History
from identifier.verdict import RoadFriction, WindowForces
from models.recordings import Recording
from models.rules import require_kind
from models.vehicle import Vehicle
from tireid.figures.style import (
    AXLES,
    BLACK,
    BLUE,
    FROZEN,
    GREY,
    MODEL,
    MOTION,
    ONLINE,
    ORANGE,
    SKY,
    TRUTH,
    ForceUnit,
    Look,
    axle_panels,
    clock_zero,
    drawable,
    force_range,
    force_unit_of,
    label_forces,
    label_time,
    legend_beside,
    mark_freeze,
    new_figure,
    note,
    styled,
)
from tireid.figures.thinned import drawn_samples, drawn_times

_Curve = tuple[Array, Look]  # forces of both axles (n, 2) [N], and their look
_RESIDUAL: Look = {"linewidth": 0.8, "linestyle": "-"}


def _force_panels(
    recording: Recording,
    rows: Sequence[tuple[str, Sequence[_Curve]]],
    known: Array | None,
    judged: Sequence[_Curve],
    heights: tuple[float, float] = (2.0, 1.0),
    window: tuple[float, float] | None = None,
    t: Array | None = None,
) -> tuple[Figure, NDArray[Any], ForceUnit]:
    """Draw forces in rows, below them what some miss of those that are known.

    rows : title of each behind the axle's name, and its curves.
    known : (n, 2) [N]; None misses nothing.   heights : of a row of forces, of the residual [in].
    t : of the forces [s]; None is each sample.
    """
    t = recording.t if t is None else t
    ends = (recording.t[0], recording.t[-1]) if window is None else window
    curves = [force for _, row in rows for force, _ in row]
    reference = curves[0] if known is None else known
    errors = [force - reference for force in curves]
    part = drawn_samples(t, ends, reference, *curves, *errors)
    t, unit = drawn_times(recording, t[part]), force_unit_of(reference[part])

    def scaled(force: Array) -> Array:
        return force[part] / unit.newtons

    limits = force_range(scaled(reference), *map(scaled, curves))
    residuals = [] if known is None else [(scaled(f) - scaled(known), look) for f, look in judged]
    ratios = [heights[0]] * len(rows) + [heights[1]] * bool(residuals)
    figure, panels = axle_panels(ratios, room=0.9)
    for axle, name in enumerate(AXLES):
        for axes, (title, row) in zip(panels[:, axle], rows, strict=False):
            axes.set(xlim=ends, ylim=limits, title=f"{name}{title}")
            for force, look in row:
                axes.plot(t, drawable(scaled(force)[:, axle], limits), **look)
        if residuals:
            panels[-1, axle].axhline(0.0, color=GREY, linewidth=0.6)
            for residual, look in residuals:
                drawn = np.clip(residual[:, axle], -1e6, 1e6)
                shape = {} if "marker" in look else _RESIDUAL
                panels[-1, axle].plot(t, drawn, **{**look, **shape})
        label_time(panels[-1, axle], recording.t)
    if residuals:
        within = (np.clip(residual, *limits) for residual, _ in residuals)
        panels[-1, 0].set_ylim(force_range(np.zeros(1), *within))
    label_forces(panels, unit, residual=bool(residuals))
    return figure, panels, unit


@styled
def force_figure(
    history: History,
    replays: Mapping[float, Replay] | None = None,
    *,
    window: tuple[float, float] | None = None,
    since: float | None = None,
) -> Figure:
    """Draw forces of front and rear axle over time: identified online, and replayed frozen.

    Above each panel stands the error, whatever the window shows: against the true force, or
    against the online force where there is no truth. That of a replay is the one it was made with;
    below it stands the paper's measure, the past against online, where both sides are known. The
    lowest row shows what the online run and the last freeze miss of that force.

    replays : by time of the freeze [s], replays of the same recording; one row of panels each.
    window : first and last time to show [s]; None shows all.
    since : time from which the error of the online run counts [s], as in the replays; None counts
    all.
    """
    replays = dict(sorted((replays or {}).items()))
    recording, truth = history.recording, history.recording.axle_force
    online = (history.axle_force, ONLINE)
    drawn_in_all = [online] if truth is None else [(truth, TRUTH), online]
    frozen = {at: (replay.axle_force, FROZEN) for at, replay in replays.items()}
    rows: list[tuple[str, Sequence[_Curve]]] = [(", online", drawn_in_all)]
    zero = clock_zero(recording.t)  # of the axis below
    rows += [
        (f", frozen at {freeze_key(round(at - zero, 6))} s", [*drawn_in_all, curve])
        for at, curve in frozen.items()
    ]
    known = history.axle_force if truth is None else truth
    judged = [*([online] if truth is not None else []), *list(frozen.values())[-1:]]
    figure, panels, unit = _force_panels(recording, rows, known, judged, (1.45, 1.05), window)
    error = online_error(history, since=since)
    for axle, name in enumerate(AXLES):
        if history.diverged_at is not None:
            note(panels[0, axle], f"diverged at {history.diverged_at:.4g} s")
        elif error is not None:
            note(panels[0, axle], f"RMSE {unit.format(error, axle)}")
        for axes, (at, replay) in zip(panels[1:, axle], replays.items(), strict=False):
            note(axes, _errors(replay, unit, axle))
            mark_freeze(panels[0, axle], at)
            mark_freeze(axes, at, prediction=True)
        if len(panels) > len(rows):
            against = "online" if truth is None else "truth"
            panels[-1, axle].set_title(f"{name}, residual to {against}")
    return figure


def _errors(replay: Replay | Prediction, unit: ForceUnit, axle: int) -> str:
    """Return the error of a replay, and below it the paper's measure where it is known."""
    online = getattr(replay, "against_online", None)
    error, to = replay.against_truth, ""
    if error is None:
        error, to = online, " to online"
    said = "" if error is None else f"RMSE{to} {unit.format(error, axle)}"
    sides = getattr(replay, "reproduction", None)
    if said and sides is not None and sides.past_against_online is not None:
        said += f"\npast to online {unit.format(sides.past_against_online, axle)}"
    return said


@styled
def prediction_figure(replay: Replay | Prediction, windows: WindowForces | None = None) -> Figure:
    """Draw the force of a model over a recording beside the known one, the difference below.

    windows : known where there is no truth: the force that the motion shows. With neither there is
        no difference.
    """
    recording, t = replay.recording, replay.recording.t
    known, look, model = recording.axle_force, TRUTH, (replay.axle_force, FROZEN)
    if known is None and windows is not None:
        t, known, look, model = windows.t, windows.measured, MOTION, (windows.modelled, MODEL)
    row = [model] if known is None else [(known, look), model]
    figure, panels, unit = _force_panels(recording, [("", row)], known, [model], t=t)
    if recording.axle_force is not None:
        for axle, axes in enumerate(panels[0]):
            note(axes, _errors(replay, unit, axle))
    return figure


@styled
def friction_figure(friction: RoadFriction) -> Figure:
    """Draw the friction of a drive's road over that of the identification drive, and its doubt."""
    some = slice(None, None, thinning(len(friction.t)))
    t, ratio, sd = friction.t[some], friction.ratio[some], friction.sd[some]
    figure = new_figure(2.8)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
    ends = ratio * np.exp(-sd), ratio * np.exp(sd)
    upper.fill_between(
        t, *ends, label="one standard deviation", color=SKY, alpha=0.5, linewidth=0.0
    )
    upper.plot(t, ratio, color=BLUE, label="friction")
    upper.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--", label="as identified")
    upper.set(ylabel="friction over that of\nthe identification drive", ylim=(0.0, None))
    lower.plot(t, friction.another[some], color=ORANGE, label="another road")
    lower.plot(
        t,
        friction.unexplained[some],
        label="no friction explains it",
        color=BLACK,
        linestyle=":",
    )
    lower.set(ylabel="probability", ylim=(-0.05, 1.05))
    label_time(lower, friction.t)
    return figure


@styled
def inputs_figure(recording: Recording) -> Figure:
    """Draw the signals of a recording; rear steering and a_y only where there are any."""
    require_kind(Recording, "as of read_recording, or run.recording", recording=recording)
    ends = recording.t[0], recording.t[-1]
    estimated = "estimated " if recording.estimated else ""
    logged = {
        "speed\n[m/s]": recording.v_x,
        "steering\n[deg]": np.degrees(recording.delta_f),
        f"lateral speed\n{estimated}[m/s]": recording.v_y,
        "yaw rate\n[deg/s]": np.degrees(recording.r),
        "lateral acc.\n[m/s²]": recording.a_y,
    }
    signals = {label: one for label, one in logged.items() if one is not None}
    part = drawn_samples(recording.t, ends, recording.delta_r, *signals.values())
    t = drawn_times(recording, recording.t[part])
    steers = bool(np.any(recording.delta_r))
    figure = new_figure(0.5 + 1.05 * len(signals), plain=not steers)
    panels = figure.subplots(len(signals), 1, sharex=True)
    panels[0].set_xlim(ends)
    for axes, (label, signal) in zip(panels, signals.items(), strict=True):
        values = signal[part]
        axes.plot(t, values, color=BLUE, linewidth=0.9)
        axes.set_ylabel(label)
        span = float(np.ptp(values))
        middle = float(values.min()) + span / 2
        room = 0.05 * abs(middle)
        if span < room:  # a speed that is held shows as held
            axes.set_ylim(middle - room, middle + room)
    if steers:
        panels[1].lines[0].set_label(r"front $\delta_f$")
        rear = np.degrees(recording.delta_r[part])
        panels[1].plot(t, rear, color=ORANGE, linewidth=0.9, label=r"rear $\delta_r$")
        legend_beside(panels[1])
        figure.align_ylabels()
    label_time(panels[-1], recording.t)
    return figure


@styled
def draw_diagnosis(
    recording: Recording, vehicle: Vehicle, repaired: Recording, car: Vehicle
) -> Figure:
    """Draw force over slip angle of both axles before and after a repair."""
    figure, panels = axle_panels([2.9], sharex=False)
    drawn = [("as logged", GREY, recording, vehicle)]
    if repaired is not recording:
        drawn.append(("repaired", BLUE, repaired, car))
    for name, color, one, given in drawn:
        motion = Motion.of(one)
        if motion is None:
            continue
        axles = forces_and_slips(motion, given, Reading())
        for panel, slip, force in zip(panels[0], axles.slip, axles.force, strict=True):
            panel.plot(np.degrees(slip), force, ".", color=color, markersize=2.5, label=name)
    for panel in panels[0]:
        panel.set_xlabel("slip angle [deg]")
        panel.axhline(0.0, color=GREY, linewidth=0.5)
    panels[0, 0].set_ylabel("force from the motion [load]")
    return figure
