"""Learn on every recording, freeze at its end, replay on every recording: does it extrapolate?

All methods are judged on the same samples. Shares are RMSE over the rms of the true force, both
axles together, in percent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.identify import identify
from identifier.method import CannotFreezeError, FrozenModel, Method
from identifier.reproducibility import AxleRmse, axle_rms, counted_samples
from models.recordings import Recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]
INFINITE = AxleRmse(front=np.inf, rear=np.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What methods are compared on.

    Parameters
    ----------
    vehicle : the car as every method is told of it.
    recordings : with true forces, each with a name of its own.
    min_speed : samples below this speed [m/s] do not count, for any method.

    Raises
    ------
    ValueError
        Where there is no recording, two have the same name, one lacks forces or has none to learn.
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
            if recording.axle_force is None:
                raise ValueError(f"{recording.name}: a comparison needs the true forces Fyf, Fyr")
            size = self.size(recording)
            if not min(size.front, size.rear) > 0.0:
                raise ValueError(f"{recording.name}: the true force of an axle is always zero")

    def size(self, recording: Recording) -> AxleRmse:
        """Return the rms of the true forces over the samples that count.

        Parameters
        ----------
        recording : one of them.
        """
        return self.error(recording, np.zeros((len(recording), 2)))

    def error(self, recording: Recording, force: Array) -> AxleRmse:
        """Return the RMSE of forces over the samples that count; infinite where not finite.

        Parameters
        ----------
        recording : one of them.
        force : (n, 2) [N].
        """
        assert recording.axle_force is not None
        found = axle_rms(force - recording.axle_force, counted_samples(recording, self.min_speed))
        return found if np.isfinite([found.front, found.rear]).all() else INFINITE

    def replays(self, model: FrozenModel) -> dict[str, AxleRmse]:
        """Return by recording the error of a frozen model.

        Parameters
        ----------
        model : the model.
        """
        return {rec.name: self.error(rec, model.axle_force(rec)) for rec in self.recordings}

    def share(self, name: str, error: AxleRmse) -> float:
        """Return an error as a share of the true force, both axles together [%].

        Parameters
        ----------
        name : of a recording.
        error : over it [N].
        """
        (recording,) = (rec for rec in self.recordings if rec.name == name)
        return 100.0 * error.both / self.size(recording).both


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One method on a course.

    Parameters
    ----------
    online : by recording, error of what was identified online [N].
    frozen : by recording learnt on and recording replayed, error of the frozen model [N]; lacks
        what diverged; None for a method that estimates a signal.
    diverged_at : by recording on which the method diverged, when [s].
    """

    online: Mapping[str, AxleRmse]
    frozen: Mapping[str, Mapping[str, AxleRmse]] | None
    diverged_at: Mapping[str, float]


class Shares(NamedTuple):
    """Means over recordings [%]: online, frozen where learnt, frozen elsewhere.

    Infinite where a run diverged; None where there is nothing to take the mean of.
    """

    online: float
    in_sample: float | None
    other: float | None


def cross_replay(method: Method, course: Course) -> Trial:
    """Learn on each recording afresh, freeze at its end and replay on all.

    Parameters
    ----------
    method : the method.
    course : car and recordings.
    """
    online, frozen, diverged_at, freezes = {}, {}, {}, True
    for recording in course.recordings:
        history = identify(recording, course.vehicle, method)
        end = float(recording.t[-1])
        online[recording.name] = course.error(recording, history.axle_force)
        if history.diverged_at is not None:
            diverged_at[recording.name] = history.diverged_at
            continue
        try:
            frozen[recording.name] = course.replays(history.freeze(end))
        except CannotFreezeError:
            freezes = False
        except ValueError:  # the last update left weights that are not finite
            diverged_at[recording.name] = end
    return Trial(online=online, frozen=frozen if freezes else None, diverged_at=diverged_at)


def shares(trial: Trial, course: Course) -> Shares:
    """Return the means of a trial over its recordings [%].

    Parameters
    ----------
    trial : one method on the course.
    course : car and recordings.
    """
    names = [recording.name for recording in course.recordings]
    if trial.diverged_at:
        frozen = None if trial.frozen is None else np.inf
        return Shares(np.inf, frozen, frozen if len(names) > 1 else None)
    online = float(np.mean([course.share(name, trial.online[name]) for name in names]))
    if trial.frozen is None:
        return Shares(online, None, None)
    return Shares(online, *frozen_shares(trial.frozen, course))


def frozen_shares(
    frozen: Mapping[str, Mapping[str, AxleRmse]], course: Course
) -> tuple[float | None, float | None]:
    """Return the mean errors of frozen models where they learnt and elsewhere [%].

    Parameters
    ----------
    frozen : by recording learnt on and recording replayed [N].
    course : car and recordings.
    """
    own, other = where_learnt_and_elsewhere(frozen)
    return (
        _mean([course.share(name, error) for name, error in own]),
        _mean([course.share(name, error) for name, error in other]),
    )


def where_learnt_and_elsewhere(
    frozen: Mapping[str, Mapping[str, AxleRmse]],
) -> tuple[list[tuple[str, AxleRmse]], list[tuple[str, AxleRmse]]]:
    """Return name and error of replays of the drive that was learnt, and of every other drive.

    Parameters
    ----------
    frozen : by recording learnt on and recording replayed [N].
    """
    own: list[tuple[str, AxleRmse]] = []
    other: list[tuple[str, AxleRmse]] = []
    for learnt, replays in frozen.items():
        for name, error in replays.items():
            (own if name == learnt else other).append((name, error))
    return own, other


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
