"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # package
    steps: int = 200
    speed: float = 20.0  # m/s
    heavier: float = 1.08  # mass of the car that is driven, over that of the prediction
    lateral: float = 4.0  # m/s^2, peak of what the path asks for
    lane_change: float = 1.5  # s
    digits: int = 9
    off_path: int = 120  # steps with faults of the sensors
    off_map: int = 140
    slow: int = 10  # steps before the end, the road ahead wants a halt at one place
    # Largest differences of the steering that the self-test allows [rad]. In double compilers
    # differ by nothing; float solves each problem to a tolerance of its own.
    tolerance_double: float = 1e-9
    tolerance_single: float = 1e-3


CHOSEN = Chosen()
