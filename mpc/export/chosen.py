"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # package
    steps: int = 200  # of the drive of the self-test
    speed: float = 20.0  # m/s
    heavier: float = 1.08  # mass of the car that is driven, over that of the prediction
    lateral: float = 4.0  # m/s^2, peak of what the path asks for
    lane_change: float = 1.5  # s
    digits: int = 9  # of its numbers
    off_path: int = 120  # step at which sensors show a car off the path
    off_map: int = 140  # step at which they show a motion beyond the limits
    slow: int = 10  # steps before the end, the road ahead wants a halt at one place
    # rad, largest difference of the steering that the self-test allows: in double compilers differ
    # by nothing
    tolerance_double: float = 1e-9
    # rad, likewise: float solves each problem to a tolerance of its own
    tolerance_single: float = 1e-3


CHOSEN = Chosen()
