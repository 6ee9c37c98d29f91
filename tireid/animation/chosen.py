"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # film
    rate: float = 10.0  # frames a second; a GIF counts in hundredths of a second
    most: int = 120  # frames: what stays small and quick to draw
    hold: int = 12  # frames for which the last picture stays
    dots: int = 150  # an inch
    quality: int = 45  # of a WebP, to 100
    # ground
    # m behind the car, of the path whose mean heading is the direction of view
    look_back: float = 8.0
    look_ahead: float = 22.0  # m ahead of the car, likewise
    level: float = 9.0  # a straight path whose sides are this close [m] is not followed sidewards
    below: float = 0.5  # what covers what, the ground below all
    ghost: float = 2.0  # above the ground, ghosts
    car: float = 3.0  # above them, the car
    above: float = 4.0  # above it, its plan and its forces
    half_road: float = 4.0  # [m]
    grid: float = 5.0  # [m]
    shown: float = 60.0  # of the path, to both sides of the car [m]
    force_length: float = 4.0  # of the arrow that is as long as the static load of the axle [m]
    smallest: float = 0.15  # an arrow that would be shorter is left out [m]
    # scene
    tail: int = 80  # samples
    small: float = 7.0  # points of the text
    many: int = 9  # entries of a legend that one row does not hold
    size: tuple[float, float] = (6.4, 4.0)  # [in]
    behind: float = 12.0  # m of the path that are shown behind the car
    ahead: float = 36.0  # m of the path that are shown ahead of it


CHOSEN = Chosen()
