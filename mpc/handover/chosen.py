"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # certificate
    largest_slip: float = 0.25  # rad: an axle slides long before
    # of the largest slip that is judged
    shares: tuple[float, ...] = (0.02, 0.04, 0.08, 0.16, 0.28, 0.44, 0.64, 1.0)
    most_grip: float = 1.8  # static axle loads: no road tire has more
    least_grip: float = 0.03  # static axle loads at a slip of 0.1 rad and more: less is no road
    # static axle loads that a force may push the wrong way, for offsets of sensors
    wrong_way: float = 0.03
    # road
    least: float = 0.15  # of the friction that a tire was learnt on: ice, after a dry road
    grid: int = 13  # frictions that are tried at once
    prior_sd: float = 0.7  # standard deviation of ln μ where nothing is seen
    # supervisor
    learns: float = 0.005  # rad: below, a tire is a straight line in noise
    beyond: float = 1.2  # slip that is trusted over the largest one that was learnt from
    lost: int = 5  # samples in a row after which a window is none


CHOSEN = Chosen()
