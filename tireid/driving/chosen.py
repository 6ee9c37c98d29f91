"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # learn
    duration: float = 40.0  # s
    speed: float = 20.0  # m/s
    frequency: float = 0.6  # Hz, of the fastest swings
    gentle: float = 0.3  # share of the angles at the start
    grows: float = 30.0  # s, in which angles grow by their whole size
    tips: float = 1.2  # times the grip: a car that is said to have more is falling over
    forgotten: float = 0.5  # s before a car spins or tips that are not learnt from
    rate_limit: float = 1.0  # rad/s at the road wheels
    # runs
    noted: float = 0.1  # change of the grip that is worth a note
    widest: float = 2.0  # deviation at which a car is off the path [m]
    plan_every: int = 4  # periods between two plans that are kept: half a frame of the film
    # setup
    fastest: float = 30.0  # on a closed course [m/s]
    acceleration: float = 2.0  # on a closed course at friction 1 [m/s²]
    braking: float = 3.0  # on a closed course at friction 1 [m/s²]
    period: float = 0.01  # control period [s]
    # least and most over that of the tire's measurement [-]
    frictions: tuple[float, float] = (0.05, 1.5)


CHOSEN = Chosen()
