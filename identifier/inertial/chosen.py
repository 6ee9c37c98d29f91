"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # design
    least_share: float = 1e-6  # of the sway, which a prior has to have
    reach: float = 0.3  # rad, up to which directions of curves are those of a tire
    # motion
    moving: int = 7  # entries of z before those that are learnt
    first_cos: int = 24  # of the series of cos δ, 2e-5 off at 0.5 rad
    # step
    # of the square of a change, up to which the next one is none: a number that settles
    same: float = 0.01
    most_waiting: int = 4  # numbers of a channel that wait for its turn
    most_sliding: float = 0.7  # |v_y|/v_x from which the filter begins anew
    most_noise: float = 9.0  # of the noise that is held for true, what one sample may show
    most_missed: float = 25.0  # one outlier alone is no alarm
    stiffness: float = 2.0  # static loads/rad, the least that a corner is begun with
    doubted: float = 0.7  # of the slip that a corner is begun with
    lag_of_a_x: float = 0.2  # s, of the washout that shows a_x
    least: float = 1e-12  # variance that is divided by


CHOSEN = Chosen()
