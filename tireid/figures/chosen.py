"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # compare
    compare_farthest: float = 300.0  # [%], what is worse is drawn at the end of the axis
    row: float = 0.3  # height of a method [in]
    # drive
    # dashes of tires as they are at the end of a drive [points]
    later: tuple[int, tuple[float, float]] = (0, (2.5, 0.9))
    near: float = 0.75  # a limit is drawn where a command comes this close to it
    front_overhang: float = 0.32  # of the wheelbase, beyond the front axle
    rear_overhang: float = 0.36  # of the wheelbase, beyond the rear axle
    track: float = 0.57  # of the wheelbase, where no chassis says
    body_beside_track: float = 0.1  # of the wheelbase: how much wider than the track the body is
    wheel_length: float = 0.24  # of the wheelbase
    wheel_width: float = 0.085  # of the wheelbase
    corners: int = 33  # points of the body
    rounding: float = 0.3  # of its corners: exponent of a circle that becomes a rectangle
    # a long and narrow path goes on in the next row after about this many meters
    row_length: float = 80.0
    most_rows: int = 5  # of a path
    narrow: float = 4.0  # from this ratio between its extents on a path is long and narrow
    margin: float = 3.0  # around the path [m]
    run_up: float = 16.0  # of the straights before and after the cones that is shown [m]
    highest: float = 5.0  # panel [in]
    cars_every: float = 2.6  # wheelbases between two outlines
    # paper
    paper_wide: float = 20.0  # from this ratio between what is drawn on, the axis is logarithmic
    offset: float = 0.2  # between neighboring laws, as a share of the distance of columns
    # side_slip
    most: int = 4  # recordings that are drawn
    columns: int = 5  # entries of a row of the legend
    beyond: float = 1.6  # times what was recorded, or estimated first: an axis reaches no farther
    # style
    page: float = 7.16  # width of both columns of a paper [in]
    resolution: int = 200  # [dots per inch]
    clouds: int = 130  # dots per inch of what is pixels in a drawing
    # s: of a clock that begins later, as a Unix time does, only the last digits are shown
    far: float = 1e5
    digits_shown: float = 100.0  # s
    # an axis reaches at most this many times beyond the force it is compared with
    style_farthest: float = 3.0


CHOSEN = Chosen()
