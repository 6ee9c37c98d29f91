"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # model
    # of G²: what an axle that uses all of its grip lengthwise keeps sideways
    least_grip: float = 0.05
    least_slope: float = 0.02  # of C: the carcass does not stretch further
    damping: float = 0.3  # ζ of the sway
    rate: float = 4.0  # κ [1/s]: what is missed is a mean over a quarter of a second
    lag_of_a_x: float = 0.2  # [s] of the washout that tells a_x


CHOSEN = Chosen()
