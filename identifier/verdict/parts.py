"""What of a run is evaluated: a portion of its drive, and parts of it, each left out once."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.run import History, learn, state_index
from identifier.tire_model import TireModel
from identifier.verdict.motion import Evidence
from models.recordings import Recording
from models.recordings.portion import Portion, portion

PARTS = 4  # of the drive, each of which is left out once
_Teach = Callable[[Recording], TireModel]


class _EvaluatedRun(NamedTuple):
    """A run whose frozen model is asked about a portion of its drive, k samples.

    model : frozen.   history : the run.   portion : of its recording.   end : time of the freeze
    in the recording's own clock [s].   until : the same in that of the portion, None at its end.
    road : what a banked road pushed (k,) [weights], None unknown.
    """

    model: TireModel
    history: History
    portion: Portion
    end: float
    until: float | None
    road: Array | None

    def taught(self, recording: Recording) -> TireModel:
        """Return what the run's method learns of another drive until the freeze."""
        run = self.history
        return learn(recording, run.vehicle, run.method, run.start, self.until)


def evaluated_run(history: History, t: float | None = None) -> _EvaluatedRun:
    """Return what of a run is part.
    t : time of the freeze in the recording's own clock [s]; None is the end.
    """
    model, whole = history.freeze(t), history.recording
    end = float(whole.t[-1]) if t is None else t
    frozen = state_index(whole, end)
    part = portion(whole, frozen)
    n = part.place(frozen)
    until = None if n == len(part.recording) else float(part.recording.t[n])
    roads = _felt.setdefault(history, {})
    if frozen not in roads:
        roads[frozen] = _road_felt(history, part)
    return _EvaluatedRun(model, history, part, end, until, roads[frozen])


# What is felt takes as long as learning: it is found once of each run and sample of the freeze.
_felt: WeakKeyDictionary[History, dict[int, Array | None]] = WeakKeyDictionary()


def _road_felt(history: History, part: Portion) -> Array | None:
    """Return what a banked road pushed over a portion of a run (k,) [weights]; None unknown."""
    method = history.method
    without = part.recording.logged_v_y is None
    if method.accelerometer is None or ("v_y" in method.needs) == without:
        return None  # it was learnt of another motion than that which is asked
    pushes = []
    for block in history.blocks(part.samples):
        first, last = np.searchsorted(part.samples, [block.part.start, block.part.stop])
        mine = part.samples[first:last] - block.part.start
        pushes.append(method.accelerometer.beside_force(block.state)[mine])
    return np.concatenate(pushes)


def taught_elsewhere(
    teach: _Teach, recording: Recording, found: Evidence
) -> Iterator[tuple[NDArray[np.bool_], TireModel | None]]:
    """Yield which windows are left out (m,), and the model taught without them; None: none came.

    The parts follow one another and hold equal shares of the force (squared); in the one that is
    left out the car is made to stand, so that learning rests. There is none where there is no
    force.
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
