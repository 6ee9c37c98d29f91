"""A drive as the estimate reads it: at most 100 Hz, smoothed alike, and where samples count.

The balance is linear in its signals but for slip: the same zero-phase mean over all of them costs
nothing and takes noise away.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, thinning
from models.recordings import Recording
from models.recordings.record import ALL
from models.recordings.samples import tears
from models.vehicle import GRAVITY, Vehicle

FASTEST = 0.01  # [s]: sampled faster, samples are averaged
SMOOTHED = 0.07  # [s] of a mean, of a sedan
SLOW = 0.45  # sqrt(g L): below, no tire curve is learnt
LONGITUDINAL = 0.3  # [s] over which v_x is differentiated
MOST_A_X = 18.0  # m/s²
_BANK_MEAN = 1.0  # [s]: roads bank slowly
_LEVEL = 0.01  # sine, by which an accelerometer may be off level; twice that is a bank in full
_MOST_ROLL = 0.08  # per g, by which a body rolls outwards
_LATE = (1, 2, 3)  # columns of v_y, r and δ_f
_EXPLAINED = 0.15  # of the fast motion that an accelerometer may miss, else it is none of this car
_ACROSS = (0.8, 1.2)  # slope of an accelerometer's a_y on that motion; a body rolls
ALONG = (0.8, 1.25)  # slope of its a_x on that motion; a body pitches


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """Signals of n samples, for the forward model.
    t : time in the recording's own clock [s], (n,).   dt : sampling interval [s].
    signals : columns as `motion.model.SIGNALS`, (n, 9).   rates : d/dt of v_y, r and δ_f, (n, 3).
    counts : samples that count, (n,).   begins : first samples of its segments, rising, (k,).
    """

    t: Array
    dt: float
    signals: Array
    rates: Array
    counts: NDArray[np.bool_]
    every: int
    begins: tuple[int, ...] = (0,)

    @property
    def begin(self) -> float:
        """Time of the first sample that its first mean is of [s]."""
        return float(self.t[0]) - 0.5 * self.dt * (1.0 - 1.0 / self.every)

    @classmethod
    def of(
        cls,
        recording: Recording,
        vehicle: Vehicle,
        part: slice = ALL,
        *,
        replay: bool = False,
        fastest: float = FASTEST,
    ) -> "Drive":
        """Return a recording with a v_y as the estimate reads it.
        replay : whether each sample is asked about, down to the lowest speed; else those that come
            faster than `fastest` are averaged, and slow ones do not count.
        fastest : sampling interval to which they are averaged [s].
        """
        every = 1 if replay else max(1, round(fastest / recording.dt))
        slowest = vehicle.lowest_speed if replay else SLOW * vehicle.froude_speed
        dt = recording.dt * every
        begin, end, _ = part.indices(len(recording))
        within = []
        for one in recording.segments:
            a, b = max(one.start, begin), min(one.stop, end)
            cuts = set() if replay or a >= b else _tears(recording, slice(a, b), every)
            within += [slice(*edges) for edges in pairwise([a, *sorted(cuts), b])]
        pieces = [
            _piece(recording, one, vehicle, every, dt, slowest)
            for one in within
            if one.stop - one.start >= every
        ]
        t, signals, rates = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        ends = np.cumsum([len(some) for _, some, _ in pieces])
        return cls(
            t=t,
            dt=dt,
            signals=signals,
            rates=rates,
            counts=signals[:, -1] > 0.0,
            every=every,
            begins=(0, *(int(k) for k in ends[:-1])),
        )

    def on_time(self, delays: Array) -> "Drive":
        """Return the drive with late signals read later, and their rates there.
        delays : of v_y, r and the front steering angle [s], (3,); at the end of a segment a late
            signal keeps its last value.
        """
        signals, rates = self.signals.copy(), self.rates.copy()
        edges = (*self.begins, len(signals))
        for k, (column, delay) in enumerate(zip(_LATE, delays, strict=True)):
            if delay == 0.0:
                continue
            for begin, end in pairwise(edges):
                at = np.arange(end - begin)
                for values in (signals[begin:end, column], rates[begin:end, k]):
                    values[:] = np.interp(at + delay / self.dt, at, values)
        return replace(self, signals=signals, rates=rates)

    def thinned(self, every: int) -> "Drive":
        """Return the drive with means of so many samples each."""
        edges = [*self.begins, len(self.signals)]
        within = [slice(a, b) for a, b in pairwise(edges) if b - a >= every] or [slice(0, every)]
        signals, rates, t = (
            np.concatenate([thinned(one[part], every) for part in within])
            for one in (self.signals, self.rates, self.t)
        )
        ends = np.cumsum([(part.stop - part.start) // every for part in within])
        signals[:, -1] = signals[:, -1] == 1.0
        return replace(
            self, t=t, signals=signals, rates=rates, counts=signals[:, -1] > 0.0,
            dt=every * self.dt, every=every * self.every, begins=(0, *(int(k) for k in ends[:-1])),
        )  # fmt: skip

    def on(self, ln_m: Array | float) -> "Drive":
        """Return the drive on roads of other frictions.
        ln_m : ln of each sample's friction over that of the curves, (n,) or one.
        """
        signals = self.signals.copy()
        signals[:, 7] = ln_m
        return replace(self, signals=signals)


def _tears(recording: Recording, within: slice, every: int) -> set[int]:
    """Return where tears are, at which no car went on: two drives in one log.

    They are whole means of so many samples from the beginning on, as without tears.
    """
    names = ("v_x", "v_y", "r", "delta_f")
    signals = {name: recording.needed(name)[within] for name in names}
    moving = {name: signal for name, signal in signals.items() if np.ptp(signal) > 0.0}
    return {within.start + at // every * every for at, _ in tears(moving) if at >= every}


def _piece(
    recording: Recording, piece: slice, vehicle: Vehicle, every: int, dt: float, slowest: float
) -> tuple[Array, Array, Array]:
    """Return time, signals and rates of a segment; its first sample does not count."""
    v_y = recording.needed("v_y")

    scale = vehicle.scale
    count = round(SMOOTHED * scale / dt) | 1
    raw = (recording.v_x, v_y, recording.r, recording.delta_f, recording.delta_r)
    v_x, v_y, r, delta_f, delta_r = (box(thinned(signal[piece], every), count) for signal in raw)
    on = v_x > slowest
    v_x = np.where(on, v_x, slowest)
    n3 = LONGITUDINAL / dt
    a_x = box(gradient(box(v_x, n3 / 2), dt), n3) - box(v_y * r, n3)
    if recording.a_x is not None:
        felt = box(thinned(recording.a_x[piece], every), count)
        if slope_on(gradient(box(v_x, n3 / 3), dt) - v_y * r, felt, on, dt, ALONG) is not None:
            a_x = felt
    a_x = np.where(on, np.clip(a_x, -MOST_A_X, MOST_A_X), 0.0)
    bank = np.zeros_like(v_x)
    if recording.a_y is not None:
        bank = _bank(thinned(recording.a_y[piece], every), v_x, v_y, r, on, dt)
    on[0] = False  # nothing is carried into a segment
    signals = np.column_stack(
        [v_x, v_y, r, delta_f, delta_r, a_x, bank, np.zeros_like(v_x), on.astype(float)]
    )
    rates = np.column_stack([gradient(signal, dt) for signal in (v_y, r, delta_f)])
    t = thinned(recording.t[piece], every)
    return t, np.ascontiguousarray(signals), np.ascontiguousarray(rates)


def thinned(signal: Array, every: int) -> Array:
    """Return the means of so many rows each, (n // every, ...)."""
    m = len(signal) // every * every
    return signal[:m].reshape(-1, every, *signal.shape[1:]).mean(axis=1)


def gradient(signal: Array, dt: float) -> Array:
    """Return d/dt by central differences, (n,).
    signal : (n,).   dt : [s].
    """
    return np.gradient(signal, dt) if signal.size > 1 else np.zeros_like(signal)


def box(signal: Array, count: float) -> Array:
    """Return the centered mean over an odd count of samples, edges held, (n,).
    signal : (n,).
    """
    width = max(1, int(count) | 1)
    if width == 1:
        return np.array(signal, dtype=np.float64)
    half = width // 2
    padded = np.concatenate([np.full(half + 1, signal[0]), signal, np.full(half, signal[-1])])
    total = np.cumsum(padded - signal[0])
    return (total[width:] - total[:-width]) / width + signal[0]


def slope_on(
    motion: Array, felt: Array, on: NDArray[np.bool_], dt: float, within: tuple[float, float]
) -> float | None:
    """Return the slope of what an accelerometer feels on the motion, of what is fast in both.

    None where it shows no such motion: a slope out of bounds, or too much that it misses.
    """
    n1, n3 = _BANK_MEAN / dt, LONGITUDINAL / dt
    fast, fast_felt = ((box(one, n3) - box(one, n1))[on] for one in (motion, felt))
    power = float(fast @ fast)
    if fast.size < 2.0 / dt or power <= 0.0 or not np.any(fast_felt):
        return None
    slope = float(fast @ fast_felt) / power
    unexplained = 1.0 - float(np.corrcoef(fast, fast_felt)[0, 1]) ** 2
    return slope if within[0] < slope < within[1] and unexplained < _EXPLAINED else None


def _bank(a_y: Array, v_x: Array, v_y: Array, r: Array, on: NDArray[np.bool_], dt: float) -> Array:
    """Return the side force of a banked road [m/s²], what motion shows and no accelerometer, (n,).

    What roll and a sensor off level show instead is taken off; a channel that does not show the
    fast motion is left out.
    """
    n1 = _BANK_MEAN / dt
    motion = gradient(box(v_y, LONGITUDINAL / dt / 3), dt) + v_x * r
    gain = slope_on(motion, a_y, on, dt, _ACROSS)
    if gain is None:
        return np.zeros_like(v_x)
    slow, felt = box(motion, n1), box(a_y, n1)
    gap = slow - felt / (1.0 + min(max(gain - 1.0, 0.0), _MOST_ROLL))
    off = 10.0 * _LEVEL
    gap = gap - min(max(float(np.median(gap[on])), -off), off)
    share = np.clip((np.abs(gap) / GRAVITY - _LEVEL) / _LEVEL, 0.0, 1.0)
    return np.where(on, gap * share, 0.0)


def hardest(recording: Recording, seconds: float) -> slice:
    """Return which samples are the time of hardest cornering, of all that are not longer.
    seconds : how long it is at most [s].
    """
    n = min(round(seconds / recording.dt), len(recording))
    if n == len(recording):
        return slice(0, n)
    each = thinning(len(recording))
    power = recording.v_x * recording.r
    power *= power
    begins = np.arange(0, len(recording), each)
    total = np.cumsum(np.append(0.0, np.add.reduceat(power, begins)))
    m = max(n // each, 1)
    first = min(each * int(np.argmax(total[m:] - total[:-m])), len(recording) - n)
    return slice(first, first + n)
