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
    # plan
    period: float = 0.01  # s, of steering.csv
    run_up: float = 1.0  # s straight ahead, before each pass
    pull: float = 3.0  # m/s², of a car that comes to speed, and of one that stops


CHOSEN = Chosen()
