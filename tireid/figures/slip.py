"""Axle force against slip angle: the shape of the tire, as measured and as learnt."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from identifier.history import History
from identifier.method import FrozenModel
from models.recordings import Recording
from tireid.figures.panels import AXLES, legend_above
from tireid.figures.style import BLACK, BLUE, LINEAR, ORANGE, PAGE, new_figure, styled
from tireid.figures.units import drawable, force_range, force_unit_of

UNKNOWN = "slip not known"


@styled
def slip_figure(model: FrozenModel, recording: Recording, online: History | None = None) -> Figure:
    """Draw force over slip angle, front and rear: truth, frozen model and linear tire.

    The slip angle has the paper's sign, α = δ - atan2(v_y ± l r, v_x), the negative of ISO 8855, so
    that the curves rise. Samples below the model's minimum speed are left out.

    Parameters
    ----------
    model : the frozen model; its vehicle gives the axle positions and the linear tire.
    recording : where the model is evaluated.
    online : an online run over the recording, drawn where there is no truth.

    Raises
    ------
    ValueError
        Where the online run is of another recording, or the car never reaches the minimum speed.
    """
    if online is not None and online.axle_force.shape != (recording.t.size, 2):
        raise ValueError(
            f"the model is drawn on {recording.name}, the online run is of {online.recording.name}"
        )
    moving = recording.v_x >= model.min_speed
    if not moving.any():
        raise ValueError(f"{recording.name}: v_x never reaches {model.min_speed:g} m/s")
    vehicle = model.vehicle
    alpha = np.rad2deg(recording.alpha(vehicle.l_f, vehicle.l_r)[moving])
    frozen = model.axle_force(recording)[moving]
    known, color, label = recording.axle_force, BLACK, "truth"
    if known is None and online is not None:
        known, color, label = online.axle_force, BLUE, "online"
    reference = frozen if known is None else known[moving]
    unit = force_unit_of(reference)
    frozen, reference = frozen / unit.newtons, reference / unit.newtons
    limits = force_range(reference, frozen)
    stiffness = vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear

    figure = new_figure(PAGE, 3.2)
    panels = figure.subplots(1, 2, sharey=True)
    for axle, (axes, name) in enumerate(zip(panels, AXLES, strict=True)):
        if known is not None:
            axes.plot(
                alpha[:, axle],
                drawable(reference[:, axle], limits),
                linestyle="",
                marker=".",
                markersize=3.0,
                markeredgewidth=0.0,
                color=color,
                alpha=0.35,
                label=label,
            )
        axes.plot(
            alpha[:, axle],
            drawable(frozen[:, axle], limits),
            linestyle="",
            marker=".",
            markersize=2.2,
            markeredgewidth=0.0,
            color=ORANGE,
            alpha=0.8,
            label="frozen weights",
        )
        low, high = float(alpha[:, axle].min()), float(alpha[:, axle].max())
        margin = 0.04 * (high - low) or 1.0
        ends = np.array([low - margin, high + margin])
        axes.plot(ends, stiffness[axle] / unit.newtons * np.deg2rad(ends), **LINEAR)
        if model.known_slip is not None:
            _draw_curve(axes, model, axle, ends, unit.newtons)
            _shade_unknown(axes, float(np.rad2deg(model.known_slip[axle])), ends)
        axes.set(
            xlim=ends, ylim=limits, title=name, xlabel=rf"slip angle $\alpha_{'fr'[axle]}$ [deg]"
        )
        axes.xaxis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10]))
    panels[0].set_ylabel(f"lateral force [{unit.name}]")
    legend_above(figure, order=(UNKNOWN,))
    return figure


def _draw_curve(
    axes: Axes, model: FrozenModel, axle: int, ends: NDArray[np.float64], newtons: float
) -> None:
    """Draw the steady curve of an axle."""
    slip = np.linspace(np.deg2rad(ends[0]), np.deg2rad(ends[1]), 200)
    axes.plot(
        np.rad2deg(slip),
        model.force(slip)[:, axle] / newtons,
        color=BLUE,
        linewidth=1.2,
        label="frozen curve, steady",
    )


def _shade_unknown(axes: Axes, known: float, ends: NDArray[np.float64]) -> None:
    """Shade the slip [deg] that the model does not know."""
    for low, high in ((ends[0], -known), (known, ends[1])):
        if low < high:
            axes.axvspan(low, high, color="#EFE9DD", linewidth=0.0, zorder=0, label=UNKNOWN)
