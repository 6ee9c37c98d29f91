"""The Frozen-Weight Reproducibility Test: does a model with frozen weights give the same forces?

Weights are frozen at an instant and the past and the future of the recording are replayed with
them, and any other recording too. The replay is compared with the true force, where there is
truth, and with what was identified online (which is what the paper compares it with).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identifier.frozen_model import FrozenModel
from identifier.history import History
from models.recordings import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class AxleRmse:
    """Root mean square of a force error [N].

    Parameters
    ----------
    front : front axle.
    rear : rear axle.
    """

    front: float
    rear: float

    @property
    def both(self) -> float:
        """Both axles together: root of the mean square over all samples of both."""
        return float(np.sqrt((self.front**2 + self.rear**2) / 2))


def axle_rms(force: Array, where: NDArray[np.bool_] | None = None) -> AxleRmse:
    """Return the root mean square of axle forces, or of their errors.

    Parameters
    ----------
    force : (n, 2) [N].
    where : samples that count (n,); None counts all.
    """
    kept = force if where is None else force[where]
    with np.errstate(over="ignore", invalid="ignore"):  # a diverged law: infinite
        front, rear = np.sqrt(np.mean(kept**2, axis=0))
    return AxleRmse(front=float(front), rear=float(rear))


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """One recording replayed with frozen weights.

    Parameters
    ----------
    recording : what was replayed.
    axle_force : forces of the frozen model (n, 2) [N].
    against_truth : error against the true force, None without truth.
    against_online : error against the forces that were identified online over the same recording.
    """

    recording: Recording
    axle_force: Array
    against_truth: AxleRmse | None
    against_online: AxleRmse


def replay(model: FrozenModel, online: History) -> Replay:
    """Replay a recording with frozen weights and compare.

    Parameters
    ----------
    model : the frozen model.
    online : a run of the identifier over the recording, the run that the weights come from or
        another; samples below the model's minimum speed do not count.
    """
    recording = online.recording
    force = model.axle_force(recording)
    moving = recording.v_x >= model.min_speed
    truth = recording.axle_force
    return Replay(
        recording=recording,
        axle_force=force,
        against_truth=None if truth is None else axle_rms(force - truth, moving),
        against_online=axle_rms(force - online.axle_force, moving),
    )


def online_error(history: History) -> AxleRmse | None:
    """Return the error of the forces identified online, None without truth.

    Parameters
    ----------
    history : an online run; samples below the design's minimum speed do not count.
    """
    truth = history.recording.axle_force
    if truth is None:
        return None
    moving = history.recording.v_x >= history.design.min_speed
    return axle_rms(history.axle_force - truth, moving)
