"""Numbers that were chosen here, file by file, with their units and reasons."""

import math
from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # information
    # times the correlation time that learning is given: half a second, as errors of models
    color: float = 5.0
    # step of the simulation that counts: 54 ms in a sedan, the regressor is low-passed
    every: int = 2
    mattering: int = 12  # slips at which the curve is asked, up to where it is flat
    # motion
    hold: float = 0.6  # 1/sqrt(L/g): pole of deviations from the course, 1.1 rad/s in a sedan
    step: float = 0.05  # of the time sqrt(L/g): 27 ms in a sedan
    least_slope: float = 0.02  # of that at zero, for the lag
    # plan
    # share of the planned lateral force that a car may need to turn inside the area
    turns: float = 0.8
    most_passes: int = 12  # of a plan
    least_time: float = 0.5  # s of a plan
    most_time: float = 60.0  # s of a plan
    # 1/sqrt(L/g): frequency of the slalom it is compared with, 0.5 Hz for a sedan
    slalom: float = 0.27
    probed: float = 15.0  # sqrt(L/g), of a maneuver whose amplitude is looked for: 8 s in a sedan
    random: int = 8  # random steerings that it is compared with
    # rehearsal
    lead: float = 1.0  # s straight ahead before the pass
    period: float = 0.01  # s, of who steers
    # search
    population: int = 32  # candidates of a generation
    generations: int = 100  # of a search, at most
    stalled: int = 20  # generations after which a search ends that brought less than a share `gain`
    gain: float = 0.01  # share of the least cost
    # sqrt(L/g): least mean duration of a change from angle to angle, 0.4 s in a sedan
    swing: float = 0.75
    # largest, of the last to the mean duration, and of the mean to the first
    chirp: float = math.log(3.0)
    calm: float = 0.5  # share of the grip that the rear axle may still need at the end of a pass
    rear: float = 0.97  # share of the grip that no rear axle passes, whatever the tires
    overhang: float = 0.32  # wheelbases by which a car reaches beyond its axles
    half_width: float = 0.33  # wheelbases, of a car without a chassis
    wider: float = 1.12  # of the body over its track
    largest_heading: float = math.radians(60.0)  # at the entry
    fewest: int = 3  # changes of the angle in a pass
    most: int = 14  # changes of the angle in a pass; where there are more, they are driven mirrored
    # tires
    spread: float = 0.3  # of stiffness and of friction, either way
    drawn: int = 6  # curves of a learnt model
    # of the largest force of a curve: slip that matters ends where it is reached
    flat: float = 0.98


CHOSEN = Chosen()
