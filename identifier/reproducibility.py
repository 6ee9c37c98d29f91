"""The Frozen-Weight Reproducibility Test: does a model with frozen weights give the same forces?

Weights are frozen at an instant and the past and the future of the recording are replayed with
them, and any other recording too. There are two measures, and they answer different questions:

- the paper's (section IV-A): the past, t < T_freeze, against what was identified *online* then. It
  asks whether the weights still say what they once said, right or wrong;
- ours: against the *true* force, where it is known, over the past, after the freeze, and over all.
  It asks whether what they say is right.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, blocks
from identifier.run import History
from identifier.tire_model import TireModel
from models.recordings import Recording, RecordingError

_EDGE = 1.01  # of the known slip, as lags differ a little while a model is identified


class NeverDrivesError(RecordingError):
    """No sample of a recording is as fast as a sample must be to count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AxleRmse:
    """Root mean square of a force error [N]."""

    front: float
    rear: float

    @property
    def both(self) -> float:
        """Both axles together: root of the mean square over all samples of both."""
        return float(np.sqrt((self.front**2 + self.rear**2) / 2))


def axle_rms(
    force: Array, where: NDArray[np.bool_] | None = None, reference: Array | None = None
) -> AxleRmse:
    """Return the root mean square of axle forces, or of their errors; NaN of no samples.
    force : (n, 2) [N].   where : samples that count (n,); None counts all.
    reference : forces that they are compared with (n, 2) [N]; None takes the forces themselves.
    """
    squares, count = np.zeros(2), 0
    for part in blocks(len(force)):
        away = force[part] if reference is None else force[part] - reference[part]
        kept = away if where is None else away[where[part]]
        with np.errstate(over="ignore", invalid="ignore"):  # a diverged law: infinite
            squares, count = squares + np.sum(kept**2, axis=0), count + len(kept)
    front, rear = np.sqrt(squares / count) if count else (np.nan, np.nan)
    return AxleRmse(front=float(front), rear=float(rear))


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """Both sides of a freeze: how frozen weights reproduce the past, and what they miss after it.

    The instant of the freeze belongs to neither side: there the frozen force is the online one. A
    side without a sample that counts has no error, None; nor has one against truth without truth.
    past_against_online : error for t < T_freeze against what was identified online, the measure of
        the paper's section IV-A; the linear part of both forces is the same and cancels.
    after_against_truth : error for t > T_freeze against the true force.
    """

    past_against_online: AxleRmse | None
    past_against_truth: AxleRmse | None
    after_against_truth: AxleRmse | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replay:
    """One recording replayed with frozen weights.
    axle_force : forces of the frozen model (n, 2) [N].
    against_truth : error over all samples against the true force, None without truth.
    against_online : error over all samples, before and after a freeze, against the forces that were
        identified online over the same recording; None where the method learns from whole logs.
    reproduction : both sides of the freeze, None where the weights were not frozen in this
        recording.
    """

    recording: Recording
    axle_force: Array
    against_truth: AxleRmse | None
    against_online: AxleRmse | None
    reproduction: Reproduction | None = None


def freeze_key(t: float) -> str:
    """Return a freeze time as results, files and figures name it: "32", "1700000004.25".
    t : time in the recording's own clock [s]; ten milliseconds of a Unix time are kept apart.
    """
    return f"{t:.12g}"


def counted_samples(
    recording: Recording, min_speed: float, since: float | None = None
) -> NDArray[np.bool_]:
    """Return which samples count wherever a force or its error is summed up, (n,).
    min_speed : samples below this speed [m/s] do not count.
    since : nor do samples before this time [s]; None begins at the first.
    """
    counted = recording.v_x >= min_speed
    if since is not None:
        counted = counted & (recording.t >= since)
    if not counted.any():
        later = "" if since is None else f" from {freeze_key(since)} s on"
        raise NeverDrivesError(
            f"{recording.name}: v_x never reaches {min_speed:.3g} m/s{later}, the speed from which "
            f"samples count; its largest value is {recording.v_x.max():.3g} m/s"
        )
    return counted


def beyond_known(model: TireModel, recording: Recording) -> tuple[float, float] | None:
    """Return the share of the samples with more slip than the model knows; None if nobody can tell.

    The slip is that of its curves: lagged, without the errors of the sensors that it finds.

    recording : the drive; samples below the model's minimum speed do not count.
    """
    known = model.known_slip
    if known is None:
        return None
    beyond, count, slip = np.zeros(2), 0, model.lagged_slip(recording)
    for part in blocks(len(recording)):
        counted = recording.v_x[part] >= model.min_speed
        beyond += np.count_nonzero(np.abs(slip[part][counted]) > _EDGE * known, axis=0)
        count += int(np.count_nonzero(counted))
    if count == 0:
        return None
    front, rear = beyond / count
    return float(front), float(rear)


def replay(model: TireModel, online: History, *, since: float | None = None) -> Replay:
    """Replay a recording with frozen weights and compare over all of it.
    model : the frozen model; samples below its minimum speed do not count.
    online : a run of the identifier over the recording, the run that the weights come from or
        another.
    since : samples before this time [s] do not count; None counts all.
    """
    force, truth = model.predict(online.recording), online.recording.axle_force
    counted = counted_samples(online.recording, model.min_speed, since)
    return Replay(
        recording=online.recording,
        axle_force=force,
        against_truth=None if truth is None else axle_rms(force, counted, truth),
        against_online=axle_rms(force, counted, online.axle_force) if online.online else None,
    )


def reproduce(online: History, t_freeze: float, *, since: float | None = None) -> Replay:
    """Freeze the weights of a run, replay its own recording and compare both sides of the freeze.
    t_freeze : time of the freeze in the recording's own clock [s].
    since : samples before this time [s] do not count; None counts all.
    """
    model = online.freeze(t_freeze)
    whole = replay(model, online, since=since)
    recording, tolerance = online.recording, 1e-6 * online.recording.dt
    counted = counted_samples(recording, model.min_speed, since)
    truth = recording.axle_force
    past = counted.copy()
    past[np.searchsorted(recording.t, t_freeze - tolerance, side="left") :] = False
    known = online.axle_force if online.online else None
    against_online = _side(whole.axle_force, known, past)
    against_truth = _side(whole.axle_force, truth, past)
    after = counted  # itself: a byte for each sample of a hundred hours is not little
    after[: np.searchsorted(recording.t, t_freeze + tolerance, side="right")] = False
    sides = Reproduction(
        past_against_online=against_online,
        past_against_truth=against_truth,
        after_against_truth=_side(whole.axle_force, truth, after),
    )
    return replace(whole, reproduction=sides)


def _side(force: Array, reference: Array | None, where: NDArray[np.bool_]) -> AxleRmse | None:
    if reference is None or not where.any():
        return None
    return axle_rms(force, where, reference)


def online_error(history: History, *, since: float | None = None) -> AxleRmse | None:
    """Return the error of the forces identified online, None without truth or without such forces.
    history : an online run; samples below the method's minimum speed do not count.
    since : samples before this time [s] do not count; None counts all.
    """
    truth = history.recording.axle_force
    if truth is None or not history.online:
        return None
    counted = counted_samples(history.recording, history.method.min_speed, since)
    return axle_rms(history.axle_force, counted, truth)


def force_rms(history: History) -> AxleRmse | None:
    """Return the size of the true forces, over the samples that `online_error` counts."""
    truth = history.recording.axle_force
    if truth is None:
        return None
    return axle_rms(truth, counted_samples(history.recording, history.method.min_speed))
