"""Numbers that were chosen here, file by file, with their units and reasons."""

import math
from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # drive
    spun: float = math.radians(45.0)  # side slip of the center of gravity [rad]
    slowest: float = 1.0  # m/s
    # lateral
    unknown: float = 1.0  # m/s: standard deviation of v_y where nothing is known
    finest: float = 1e-3  # m/s: least deviation that is believed
    # sensing
    bias_a_y: float = 0.05  # m/s²: standard deviation from one unit to the next
    bias_r: float = 0.001  # rad/s: standard deviation from one unit to the next
    ramp_time: float = 20.0  # s
    ramp_speed: float = 20.0  # m/s
    largest_angle: float = 0.3  # rad at friction 1: beyond the peak of any tire for the road


CHOSEN = Chosen()
