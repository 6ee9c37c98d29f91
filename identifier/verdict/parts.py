"""A drive in parts, and what a model makes of each that was taught without it."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identifier.tire_model import TireModel
from identifier.verdict.motion import Evidence
from models.recordings import Recording

PARTS = 4  # of the drive, each of which is left out once
Teach = Callable[[Recording], TireModel]


def taught_elsewhere(
    teach: Teach, recording: Recording, found: Evidence
) -> Iterator[tuple[NDArray[np.bool_], TireModel | None]]:
    """Yield which windows are left out (m,), and the model taught without them; None: none came.

    The parts follow one another and hold equal shares of the force (squared); in the one that is
    left out the car is made to stand, so that learning rests. There is none where there is no
    force.

    Parameters
    ----------
    teach : returns the model that a drive teaches.
    recording : the drive.
    found : evidence of it.
    """
    windows = found.windows
    power = np.cumsum(np.sum(found.measured**2, axis=1))
    if not power[-1] > 0.0:
        return
    part = np.minimum((PARTS * power / power[-1]).astype(np.intp), PARTS - 1)
    for k in range(PARTS):
        mine = part == k
        if not mine.any():
            continue
        starts, halt = windows.starts[mine], np.array(recording.v_x)
        halt[starts[0] : starts[-1] + windows.n + 1] = 0.0
        try:
            model = teach(replace(recording, v_x=halt))
        except (ArithmeticError, ValueError):
            model = None
        yield mine, model
