"""What `tireid compare` finds out: every method on every recording, its time, its sweep."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from codegen import cache_folder
from identifier.compare.course import Course, Shares, Trial, cross_replay, shares, step_times
from identifier.compare.floors import FLOOR_OF, STRUCTURES, fit_floors
from identifier.compare.sweep import Candidate, frozen_share, sweep
from identifier.compare.work import Map
from identifier.method import Method
from identifier.methods import REFERENCE, make_method
from identifier.reproducibility import AxleRmse
from models.recordings import Recording
from models.vehicle import Vehicle

Frozen = Mapping[str, Mapping[str, AxleRmse]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Methods side by side.

    Parameters
    ----------
    trials : by method, its errors with the numbers that follow from the vehicle.
    floors : by structure of the network, errors of its offline fit to the true forces of one
        recording, on every recording.
    step_times : by method, time of one compiled step [s]; REFERENCE is always among them.
    sweeps : by method, its random designs; empty without a sweep.
    """

    course: Course
    seed: int
    trials: Mapping[str, Trial]
    floors: Mapping[str, Frozen]
    step_times: Mapping[str, float]
    sweeps: Mapping[str, tuple[Candidate, ...]]
    left_out: Mapping[str, str] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """Names of the recordings."""
        return [recording.name for recording in self.course.recordings]

    def shares(self, method: str) -> Shares:
        """Return the mean errors of a method over the recordings [%]."""
        return shares(self.trials[method], self.course)

    def time_ratio(self, method: str) -> float:
        """Return the time of a step over that of the paper's law."""
        return self.step_times[method] / self.step_times[REFERENCE]


# About how long the steps of a comparison take, beside learning and replaying with one method on
# one recording: what is left of it is told by these.

FIT, NETWORK_FIT, DESIGN = 2.0, 60.0, 1.0  # each start of a fit, of the network's; each design


def step_lengths(
    names: Sequence[str], recordings: int, *, designs: int, starts: int, others: int = 0
) -> list[float]:
    """Return how long each step that `run_comparison` tells of takes beside the others."""
    lengths = [float(recordings)] * (len(names) + others)
    if starts:
        wanted = {FLOOR_OF[name] for name in names if name in FLOOR_OF}
        for structure in (one for one in STRUCTURES if one in wanted):
            lengths += [
                starts * (NETWORK_FIT if structure == FLOOR_OF[REFERENCE] else FIT)
            ] * recordings
    if designs:
        lengths += [0.0, *[DESIGN * designs * recordings] * len(names)]
    return lengths


def cannot_learn(
    names: Sequence[str], vehicle: Vehicle, recordings: Sequence[Recording]
) -> dict[str, str]:
    """Return by method why it cannot learn on all of the recordings; without those that can."""
    lacking = [recording.name for recording in recordings if recording.a_y is None]
    why = f"left out, it learns from ay and {', '.join(lacking)} has none"
    return {name: why for name in names if lacking and make_method(name, vehicle).needs_a_y}


def run_comparison(
    names: Sequence[str],
    vehicle: Vehicle,
    recordings: Sequence[Recording],
    *,
    seed: int,
    designs: int,
    starts: int,
    workers: int,
    progress: Callable[[str], None],
    note: Callable[[str], None] | None = None,
    elsewhere: Map | None = None,
    others: Mapping[str, Method] | None = None,
    left_out: Mapping[str, str] | None = None,
) -> Comparison:
    """Run every method over every recording.

    Parameters
    ----------
    recordings : with true forces, or judged by the motion, without sweep and floors.
    designs : random designs of each method; 0 leaves the sweep out.
    starts : of each offline fit to the true forces; 0 leaves the floors out.
    progress : told of each step that is done, of `step_lengths` many.
    note : told how far a sweep has come, now and then; None tells it to `progress`.
    elsewhere : does the sweep in place of processes of this machine, as a cluster's map does.
    others : further methods by name, which have neither sweep nor floor.

    Raises
    ------
    ValueError
        Where a method is unknown, a sweep or floors lack true forces, or the recordings cannot be
        compared on; a RecordingError where one cannot learn on them, as `cannot_learn` tells.
    """
    methods: dict[str, Method] = {name: make_method(name, vehicle, seed) for name in names}
    methods |= others or {}
    slowest = max(method.min_speed for method in methods.values())
    course = Course(vehicle=vehicle, recordings=tuple(recordings), min_speed=slowest)
    if course.by_motion and (designs or starts):
        raise ValueError("sweeps and floors are fitted to the true forces Fyf, Fyr of every log")
    trials = {}
    for name, method in methods.items():
        trials[name] = cross_replay(method, course)
        lost = "".join(f", diverged on {rec}" for rec in trials[name].diverged_at)
        progress(f"{name}: learnt on {len(recordings)} recordings, replayed on all{lost}")
    floors: Mapping[str, Frozen] = {}
    if starts:
        floors = fit_floors(
            names, course, starts=starts, seed=seed, workers=workers, progress=progress
        )
    timed = {REFERENCE: make_method(REFERENCE, vehicle, seed)} | methods
    longest = max(recordings, key=len)
    times = step_times(timed, vehicle, longest)
    sweeps: dict[str, tuple[Candidate, ...]] = {}
    if designs:
        progress(f"sweep: {designs} random designs of each method")
        sweeps = sweep(
            names,
            course,
            designs=designs,
            seed=seed,
            workers=workers,
            progress=progress,
            note=note,
            elsewhere=elsewhere,
            folder=cache_folder() / "sweeps",
        )
    return Comparison(
        course=course,
        seed=seed,
        trials=trials,
        floors=floors,
        step_times=times,
        sweeps=sweeps,
        left_out=left_out or {},
    )


def ranking(comparison: Comparison) -> list[str]:
    """Return the methods, smallest frozen error elsewhere first; those that cannot freeze last."""

    def key(name: str) -> tuple[bool, float]:
        found = comparison.shares(name)
        error = frozen_share(found)
        return (error is None, found.online if error is None else error)

    return sorted(comparison.trials, key=key)
