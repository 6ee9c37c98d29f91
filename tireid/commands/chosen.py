"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # channels
    # that are read for ranges; of a larger log only those of likely channels
    most_numbers: float = 5e7
    longest_name: int = 48  # letters of a channel in the table
    # demo_story
    speed: float = 20.0  # m/s
    freeze: float = 30.0  # s, the end of the first drive


CHOSEN = Chosen()
