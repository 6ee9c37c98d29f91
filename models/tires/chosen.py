"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # forces
    # 1 + κ of a locked wheel: slides in the same direction, divides by no zero
    rolling_floor: float = 1e-3
    cosine_floor: float = 1e-3  # |cos α| of a wheel that moves sideways
    # N; rounds the root of a sum of squares at zero, so that its derivative exists
    no_force: float = 1e-6
    # tir
    largest: float = 1e12  # of a number, in the unit of the file: a stiffness in N/km fits
    some: int = 10  # lines in a message
    # MF-Tyre up to 5.2 under its several numbers; 60 and above is 6.x
    fittyps: tuple[int, ...] = (5, 6, 21, 51, 52)
    pky4_of_52: float = 2.0  # PKY4, as MF-Tyre 5.2 has it fixed


CHOSEN = Chosen()
