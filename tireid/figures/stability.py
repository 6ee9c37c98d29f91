"""How far the learning loop is from instability: its sampled poles at any gain."""

import numpy as np
from matplotlib.figure import Figure

from identifier.stability.loop import INTEGRATORS, Loop, eigenvalues, scaled_matrices
from identifier.stability.margins import gain_margin, phase_margin
from tireid.figures.panels import legend_above
from tireid.figures.style import BLACK, BLUE, GREY, ORANGE, PAGE, new_figure, styled

FACTORS = np.geomspace(1e-3, 1e3, 1500)  # on the loop gain, along the locus


@styled
def locus_figure(loop: Loop, *, integrator: str, dt: float) -> Figure:
    """Draw the root locus of the sampled loop, with the design on it and the gain at its limit.

    Left all of the unit circle, right the part near z = 1, where slow poles are.

    Parameters
    ----------
    loop : the loop at the worst regressor.
    integrator : "euler" or "rk4".
    dt : sampling interval [s].
    """
    step = INTEGRATORS[integrator]
    locus = step(eigenvalues(scaled_matrices(loop, FACTORS)) * dt).ravel()
    design = step(eigenvalues(loop.matrix()) * dt)
    margin = gain_margin(loop, step, dt)
    circle = np.exp(1j * np.linspace(-np.pi, np.pi, 2881))
    figure = new_figure(PAGE, 3.5)
    panels = figure.subplots(1, 2)
    span = 1.3 * float(np.abs(1.0 - design).max())
    views = (-1.1, 1.1, 1.1), (1.0 - 1.5 * span, 1.0 + 0.5 * span, span)
    for axes, (left, right, height) in zip(panels, views, strict=True):
        axes.plot(circle.real, circle.imag, color=BLACK, linewidth=0.9, label="stability limit")
        axes.plot(locus.real, locus.imag, ".", color=GREY, markersize=1.0, label="any gain")
        axes.plot(design.real, design.imag, "o", color=BLUE, markersize=4.5, label="design")
        if 0.0 < margin.factor < np.inf:
            edge = step(eigenvalues(loop.scaled(margin.factor).matrix()) * dt)
            name = f"{margin.factor:.3g} times its gain"
            axes.plot(edge.real, edge.imag, "x", color=ORANGE, markersize=5.5, label=name)
        axes.set(xlim=(left, right), ylim=(-height, height), aspect="equal")
        axes.set_xlabel("real part of z [-]")
    panels[0].set_ylabel("imaginary part of z [-]")
    panels[0].set_title("Poles of the sampled loop")
    phase = phase_margin(loop, step, dt)
    panels[1].set_title(f"Near z = 1; phase margin {phase:.0f}°")
    legend_above(figure)
    return figure
