"""Many methods over one recording at once: those with the same compiled step share its lanes.

A run has the bits of the same run by `identify`; its error is summed up while it runs.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from codegen.arrays import Array
from identifier.compare.course import (
    INFINITE,
    Course,
    Scores,
    Trial,
    rmse,
    run_scored,
    shown_to,
)
from identifier.method import CannotFreezeError, Method
from identifier.reproducibility import AxleRmse, counted_samples
from identifier.run import IMPOSSIBLE_FORCE, DivergedError, check_recording, state_index
from identifier.setup import Setup
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.vehicle import Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchRun:
    """One run of a batch: what is left of a `History` once its samples are summed up.

    Parameters
    ----------
    online : error of the forces that were identified online [N], not a number where the law
        diverged to none; None without true forces.
    diverged_at : time [s] from which a force is not finite or a hundred times the weight, or None.
    state : by freeze time, and at the end as infinity, the carried values in effect.
    """

    vehicle: Vehicle
    design: Method
    online: AxleRmse | None
    diverged_at: float | None
    state: Mapping[float, Mapping[str, Array]]

    def freeze(self, t: float = np.inf) -> TireModel:
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
        if t not in self.state:
            raise ValueError(f"weights were kept at {sorted(self.state)} s, not at {t:g} s")
        if self.diverged_at is not None and self.diverged_at <= t:
            raise DivergedError(f"the law diverged at {self.diverged_at:g} s, before {t:g} s")
        return self.design.frozen(self.vehicle, self.state[t])


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
        check_recording(recording, design)
    slowest = max((design.min_speed for design in designs), default=0.0)
    counts = counted_samples(recording, slowest if min_speed is None else min_speed)
    instants = {np.inf: len(recording)} | {t: state_index(recording, t) for t in freeze_times}
    kept = sorted(set(instants.values()) - {len(recording)})
    setups = [design.setup(car) for design, car in zip(designs, cars, strict=True)]
    groups: dict[Scan, list[int]] = defaultdict(list)
    for i, setup in enumerate(setups):
        groups[setup.scan].append(i)
    runs: dict[int, BatchRun] = {}
    for scan, members in groups.items():
        scores = run_scored(
            scan,
            [{**setups[i].begun(recording), **setups[i].constants} for i in members],
            recording,
            impossible=[IMPOSSIBLE_FORCE * cars[i].weight for i in members],
            counts=counts,
            keep=kept,
            rest=max(setups[i].rest for i in members),
            workers=workers,
        )
        for row, i in enumerate(members):
            sane = int(scores.sane_samples[row])
            runs[i] = BatchRun(
                vehicle=cars[i],
                design=designs[i],
                online=None if recording.axle_force is None else rmse(scores.squares[row]),
                diverged_at=None if sane == len(recording) else float(recording.t[sane]),
                state={
                    t: _state(scores, scan.carry, row, kept.index(k) if k in kept else None)
                    for t, k in instants.items()
                },
            )
    return tuple(runs[i] for i in range(len(designs)))


def _state(scores: Scores, ports: tuple[str, ...], row: int, place: int | None) -> dict[str, Array]:
    """Carried values of one run at one of the kept samples; None: after the last."""
    if place is None:
        return {port: scores.record[f"{port}_final"][row] for port in ports}
    return {port: scores.record[port][row, place] for port in ports}


# Many frozen models over one recording at once, as `identify_batch` runs many methods.


def replay_batch(
    recording: Recording,
    models: Sequence[TireModel],
    *,
    counts: NDArray[np.bool_],
    workers: int | None = None,
) -> tuple[AxleRmse, ...]:
    """Return the error of each frozen model over a recording [N].

    Parameters
    ----------
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
        setup = model.setup(recording.dt)
        groups[setup.scan][i] = setup
    for scan, setups in groups.items():
        scores = run_scored(
            scan,
            [{**setup.carry, **setup.constants} for setup in setups.values()],
            recording,
            impossible=[np.inf] * len(setups),
            counts=counts,
            rest=max(setup.rest for setup in setups.values()),
            workers=workers,
        )
        found |= dict(zip(setups, map(rmse, scores.squares), strict=True))
    return tuple(found[i] for i in range(len(models)))


# `cross_replay` of many methods at once.


def cross_replay_batch(
    methods: Sequence[Method], course: Course, *, workers: int | None = None
) -> tuple[Trial, ...]:
    """Let each method learn on each recording afresh, freeze at its end and replay on all.

    Parameters
    ----------
    methods : in any order; those of one structure share the lanes of one compiled loop.
    workers : threads; None takes one for each processor.
    """
    online: list[dict[str, AxleRmse]] = [{} for _ in methods]
    diverged_at: list[dict[str, float]] = [{} for _ in methods]
    freezes = [True] * len(methods)
    models: dict[tuple[int, str], TireModel] = {}
    for learnt in course.recordings:
        for i, run in _learnt_on(learnt, course, methods, workers):
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


def _learnt_on(
    recording: Recording, course: Course, methods: Sequence[Method], workers: int | None
) -> Iterator[tuple[int, BatchRun]]:
    """Yield by number of the method its run over what a comparison shows it of a recording."""
    for reads in (True, False):
        some = {i: method for i, method in enumerate(methods) if method.needs_v_y == reads}
        if some:
            runs = identify_batch(
                shown_to(next(iter(some.values())), recording),
                course.vehicle,
                list(some.values()),
                min_speed=course.min_speed,
                workers=workers,
            )
            yield from zip(some, runs, strict=True)


def _finite(error: AxleRmse) -> AxleRmse:
    return error if np.isfinite([error.front, error.rear]).all() else INFINITE
