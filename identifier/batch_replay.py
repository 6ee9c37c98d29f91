"""Many frozen models over one recording at once, as `identify_batch` runs many methods."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.method import FrozenModel, Setup
from identifier.reproducibility import AxleRmse, axle_rms
from identifier.score import rmse, run_scored
from models.recordings import Recording


@runtime_checkable
class Replayable(Protocol):
    """A frozen model that runs as a compiled step does."""

    def setup(self, recording: Recording) -> Setup:
        """Return what a replay needs.

        Parameters
        ----------
        recording : what is replayed.
        """


def replay_batch(
    recording: Recording,
    models: Sequence[FrozenModel],
    *,
    counts: NDArray[np.bool_],
    workers: int | None = None,
) -> tuple[AxleRmse, ...]:
    """Return the error of each frozen model over a recording [N].

    Parameters
    ----------
    recording : with true forces.
    models : in any order; those that are not `Replayable` run one at a time.
    counts : samples that count (n,).
    workers : threads; None takes one for each processor.

    Raises
    ------
    ValueError
        Where the recording has no true forces.
    """
    if recording.axle_force is None:
        raise ValueError(f"{recording.name} has no true forces to compare a replay with")
    found: dict[int, AxleRmse] = {}
    groups: dict[Scan, dict[int, Setup]] = defaultdict(dict)
    for i, model in enumerate(models):
        if isinstance(model, Replayable):
            setup = model.setup(recording)
            groups[setup.scan][i] = setup
        else:
            found[i] = axle_rms(model.axle_force(recording) - recording.axle_force, counts)
    for scan, setups in groups.items():
        scores = run_scored(
            scan,
            [{**setup.carry, **setup.constants} for setup in setups.values()],
            recording,
            impossible=[np.inf] * len(setups),
            counts=counts,
            workers=workers,
        )
        found |= dict(zip(setups, map(rmse, scores.squares), strict=True))
    return tuple(found[i] for i in range(len(models)))
