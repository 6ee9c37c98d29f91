"""`cross_replay` of many methods at once."""

from collections.abc import Sequence

import numpy as np

from identifier.batch import identify_batch
from identifier.batch_replay import replay_batch
from identifier.cross_replay import INFINITE, Course, Trial
from identifier.method import CannotFreezeError, FrozenModel, Method
from identifier.reproducibility import AxleRmse, counted_samples


def cross_replay_batch(
    methods: Sequence[Method], course: Course, *, workers: int | None = None
) -> tuple[Trial, ...]:
    """Let each method learn on each recording afresh, freeze at its end and replay on all.

    Parameters
    ----------
    methods : in any order; those of one structure share the lanes of one compiled loop.
    course : car and recordings.
    workers : threads; None takes one for each processor.
    """
    online: list[dict[str, AxleRmse]] = [{} for _ in methods]
    diverged_at: list[dict[str, float]] = [{} for _ in methods]
    freezes = [True] * len(methods)
    models: dict[tuple[int, str], FrozenModel] = {}
    for learnt in course.recordings:
        runs = identify_batch(
            learnt, course.vehicle, methods, min_speed=course.min_speed, workers=workers
        )
        for i, run in enumerate(runs):
            assert run.online is not None  # a course has true forces
            online[i][learnt.name] = _finite(run.online)
            time = run.diverged_at
            try:
                if time is None:
                    models[i, learnt.name] = run.freeze()
            except CannotFreezeError:
                freezes[i] = False
            except ValueError:  # the last update left weights that are not finite
                time = float(learnt.t[-1])
            if time is not None:
                diverged_at[i][learnt.name] = time
    frozen: list[dict[str, dict[str, AxleRmse]]] = [{} for _ in methods]
    for target in course.recordings:
        counts = counted_samples(target, course.min_speed)
        errors = replay_batch(target, [*models.values()], counts=counts, workers=workers)
        for (i, name), error in zip(models, errors, strict=True):
            frozen[i].setdefault(name, {})[target.name] = _finite(error)
    return tuple(
        Trial(online=o, frozen=f if can else None, diverged_at=d)
        for o, f, can, d in zip(online, frozen, freezes, diverged_at, strict=True)
    )


def _finite(error: AxleRmse) -> AxleRmse:
    return error if np.isfinite([error.front, error.rear]).all() else INFINITE
