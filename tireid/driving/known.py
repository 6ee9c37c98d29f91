"""What was known of the tires at every moment of a drive.

The tracker steers by the weights that it was handed; what the identifier has learnt by now runs
ahead of them, until the supervisor hands it over.
"""

from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.method import CannotFreezeError
from identifier.run import DivergedError
from mpc.handover.learner import Learner
from mpc.loop.sensing import Measured
from mpc.tires import PredictionTire, prediction_tire

_EVERY = 8  # samples between two looks


class Known(NamedTuple):
    """What was known from a time [s] on.

    steering : weights that the tracker steers by.   learnt : weights that were learnt by then.
    slip : up to which these are known [rad], (2,).
    """

    t: float
    steering: Array
    learnt: Array
    slip: Array


class Witness:
    """Stands between a drive and what learns, and keeps what was known.

    Attributes: known, in the order of time.

    Parameters
    ----------
    learner : which is asked, as if nobody stood between.
    period : of the samples [s].
    """

    def __init__(self, learner: Learner, period: float) -> None:
        self.known: list[Known] = []
        self._learner, self._period, self._samples = learner, period, 0

    def observe(self, measured: Measured, tracker: Any) -> str | None:
        """Ask the learner; return what it said."""
        said = self._learner.observe(measured, tracker)
        if self._samples % _EVERY == 0:
            self.known.append(self._seen(tracker.tire))
        self._samples += 1
        return said

    def _seen(self, steering: PredictionTire) -> Known:
        try:
            model = self._learner.supervisor.identifier.model()
        except (DivergedError, CannotFreezeError, ValueError):  # as the supervisor: no model now
            learnt, slip = np.full_like(steering.weights, np.nan), np.zeros(2)
        else:
            slip = np.full(2, np.nan) if model.known_slip is None else model.known_slip
            learnt = prediction_tire(model).weights
        return Known(self._samples * self._period, steering.weights.copy(), learnt, slip)
