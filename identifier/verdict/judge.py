"""Judging a run, and a model that is asked about a drive."""

import math

import numpy as np

from codegen.arrays import Array
from identifier.method import Method
from identifier.run import History, identify
from identifier.tire_model import TireModel
from identifier.verdict.causes import CAUSES, Ask, Mended, Suspect, suspects
from identifier.verdict.motion import FEWEST, Evidence, clean_share, evidence, modelled_force
from identifier.verdict.rules import MOST_MISSED, Drive, findings
from identifier.verdict.verdict import Finding, Number, Verdict
from models.recordings import Recording, RecordingError
from models.vehicle import Vehicle

GEOMETRY = tuple(one for one in CAUSES if one.code in ("sensor_ahead", "center_of_gravity"))


def judge(history: History, t: float | None = None) -> Verdict:
    """Return the verdict on a run: on the model that was frozen, over all of its recording.

    Parameters
    ----------
    history : the run.
    t : time of the freeze in the recording's own clock [s]; None is the end.

    Raises
    ------
    DivergedError
        Where the law had diverged by then.
    CannotFreezeError
        Where the method estimates a signal, not a model.
    """
    model, recording = history.freeze(t), history.recording
    found = evidence(model, recording)
    if found is None:
        return _too_short(model)

    def taught(mended: Mended) -> float:
        learnt = identify(mended.recording, mended.vehicle, history.design).freeze()
        return _missed(learnt, mended)

    drive = Drive(
        model=model,
        recording=recording,
        found=found,
        suspects=_suspects(taught, model, recording, found),
        geometry=suspects(taught, recording, model.vehicle, GEOMETRY),
        elsewhere=_elsewhere(history, found),
        apart=_apart(history, found),
        learns=True,
    )
    reached = [
        Finding(
            "at_bound",
            one.axle,
            f"the {one.title} rests at its bound, {one.value:.3g} {one.unit}: {one.meaning}",
            one.refuses,
        )
        for one in history.design.reached(history.vehicle, history.state_at(_end(history, t)))
    ]
    return _verdict(drive, [*findings(drive), *reached])


def judge_prediction(model: TireModel, recording: Recording) -> Verdict:
    """Return the verdict on a stored model over a drive: does it give back the drive's motion?

    Parameters
    ----------
    model : that learns nothing from it.
    recording : the drive.
    """
    found = evidence(model, recording)
    if found is None:
        return _too_short(model)

    def asked(mended: Mended) -> float:
        same = mended.vehicle == model.vehicle
        return _missed(model if same else model.mounted_on(mended.vehicle), mended)

    drive = Drive(
        model=model,
        recording=recording,
        found=found,
        suspects=_suspects(asked, model, recording, found),
        geometry=(),
        elsewhere=None,
        apart=None,
        learns=False,
    )
    return _verdict(drive, findings(drive))


def _missed(model: TireModel, mended: Mended) -> float:
    """Return the share of the force that a model misses of a mended drive, of both axles."""
    found = evidence(model, mended.recording)
    if found is None:
        return math.inf
    measured = found.measured + mended.bank
    missed = clean_share(measured - found.modelled, measured, found.noise)
    return float(np.sqrt(np.mean(missed**2)))


def _suspects(
    ask: Ask, model: TireModel, recording: Recording, found: Evidence
) -> tuple[Suspect, ...]:
    """Return the likely causes, where there is something to be explained."""
    if not (found.missed > MOST_MISSED).any():
        return ()
    return suspects(ask, recording, model.vehicle)


def _end(history: History, t: float | None) -> float:
    return float(history.recording.t[-1]) if t is None else t


def _verdict(drive: Drive, listed: list[Finding]) -> Verdict:
    """Return the verdict of what was found."""
    listed.sort(key=lambda finding: not finding.refuses)
    found, car = drive.found, drive.model.vehicle
    lateral, yaw = found.accelerations(car)
    measures: dict[str, tuple[float, ...] | float | None] = {
        "force_missed": _pair(found.missed),
        "force_missed_elsewhere": _pair(drive.elsewhere),
        "online_from_frozen": _pair(drive.apart),
        "rms_force_static_loads": _pair(found.force),
        "peak_force_static_loads": _pair(found.peak),
        **{f"{one.cause.code}_m": one.size for one in drive.geometry},
        **{f"{one.cause.code}_explains": one.share for one in drive.geometry},
        "explained_lateral": lateral,
        "explained_yaw": yaw,
    }
    refused = {one.axle for one in listed if one.refuses}
    numbers = tuple(
        Number(*one, valid=one.learnt and not refused & {None, one.axle})
        for one in drive.model.estimates()
    )
    return Verdict(findings=tuple(listed), numbers=numbers, measures=measures)


def _pair(values: Array | None) -> tuple[float, ...] | None:
    return None if values is None else tuple(float(value) for value in values)


def _too_short(model: TireModel) -> Verdict:
    finding = Finding(
        "too_short",
        None,
        f"fewer than {FEWEST} windows of 0.3 s are driven briskly: there is nothing to judge by, "
        "and nothing to learn from",
        True,
    )
    numbers = tuple(Number(*one, valid=False) for one in model.estimates())
    return Verdict(findings=(finding,), numbers=numbers, measures={})


def _apart(history: History, found: Evidence) -> Array:
    """Return how far online lies from frozen over the later half, over the frozen force (2,)."""
    windows = found.windows
    online = windows.mean(history.axle_force / np.array(history.vehicle.axle_loads))
    half = slice(len(windows) // 2, None)
    return clean_share((online - found.modelled)[half], found.modelled[half], np.zeros(2))


def _elsewhere(history: History, found: Evidence) -> Array | None:
    """Return what models of each half of the drive miss of the other, over its force (2,).

    The halves hold equal shares of the force (squared); a window counts where the slip is known.
    """
    power = np.cumsum(np.sum(found.measured**2, axis=1))
    recording, windows = history.recording, found.windows
    middle = float(recording.t[windows.starts[int(np.searchsorted(power, 0.5 * power[-1]))]])
    begins = recording.t[windows.starts]
    missed, force = [], []
    for first, last, other in (
        (float(recording.t[0]), middle, begins > middle),
        (middle, float(recording.t[-1]), begins + windows.duration <= middle),
    ):
        model = _taught(recording, first, last, history.vehicle, history.design)
        if model is None or np.count_nonzero(other) < FEWEST:
            return None
        known = model.known_slip
        counted = np.repeat(other[:, None], 2, axis=1)
        if known is not None:
            car = history.vehicle
            slip = np.abs(windows.mean(np.asarray(recording.alpha(car.l_f, car.l_r))))
            counted &= slip <= known
        away = found.measured - modelled_force(model, recording, windows)
        missed.append(np.where(counted, away, 0.0))
        force.append(np.where(counted, found.measured, 0.0))
    both, size = np.vstack(missed), np.vstack(force)
    seen = np.mean(size != 0.0, axis=0)
    return np.where(seen > 0.0, clean_share(both, size, found.noise * seen), 0.0)


def _taught(
    recording: Recording, first: float, last: float, vehicle: Vehicle, design: Method
) -> TireModel | None:
    """Return what a part of a recording teaches; None where it is too short to teach."""
    try:
        return identify(recording.between(first, last), vehicle, design).freeze()
    except (RecordingError, ArithmeticError, ValueError):
        return None
