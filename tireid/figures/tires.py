"""Axle force against slip angle: the shape of the tire, as measured and as learnt."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from codegen.arrays import Array
from identifier.measured import printed_unit
from identifier.run import History
from identifier.tire_model import AXLES as SIDES
from identifier.tire_model import TireModel
from identifier.verdict import WindowForces
from models.bicycle import measured_slip
from models.recordings import Recording
from tireid.figures.drive import tire_look
from tireid.figures.style import (
    AXLES,
    BLUE,
    GREEN,
    LINEAR,
    MODEL,
    MOTION,
    PURPLE,
    SKY,
    TRUTH,
    Look,
    axle_panels,
    drawable,
    force_range,
    force_unit_of,
    label_forces,
    label_time,
    legend_above,
    mark_freeze,
    new_figure,
    styled,
)
from tireid.figures.thinned import cloud, drawn_of_run

if TYPE_CHECKING:
    from mpc.loop.record import Drive

_UNKNOWN = "slip not known"
_BAND = "band of 90 %"
_CLOUD: Look = {
    "linestyle": "",
    "marker": ".",
    "markersize": 2.2,
    "markeredgewidth": 0.0,
    "alpha": 0.8,
}


def forces_over_slip(
    model: TireModel, recording: Recording, windows: WindowForces | None
) -> WindowForces:
    """Return the forces of a drive over the slip that makes them, in the paper's sign.

    True ones above the model's minimum speed, else those that the motion shows, else the model's.
    The slip has neither errors of sensors nor lag of the tires, as far as the model knows them.
    """
    if recording.axle_force is None and windows is not None:
        return windows
    counted, force = recording.v_x >= model.min_speed, model.predict(recording)
    if not counted.any():
        raise ValueError(f"{recording.name}: v_x never reaches {model.min_speed:g} m/s")
    known = force if recording.axle_force is None else recording.axle_force
    every = recording.t, known, force, model.lagged_slip(recording)
    return WindowForces(*(one[counted] for one in every))


@styled
def slip_figure(
    model: TireModel, recording: Recording, windows: WindowForces | None = None
) -> Figure:
    """Draw force over slip angle, front and rear: of the drive, of the model, and a linear tire.

    The slip angle has the paper's sign, α = δ - atan2(v_y ± l r, v_x), the negative of ISO 8855, so
    that the curves rise. The linear tire is that of the vehicle file, where it has one.
    """
    drawn = forces_over_slip(model, recording, windows)
    truth, vehicle = recording.axle_force is not None, model.vehicle
    part = cloud(drawn.t, drawn.slip, drawn.measured, drawn.modelled - drawn.measured)
    _, reference, modelled, slip = (one[part] for one in drawn)
    alpha, unit = np.rad2deg(slip), force_unit_of(reference)
    modelled, reference = modelled / unit.newtons, reference / unit.newtons
    limits, known = force_range(reference, modelled), truth or windows is not None

    look: Look = {**(TRUTH if truth else MOTION), **_CLOUD, "markersize": 3.0, "alpha": 0.35}
    learnt: Look = {**MODEL, **_CLOUD}
    figure, panels = axle_panels([3.2, 1.3] if known else [3.2], sharex="col")
    for axle, (axes, lowest) in enumerate(zip(panels[0], panels[-1], strict=True)):
        x, y, force = alpha[:, axle], modelled[:, axle], reference[:, axle]
        if known:
            axes.plot(x, drawable(force, limits), **look)
            lowest.axhline(0.0, color=look["color"], linewidth=0.6)
            lowest.plot(x, np.clip(y - force, *limits), **learnt)
        axes.plot(x, drawable(y, limits), **learnt)
        margin = 0.04 * float(np.ptp(x)) or 1.0
        ends = np.array([x.min() - margin, x.max() + margin])
        if (name := f"cornering_stiffness_{SIDES[axle]}") not in vehicle.estimated:
            stiffness = getattr(vehicle, name) / unit.newtons
            axes.plot(ends, stiffness * np.deg2rad(ends), **LINEAR)
        if model.known_slip is not None:
            _draw_curve(axes, model, axle, ends, unit.newtons)
            edge, under = float(np.rad2deg(model.known_slip[axle])), {"lw": 0.0, "zorder": 0}
            for low, high in ((ends[0], -edge), (edge, ends[1])):
                for panel in panels[:, axle] if low < high else ():
                    panel.axvspan(low, high, color="#EFE9DD", label=_UNKNOWN, **under)
        axes.set(xlim=ends, ylim=limits)
        _label_slip(lowest)
    label_forces(panels, unit, residual=known)
    legend_above(figure, last=(_UNKNOWN,))
    return figure


def _label_slip(axes: Axes) -> None:
    axes.set_xlabel("slip angle [deg]")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10]))


def _draw_curve(axes: Axes, model: TireModel, axle: int, ends: Array, newtons: float) -> None:
    """Draw the steady curve of an axle, in its band where it has one."""
    degrees = np.linspace(float(ends[0]), float(ends[1]), 200)
    slip = np.deg2rad(degrees)
    if model.band is not None:  # under the points, which it would make grey
        low, high = (force[:, axle] / newtons for force in model.band.at(slip))
        axes.fill_between(
            degrees,
            low,
            high,
            facecolor=(SKY, 0.6),
            label=_BAND,
            edgecolor=BLUE,
            linewidth=0.4,
            zorder=1.5,
        )
    axes.plot(
        degrees,
        model.force(slip)[:, axle] / newtons,
        color=BLUE,
        linewidth=1.2,
        zorder=4,
        label=f"curve, {'static load' if model.vehicle.has_downforce else 'steady'}",
    )


class TireCurve(NamedTuple):
    """Steady axle forces over slip, one curve an axle.

    alpha : slip in the paper's sign [rad], (k,).
    force : of front and rear axle [N], (k, 2).
    """

    label: str
    alpha: Array
    force: Array


def axle_slip(drive: "Drive") -> Array:
    """Return the slip angles δ - atan2(v_y ± l r, v_x) in the paper's sign [rad], (n, 2)."""
    car = drive.vehicle
    return measured_slip(
        car.l_f, car.l_r, v_x=drive.v_x, v_y=drive.v_y, r=drive.r, delta_f=drive.delta
    )


_REACH = 1.25  # curves go on this far beyond the slip of the drive


@styled
def drive_tires_figure(drive: "Drive", curves: Sequence[TireCurve]) -> Figure:
    """Draw the forces of a drive as a cloud, and the curves that trackers believed."""
    unit = force_unit_of(drive.axle_force)
    alpha, force = np.rad2deg(axle_slip(drive)), drive.axle_force / unit.newtons
    reach = _REACH * float(np.abs(alpha).max())
    near = [
        curve.force[np.abs(np.rad2deg(curve.alpha)) <= reach] / unit.newtons
        for curve in curves
        if not curve.label.startswith("linear")
    ]
    limits = force_range(force, *near)
    cloud = {**_CLOUD, "markersize": 3.0, "alpha": 0.6, "label": "this drive, true forces"}
    figure, panels = axle_panels([3.3])
    for axle, axes in enumerate(panels[0]):
        axes.plot(alpha[:, axle], force[:, axle], color=SKY, **cloud)
        for curve in curves:
            drawn = drawable(curve.force[:, axle] / unit.newtons, limits)
            axes.plot(np.rad2deg(curve.alpha), drawn, label=curve.label, **tire_look(curve.label))
        axes.set(xlim=(-reach, reach), ylim=limits)
        _label_slip(axes)
    label_forces(panels, unit, residual=False)
    return figure


@styled
def learnt_axles_figure(history: History, freeze_times: Sequence[float] = ()) -> Figure:
    """Draw what was learnt of both axles over time.

    Of the axle identifier cornering stiffness, relaxation length and capacity, the force at which
    the learnt curve saturates, over the static load of the axle.

    freeze_times : times at which weights were taken [s].
    """
    tracks, t = history.tracks_over(next(history.blocks())), history.recording.t
    if not tracks:
        raise TypeError(f"{history.method} has no estimates of the axles")
    at, curves = drawn_of_run(history, lambda block: [o.values for o in history.tracks_over(block)])
    figure = new_figure(4.4)
    panels = figure.subplots(len(tracks), 1, sharex=True)
    for axes, (title, unit, _), values in zip(panels, tracks, curves, strict=True):
        unit, size = printed_unit(unit, values)
        label, values = f"{title}\n[{unit}]", values / size
        for axle, color in enumerate((GREEN, PURPLE)):
            axes.plot(at, values[:, axle], linewidth=1.0, color=color, label=AXLES[axle].lower())
        axes.set(ylabel=label, xlim=(t[0], t[-1]))
        axes.set_ylim(0.0, 1.1 * float(values.max()) or 1.0)
        for freeze in freeze_times:
            mark_freeze(axes, freeze)
    label_time(panels[-1], t)
    return figure
