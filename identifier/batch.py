"""Many methods over one recording at once: those with the same compiled step share its lanes.

A run has the bits of the same run by `identify`; its error is summed up while it runs.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.history import IMPOSSIBLE_FORCE, DivergedError, carried_index
from identifier.identify import check_sampling
from identifier.method import FrozenModel, Method
from identifier.reproducibility import AxleRmse, counted_samples
from identifier.score import Scores, rmse, run_scored
from models.recordings import Recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchRun:
    """One run of a batch: what is left of a `History` once its samples are summed up.

    Parameters
    ----------
    vehicle : the car the method was told of.
    design : the method that ran.
    online : error of the forces that were identified online [N], not a number where the law
        diverged to none; None without true forces.
    diverged_at : time [s] from which a force is not finite or a hundred times the weight, or None.
    carried : by freeze time, and at the end as infinity, the carried values in effect.
    """

    vehicle: Vehicle
    design: Method
    online: AxleRmse | None
    diverged_at: float | None
    carried: Mapping[float, Mapping[str, Array]]

    def freeze(self, t: float = np.inf) -> FrozenModel:
        """Return the model with the weights in effect at a freeze time, or at the end.

        Parameters
        ----------
        t : one of the freeze times of the batch [s]; infinity is the end.

        Raises
        ------
        DivergedError
            Where the law had diverged by then.
        CannotFreezeError
            Where the method estimates a signal, not a model.
        ValueError
            Where the weights were not kept at that time, or are not finite.
        """
        if t not in self.carried:
            raise ValueError(f"weights were kept at {sorted(self.carried)} s, not at {t:g} s")
        if self.diverged_at is not None and self.diverged_at <= t:
            raise DivergedError(f"the law diverged at {self.diverged_at:g} s, before {t:g} s")
        return self.design.frozen(self.vehicle, self.carried[t])


def identify_batch(
    recording: Recording,
    vehicle: Vehicle | Sequence[Vehicle],
    designs: Sequence[Method],
    *,
    freeze_times: Sequence[float] = (),
    min_speed: float | None = None,
    workers: int | None = None,
) -> tuple[BatchRun, ...]:
    """Run many methods over a recording.

    Parameters
    ----------
    recording : signals, sampled at the designs' interval; its forces only judge.
    vehicle : the car as every method is told of it, or one car for each method.
    designs : methods, in any order; those that differ in numbers only run side by side.
    freeze_times : when carried values are kept, in the recording's own clock [s].
    min_speed : samples below this speed [m/s] do not count in the error; None takes the highest
        min_speed of the designs.
    workers : threads; None takes one for each processor.

    Raises
    ------
    ValueError
        Where the sampling intervals of recording and design differ, the recording begins after a
        freeze time, or there are not as many cars as designs.
    """
    cars = [vehicle] * len(designs) if isinstance(vehicle, Vehicle) else list(vehicle)
    if len(cars) != len(designs):
        raise ValueError(f"{len(designs)} designs need as many vehicles, there are {len(cars)}")
    for design in designs:
        check_sampling(recording, design)
    slowest = max((design.min_speed for design in designs), default=0.0)
    counts = counted_samples(recording, slowest if min_speed is None else min_speed)
    instants = {np.inf: len(recording)} | {t: carried_index(recording, t) for t in freeze_times}
    kept = sorted(set(instants.values()) - {len(recording)})
    setups = [design.setup(car, recording) for design, car in zip(designs, cars, strict=True)]
    groups: dict[Scan, list[int]] = defaultdict(list)
    for i, setup in enumerate(setups):
        groups[setup.scan].append(i)
    runs: dict[int, BatchRun] = {}
    for scan, members in groups.items():
        scores = run_scored(
            scan,
            [{**setups[i].carry, **setups[i].constants} for i in members],
            recording,
            impossible=[IMPOSSIBLE_FORCE * cars[i].weight for i in members],
            counts=counts,
            keep=kept,
            workers=workers,
        )
        for row, i in enumerate(members):
            sane = int(scores.sane_samples[row])
            runs[i] = BatchRun(
                vehicle=cars[i],
                design=designs[i],
                online=None if recording.axle_force is None else rmse(scores.squares[row]),
                diverged_at=None if sane == len(recording) else float(recording.t[sane]),
                carried={
                    t: _carried(scores, scan.carry, row, kept.index(k) if k in kept else None)
                    for t, k in instants.items()
                },
            )
    return tuple(runs[i] for i in range(len(designs)))


def _carried(
    scores: Scores, ports: tuple[str, ...], row: int, place: int | None
) -> dict[str, Array]:
    """Carried values of one run at one of the kept samples; None: after the last."""
    if place is None:
        return {port: scores.record[f"{port}_final"][row] for port in ports}
    return {port: scores.record[port][row, place] for port in ports}
