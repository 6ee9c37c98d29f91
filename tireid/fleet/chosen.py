"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # learn
    # logs that a process takes at most at once, and whose rows are written at once
    together: int = 8
    portions: int = 16  # that few logs are shared into
    part: float = 300.0  # s of a log whose information is kept as one
    dt: float = 0.01  # s, to which logs are brought
    # merge
    rounds: int = 3  # over the rows
    passes: int = 60  # of expectation and maximization
    worth: float = 2.0  # cars that the identifier's prior counts as
    apart: float = 0.1  # their standard deviation, of that of their prior
    # store
    buckets: int = 16  # files that the rows of cars are shared into
    batch: int = 512  # rows that are read at once
    small: int = 1 << 22  # bytes of a file that is fetched as one
    bytes_at_once: int = 1 << 26  # bytes of what pends that are sorted at once
    files_at_once: int = 1000  # files of what pends that are sorted at once
    # watch
    least: float = 600.0  # s of driving that an alarm takes at least
    shortest: float = 5.0  # s of learning, below which a part says nothing
    floor: float = 0.01  # standard deviation of ln C that roads make at least
    floor_friction: float = 0.05  # and of ln μ
    scatter_parts: float = 10.0  # parts that the fleet's scatter counts as
    # standard deviation of normal errors over their median absolute deviation
    normal: float = 1.4826
    largest: float = 0.5  # standard deviation of ln C and ln μ that is believed before


CHOSEN = Chosen()
