"""The lane changes of ISO 3888: a double lane change (part 1) and obstacle avoidance (part 2).

Lengths and widths of the lanes are those of ISO 3888-1:2018 and ISO 3888-2:2011 as public programs
and papers give them, not checked against the text of the standards; b is the width of the car.
x = 0 at the first cones, y = 0 in the middle of the first lane, the middle lane is to the left, and
the right cones of the last lane are in line with those of the first.
    part 1: lanes 15, 25, 30 m (two of 15) with 30 and 25 m between them, 1.1 b + 0.25,
        1.2 b + 0.25, 1.3 b + 0.25 wide; the middle lane is offset by 3.5 m.
    part 2: lanes 12, 11, 12 m with 13.5 and 12.5 m between them, 1.1 b + 0.25, b + 1 and
        1.3 b + 0.25, at least 3 m, wide; the middle lane begins 1 m beside the first.
The offset of part 1 is taken between right cones. The standard leaves the line to the driver; ours
is the one of smallest peak curvature, see `mpc.path.gates`.
"""

from mpc.path.gates import Gate, cones_of, line_through_gates
from mpc.path.line import PathError
from mpc.path.path import Path

CAR_WIDTH = 1.8  # m
NARROWEST, WIDEST = 1.0, 2.6  # m, of a car


def iso_3888_1(
    *,
    car_width: float = CAR_WIDTH,
    margin: float = 0.05,
    run_in: float = 40.0,
    run_out: float = 40.0,
    spacing: float = 0.25,
) -> Path:
    """Return the double lane change of ISO 3888-1, 125 m between the first and the last cones.

    Parameters
    ----------
    car_width : width of the car without mirrors [m]; the lanes grow with it.
    margin : room between the side of the car and the cones, on top of half its width [m].
    run_in : lane before the first cones [m].
    run_out : lane after the last cones [m].
    spacing : longest step of the samples [m].

    Raises
    ------
    PathError
        Where a number is out of range.
    """
    first, middle, last = (share * _checked(car_width) + 0.25 for share in (1.1, 1.2, 1.3))
    right = -0.5 * first
    gates = (
        Gate(start=0.0, end=15.0, right=right, left=right + first),
        Gate(start=45.0, end=70.0, right=right + 3.5, left=right + 3.5 + middle),
        Gate(start=95.0, end=125.0, right=right, left=right + last),
    )
    name, easing = "ISO 3888-1", 10.0
    return _lane_change(name, gates, car_width, margin, easing, run_in, run_out, spacing)


def iso_3888_2(
    *,
    car_width: float = CAR_WIDTH,
    margin: float = 0.05,
    run_in: float = 40.0,
    run_out: float = 40.0,
    spacing: float = 0.25,
) -> Path:
    """Return the obstacle avoidance of ISO 3888-2, 61 m between the first and the last cones.

    Parameters
    ----------
    car_width : width of the car without mirrors [m]; the lanes grow with it.
    margin : room between the side of the car and the cones, on top of half its width [m].
    run_in : lane before the first cones [m].
    run_out : lane after the last cones [m].
    spacing : longest step of the samples [m].

    Raises
    ------
    PathError
        Where a number is out of range.

    Examples
    --------
    >>> path = iso_3888_2(car_width=1.8)
    >>> f"{path.length:.1f} m, tightest radius {1.0 / path.peak_curvature:.1f} m"
    '141.7 m, tightest radius 40.7 m'
    """
    first, middle = 1.1 * _checked(car_width) + 0.25, car_width + 1.0
    last = max(1.3 * car_width + 0.25, 3.0)
    right = -0.5 * first
    side = right + first + 1.0
    gates = (
        Gate(start=0.0, end=12.0, right=right, left=right + first),
        Gate(start=25.5, end=36.5, right=side, left=side + middle),
        Gate(start=49.0, end=61.0, right=right, left=right + last),
    )
    name, easing = "ISO 3888-2", 6.0
    return _lane_change(name, gates, car_width, margin, easing, run_in, run_out, spacing)


def _checked(car_width: float) -> float:
    if not NARROWEST <= car_width <= WIDEST:
        raise PathError(f"car_width must be {NARROWEST} to {WIDEST} m, it is {car_width}")
    return car_width


def _lane_change(
    name: str,
    gates: tuple[Gate, Gate, Gate],
    car_width: float,
    margin: float,
    easing: float,
    run_in: float,
    run_out: float,
    spacing: float,
) -> Path:
    """Drive through the gates; before and after them the car keeps their lanes."""
    for what, value in (("run_in", run_in), ("run_out", run_out)):
        if not 5.0 <= value <= 1000.0:
            raise PathError(f"{what} must be 5 to 1000 m, it is {value}")
    first, middle, last = gates
    begin, finish = first.start - run_in, last.end + run_out
    lanes = (
        Gate(start=begin, end=first.end, right=first.right, left=first.left),
        middle,
        Gate(start=last.start, end=finish, right=last.right, left=last.left),
    )
    line = line_through_gates(
        lanes,
        start=(begin, 0.0),
        end=(finish, 0.0),
        clearance=0.5 * car_width + margin,
        easing=easing,
        spacing=spacing,
    )
    return Path.from_line(line, name=name, cones=cones_of(gates))
