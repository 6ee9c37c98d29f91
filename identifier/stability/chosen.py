"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # checks
    enough_gain: float = 2.0  # times the gains of learning that the loop bears
    enough_phase: float = 30.0  # deg, of the phase margin
    enough_damping: float = 0.2  # [-], of the poles
    largest_step: float = 0.2  # fastest pole times dt that Euler resolves well
    # margins
    largest_factor: float = 1e6  # of gains at which a margin is looked for, either way
    at_once: int = 150  # points of a grid whose eigenvalues are found together


CHOSEN = Chosen()
