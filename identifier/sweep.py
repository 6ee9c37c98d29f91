"""Random designs of every method on the same budget, run over a course in several processes.

A method whose numbers were chosen well beats one whose were not, whatever their merit; so each may
try the same number of designs from the ranges that it names itself.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from identifier.cross_replay import Course, Shares, cross_replay, shares
from identifier.tuned import tunables, tuned_method
from identifier.tuning import Range
from identifier.workers import spread

CHUNK = 10  # designs that a process takes at once


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One random design and how it did.

    Parameters
    ----------
    values : of what was drawn, by name.
    shares : mean errors [%], infinite where it diverged.
    diverged_on : recordings on which it diverged.
    """

    values: Mapping[str, float]
    shares: Shares
    diverged_on: tuple[str, ...]


def random_values(
    ranges: Mapping[str, Range], designs: int, rng: np.random.Generator
) -> list[dict[str, float]]:
    """Draw designs; the first k of a longer sweep are those of a sweep of k.

    Parameters
    ----------
    ranges : by name.
    designs : how many.
    rng : source of randomness.
    """
    return [
        {
            name: span.at(float(share))
            for (name, span), share in zip(ranges.items(), row, strict=True)
        }
        for row in rng.random((designs, len(ranges)))
    ]


def judge(course: Course, seed: int, task: tuple[str, Mapping[str, float]]) -> Candidate:
    """Run one design over the course.

    Parameters
    ----------
    course : car and recordings.
    seed : seed of the initial weights.
    task : name of the method, and values of its tunables.
    """
    name, values = task
    trial = cross_replay(tuned_method(name, course.vehicle, values, seed), course)
    return Candidate(
        values=values, shares=shares(trial, course), diverged_on=tuple(trial.diverged_at)
    )


def sweep(
    names: Sequence[str],
    course: Course,
    *,
    designs: int,
    seed: int,
    workers: int = 2,
    progress: Callable[[str], None] | None = None,
) -> dict[str, tuple[Candidate, ...]]:
    """Try the same number of random designs of each method.

    Parameters
    ----------
    names : of methods.
    course : car and recordings.
    designs : of each method; a method without tunables runs once.
    seed : of the initial weights, and of the draws, which are the same numbers for each method.
    workers : processes; 1 stays in this one.
    progress : told what is being done.
    """
    found: dict[str, tuple[Candidate, ...]] = {}
    with spread(workers, chunk=CHUNK) as spread_map:
        for name in names:
            ranges = tunables(name, course.vehicle)
            rng = np.random.default_rng(seed)
            draws = random_values(ranges, designs if ranges else 1, rng)
            tasks = [(name, values) for values in draws]
            found[name] = tuple(spread_map(partial(judge, course, seed), tasks))
            lost = sum(bool(candidate.diverged_on) for candidate in found[name])
            if progress:
                progress(f"{name}: {len(tasks)} designs, {lost} diverged")
    return found
