"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # ggv
    speeds: int = 13  # of the table, of a diagram, of a curve
    pushes: int = 200
    slips: int = 200
    # package
    samples: int = 240
    rest: int = 10  # samples at rest, and some as long in between
    # Largest differences of a force that the self-test allows, in parts of the limit of forces.
    tolerance_double: float = 1e-8
    tolerance_single: float = 2e-5
    # tir
    widest: float = 0.6  # slip up to which curves are compared [rad]; weight past what is known
    beyond: float = 0.02
    least_reach: float = 0.032  # rad, that is followed at least, and where nothing is said
    reach: float = 0.1
    tir_low: tuple[float, ...] = (0.0, -4.0, 1.0001, -5.0)  # of ln K, ln μ, C, E
    tir_high: tuple[float, ...] = (6.0, 2.0, 2.4, 0.95)
    # power of the errors whose squares are summed at last: near to the largest one
    worst: float = 5.0
    most_missed: float = 0.1  # of the peak: past that a curve is no Magic Formula
    # PKY2: stiffness goes with load, within 0.1 % up to twice the nominal one
    proportional: float = 100.0
    # understeer
    step: float = 1.0  # m/s², of the lateral acceleration
    understeer_count: int = 3  # of speeds
    drawn: int = 100  # models; shares of them that lie a deviation off
    understeer_low: float = 0.16
    understeer_high: float = 0.84


CHOSEN = Chosen()
