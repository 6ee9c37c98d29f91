"""Random designs of every method on the same budget, run over a course in several processes.

A method whose numbers were chosen well beats one whose were not, whatever their merit; so each may
try the same number of designs from the ranges that it names itself.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from identifier.compare.batch import cross_replay_batch
from identifier.compare.course import Course, Shares, shares
from identifier.compare.tunables import tunables, tuned_method
from identifier.compare.work import Map, Store, content_digest, run_resumably, spread
from identifier.tuning import Range

CHUNK = 64  # designs that a process takes at once: their runs fill the lanes of a few registers
QUIET = 5.0  # s between words about a method


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One random design and how it did.

    Parameters
    ----------
    shares : mean errors [%], infinite where it diverged.
    """

    values: Mapping[str, float]
    shares: Shares
    diverged_on: tuple[str, ...]


def random_values(
    ranges: Mapping[str, Range], designs: int, rng: np.random.Generator
) -> list[dict[str, float]]:
    """Draw designs; the first k of a longer sweep are those of a sweep of k."""
    return [
        {
            name: span.at(float(share))
            for (name, span), share in zip(ranges.items(), row, strict=True)
        }
        for row in rng.random((designs, len(ranges)))
    ]


def judge(
    course: Course, seed: int, task: tuple[str, Sequence[Mapping[str, float]]]
) -> tuple[Candidate, ...]:
    """Run designs of one method over the course, side by side."""
    name, draws = task
    methods = [tuned_method(name, course.vehicle, values, seed) for values in draws]
    return tuple(
        Candidate(values=values, shares=shares(trial, course), diverged_on=tuple(trial.diverged_at))
        for values, trial in zip(draws, cross_replay_batch(methods, course, workers=1), strict=True)
    )


def sweep(
    names: Sequence[str],
    course: Course,
    *,
    designs: int,
    seed: int,
    workers: int = 2,
    progress: Callable[[str], None] | None = None,
    note: Callable[[str], None] | None = None,
    elsewhere: Map | None = None,
    folder: Path | None = None,
) -> dict[str, tuple[Candidate, ...]]:
    """Try the same number of random designs of each method.

    Parameters
    ----------
    designs : of each method; a method without tunables runs once.
    workers : processes; 1 stays in this one.
    note : told how far one has come, now and then; None tells it to `progress`.
    elsewhere : does the work in place of processes of this machine, as a cluster's map does; its
        results may come in any order.
    folder : where results are kept, so that a sweep that was stopped goes on; None keeps none.
    """
    found: dict[str, tuple[Candidate, ...]] = {}
    noted = note or progress
    with nullcontext(elsewhere) if elsewhere else spread(workers) as spread_map:
        for name in names:
            ranges = tunables(name, course.vehicle)
            rng = np.random.default_rng(seed)
            draws = random_values(ranges, designs if ranges else 1, rng)
            chunks = run_resumably(
                partial(judge, course, seed),
                [(name, draws[i : i + CHUNK]) for i in range(0, len(draws), CHUNK)],
                spread_map,
                store=None if folder is None else _store(folder, course, seed),
                done=noted and _counter(name, len(draws), noted),
            )
            found[name] = tuple(candidate for chunk in chunks for candidate in chunk)
            lost = sum(bool(candidate.diverged_on) for candidate in found[name])
            if progress:
                progress(f"{name}: {len(draws)} designs, {lost} diverged")
    return found


def _counter(
    name: str, designs: int, progress: Callable[[str], None]
) -> Callable[[int, int], None]:
    """Return who is told of chunks and says so now and then."""
    last, reported_earlier = time.monotonic(), False

    def count(earlier: int, ready: int) -> None:
        nonlocal last, reported_earlier
        if earlier and not reported_earlier:
            reported_earlier = True
            found = min(earlier * CHUNK, designs)
            progress(f"{name}: {found} of {designs} designs were judged by an earlier run")
        elif time.monotonic() - last > QUIET and ready * CHUNK < designs:
            last = time.monotonic()
            progress(f"{name}: {ready * CHUNK} of {designs} designs")

    return count


def _store(folder: Path, course: Course, seed: int) -> Store:
    """Return the store of `judge`, whose results follow from the course, the seed and the task."""
    arrays = [
        array
        for rec in course.recordings
        for array in (rec.t, rec.x, rec.u, rec.v_x, rec.axle_force)
    ]
    names = [rec.name for rec in course.recordings]
    setting = content_digest(course.vehicle, course.min_speed, seed, names, *arrays)
    return Store(
        folder=folder,
        name=lambda task: content_digest(setting, task),
        to_json=lambda candidates: [asdict(candidate) for candidate in candidates],
        from_json=lambda rows: tuple(
            Candidate(
                values=row["values"],
                shares=Shares(*row["shares"]),
                diverged_on=tuple(row["diverged_on"]),
            )
            for row in rows
        ),
    )


# Which designs of a sweep are worth having: the Pareto front of frozen against online error.


def pareto_front(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the designs that none beats both online and frozen, by rising online error.

    The frozen error is that on other recordings, or where learnt if there is only one; designs
    that diverged, and those of methods that cannot be frozen, are never on it.
    """
    front: list[Candidate] = []
    sane = [c for c in candidates if not c.diverged_on and frozen_share(c.shares) is not None]
    for candidate in sorted(sane, key=lambda c: (c.shares.online, frozen_share(c.shares) or 0.0)):
        error = frozen_share(candidate.shares)
        best = frozen_share(front[-1].shares) if front else None
        assert error is not None
        if best is None or error < best:
            front.append(candidate)
    return front


def best_candidate(candidates: Sequence[Candidate]) -> Candidate | None:
    """Return the design with the smallest frozen error, online error where nothing is frozen.

    Returns
    -------
    None where every design diverged.
    """

    def error(candidate: Candidate) -> float:
        frozen = frozen_share(candidate.shares)
        return candidate.shares.online if frozen is None else frozen

    sane = [candidate for candidate in candidates if not candidate.diverged_on]
    return min(sane, key=error, default=None)


def frozen_share(found: Shares) -> float | None:
    """Return the frozen error on other recordings, or where learnt if there is only one [%]."""
    return found.in_sample if found.other is None else found.other
