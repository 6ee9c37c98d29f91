"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # ggv
    speeds: int = 13  # of the table
    pushes: int = 200  # longitudinal forces of a diagram
    slips: int = 200  # of a curve
    # package
    samples: int = 240  # of the self-test
    rest: int = 10  # samples at rest, and some as long in between
    # largest difference of a force that the self-test allows, of the limit of forces
    tolerance_double: float = 1e-8
    tolerance_single: float = 2e-5  # likewise, in float
    # tir
    widest: float = 0.6  # rad, slip up to which curves are compared
    beyond: float = 0.02  # weight of slip past what is known
    least_reach: float = 0.032  # rad, slip that is followed at least
    reach: float = 0.1  # rad, slip that is followed where nothing is said of what is known
    tir_low: tuple[float, ...] = (0.0, -4.0, 1.0001, -5.0)  # of ln K, ln μ, C, E, at least
    tir_high: tuple[float, ...] = (6.0, 2.0, 2.4, 0.95)  # of ln K, ln μ, C, E, at most
    # power of the errors whose squares are summed at last: near to the largest one
    worst: float = 5.0
    most_missed: float = 0.1  # of the peak: past that a curve is no Magic Formula
    # PKY2: stiffness goes with load, within 0.1 % up to twice the nominal one
    proportional: float = 100.0
    # understeer
    step: float = 1.0  # m/s², of the lateral acceleration
    understeer_speeds: int = 3  # at which gradients are given
    drawn: int = 100  # models
    # share of the models that lie below the lower end, a deviation off
    lower_share: float = 0.16
    upper_share: float = 0.84  # share of them that lie below the upper end, a deviation off


CHOSEN = Chosen()
