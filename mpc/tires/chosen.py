"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # ladder
    units: int = 6  # of the ladder
    # α_1 over the slip F_max/C at which the linear tire would reach the peak force
    narrowest: float = 0.25
    worst: float = 0.02  # largest error of a fit over the largest force
    samples: int = 400  # of a curve that is fitted
    small: float = 1e-3  # rad; the slope at zero is read here, well above rounding
    straight: float = 0.1  # of that slip F_max/C; a slope that is read beyond it is no longer C
    largest_slip: float = 0.5  # rad, where the table ends; less where friction is low
    halvings: int = 50  # of an interval: 1e-15 of it is left
    # tire
    n_doubts: int = 26  # slips at which the uncertainty of the forces is given
    doubt_step: float = 0.02  # rad, between these slips
    # of the force: half a band of 90 % of what a learnt tire misses at best
    relative: float = 0.066
    floor: float = 0.016  # of a static axle load, likewise
    # of the slope at zero: the peak is reached within a per cent or two of its force
    flat: float = 0.05
    # of the slope at zero; a little less than where slip ends to be of use
    least_rise: float = 0.04
    speed: float = 15.0  # m/s; curves of slip do not depend on it, but where the car has downforce


CHOSEN = Chosen()
