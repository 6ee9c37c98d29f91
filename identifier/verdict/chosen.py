"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # bands
    # windows of all ranges that count in each, so that few windows decide nothing
    shared: float = 10.0
    independent: float = 0.5  # of the windows, which overlap by half
    # of an instant of another drive, over a window of a part left out, by range of slip: means hide
    # errors of quick passes through zero; chosen on 256 random cars, seeds 100 to 131 and 200 to
    # 231
    elsewhere: tuple[float, ...] = (1.65, 0.68, 0.93, 1.1, 1.22, 1.35)
    # friction
    least: float = 0.2  # of the grid of frictions, over that of the road that taught
    most: float = 2.5  # of the same grid
    frictions: int = 26  # frictions of the grid beside 1
    spread: float = 0.7  # standard deviation of ln μ of another road
    lasts: float = 60.0  # s: a road, on average
    as_taught: float = 0.5  # probability that the drive begins on the road that taught
    unexplained: float = 0.02  # of p₀, that no friction explains the force
    beside: float = 0.02  # static axle loads: error of curves beside the band
    of_force: float = 0.07  # error of curves beside the band, over the force
    of_estimate: float = 0.05  # static axle loads: by a v_y that was estimated with that model
    # rad: by so much the slip of another drive is off, as the zero of its steering is
    zero: float = 0.015
    anything: float = 0.3  # static axle loads: of forces that no friction explains
    overlap: float = 0.5  # of a window is new
    another: float = 0.25  # |ln μ| from which a road counts as another
    sure: float = 0.99  # probability from which another road is reported
    likely: float = 0.5  # probability down to which it is taken to go on
    two_sigma: float = 2.0  # of its doubt: a friction nearer to that which taught is not reported
    similar: float = 0.1  # of ln μ: by so much roads of a tire are not similar
    # judging
    secant: float = 0.01  # rad, to which the slope of a curve is taken: play makes none at zero
    roads: int = 3  # segments of another friction that are listed one by one
    # motion
    # T [s]: shorter ones show the noise of the sensors, longer ones no transient
    window: float = 0.3
    # speed in sqrt(g L) from which a window counts; slower, slip angles mean little
    brisk: float = 0.6
    fewest: int = 8  # windows, below which nothing can be said
    # windows of an identification drive, 3.8 s: of 14 snippets of 2 s of random drives 4 had bands
    # that held 41 to 64 % of the true forces, of snippets of 5 s none below 80 %
    fewest_taught: int = 24
    segment: float = 0.3  # share of the windows that may be missed in one piece
    rest_missed: float = 0.08  # of the force elsewhere, where a piece is missed
    confined: float = 0.6  # of what is missed with that piece, what the rest may miss
    moment: float = 0.2  # s, over which both are meant


CHOSEN = Chosen()
