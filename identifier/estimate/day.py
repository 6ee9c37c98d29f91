"""The errors of the sensors in a log, by the balance of the estimate with the tires held."""

from dataclasses import replace

import numpy as np

from codegen.arrays import Array
from identifier.day import ENOUGH, INSTALLED, NUMBERS, WHERE, Day, usual_errors
from identifier.estimate.drive import FASTEST, SLOW, Drive, hardest
from identifier.estimate.priors import SEDAN, Priors
from identifier.estimate.solve import estimate
from identifier.motion.parameters import INDEX
from models.recordings import Recording
from models.vehicle import Vehicle

_STEERED = np.array([name.startswith("steering") for name in NUMBERS])
_ZEROS = 3  # of NUMBERS, that change from day to day
_ANOTHER = 30.0  # squared deviations of a segment's zeros from those of the whole: another day
_LONGEST = 600.0  # [s] of a log that are looked at: those of hardest cornering
_ROUGH = 0.04  # [s] of a sedan, to which samples are averaged to see whether days differ
_LEAST_DOUBT = 0.02  # of what was identified, in standard deviations of the table


def day_of(
    recording: Recording, vehicle: Vehicle, p: Array, covariance: Array, fastest: float = FASTEST
) -> Day:
    """Return the errors of a log's sensors with the tires held, by its motion alone.

    What is installed (steering gain, place of the v_y sensor) is believed about what was
    identified, as sure as that is, the rest about zero. Of a log with less than 15 s of driving
    they are those of the identification drive; a v_y that was estimated has none.
    p, covariance : of the tires, as `motion.parameters` lists them (p,), (p, p).
    fastest : sampling interval to which samples are averaged [s].
    """
    table, usual = Priors.of(vehicle), usual_errors(vehicle)
    taught, doubt = p[WHERE], covariance[np.ix_(WHERE, WHERE)]
    on = recording.v_x > SLOW * vehicle.froude_speed
    if recording.logged_v_y is None:
        value, P = taught * _STEERED, doubt * np.outer(_STEERED, _STEERED)
        expected = taught * (np.array(NUMBERS) == "steering_gain")
        return Day.of(value, P, (expected, usual), recording.v_x[on], anew=False)
    if np.count_nonzero(on) * recording.dt < ENOUGH:
        return Day.of(taught, doubt, (taught, usual), recording.v_x[on], anew=False)
    drive = Drive.of(recording, vehicle, hardest(recording, _LONGEST), fastest=fastest)
    v_x = drive.signals[drive.counts, 0]
    mean, moves = p.copy(), np.zeros(p.size, dtype=bool)
    information = np.zeros_like(table.information)
    information[np.ix_(WHERE, WHERE)] = table.information[np.ix_(WHERE, WHERE)]
    moves[WHERE] = table.moves[WHERE]
    for name in NUMBERS:
        k = INDEX[name]
        if name not in INSTALLED:
            mean[k] = 0.0
        elif covariance[k, k] > 0.0:
            sd = max(float(np.sqrt(covariance[k, k])), _LEAST_DOUBT * float(table.sd[k]))
            information[k, k] = sd**-2
            usual[NUMBERS.index(name)] = sd
    held = replace(table, mean=mean, information=information, moves=moves)
    found = estimate([drive], vehicle, held)
    P = found.covariance[np.ix_(WHERE, WHERE)]
    return Day.of(found.p[WHERE], P, (mean[WHERE], usual), v_x, anew=True)


def days_of(
    recording: Recording, vehicle: Vehicle, p: Array, covariance: Array
) -> tuple[tuple[int, Day], ...]:
    """Return the days of a log: the first sample of each, and the day.

    Of several logs in a row each long segment has a day of its own where they differ clearly, and
    short ones have that of the one before; else there is one.
    """
    given = vehicle, p, covariance
    return tuple(
        (0 if k == 0 else one.start, day_of(recording.taken(one), *given))
        for k, one in enumerate(days_apart(recording, *given))
    ) or ((0, day_of(recording, *given)),)


def days_apart(recording: Recording, vehicle: Vehicle, p: Array, covariance: Array) -> list[slice]:
    """Return the long segments of a log where they differ as days do; none where they are alike."""
    moving = np.concatenate([[0], np.cumsum(recording.v_x > SLOW * vehicle.froude_speed)])
    long = [
        one
        for one in recording.segments
        if (moving[one.stop] - moving[one.start]) * recording.dt >= ENOUGH
    ]
    if recording.logged_v_y is None or len(long) < 2:
        return []
    rough = _ROUGH * min(float(np.sqrt(vehicle.wheelbase / SEDAN)), 1.0)
    each = [day_of(recording.taken(one), vehicle, p, covariance, rough) for one in long]
    z = slice(0, _ZEROS)
    weights = [np.linalg.inv(one.covariance[z, z]) for one in each]
    pulls = [W @ one.value[z] for W, one in zip(weights, each, strict=True)]
    mean = np.linalg.solve(np.sum(weights, axis=0), np.sum(pulls, axis=0))
    away = [one.value[z] - mean for one in each]
    far = max(float(d @ W @ d) for W, d in zip(weights, away, strict=True))
    return long if far > _ANOTHER else []
