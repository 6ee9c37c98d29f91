"""What `tireid compare` finds out: every method on every recording, and its time."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from identifier.compare.course import Course, Shares, Trial, cross_replay, shares, step_times
from identifier.methods import REFERENCE, make_method
from identifier.run import History
from models.recordings import Recording
from models.vehicle import Vehicle


class Comparison(NamedTuple):
    """Methods side by side.
    step_times : by method, time of one compiled step [s]; REFERENCE is always among them, a method
        that learns from whole logs never.
    """

    course: Course
    seed: int
    trials: Mapping[str, Trial]
    step_times: Mapping[str, float]
    left_out: Mapping[str, str]

    @property
    def names(self) -> list[str]:
        return [recording.name for recording in self.course.recordings]

    def shares(self, method: str) -> Shares:
        """Return the mean errors of a method over the recordings [%]."""
        return shares(self.trials[method], self.course)

    def time_ratio(self, method: str) -> float:
        """Return the time of a step over that of the paper's law."""
        return self.step_times[method] / self.step_times[REFERENCE]


def cannot_learn(
    names: Sequence[str], vehicle: Vehicle, recordings: Sequence[Recording]
) -> dict[str, str]:
    """Return by method why it cannot learn on all of the recordings; without those that can."""
    lacking = [recording.name for recording in recordings if recording.a_y is None]
    why = f"left out, it learns from ay and {', '.join(lacking)} has none"
    return {name: why for name in names if lacking and "a_y" in make_method(name, vehicle).needs}


def run_comparison(
    names: Sequence[str],
    vehicle: Vehicle,
    recordings: Sequence[Recording],
    *,
    seed: int,
    progress: Callable[[str], None],
    left_out: Mapping[str, str],
    seen: Callable[[str, History], None] | None = None,
) -> Comparison:
    """Run every method over every recording.
    recordings : with true forces, or judged by the motion.
    seen : called with each method's name and run.
    """
    methods = {name: make_method(name, vehicle, seed) for name in names}
    slowest = max(method.min_speed for method in methods.values())
    course = Course(vehicle=vehicle, recordings=tuple(recordings), min_speed=slowest)
    trials = {}
    for name, method in methods.items():
        trials[name] = cross_replay(method, course, None if seen is None else partial(seen, name))
        lost = "".join(f", diverged on {rec}" for rec in trials[name].diverged_at)
        progress(f"{name}: identified on {len(recordings)} recordings, replayed on all{lost}")
    timed = {REFERENCE: make_method(REFERENCE, vehicle, seed)} | methods
    return Comparison(
        course=course,
        seed=seed,
        trials=trials,
        step_times=step_times(timed, vehicle, max(recordings, key=len)),
        left_out=left_out,
    )


def ranking(comparison: Comparison) -> list[str]:
    """Return the methods, smallest frozen error elsewhere first; those that cannot freeze last."""

    def key(name: str) -> tuple[bool, float]:
        found = comparison.shares(name)
        error = found.in_sample if found.other is None else found.other
        return (error is None, found.online if error is None else error)

    return sorted(comparison.trials, key=key)
