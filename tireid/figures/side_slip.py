"""Side slip and lateral velocity as they were estimated, with their band, beside what is known."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codegen.arrays import Array
from identifier.compare.course import SIGMAS, SideSlip
from models.recordings import Recording
from tireid.figures.compare import method_label, short_names
from tireid.figures.drive import ARC
from tireid.figures.style import (
    AMBER,
    BLUE,
    GREEN,
    GREY,
    ONLINE,
    ORANGE,
    PURPLE,
    SKY,
    TRUTH,
    Look,
    label_time,
    new_figure,
    note,
    styled,
)
from tireid.figures.thinned import drawn_samples, drawn_times

if TYPE_CHECKING:
    from mpc.loop.record import Drive

_MOST = 4  # recordings that are drawn
_BEYOND = 1.6  # times what was recorded, or estimated first: an axis reaches no farther

_FIRST = "inertial"  # which has the band where several estimate v_y
_OTHERS = (ORANGE, GREEN, PURPLE, AMBER, SKY, GREY)
_BAND = "within 2 standard deviations"
_SHADE: Look = {"color": BLUE, "alpha": 0.2, "linewidth": 0.0}
_ALONE: Look = {"color": GREY, "label": "inertial identifier alone"}


@styled
def side_slip_figure(
    recordings: Sequence[Recording], given: Mapping[str, Mapping[str, SideSlip]]
) -> Figure:
    """Draw side slip as it was recorded and estimated; the band is of the inertial identifier.

    Where that is not there, it is of the first method that has one.
    """
    drawn = list(recordings)[:_MOST]
    given = {name: by_name for name, by_name in given.items() if by_name}
    first = max(
        given, key=lambda n: (n == _FIRST, any(one.v_y_sd is not None for one in given[n].values()))
    )
    looks: dict[str, dict[str, Any]] = {first: {"color": BLUE, "zorder": 2.5}}  # above the others
    others = [name for name in given if name != first]
    looks |= {n: {"color": color} for n, color in zip(others, cycle(_OTHERS), strict=False)}
    figure = new_figure(0.7 + 1.5 * len(drawn))
    panels = figure.subplots(len(drawn), 1, squeeze=False)[:, 0]
    names = short_names([recording.name for recording in recordings])
    for axes, recording in zip(panels, drawn, strict=True):
        axes.set_title(names[recording.name])
        _draw(axes, recording, {name: given[name][recording.name] for name in looks}, looks)
    figure.align_ylabels()
    return figure


def _draw(
    axes: Axes,
    recording: Recording,
    given: Mapping[str, SideSlip],
    looks: Mapping[str, Look],
) -> None:
    """Draw the side slip of a recording, with the band of the first estimate."""
    truth, first = recording.logged_v_y, next(iter(given.values()))
    ends = recording.t[0], recording.t[-1]
    part = drawn_samples(recording.t, ends, *(one.v_y for one in given.values()))
    t = drawn_times(recording, recording.t[part])

    def slip(v_y: Array) -> Array:
        v_x = recording.v_x[part]
        return np.degrees(np.where(v_x > 0.0, np.arctan2(v_y[part], np.maximum(v_x, 1e-9)), 0.0))

    main = slip(first.v_y if truth is None else truth)
    limit = _BEYOND * max(float(np.abs(main).max()), 0.1)
    if first.v_y_sd is not None:
        room = SIGMAS * first.v_y_sd
        low, high = (slip(end).clip(-limit, limit) for end in (first.v_y - room, first.v_y + room))
        axes.fill_between(t, low, high, label=_BAND, **_SHADE)
    if truth is not None:
        axes.plot(t, main, **{**TRUTH, "label": "recorded"})
    for name, one in given.items():
        drawn = slip(one.v_y).clip(-limit, limit)
        axes.plot(t, drawn, linewidth=0.9, label=method_label(name), **looks[name])
    axes.set(xlim=ends, ylim=(-limit, limit), ylabel="side slip [deg]")
    if first.rms is not None:
        note(axes, f"RMSE {first.rms:.2g} deg")
    label_time(axes, recording.t)


@styled
def drive_lateral_figure(drive: "Drive") -> Figure:
    """Draw the estimated v_y over the true one, and its error, each with the band of two sigma."""
    v_y, band = drive.estimates["v_y"], SIGMAS * drive.estimates["v_y_sd"]
    figure = new_figure(3.6)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, scale, zero in zip(
        panels, (1.0, 1e3), (np.zeros_like(v_y), drive.v_y), strict=True
    ):  # m/s, mm/s
        for curve, look in (
            (drive.estimates["inertial_v_y"], _ALONE),
            (drive.v_y, TRUTH),
            (v_y, {**ONLINE, "label": "estimate"}),
        ):
            axes.plot(drive.s, scale * (curve - zero), **look)
        ends = scale * (v_y - band - zero), scale * (v_y + band - zero)
        axes.fill_between(drive.s, *ends, label="estimate, two sigma", **_SHADE)
    reach = 1.2e3 * float(np.max(np.maximum(band, np.abs(v_y - drive.v_y))))
    panels[0].set(ylabel="$v_y$\n[m/s]", xlim=drive.s[[0, -1]])
    panels[1].set(ylabel="error of it\n[mm/s]", xlabel=ARC, ylim=(-reach, reach))
    figure.align_ylabels(panels)
    return figure
