"""Side slip and lateral velocity as they were estimated, with their band, beside what is known."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codegen.arrays import Array
from identifier.compare.course import SIGMAS, SideSlip
from models.recordings import Recording
from tireid.figures import style
from tireid.figures.chosen import CHOSEN
from tireid.figures.compare import method_label, short_names
from tireid.figures.drive import ARC
from tireid.figures.thinned import Signal, drawn_times, shown

if TYPE_CHECKING:
    from mpc.loop.record import Drive

_FIRST = "inertial"  # which has the band where several estimate v_y
_OTHERS = (style.ORANGE, style.GREEN, style.PURPLE, style.AMBER, style.SKY, style.GREY)
_BAND = "within 2 standard deviations"
_SHADE: Mapping[str, Any] = {"color": style.BLUE, "alpha": 0.2, "linewidth": 0.0}


@style.styled
def side_slip_figure(
    recordings: Sequence[Recording], given: Mapping[str, Mapping[str, SideSlip]]
) -> Figure:
    """Draw side slip and what estimates miss of it; the band is of the inertial identifier.

    Without a recorded v_y there is an estimate with its band, and nothing is missed. A band is
    drawn of the inertial identifier, of the first method with one where it is not there.
    """
    drawn = list(recordings)[: CHOSEN.most]
    given = {name: by_name for name, by_name in given.items() if by_name}
    if not given:
        raise ValueError("no method estimated a lateral velocity")
    has_band = {n: any(one.v_y_sd is not None for one in given[n].values()) for n in given}
    first = max(given, key=lambda name: (name == _FIRST, has_band[name]))
    known = [recording.logged_v_y is not None for recording in drawn]
    ratios = [ratio for one in known for ratio in ([1.5, 0.9] if one else [1.5])]
    figure = style.new_figure(CHOSEN.page, 0.7 + sum(ratios))
    panels = iter(figure.subplots(len(ratios), 1, squeeze=False, height_ratios=ratios)[:, 0])
    names = short_names([recording.name for recording in recordings])
    for recording, has_truth in zip(drawn, known, strict=True):
        here = {name: by_name[recording.name] for name, by_name in given.items()}
        upper = next(panels)
        upper.set_title(names[recording.name])
        _draw(upper, next(panels) if has_truth else None, recording, here, first)
    figure.align_ylabels()
    style.legend_above(figure, columns=CHOSEN.columns)
    return figure


def _draw(
    upper: Axes, lower: Axes | None, recording: Recording, given: Mapping[str, SideSlip], first: str
) -> None:
    """Draw the side slip of a recording, and below it the errors of the estimates."""
    v_x, truth, ends = recording.v_x, recording.logged_v_y, (recording.t[0], recording.t[-1])
    signals: list[Signal] = [one.v_y.__getitem__ for one in given.values()]
    part = shown(recording.t, ends, *signals)
    t, at = drawn_times(recording, recording.t[part]), v_x[part]
    slips = {name: _degrees(one.v_y[part], at) for name, one in given.items()}
    exact = None if truth is None else _degrees(truth[part], at)
    reach = float(np.abs(slips[first] if exact is None else exact).max())
    limit = CHOSEN.beyond * max(reach, 0.1)
    band = given[first].v_y_sd
    if band is not None:
        low, high = (
            np.clip(
                _degrees(given[first].v_y[part] + side * SIGMAS * band[part], at), -limit, limit
            )
            for side in (-1.0, 1.0)
        )
        upper.fill_between(t, low, high, label=_BAND, **_SHADE)
    if exact is not None:
        upper.plot(t, exact, **{**style.TRUTH, "label": "recorded"})
    colors = dict(
        zip((name for name in given if name != first), _OTHERS * len(given), strict=False)
    )
    errors = {}
    for name in (*colors, first):  # the first lies above the others
        look: dict[str, Any] = {"color": colors.get(name, style.BLUE), "linewidth": 0.9}
        upper.plot(t, np.clip(slips[name], -limit, limit), **look, label=method_label(name))
        if lower is not None and exact is not None:
            errors[name] = slips[name] - exact
            lower.plot(t, np.clip(errors[name], -limit, limit), **look, rasterized=True)
    upper.set(xlim=ends, ylim=(-limit, limit), ylabel="side slip [deg]")
    if given[first].rms is not None:
        style.note(upper, f"RMSE {given[first].rms:.2g} deg")
    if lower is not None:
        lower.axhline(0.0, color=style.GREY, linewidth=0.6)
        lower.set(xlim=ends, ylabel="error [deg]")
    style.label_time(upper if lower is None else lower, recording.t)


def _degrees(v_y: Array, v_x: Array) -> Array:
    """Return side slip [deg], zero at standstill."""
    return np.degrees(np.where(v_x > 0.0, np.arctan2(v_y, np.maximum(v_x, 1e-9)), 0.0))


@style.styled
def drive_lateral_figure(drive: "Drive") -> Figure:
    """Draw the estimated v_y over the true one, and its error, each with the band of two sigma."""
    v_y, band = drive.estimates["v_y"], SIGMAS * drive.estimates["v_y_sd"]
    inertial = drive.estimates["inertial_v_y"]
    figure = style.new_figure(CHOSEN.page, 3.6)
    above, below = figure.subplots(2, 1, sharex=True)
    shade: Mapping[str, Any] = {**_SHADE, "label": "estimate, two sigma"}
    look: Mapping[str, Any] = {**style.ONLINE, "label": "estimate"}
    alone: Mapping[str, Any] = {"color": style.GREY, "label": "inertial identifier alone"}
    above.fill_between(drive.s, v_y - band, v_y + band, **shade)
    above.plot(drive.s, inertial, **alone)
    above.plot(drive.s, drive.v_y, **style.TRUTH)
    above.plot(drive.s, v_y, **look)
    above.set_ylabel("$v_y$\n[m/s]")
    below.fill_between(drive.s, -CHOSEN.mm_per_m * band, CHOSEN.mm_per_m * band, **shade)
    below.plot(drive.s, CHOSEN.mm_per_m * (inertial - drive.v_y), **alone)
    below.plot(drive.s, CHOSEN.mm_per_m * (v_y - drive.v_y), **look)
    reach = 1.2 * CHOSEN.mm_per_m * float(np.max(np.maximum(band, np.abs(v_y - drive.v_y))))
    below.set(ylabel="error of it\n[mm/s]", xlabel=ARC, ylim=(-reach, reach))
    below.set_xlim(0.0, float(drive.s[-1]))
    figure.align_ylabels([above, below])
    style.legend_above(figure)
    return figure
