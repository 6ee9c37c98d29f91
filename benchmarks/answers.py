"""What a user gets for a log: tires, what they are wrong by, and the verdict on them.

The road is that of a user, by public functions alone: the log is read from a table, which refuses
wrong signs, units and axes, `ti.identify` refuses a car that cannot have driven it, and learns; the
model is frozen at the end, `run.verdict` judges. What the doctor finds, which `ti.identify` asks,
is kept too. None of them sees a true force.
"""

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

import tireid as ti
from identifier.doctor import Finding
from identifier.reproducibility import NeverDrivesError
from models.recordings import Recording, RecordingError
from models.vehicle import Vehicle

WRONG, RIGHT = 20.0, 8.0  # % of the rms force, worse axle: no such is valid, and all such
REFUSED = "refused"  # in place of a code of the verdict: the log is not let in
Pair = tuple[float, float]
NO_FORCE = (math.inf, math.inf)
COLUMNS = {  # of a table that is read, by what a recording calls them
    **{"t": "t", "vx": "v_x", "vy": "v_y", "r": "r", "ay": "a_y"},
    **{"delta_f": "delta_f", "delta_r": "delta_r"},
}


class Answer(NamedTuple):
    """What became of a log."""

    error: Pair
    """Of the force of the frozen model, front and rear [% of the rms force]; inf without model."""
    valid: bool
    """The verdict."""
    codes: tuple[str, ...]
    """Of what was found against it; the name of the exception where there was one."""
    doctor: tuple[str, ...] = ()
    """What the doctor says that matters, code and channel of each."""

    @property
    def worse(self) -> float:
        """Error of the worse axle [% of the rms force]."""
        return max(self.error)

    @property
    def wrong(self) -> bool:
        """Whether an axle is so far off that no verdict may call it valid."""
        return not self.worse <= WRONG

    @property
    def right(self) -> bool:
        """Whether both axles are so near that a verdict should call it valid."""
        return self.worse <= RIGHT


def force_error(tire: ti.TireModel, recording: Recording) -> Pair:
    """Return by how much a model misses the true forces of a drive [% of their rms value].

    Parameters
    ----------
    tire : that is asked.
    recording : with true forces.
    """
    told = ti.replay(recording, tire)
    assert told.against_truth is not None and told.true_force is not None
    missed, size = told.against_truth, told.true_force
    return 100.0 * missed.front / size.front, 100.0 * missed.rear / size.rear


def blind(recording: Recording) -> Recording:
    """Return the recording without its true forces.

    Parameters
    ----------
    recording : of a drive.
    """
    return replace(recording, axle_force=None)


def answer(log: Recording, told: Vehicle, judged: Recording) -> Answer:
    """Return what a user gets for a log, and what it is wrong by.

    Where the log is refused before anything is learnt, the error is that of a user who insists.

    Parameters
    ----------
    log : what reaches the identifier.
    told : the car as it is told.
    judged : the drive on which the error is measured, with true forces.
    """
    try:
        with _warnings() as said:
            run, let_in = _run(blind(log), told)
        tire = run.freeze()
        verdict = run.verdict if let_in else None
        missed = force_error(tire, judged)
    except NeverDrivesError:  # a car of that size, whoever insists
        return Answer(NO_FORCE, False, (REFUSED,))
    except Exception as error:
        return Answer(NO_FORCE, False, (type(error).__name__,))
    against = {REFUSED} if verdict is None else {x.code for x in verdict.findings if x.refuses}
    return Answer(
        missed if all(map(math.isfinite, missed)) else NO_FORCE,
        verdict is not None and verdict.valid,
        tuple(sorted(against)),
        tuple(sorted({f"{one.code} {one.channel}".strip() for one in said})),
    )


@contextmanager
def _warnings() -> Iterator[list[Finding]]:
    """Collect the findings that the doctor warns of."""
    found: list[Finding] = []

    def keep(record: logging.LogRecord) -> bool:
        found.append(vars(record)["finding"])
        return True

    log = logging.getLogger("tireid.doctor")
    log.addFilter(keep)
    try:
        yield found
    finally:
        log.removeFilter(keep)


def _run(log: Recording, told: Vehicle) -> tuple[ti.Run, bool]:
    """Return the run over a log, and whether it was let in without insisting."""
    signals = {name: getattr(log, of) for name, of in COLUMNS.items()}
    table = {name: signal for name, signal in signals.items() if signal is not None}
    try:
        read = ti.read_recording(table, name=log.name, dt=log.dt)
        return ti.identify(read, told), True
    except RecordingError:
        return ti.identify(log, told, check=False), False
