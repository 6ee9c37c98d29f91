"""What is wrong with the samples of a channel, before any physics: frozen, held, lost, copied.

Every rule compares a channel with its own noise or with the other channels; none knows a car.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.doctor.chosen import CHOSEN
from identifier.doctor.finding import Finding, first_of_each
from identifier.doctor.pieces import driven_pieces
from models.recordings import Recording
from models.recordings.repair import Repair

LATERAL = ("v_y", "r", "delta_f", "a_y")
CHANNELS = ("v_x", *LATERAL, "delta_r")
UNITS = {"v_x": "m/s", "v_y": "m/s", "r": "rad/s", "delta_f": "rad", "delta_r": "rad",
         "a_y": "m/s^2"}  # fmt: skip
_ESTIMATED, _SWITCHED = ("v_y", "r"), 2  # channels that may be, how often they are off in a turn


class _Runs(NamedTuple):
    """Segments of equal neighbors of a channel: index of the first sample, and length, (k,)."""

    first: NDArray[np.intp]
    length: NDArray[np.intp]


def channels(recording: Recording) -> Mapping[str, Array]:
    """Return the signals that a recording has, by name; a rear axle that never steers is none."""
    found = {name: getattr(recording, name) for name in CHANNELS}
    if not recording.delta_r.any():
        del found["delta_r"]
    return {name: signal for name, signal in found.items() if signal is not None}


def sample_findings(recording: Recording) -> list[Finding]:
    pieces = driven_pieces(recording)
    listed = [*_missing(pieces), *(one for piece in pieces for one in _piece_findings(piece))]
    late = {one.channel: one.size for one in listed if one.code == "jitter"}
    several = len(late) > 1  # all channels are torn then, at every sample
    late = {name: size for name, size in late.items() if _is_late(name, late, recording.dt)}
    return [
        one
        for one in first_of_each(listed)
        if (one.code != "jitter" or one.channel in late)
        and not (several and one.code == "clock" and one.confidence < CHOSEN.certain)
    ]


def _is_late(name: str, late: Mapping[str, float], dt: float) -> bool:
    """Whether noise that grows with the slope is that of late samples: r has it, and others alike.

    Noise of v_y alone may well grow with the slip, and that of a camera with the speed.
    """
    alike = [
        one for one, size in late.items() if abs(math.log(size / late[name])) < CHOSEN.alike_delays
    ]
    return "r" in alike and len(alike) > 1 and late[name] > 0.7 * dt


def _found(
    code: str, channel: str, size: float, unit: str, confidence: float, text: str
) -> Finding:
    return Finding(
        code=code, channel=channel, size=size, unit=unit, confidence=confidence, text=text
    )


def _piece_findings(recording: Recording) -> list[Finding]:
    signals = channels(recording)
    found = list(_copies(signals))
    named = {one.channel for one in found} | set(_still(signals))
    jump = _clock_jump(recording, signals)
    if jump is not None:
        found.append(jump)
    for name, signal in signals.items():
        if name not in named:
            found += _channel(name, signal, recording, jump is not None)
    return found


def _still(signals: Mapping[str, Array]) -> tuple[str, ...]:
    """Return the channels that never change while two others do."""
    moves = {name: bool(np.ptp(signals[name]) > 0.0) for name in LATERAL if name in signals}
    return (
        tuple(name for name, does in moves.items() if not does) if sum(moves.values()) > 1 else ()
    )


def _missing(pieces: tuple[Recording, ...]) -> Iterator[Finding]:
    """Channels that stand still throughout, or in whole pieces of a long drive."""
    still = [set(_still(channels(piece))) for piece in pieces]
    for name in LATERAL:
        there = [piece for piece, names in zip(pieces, still, strict=True) if name in names]
        if len(there) < len(pieces):  # a straight road may well leave a coarse channel alone
            usual = _swing(np.concatenate([_turning(name, piece) for piece in pieces]))
            there = [piece for piece in there if _moves(name, piece, 0, len(piece), usual)]
        if not there:
            continue
        length = sum(one.duration for one in there)
        value = f"{float(getattr(there[0], name)[0]):g} {UNITS[name]}"
        text = (
            f"{name} is {value} throughout while the car moves: no sensor, or it was not connected"
            if len(there) == len(pieces)
            else _stopped(name, float(there[0].t[0]), there[0].duration)
        )
        yield _found("frozen", name, length, "s", CHOSEN.certain, text)


def _stopped(name: str, since: float, duration: float) -> str:
    return (
        f"{name} does not change from {since:.4g} s on for {duration:.3g} s: frozen; cut the log "
        "there"
    )


def _copies(signals: Mapping[str, Array]) -> Iterator[Finding]:
    moving = {name: signal for name, signal in signals.items() if np.ptp(signal) > 0.0}
    names = list(moving)
    for k, one in enumerate(names):
        for other in names[k + 1 :]:
            a, b = moving[one], moving[other]
            ratio = float(a @ b) / float(a @ a)
            size = float(np.sqrt(b @ b))
            if float(np.sqrt(np.sum((b - ratio * a) ** 2))) > 1e-7 * size:
                continue
            what = "is a copy of" if abs(ratio - 1.0) < 1e-7 else f"is {ratio:.4g} times"
            text = (
                f"{other} {what} {one}, sample by sample: it was computed or mapped, not measured"
            )
            yield _found("copied", other, ratio, "", CHOSEN.certain, text)


def _channel(name: str, signal: Array, recording: Recording, jumps: bool) -> Iterator[Finding]:
    dt = recording.dt
    noise = _noise(signal)
    quantum = _quantum(signal)
    runs = _runs(signal)
    if quantum is not None and quantum > CHOSEN.coarse * float(np.std(signal)):
        text = (
            f"{name} comes in steps of {quantum:.3g} {UNITS[name]}: a coarse sensor, or too few "
            "digits were written"
        )
        yield _found("quantized", name, quantum, UNITS[name], CHOSEN.certain, text)
    lost = _lost(signal, noise)
    if lost.size:
        text = (
            f"{name} drops to 0 for {lost.size} of {signal.size} samples, first at "
            f"{recording.t[lost[0]]:.4g} s: a lost sensor; leave these samples out of the log"
        )
        yield _found("dropout", name, float(lost.size), "", CHOSEN.certain, text)
        return
    stairs = _stairs(runs, signal.size, quantum)
    if stairs is not None:
        delay = 0.5 * (stairs - 1) * dt
        yield Finding(
            code="held",
            channel=name,
            size=stairs * dt,
            unit="s",
            confidence=CHOSEN.certain,
            text=f"{name} has a new value every {1e3 * stairs * dt:.3g} ms only and repeats it in "
            f"between: so it is {1e3 * delay:.3g} ms late in the mean",
            repair=Repair(delay={name: delay}),
            sure=True,
        )
    elif quantum is None:
        yield from _repeats(name, runs, noise > 0.0, recording)
    spikes = _spikes(signal, noise) if not jumps else np.empty(0)
    if 3 <= spikes.size <= 0.1 * signal.size:
        first = f"first at {recording.t[int(spikes[0])]:.4g} s"
        text = f"{name} has {spikes.size} samples far off their neighbors, {first}"
        yield _found("spikes", name, float(spikes.size), "", 0.9, text)
    late = _jitter(signal, dt)
    if late is not None and stairs is None:
        size, z = late
        text = (
            f"samples of {name} are up to {1e3 * size:.2g} ms late at random: stamped on arrival, "
            "not on sampling"
        )
        yield replace(_found("jitter", name, size, "s", 0.9, text), deviation=size / z)


def _repeats(name: str, runs: _Runs, noisy: bool, recording: Recording) -> Iterator[Finding]:
    """A channel that holds one number: for long, or again and again, as noise never does."""
    signal, dt = getattr(recording, name), recording.dt
    zero = _zero(name, runs, recording) if name in _ESTIMATED else None
    if zero is not None:
        yield zero
        return
    longest = int(np.argmax(runs.length))
    length, at = int(runs.length[longest]), int(runs.first[longest])
    grain = _grain(signal, runs)
    lost = _lost_on_the_way(signal, runs, grain)
    rests = not (lost[longest] or at + length == signal.size)
    frozen = length * dt >= CHOSEN.freeze and not rests and (noisy or name in ("v_y", "r", "a_y"))
    frozen = frozen and _runs_on(name, noisy, recording, at, length)
    first = float(recording.t[at])
    of_all, again = float(np.sum(runs.length[lost] - 1)), int(np.count_nonzero(lost))
    of_others = of_all - (length - 1) * bool(frozen and lost[longest])
    enough = CHOSEN.caught_up if grain is not None else CHOSEN.repeated + _rounded_alike(signal)
    known = noisy or grain is not None
    if known and of_others / len(recording) > enough and again >= CHOSEN.few:
        typical = float(np.median(runs.length[lost])) * dt
        most = f", the longest for {length * dt:.3g} s from {first:.4g} s on" if frozen else ""
        text = (
            f"{name} holds its last value {again} times, typically for {1e3 * typical:.3g} ms "
            f"({100.0 * of_all / len(recording):.2g} % of the log){most}: samples were lost on the "
            "way and repeated"
        )
        yield _found("held", name, typical, "s", 0.95, text)
    elif frozen:
        yield _found("frozen", name, length * dt, "s", 0.95, _stopped(name, first, length * dt))


def _zero(name: str, runs: _Runs, recording: Recording) -> Finding | None:
    """A channel that is exactly 0 for long, again and again, while the car turns.

    No sensor does that: an estimate does, which is switched off there.
    """
    signal, dt, usual = getattr(recording, name), recording.dt, _swing(_turning(name, recording))
    long = np.flatnonzero((runs.length * dt >= CHOSEN.freeze) & (signal[runs.first] == 0.0))
    places = [slice(int(runs.first[k]), int(runs.first[k] + runs.length[k])) for k in long]
    turning = [
        one for one in places if _moves(name, recording, one.start, one.stop - one.start, usual)
    ]
    if len(turning) < _SWITCHED:
        return None
    off = np.zeros(len(recording), dtype=bool)
    for one in places:
        off[one] = True
    size, there = dt * np.count_nonzero(off), max(turning, key=lambda one: one.stop - one.start)
    speed = np.abs(recording.v_x)
    slowest, fastest = float(np.percentile(speed[~off], 5)), float(np.percentile(speed[off], 95))
    slow = f", where the car is slower than {slowest:.3g} m/s" if fastest <= slowest else ""
    text = (
        f"{name} reads exactly 0 {len(places)} times, for {size:.3g} s in all "
        f"({100.0 * float(np.mean(off)):.2g} % of the log), as from {recording.t[there.start]:.4g} "
        f"s on for {dt * (there.stop - there.start):.3g} s{slow}: an estimate that is switched off "
        "there and no measurement; cut these segments out of the log"
    )
    return _found("zero", name, size, "s", 0.95, text)


def _grain(signal: Array, runs: _Runs) -> float | None:
    """Return the step of which all values are multiples that a channel keeps for a while.

    None where there is none. Between them a channel that was brought to another clock has any
    value, so that all of its values say nothing.
    """
    kept = np.unique(signal[runs.first[runs.length > 2]])
    steps = np.diff(kept)
    steps = steps[steps > 1e-9 * float(np.abs(signal).max())]
    if steps.size < CHOSEN.few:
        return None
    step = float(np.median(steps[steps < 1.5 * float(steps.min())]))
    count = steps / step
    return step if float(np.mean(np.abs(count - np.round(count)) < 0.05)) > CHOSEN.on_grid else None


def _lost_on_the_way(signal: Array, runs: _Runs, grain: float | None) -> NDArray[np.bool_]:
    """Return which runs of equal values may be lost samples: a rest of a rounded channel is none.

    A rest ends by one step of the rounding, or as the channel begins to move: by a step that others
    follow. After a loss the channel catches up at once, brought to another clock by two steps; that
    of a rest then may overshoot.
    """
    again = runs.length > 1
    if grain is None:
        return again
    change = np.concatenate([np.diff(signal), [0.0, 0.0, 0.0]])
    end = runs.first + runs.length - 1
    step, after, later = change[end], change[end + 1], change[end + 2]
    goes_on = step * later > CHOSEN.goes_on * step**2
    far = np.minimum(np.abs(step), np.abs(step + after)) > 1.5 * grain
    may: NDArray[np.bool_] = again & far & ~goes_on
    return may


def _rounded_alike(signal: Array) -> float:
    """Return the share of neighbors that rounding alone makes equal; 0 where nothing was rounded.

    Differences of a rounded channel are multiples k of its last digit. Where noise makes them,
    ln(share of k) falls with k²: those of ±1 and ±2 tell how many are 0.
    """
    steps = np.abs(np.diff(signal))
    moved = steps[steps > 1e-9 * float(np.abs(signal).max())]
    if not moved.size:
        return 0.0
    digits = np.round(moved / float(moved.min()))
    one, two = (float(np.count_nonzero(digits == k)) / (2.0 * signal.size) for k in (1, 2))
    return one * (one / two) ** (1.0 / 3.0) if two > 0.0 else 0.0


def _runs_on(name: str, noisy: bool, recording: Recording, first: int, length: int) -> bool:
    """Whether the drive goes on while a channel stands still: it moves, or another one does."""
    here = slice(first, first + length)
    if np.mean(np.abs(recording.v_x[here])) < 0.3 * float(np.percentile(np.abs(recording.v_x), 95)):
        return False
    others = [getattr(recording, one) for one in ("v_y", "r", "delta_f", "v_x") if one != name]
    alive = sum(bool(np.ptp(one[here]) > 0.0) for one in others if one is not None)
    usual = _swing(_turning(name, recording))
    return (noisy and alive >= 2) or _moves(name, recording, first, length, usual)


def _moves(name: str, recording: Recording, first: int, length: int, usual: float) -> bool:
    """Whether the car changes its turn over a segment, by the channels that are not judged."""
    width = max(1, min(round(0.2 / recording.dt), length // 2))
    turn = _turning(name, recording)[first : first + length]
    smooth = np.convolve(turn, np.ones(width) / width, "valid")
    return bool(np.ptp(smooth) > CHOSEN.moves * usual > 0.0)


def _turning(name: str, recording: Recording) -> Array:
    """Return what tells how a car turns, other than the channel that is judged."""
    return recording.delta_f if name == "r" else recording.v_x * recording.r


def _swing(signal: Array) -> float:
    return float(np.percentile(signal, 99) - np.percentile(signal, 1))


def _noise(signal: Array) -> float:
    """Return the standard deviation of white noise where a channel moves, 0 where it is smooth.

    Second differences of noise alternate, neighbors correlate by -2/3; those of a motion do not.
    """
    bend = np.diff(signal, 2)
    moving = np.flatnonzero((bend[1:] != 0.0) & (bend[:-1] != 0.0))
    if moving.size < 0.05 * bend.size or moving.size < 20:
        return 0.0
    a, b = bend[moving], bend[moving + 1]
    cut = 6.0 * float(np.median(np.abs(a)))
    kept = (np.abs(a) < cut) & (np.abs(b) < cut)
    together = float(a[kept] @ b[kept]) / (float(np.sum(a[kept] ** 2)) + 1e-300)
    return (
        float(np.median(np.abs(a))) / (0.6745 * math.sqrt(6.0))
        if together < CHOSEN.alternate
        else 0.0
    )


def _runs(signal: Array) -> _Runs:
    starts = np.flatnonzero(np.concatenate([[True], np.diff(signal) != 0.0]))
    return _Runs(starts, np.diff(np.append(starts, signal.size)))


def _quantum(signal: Array) -> float | None:
    """Return the step of which all values are multiples, None where there is none."""
    values = np.unique(signal)
    if values.size < 3:
        return None
    steps = np.diff(values)
    step = float(np.median(steps[steps < 1.5 * float(np.min(steps))]))
    if (
        not step > 1e-9 * float(np.abs(values).max())
        or values.size > 0.5 * np.ptp(signal) / step + 2e3
    ):
        return None
    count = steps / step
    on_grid = np.abs(count - np.round(count)) < 0.05
    few = values.size < 0.5 * signal.size
    return step if few and bool(np.mean(on_grid) > 0.99) else None


def _stairs(runs: _Runs, n: int, quantum: float | None) -> int | None:
    """Return how many samples each value of a slow channel lasts, None where it is not slow."""
    inner = runs.length[1:-1]
    if inner.size < 10:
        return None
    typical = int(np.median(inner))
    same = np.abs(inner - typical) <= max(1, round(0.1 * typical))
    regular = float(np.sum(inner[same])) > (0.7 if quantum is None else 0.9) * n
    return typical if typical >= 2 and regular and np.mean(inner >= 2) > 0.8 else None


def _lost(signal: Array, noise: float) -> NDArray[np.intp]:
    """Return the samples that are exactly zero far from what stands before and after them."""
    zero = signal == 0.0
    if not zero.any() or zero.mean() > 0.3:
        return np.empty(0, dtype=np.intp)
    kept = np.flatnonzero(~zero)
    between = np.interp(np.arange(signal.size), kept, signal[kept])
    step = float(np.percentile(np.abs(np.diff(signal[kept])), 90))
    far = zero & (np.abs(between) > 10.0 * max(noise, step))
    edges = np.flatnonzero(np.diff(far.astype(int)) == 1)
    found: NDArray[np.intp] = np.flatnonzero(far)
    return found if edges.size >= 1 and found.size >= 2 else np.empty(0, dtype=np.intp)


def _spikes(signal: Array, noise: float) -> NDArray[np.intp]:
    """Return single samples far off both neighbors, which agree with each other."""
    if not noise > 0.0 or signal.size < 8:
        return np.empty(0, dtype=np.intp)
    off = signal[2:-2] - np.median(
        np.stack([signal[:-4], signal[1:-3], signal[3:-1], signal[4:]]), axis=0
    )
    around = np.ptp(np.stack([signal[:-4], signal[1:-3], signal[3:-1], signal[4:]]), axis=0)
    size = np.percentile(signal, 99) - np.percentile(signal, 1)
    far = np.abs(off) > np.maximum(CHOSEN.spike * noise, np.maximum(0.05 * size, 3.0 * around))
    found: NDArray[np.intp] = np.flatnonzero(far) + 2
    return found


def _jitter(signal: Array, dt: float) -> tuple[float, float] | None:
    """Return how late samples are at most, and how sure: noise that grows with the slope.

    Samples late by u, uniform from 0 to J, are off by slope times u: third differences then have
    the variance 20 (σ^2 + J^2 slope^2/12).
    """
    if signal.size < 200:
        return None
    bend = np.diff(signal, 3)
    width = max(3, round(0.05 / dt))
    smooth = np.convolve(signal, np.ones(width) / width, "same")
    slope = np.gradient(smooth, dt)[1:-2]
    inner = slice(width, -width)
    y, x = (bend[inner] ** 2) / 20.0, slope[inner] ** 2
    size_x, size_y = float(np.mean(x)), float(np.mean(y))
    if not (size_x > 0.0 and size_y > 0.0):
        return None
    x, y = x / size_x, y / size_y
    X = np.column_stack([np.ones(x.size), x])
    y = np.minimum(y, CHOSEN.outlier * _two_step(X, y))
    weight = 1.0 / _two_step(X, y)
    normal = X.T @ (weight[:, None] ** 2 * X)
    try:
        theta = np.linalg.solve(normal, X.T @ (weight**2 * y))
        deviation = math.sqrt(float(np.linalg.inv(normal)[1, 1]) * 2.0 * 1.8)
    except np.linalg.LinAlgError:
        return None
    if theta[1] <= 0.0:
        return None
    z = float(theta[1]) / max(deviation, 1e-300)
    size = math.sqrt(12.0 * float(theta[1]) * size_y / size_x)
    grows = theta[1] * float(np.percentile(x, 90)) > 0.5 * max(float(theta[0]), 0.0)
    return (size, 2.0 * z) if z > 8.0 and grows and size > 0.3 * dt else None


def _two_step(X: Array, y: Array) -> Array:
    """Return the variance that a first fit says each sample has."""
    theta, *_ = np.linalg.lstsq(X, y, rcond=None)
    floor = 0.1 * float(np.mean(y))
    variance: Array = np.maximum(X @ theta, floor)
    return variance


# The clock.

SMOOTH = ("v_y", "r", "v_x")  # that no car can change at once, as it can its steering


def _clock_jump(recording: Recording, signals: Mapping[str, Array]) -> Finding | None:
    """Return where the clock jumped, None where it did not."""
    moving = {name: signal for name, signal in signals.items() if np.ptp(signal) > 0.0}
    again, dt = _logged_again(moving), recording.dt
    found = _torn(moving, dt) if again is None else (again[0], -again[1] * dt, 0.0)
    if found is None:
        return None
    (at, size, deviation), confidence = found, 0.95 if again is None else CHOSEN.certain
    there = f"{recording.t[at]:.4g} s"
    text = f"all channels jump at once at {there}: time is missing or logged twice"
    if again is not None:
        text = f"{-size:.3g} s before {there} are logged twice"
    text = f"the clock jumps: {text}; cut the log into runs there ({there})"
    return replace(_found("clock", "", size, "s", confidence, text), deviation=deviation)


def _logged_again(moving: Mapping[str, Array]) -> tuple[int, int] | None:
    """Return where samples begin that were logged before, and how many samples before."""
    if len(moving) < 3:
        return None
    table = np.column_stack(list(moving.values()))
    _, code = np.unique(table, axis=0, return_inverse=True)
    code = code.reshape(-1)
    order = np.argsort(code, kind="stable")
    same = np.flatnonzero(np.diff(code[order]) == 0)
    back = order[same + 1] - order[same]
    lags, count = np.unique(back[back > CHOSEN.block], return_counts=True)
    for lag in lags[count >= CHOSEN.block]:
        late = np.sort(order[same + 1][back == lag])
        block = late[: np.count_nonzero(np.diff(late) == 1) + 1]
        if np.all(np.ptp(table[block], axis=0) > 0.0) and block.size >= CHOSEN.block:
            return int(late[0]), int(lag)
    return None


def _torn(moving: Mapping[str, Array], dt: float) -> tuple[int, float, float] | None:
    """Return where both sides of an instant disagree in several channels, and by what time."""
    names = [name for name in moving if moving[name].size > 20 * CHOSEN.side]
    if len(names) < 3 or not set(names) & set(SMOOTH):
        return None
    k = np.arange(CHOSEN.side) + 0.5
    V = np.vander(k, 3, increasing=True)
    weights = np.linalg.pinv(V)[0]  # of a parabola's value between both sides
    slopes = np.linalg.pinv(V)[1]
    score, torn, rate = [], [], []
    for name in names:
        signal = moving[name]
        windows = np.lib.stride_tricks.sliding_window_view(signal, CHOSEN.side)
        right, left = windows[CHOSEN.side :] @ weights, windows[: -CHOSEN.side] @ weights[::-1]
        jump = right - left
        usual = np.median(np.abs(jump)) / 0.6745
        busy = np.convolve(np.abs(jump), np.ones(8 * CHOSEN.side) / (8 * CHOSEN.side), "same")
        score.append(np.abs(jump) / np.maximum(np.maximum(usual, 0.8 * busy), 1e-300))
        torn.append(jump)
        rate.append(
            0.5 * (windows[CHOSEN.side :] @ slopes - windows[: -CHOSEN.side] @ slopes[::-1]) / dt
        )
    table = np.sort(np.stack(score), axis=0)
    at = int(np.argmax(table[-2]))
    smooth = max(score[names.index(name)][at] for name in names if name in SMOOTH)
    if table[-2, at] < CHOSEN.jump or table[-3, at] < CHOSEN.also or smooth < CHOSEN.jump:
        return None
    jumps, rates = np.stack(torn)[:, at], np.stack(rate)[:, at]
    scale = np.array([np.std(moving[name]) for name in names])
    a, b = rates / scale, jumps / scale
    size = float(a @ b / (a @ a + 1e-300))
    if abs(size) < CHOSEN.shortest_jump * dt:
        return None  # that is a late sample, not another time
    return at + CHOSEN.side, size, 0.5 * abs(size)
