"""What a user gets for a log: tires, what they are wrong by, and the verdict on them.

The road is that of a user: signs, units and axes are judged as where a file is read, `ti.identify`
learns, the model is frozen at the end, `run.verdict` judges. None of them sees a true force.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from itertools import count
from typing import Any, NamedTuple

import numpy as np

import tireid as ti
from benchmarks.random_cars import Beginning, RandomDrive, random_car, random_drive
from models.plant import PlantError
from models.recordings import (
    Recording,
    RecordingError,
    check_against_vehicle,
    check_physics,
)
from models.vehicle import Vehicle

DEAD = 0.1  # of the true stiffness: an axle below it learnt nothing that is a tire
REFUSED = "refused"  # in place of a code of the verdict: the log is not let in
Pair = tuple[float, float]
NO_FORCE, NO_TIRE = (math.inf, math.inf), (math.nan, math.nan)
MakeBeginning = Callable[[Vehicle, np.random.Generator], Beginning]


class Answer(NamedTuple):
    """What became of a log."""

    error: Pair
    """Of the force of the frozen model, front and rear [% of the rms force]; inf without model."""
    stiffness: Pair
    """That was learnt, front and rear [N/rad]; NaN without model."""
    valid: bool | None
    """The verdict; None where nobody gave one."""
    codes: tuple[str, ...]
    """Of what was found against it; the name of the exception where there was one."""

    @property
    def worse(self) -> float:
        """Error of the worse axle [% of the rms force]."""
        return max(self.error)

    @property
    def stopped(self) -> bool:
        """Whether the program stopped where it should have answered or refused."""
        return REFUSED not in self.codes and not all(map(math.isfinite, self.stiffness))


def force_error(tire: ti.TireModel, recording: Recording) -> Pair:
    """Return by how much a model misses the true forces of a drive [% of their rms value].

    Parameters
    ----------
    tire : that is asked.
    recording : with true forces.
    """
    told = ti.replay(tire, recording)
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


def answer(log: Recording, told: Vehicle, judged: Recording, *, ask: bool = True) -> Answer:
    """Return what a user gets for a log, and what it is wrong by.

    Where the log is refused before anything is learnt, the error is that of a user who insists.

    Parameters
    ----------
    log : what reaches the identifier.
    told : the car as it is told.
    judged : the drive on which the error is measured, with true forces.
    ask : whether the log is judged and a verdict asked for; a user who insists does neither.
    """
    log = blind(log)
    valid: bool | None = None
    codes: tuple[str, ...] = ()
    if log.v_x.max() < told.lowest_speed:  # a car of that size never drives
        return Answer(NO_FORCE, NO_TIRE, False, (REFUSED,))
    try:
        if ask and not _is_let_in(log, told):
            valid, codes = False, (REFUSED,)
        run = ti.identify(log, told, check=False)
        tire = run.freeze()
        if ask and not codes:
            valid, codes = _verdict(run)
        stiffness = tire.stiffness
        assert stiffness is not None
        missed = force_error(tire, judged)
    except Exception as error:
        return Answer(NO_FORCE, NO_TIRE, False, (type(error).__name__,))
    return Answer(
        missed if all(map(math.isfinite, missed)) else NO_FORCE,
        (float(stiffness[0]), float(stiffness[1])),
        valid,
        codes,
    )


def _is_let_in(log: Recording, told: Vehicle) -> bool:
    """Whether a log passes the checks of a file that is read and learnt from."""
    try:
        check_physics(log)
        check_against_vehicle(log, told)
    except RecordingError:
        return False
    return True


def _verdict(run: ti.History) -> tuple[bool | None, tuple[str, ...]]:
    """The verdict and the codes of what refuses."""
    ask: Callable[[], Any] | None = getattr(run, "verdict", None)
    if ask is None:
        return None, ()
    verdict = ask()
    codes = {one.code for one in verdict.findings if one.refuses}
    return verdict.valid, tuple(sorted(codes))


def is_dead(found: Answer, right: Pair) -> bool:
    """Return whether an axle was left with next to no stiffness, or no model at all came out.

    A log that was not let in leaves nothing dead.

    Parameters
    ----------
    found : the answer.
    right : stiffness of the axles, front and rear [N/rad].
    """
    alive = np.array(found.stiffness) >= DEAD * np.array(right)
    return REFUSED not in found.codes and not bool(alive.all())


def drawn(
    kind: str, seed: int, beginning: MakeBeginning | None = None, number: int = 0
) -> RandomDrive:
    """Return a drive of the car of a seed; where it has no good one, another car is drawn.

    Parameters
    ----------
    kind : class of the car.
    seed : of the car.
    beginning : makes one from car and generator; None is a straight road.
    number : of the drive, each another.
    """
    for attempt in count():
        car = random_car(kind, np.random.default_rng([seed, attempt, *kind.encode()]))
        rng = np.random.default_rng([seed, attempt, number, *kind.encode()])
        begin = None if beginning is None else beginning(car.vehicle, rng)
        with suppress(PlantError):
            return random_drive(car, rng, begin)
    raise AssertionError("it counts for ever")
