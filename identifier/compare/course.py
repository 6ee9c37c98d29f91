"""Learn on every recording, freeze at its end, replay on every recording: does it extrapolate?

All methods are judged on the same samples. Shares are RMSE over the rms of the true force, both
axles together, in percent. Where a recording has no true forces, all are judged by the motion: by
mean forces over windows of 0.3 s, which the motion shows (`identifier.evidence`), the white
noise of the sensors taken off.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from codegen import Scan
from codegen.arrays import Array, root_mean_square
from identifier.compare.zeros import replayed
from identifier.evidence import (
    BRISK,
    FEWEST,
    brisk_windows,
    clean_rms,
    measured_force,
    noise_variance,
)
from identifier.method import CannotFreezeError, Method
from identifier.reproducibility import AxleRmse, axle_rms, counted_samples
from identifier.run import History, identify
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.recordings.evidence import Windows
from models.vehicle import Vehicle

INFINITE = AxleRmse(front=np.inf, rear=np.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What methods are compared on.
    min_speed : samples below this speed [m/s] do not count, for any method.
    """

    vehicle: Vehicle
    recordings: tuple[Recording, ...]
    min_speed: float

    def __post_init__(self) -> None:
        names = [recording.name for recording in self.recordings]
        if not names:
            raise ValueError("a comparison needs at least one recording")
        for recording in self.recordings:
            if names.count(recording.name) > 1:
                raise ValueError(f"{recording.name} is given twice: each needs its own name")
            if self.by_motion and len(self._windows(recording)) < FEWEST:
                raise ValueError(
                    f"{recording.name}: fewer than {FEWEST} windows are driven "
                    "briskly, and there are no true forces Fyf, Fyr to judge by"
                )
            size = self.size(recording)
            if not min(size.front, size.rear) > 0.0:
                what = "in the motion of" if self.by_motion else "of"
                raise ValueError(f"{recording.name}: the force {what} an axle is always zero")

    @property
    def by_motion(self) -> bool:
        """Whether forces are judged by the motion: where a recording has no true forces."""
        return any(recording.axle_force is None for recording in self.recordings)

    @property
    def measure(self) -> str:
        by = ", means over 0.3 s by the motion" if self.by_motion else ""
        return f"RMSE of the axle force{by}"

    def _windows(self, recording: Recording) -> Windows:
        return brisk_windows(recording, max(self.min_speed, BRISK * self.vehicle.froude_speed))

    def size(self, recording: Recording) -> AxleRmse:
        """Return the rms over the samples that count of the forces that methods are judged by."""
        return self.error(recording, np.zeros((len(recording), 2)))

    def error(self, recording: Recording, force: Array) -> AxleRmse:
        """Return the RMSE of forces over the samples that count; infinite where not finite.
        force : (n, 2) [N].
        """
        if self.by_motion:
            vehicle, windows = self.vehicle, self._windows(recording)
            loads = np.array(vehicle.axle_loads)
            with np.errstate(over="ignore", invalid="ignore"):  # of a law that diverged
                error = measured_force(recording, vehicle, windows) - windows.mean(force / loads)
                front, rear = loads * clean_rms(error, noise_variance(recording, vehicle, windows))
            found = AxleRmse(front=front, rear=rear)
        else:
            assert recording.axle_force is not None
            counted = counted_samples(recording, self.min_speed)
            found = axle_rms(force, counted, recording.axle_force)
        return found if np.isfinite([found.front, found.rear]).all() else INFINITE

    def replays(self, model: TireModel) -> dict[str, AxleRmse]:
        """Return by recording the error of a frozen model, read by that log's own sensors."""
        return {rec.name: self.error(rec, replayed(model, rec)) for rec in self.recordings}

    def share(self, name: str, error: AxleRmse) -> float:
        """Return an error as a share of the true force, both axles together [%].
        error : over it [N].
        """
        (recording,) = (rec for rec in self.recordings if rec.name == name)
        return 100.0 * error.both / self.size(recording).both


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One method on a course.
    online : by recording, error of what was identified online [N].
    frozen : by recording learnt on and recording replayed, error of the frozen model [N]; lacks
        what diverged; None for a method that estimates a signal.
    diverged_at : by recording on which the method diverged, when [s].
    side_slip : by recording, what was given of lateral velocity; empty for a method that reads it.
    """

    online: Mapping[str, AxleRmse]
    frozen: Mapping[str, Mapping[str, AxleRmse]] | None
    diverged_at: Mapping[str, float]
    side_slip: Mapping[str, "SideSlip"] = field(default_factory=dict, compare=False)


class Shares(NamedTuple):
    """Means over recordings [%]: online, frozen where learnt, frozen elsewhere.

    Infinite where a run diverged; None where there is nothing to take the mean of.
    """

    online: float
    in_sample: float | None
    other: float | None


def cross_replay(
    method: Method, course: Course, seen: Callable[[History], None] | None = None
) -> Trial:
    """Learn on each recording afresh, freeze at its end and replay on all.

    A method that tells lateral velocity learns without that of the recording; the frozen tires of
    all are asked at the same slip.
    """
    online, frozen, diverged_at, freezes = {}, {}, {}, True
    estimated: dict[str, SideSlip] = {}
    for recording in course.recordings:
        history = identify(
            recording if "v_y" in method.needs else replace(recording, v_y=None),
            course.vehicle,
            method,
        )
        end = float(recording.t[-1])
        if seen is not None:
            seen(history)
        online[recording.name] = course.error(recording, history.axle_force)
        found = side_slip(history, course.min_speed, recording.v_y)
        estimated |= {} if found is None else {recording.name: found}
        if history.diverged_at is not None:
            diverged_at[recording.name] = history.diverged_at
            continue
        try:
            frozen[recording.name] = course.replays(history.freeze(end))
        except CannotFreezeError:
            freezes = False
        except ValueError:  # the last update left weights that are not finite
            diverged_at[recording.name] = end
    return Trial(
        online=online,
        frozen=frozen if freezes else None,
        diverged_at=diverged_at,
        side_slip=estimated,
    )


SIGMAS = 2.0  # of what a method says it knows v_y to: 95 % of honest errors lie within


class SideSlip(NamedTuple):
    """The lateral velocity that a method estimated over a recording, and how far it was off.
    v_y : of each sample (n,) [m/s].
    v_y_sd : how well the method says it knows it (n,) [m/s]; None where it does not say.
    rms : of the error of side slip, from the first sample at a speed that counts [deg], infinite
        where not finite; None where the recording has no v_y.
    within : share of those errors of v_y within two standard deviations [%], or None.
    """

    v_y: Array
    v_y_sd: Array | None
    rms: float | None
    within: float | None


def side_slip(history: History, min_speed: float, truth: Array | None) -> SideSlip | None:
    """Return the lateral velocity that a run estimated; None of a method that reads it.
    min_speed : samples below this speed [m/s] do not count.
    truth : v_y that it is judged by (n,) [m/s], or None.
    """
    if "v_y" not in history.outputs:
        return None
    recording, outputs = history.recording, history.outputs
    v_y = outputs["v_y"].ravel()
    sd = outputs["v_y_sd"].ravel() if "v_y_sd" in outputs else None
    if truth is None:
        return SideSlip(v_y=v_y, v_y_sd=sd, rms=None, within=None)
    counts = counted_samples(recording, min_speed)
    v_x, error = recording.v_x[counts], (v_y - truth)[counts]
    slip = np.degrees(np.arctan2(v_y[counts], v_x) - np.arctan2(truth[counts], v_x))
    rms = root_mean_square(slip)
    within = None if sd is None else 100.0 * np.mean(np.abs(error) <= SIGMAS * sd[counts])
    return SideSlip(
        v_y=v_y,
        v_y_sd=sd,
        rms=rms if np.isfinite(rms) else np.inf,
        within=None if within is None else float(within),
    )


def shares(trial: Trial, course: Course) -> Shares:
    """Return the means of a trial over its recordings [%]."""
    names = [recording.name for recording in course.recordings]
    if trial.diverged_at:
        frozen = None if trial.frozen is None else np.inf
        return Shares(np.inf, frozen, frozen if len(names) > 1 else None)
    online = float(np.mean([course.share(name, trial.online[name]) for name in names]))
    if trial.frozen is None:
        return Shares(online, None, None)
    same, other = (
        [course.share(name, error) for name, error in listed]
        for listed in same_and_other(trial.frozen)
    )
    return Shares(online, _mean(same), _mean(other))


def same_and_other(
    frozen: Mapping[str, Mapping[str, AxleRmse]],
) -> tuple[list[tuple[str, AxleRmse]], list[tuple[str, AxleRmse]]]:
    """Return name and error of replays of the drive that was learnt, and of every other drive.
    frozen : by recording learnt on and recording replayed [N].
    """
    learnt_on: list[tuple[str, AxleRmse]] = []
    other: list[tuple[str, AxleRmse]] = []
    for learnt, replays in frozen.items():
        for name, error in replays.items():
            (learnt_on if name == learnt else other).append((name, error))
    return learnt_on, other


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


# How long one step of a method takes, in compiled code.

LONG = 10_000  # samples, beside which the call of the loop does not count
ENOUGH = 100_000  # samples, of which a longer recording gives its first


def step_times(
    methods: Mapping[str, Method], vehicle: Vehicle, recording: Recording, *, repeats: int = 10
) -> dict[str, float]:
    """Return by method the shortest time per sample of a compiled run over a recording [s].

    A method that learns from whole logs has none.

    Setting up is left out. Times are those of this thread on its processor, so that waiting for a
    busy machine does not count, and the methods take turns. A short recording is run forward and
    backward in time until it is long enough, of a long one the first 100 000 samples count.
    repeats : turns; the shortest counts.
    """
    runs: dict[str, tuple[Scan, dict[str, Array], int]] = {}
    for name, method in methods.items():
        if method.whole:
            continue
        setup = method.setup(vehicle).begin(recording.x[0])
        sampled = {port: _long(signal) for port, signal in setup.sampled(recording).signals.items()}
        n = len(sampled["v_x"])
        runs[name] = setup.scan, {**setup.carry, **sampled, **setup.constants}, n
        setup.scan(n, runs[name][1])  # compiled and warm
    shortest = dict.fromkeys(runs, math.inf)
    for _ in range(repeats):
        for name, (scan, values, n) in runs.items():
            start = time.thread_time()
            scan(n, values, every=n)
            shortest[name] = min(shortest[name], (time.thread_time() - start) / n)
    return shortest


def _long(signal: Array) -> Array:
    """Return a signal (n, ...) forward and backward in turn, without a jump."""
    signal = signal[:ENOUGH]
    there_and_back = np.concatenate([signal, signal[::-1]])
    return np.concatenate([there_and_back] * math.ceil(LONG / len(there_and_back)))
