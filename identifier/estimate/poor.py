"""A v_y that comes rarely or is noisy, its delay removed by the motion between its samples.

v_y' = (1 - ρ) a_y - v_x r - b + w,   b' = white,   shown: v_y(t - τ) + noise,
ρ: what a rolling body adds to a_y, b: bank and bias. Linear least squares over the log, by banded
Cholesky; τ and the variances of w, b' and noise are those of the largest likelihood over its
minute of hardest cornering. No tire is in it. A v_y that is good stays as it is.
"""

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.estimate.drive import SMOOTHED, hardest
from models.recordings import Recording
from models.recordings.samples import FAR, resolution, white_noise
from models.vehicle import Vehicle

_RARE = 0.03  # [s] of a sedan between new values, more of which are too few
_NOISY = 0.015  # [m/s] of a sedan, white noise that is too much in the mean that the estimate takes
_FEWEST_VALUES = 20  # new values
_FINE = 0.005  # [s] of a sedan, to which a delay is found
_SURE = 20.0  # nats that a delay must gain
_HARDEST = 60.0  # [s] of hardest cornering that tell delay and noise
_MOST = 12000  # samples of hardest cornering that tell them
_ROLL = 0.05  # ρ, mean of its prior: by which a_y is larger in a car whose body rolls
_ROLL_SD = 0.04  # of ρ, standard deviation of its prior
_OFF = 0.15  # [m/s²], b at first
_WANDERS = 5e-3  # [(m/s²)²/s], variance of b' of a banked road
_BENT = (0.55, 0.3)  # share of samples that move, at which straight lines bend; of rounded ones
_EQUAL = 1e-9  # of the largest change, below which two are one
_CLIP = 3.0  # deviations from which a sample counts less
_ASKED = 32  # instants of a log at which the doubt of v_y is asked for
_AGAIN = 3  # times that samples are weighted anew
_DELAY_HALVINGS = 5  # halvings of the step in which a delay is looked for

DELAYS = np.arange(0.0, 0.41, 0.05)  # [s]
NOISE = 3e-3 * 10.0 ** np.arange(0.0, 2.1, 0.25)  # [m/s] of a sedan
PUSHES = 10.0 ** np.arange(-5.0, 0.1, 0.5)  # [(m/s²)² s], variance of w
BANKS = _WANDERS * 10.0 ** np.arange(-3.0, 1.1, 1.0)


class _Sensor(NamedTuple):
    """How a sensor shows v_y.
    interval : between new values [s].   late : [s].   noise : [m/s].
    push, wanders : variances of w [(m/s²)² s] and of b' [(m/s²)²/s].
    """

    interval: float
    late: float = 0.0
    noise: float = float(NOISE[0])
    push: float = 0.003
    wanders: float = _WANDERS


def on_time(recording: Recording, vehicle: Vehicle) -> Recording:
    """Return a recording with a v_y that is known at each sample, and a note where it was not.

    It is the same where the sensor shows v_y well, or where there is none.
    """
    v_y = recording.logged_v_y
    if v_y is None:
        return recording
    scale = vehicle.scale
    new = _new_values(v_y)
    rare = len(new) < len(v_y) and _interval(new) * recording.dt > _RARE * scale
    new = new if rare else np.arange(len(v_y))
    sensor = _Sensor(_interval(new) * recording.dt, noise=float(NOISE[0]) * scale)
    if len(new) < _FEWEST_VALUES or (recording.a_y is None and not rare):
        return recording
    delay = 0.0
    if recording.a_y is None:
        sensor = sensor._replace(push=float(PUSHES[-1]))
    else:
        part = hardest(recording, min(_HARDEST, _MOST * recording.dt))
        inside = new[(new >= part.start) & (new < part.stop)] - part.start
        problem = _Kinematics(recording.taken(part), inside)
        white = white_noise(problem.values) if problem.values.size > _FEWEST_VALUES else 0.0
        if not rare and not white * np.sqrt(sensor.interval / SMOOTHED) > _NOISY * scale:
            return recording
        sensor = _likeliest(problem, sensor._replace(noise=max(white, sensor.noise)), scale)
        if not rare and not sensor.push < PUSHES[-1]:
            return recording  # a_y does not show this motion
        delay = _doubt_of_delay(problem, sensor)
    weights, whole = np.ones(len(new)), _Kinematics(recording, new)
    for k in range(_AGAIN):
        asked = _ASKED if k == _AGAIN - 1 and recording.a_y is not None else 0
        found, misses, _, each = whole.solved(sensor, weights, asked=asked)
        weights = np.minimum(1.0, _CLIP * sensor.noise / np.maximum(np.abs(misses), 1e-12))
    found.setflags(write=False)
    alone = recording.a_y is None
    by = "straight lines" if alone else "ay, vx and r"
    sd = 0.0 if alone else float(np.hypot(np.sqrt(np.mean(each**2)), delay))
    note = (
        f"vy: a new value every {1e3 * sensor.interval:.0f} ms, {1e3 * sensor.late:.0f} ms late, "
        f"noise {sensor.noise:.2g} m/s: delay removed, and smoothed with {by}"
        + ("" if alone else f", which leaves ± {sd:.2g} m/s")
    )
    return replace(recording, v_y=found, v_y_sd=sd, notes=(*recording.notes, note))


def _new_values(signal: Array) -> NDArray[np.intp]:
    """Return which samples are new: not the last one held, nor on a straight line, (m,).

    All are new where neither is the rule, or where rounding makes it so.
    """
    step, rounded = np.diff(signal), resolution(signal)
    most = _EQUAL * max(float(np.abs(step).max(initial=0.0)), 1e-12)
    changes = 1 + np.flatnonzero(np.abs(step) > most)
    apart, far = np.diff(changes), np.abs(step[changes - 1]) > FAR * rounded
    apart = apart[far[1:] & far[:-1]]
    if apart.size > 2 and np.median(apart) > 1.0:
        return np.append(0, changes)
    bend = np.abs(np.diff(step)) > most
    bends = 1 + np.flatnonzero(bend)
    ends = bends[np.append(np.diff(bends) > 1, True)] if bends.size else bends
    ends = ends[ends < len(signal) - 2]  # what bends at the last one nobody sees
    moves = np.abs(step[1:]) > max(most, FAR * rounded)
    few = np.count_nonzero(bend & moves) < _BENT[rounded > 0.0] * np.count_nonzero(moves)
    if ends.size > 3 and few and np.median(np.diff(ends)) > 2.0:
        return np.append(0, ends)
    return np.arange(len(signal))


def _interval(new: NDArray[np.intp]) -> float:
    if new.size > 1 and new[-1] - new[0] == new.size - 1:
        return 1.0
    return float(np.median(np.diff(new))) if new.size > 1 else np.inf


class _Kinematics:
    """v_y over a recording as least squares, its unknowns v_y and b of each sample in turn.
    new : samples at which a value is new, (m,).
    """

    def __init__(self, recording: Recording, new: NDArray[np.intp]) -> None:
        self.recording, self.new = recording, new
        self.dt, self.n = recording.dt, len(recording)
        self.values = recording.needed("v_y")[new]
        self.goes = np.ones(self.n - 1, dtype=bool)
        self.goes[np.array(recording.breaks, dtype=np.intp) - 1] = False
        a_y = recording.a_y
        zero = np.zeros(self.n - 1)
        self.felt = zero if a_y is None else self._over(a_y)
        self.moved = zero if a_y is None else self._over(a_y - recording.v_x * recording.r)
        self.first = np.append(0, np.flatnonzero(~self.goes) + 1)

    def _over(self, signal: Array) -> Array:
        return 0.5 * self.dt * (signal[1:] + signal[:-1])

    @cached_property
    def _piece(self) -> NDArray[np.intp]:
        return np.searchsorted(np.array(self.recording.breaks), np.arange(self.n), side="right")

    def solved(
        self, s: _Sensor, weights: Array | float, late: float | None = None, asked: int = 0
    ) -> "_Solved":
        """Return v_y and how sure it is.
        weights : of the values, at most 1, (m,).
        late : delay up to which values must have a past to count [s]; None takes that of `s`.
        asked : instants at which the standard deviation is asked for.
        """
        from scipy.linalg import cho_solve_banded, cholesky_banded  # takes long to import

        n, dt = self.n, self.dt
        push = self.goes / (s.push * dt)
        wander = self.goes / (s.wanders * dt)
        band, g = np.zeros((4, 2 * n)), np.zeros((2 * n, 2))
        slope = (-1.0, 0.5 * dt, 1.0, 0.5 * dt)  # over v, b, and the next v, b
        for i, of in enumerate(slope):
            rows = slice(i, i + 2 * (n - 1), 2)
            g[rows, 0] += push * of * self.moved
            g[rows, 1] += push * of * self.felt
            for j in range(i + 1):
                band[i - j, j : j + 2 * (n - 1) : 2] += push * of * slope[j]
        band[0, 1:-1:2] += wander
        band[0, 3::2] += wander
        band[2, 1:-2:2] -= wander
        band[0, 2 * self.first] += 1e-4
        band[0, 2 * self.first + 1] += _OFF**-2
        at = np.maximum(self.new - s.late / dt, 0.0)
        i = np.minimum(at.astype(np.intp), n - 2)
        share = at - i
        latest = s.late if late is None else late
        there = (self.new * dt >= latest) & (self._piece[i] == self._piece[self.new])
        if late is not None:
            first = np.maximum(self.new - round(late / dt), 0)
            there &= self._piece[first] == self._piece[self.new]
        there &= self._piece[i + 1] == self._piece[self.new]
        w = np.where(there, weights, 0.0) / s.noise**2
        for place, value in (
            ((0, 2 * i), w * (1.0 - share) ** 2),
            ((0, 2 * i + 2), w * share**2),
            ((2, 2 * i), w * share * (1.0 - share)),
        ):
            np.add.at(band, place, value)
        np.add.at(g[:, 0], 2 * i, w * (1.0 - share) * self.values)
        np.add.at(g[:, 0], 2 * i + 2, w * share * self.values)
        factor = cholesky_banded(band, lower=True, overwrite_ab=True, check_finite=False)
        x, X = cho_solve_banded((factor, True), g, check_finite=False).T
        # ρ is a border of the matrix: eliminated by Schur's complement.
        S = np.sum(push * self.felt**2) + _ROLL_SD**-2 - g[:, 1] @ X
        roll = (np.sum(push * self.felt * self.moved) + _ROLL / _ROLL_SD**2 - g[:, 1] @ x) / S
        x = x - roll * X
        v, b = x[::2], x[1::2]
        residual = (1.0 - share) * v[i] + share * v[i + 1] - self.values
        moves = np.diff(v) + 0.5 * dt * (b[1:] + b[:-1]) - self.moved + roll * self.felt
        squares = w @ residual**2 + push @ moves**2 + wander @ np.diff(b) ** 2
        squares += ((roll - _ROLL) / _ROLL_SD) ** 2 + np.sum(b[self.first] ** 2) / _OFF**2
        count, steps = np.count_nonzero(there), np.count_nonzero(self.goes)
        logs = 2.0 * np.sum(np.log(factor[0])) + np.log(S) + count * np.log(s.noise**2)
        logs += steps * np.log(s.push * s.wanders)
        variance = np.zeros(0)
        if asked:
            at = np.linspace(0, n - 1, asked + 2).astype(np.intp)[1:-1]
            units = np.zeros((2 * n, at.size))
            units[2 * at, np.arange(at.size)] = 1.0
            inverse = cho_solve_banded((factor, True), units, check_finite=False)
            variance = inverse[2 * at, np.arange(at.size)] + X[2 * at] ** 2 / S
        misses = np.where(there, residual, 0.0)
        return _Solved(v, misses, 0.5 * float(squares + logs), np.sqrt(variance))


class _Solved(NamedTuple):
    """v_y (n,) and what it misses of the values (m,) [m/s], -ln of the likelihood but for a
    constant [nats], and the standard deviation of v_y at the instants asked for (k,) [m/s].
    """

    v_y: Array
    misses: Array
    cost: float
    sd: Array


def _doubt_of_delay(problem: _Kinematics, sensor: _Sensor) -> float:
    """Return what v_y is unsure of by its delay [m/s], rms: each delay as likely as it is."""
    found = problem.solved(sensor, 1.0).v_y
    some = [
        problem.solved(sensor._replace(late=float(one)), 1.0, float(DELAYS[-1])) for one in DELAYS
    ]
    cost = np.array([one.cost for one in some])
    likely = np.exp(cost.min() - cost)
    away = [float(np.mean((one.v_y - found) ** 2)) for one in some]
    return float(np.sqrt(likely @ away / likely.sum()))


def _likeliest(problem: _Kinematics, best: _Sensor, scale: float) -> _Sensor:
    """Return how v_y is shown, by the largest likelihood, from a beginning on."""

    def cost(sensor: _Sensor) -> float:  # the same values count for each delay
        return problem.solved(sensor, 1.0, float(DELAYS[-1])).cost

    least = cost(best)

    def better(**lists: Array) -> bool:
        nonlocal best, least
        before = least
        for name, values in lists.items():
            for value in values:
                one = best._replace(**{name: float(value)})
                if (reached := cost(one)) < least:
                    best, least = one, reached
        return least < before - 0.1

    others = {"noise": NOISE * scale, "push": PUSHES, "wanders": BANKS}
    better(late=DELAYS, **others)
    step = float(DELAYS[1])
    for _ in range(_DELAY_HALVINGS):
        step *= 0.5
        near = np.maximum(best.late + step * np.array([-1.0, 1.0]), 0.0)
        if not better(late=near, **others) and step < _FINE * scale:
            break
    if best.late and cost(best._replace(late=0.0)) - least < _SURE:
        best = best._replace(late=0.0)
        least = cost(best)
        better(**others)
    return best
