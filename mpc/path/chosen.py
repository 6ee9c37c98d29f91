"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # gates
    knots: float = 1.0  # m, about their distance
    per_interval: int = 4  # places between two knots where limits hold
    gently: float = 5.0  # m³: weight of ∫ (dκ/ds)² ds against the peak of |κ| [1/m]
    cone_spacing: float = 3.0  # m
    car_width: float = 1.8  # m
    lane_margin: float = 0.05  # m, between the side of a car and the cones of a lane
    slalom_margin: float = 0.3  # m, and those of a slalom
    run: float = 40.0  # m, before the first cones and after the last
    spacing: float = 0.25  # m, longest step of the samples
    narrowest: float = 1.0  # m, of a car
    widest: float = 2.6  # m, of a car
    easing: float = 6.0  # m
    # line
    # rad in one step; coarser samples would not carry the cubics between them
    largest_turn: float = 0.3
    disagreement: float = 0.02  # of a step, or rad; beside what cubics leave out at that turn
    # path
    # m; shorter than any turn that a car can drive, so that no step skips a bend
    longest_step: float = 1.0
    # of 1 - κ e_y: near the center of a turn every s is as close as the next
    smallest_slope: float = 0.3
    tolerance: float = 1e-9  # m
    search_distance: float = 10.0  # m, from the last place of a car
    steps: int = 200  # in search of the nearest point, at most
    # waypoints
    fits: int = 4  # of a line, each over the arc length of the one before
    farthest: float = 1e8  # of a way-point from the origin [m]: every map of the earth fits
    same: float = 1e-6  # of the median gap: way-points as near as this are one
    pieces: int = 8  # of every interval between knots, for its length


CHOSEN = Chosen()
