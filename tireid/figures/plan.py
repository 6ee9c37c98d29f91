"""A planned maneuver: its steering over time, and the way of the likely car."""

import numpy as np
from matplotlib.figure import Figure

from identifier.plan import Planned
from tireid.figures import style


@style.styled
def plan_figure(best: Planned, ratio: float | None) -> Figure:
    """Draw the angle of the front wheels, the lateral acceleration, and the way."""
    figure = style.new_figure(5.0)
    steering, felt, way = figure.subplots(3, 1)
    steering.plot(best.log.t, np.degrees(best.log.delta_f), color=style.BLUE)
    steering.set(ylabel="front wheels [deg]", title=f"{best.name} at {best.speed:.3g} m/s")
    if ratio is not None:
        steering.secondary_yaxis(
            "right", functions=(lambda x: ratio * x, lambda x: x / ratio)
        ).set_ylabel("hand wheel [deg]")
    felt.plot(best.log.t, np.asarray(best.log.a_y), color=style.BLUE)
    felt.set(xlabel="time [s]", ylabel="$a_y$ [m/s²]")
    way.plot(best.X, best.Y, color=style.ORANGE)
    way.set(xlabel="X [m]", ylabel="Y [m]")
    way.set_aspect("equal", adjustable="datalim")
    return figure
