"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # design
    shortest_step: float = 1e-4  # [s]: finer is only work
    longest_step: float = 0.1  # [s]: coarser is blind
    # laws
    least: float = 1e-15  # of a gain that is not 0, in its unit, whatever U is
    largest: float = 1e12  # of a gain, in its unit, whatever U is
    # network
    largest_sum: float = 1e9  # of the units of an axle together [N]: what cancels may be large
    largest_v: float = 1e9  # [-], beyond which tanh is a sign at the slip of a resting car
    # step
    largest_speed: float = 300.0  # m/s: no car is faster
    largest_angle: float = 1.5  # rad: no wheel turns more


CHOSEN = Chosen()
