"""The errors of the sensors in a log, by the balance of the estimate with the tires held."""

from dataclasses import replace

import numpy as np

from codegen.arrays import Array
from identifier.day import ENOUGH, INSTALLED, NUMBERS, WHERE, Day, usual_errors
from identifier.estimate.drive import FASTEST, SLOW, Drive, hardest, thinned
from identifier.estimate.priors import Priors
from identifier.estimate.solve import estimate
from identifier.motion.parameters import INDEX
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

_STEERED = np.array([name.startswith("steering") for name in NUMBERS])
_ZEROS = 3  # of NUMBERS, that change from day to day
_ANOTHER = 30.0  # squared deviations of a segment's zeros from those of the whole: another day
_LONGEST = 600.0  # [s] of a log that are looked at: those of hardest cornering
_ROUGH = 0.04  # [s] of a sedan, to which samples are averaged to see whether days differ
_LEAST_DOUBT = 0.02  # of what was identified, in standard deviations of the table
_GENTLE = 0.4  # g, up to which steering without v_y tells its zero, and
_SLOWLY = 0.25  # [s] of a sedan, over which samples are averaged for it: of 16 random cars, two
# drives each, zeros that were equal came out .0005 rad apart at most, and
_ANOTHER_ZERO = 0.004  # [rad] apart they are zeros of different days
_ONE_SIDED = 0.02  # [rad] of mean steering, from which an error of the ratio looks like a zero
_FINE = 5e-4  # [rad] of noise, within which least absolute deviations are squared
_ROUNDS = 5  # of those


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
    """Return the days of a log with a v_y: the first sample of each, and the day.

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
    long, z = long_segments(recording, vehicle), slice(0, _ZEROS)
    rough = _ROUGH * min(vehicle.scale, 1.0)
    if len(long) < 2:
        return []
    each = [day_of(recording.taken(one), vehicle, p, covariance, rough) for one in long]
    weights = [np.linalg.inv(one.covariance[z, z]) for one in each]
    pulls = [W @ one.value[z] for W, one in zip(weights, each, strict=True)]
    mean = np.linalg.solve(np.sum(weights, axis=0), np.sum(pulls, axis=0))
    away = [one.value[z] - mean for one in each]
    far = max(float(d @ W @ d) for W, d in zip(weights, away, strict=True))
    return long if far > _ANOTHER else []


def steering_zeros(recording: Recording, vehicle: Vehicle) -> Array:
    """Return the zero of the steering of each sample [rad], (n,), where days differ; else none.

    δ_f = L r/v + δ0 + K v r + T r' where a car turns gently and to both sides, with a δ0 of each
    long segment; other ones have that of the one before. Tires need not be known.
    """
    L, slowest, rows, starts = vehicle.wheelbase, SLOW * vehicle.froude_speed, [], []
    every = max(round(_SLOWLY * vehicle.scale / recording.dt), 1)
    for one in long_segments(recording, vehicle):
        signals = recording.v_x, recording.r, recording.delta_f
        v_x, r, delta = (thinned(signal[one], every) for signal in signals)
        on = (v_x > slowest) & (np.abs(v_x * r) < _GENTLE * GRAVITY)
        ideal = L * r / np.maximum(v_x, slowest)
        if abs(ideal[on].sum()) < _ONE_SIDED * on.sum():
            rows.append(np.column_stack([delta - ideal, v_x * r, np.gradient(r)])[on])
            starts.append(one.start)
    if len(rows) < 2:
        return np.zeros(len(recording))
    turned, *slow = np.concatenate(rows).T
    A = np.column_stack([*slow, np.repeat(np.eye(len(rows)), [*map(len, rows)], axis=0)])
    weights = np.ones(len(A))
    for _ in range(_ROUNDS):
        found = np.linalg.lstsq(A * weights[:, None], turned * weights)[0]
        weights = np.maximum(np.abs(turned - A @ found), _FINE) ** -0.5
    each = found[2:] * (np.ptp(found[2:]) > _ANOTHER_ZERO)
    return np.repeat(each, np.diff([0, *starts[1:], len(recording)]))


def long_segments(recording: Recording, vehicle: Vehicle) -> list[slice]:
    """Return the segments that are long enough for a day of their own."""
    on, fewest = recording.v_x > SLOW * vehicle.froude_speed, ENOUGH / recording.dt
    return [one for one in recording.segments if np.count_nonzero(on[one]) >= fewest]
