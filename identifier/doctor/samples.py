"""What is wrong with the samples of a channel, before any physics: frozen, held, lost, copied.

What samples are like tells `models.recordings.samples`; here it becomes findings, where the drive
goes on meanwhile and in their units.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from codegen.arrays import Array
from identifier.doctor.finding import Finding, first_of_each
from identifier.doctor.pieces import SLOWEST, driven_pieces, usual_speed
from models.recordings import Recording
from models.recordings import samples as facts
from models.recordings.evidence import computed_v_y
from models.recordings.record import CHANNELS
from models.recordings.repair import Repair

_FREEZE = 0.3  # [s] that a noisy channel repeats one number
_MOVES = 0.15  # of the range of v_x r, by which a car must move meanwhile, in any unit
_NOISY = 2.0  # steps of a rounded channel, of noise that never lets it repeat one number so long
_REPEATED = 0.01  # of a noisy channel: share of repeated samples
_FEW = 5  # of a noisy channel: how often it repeats
_CAUGHT_UP = 0.025  # of a rounded channel: share of samples after which it catches up
_ALIKE_DELAYS = math.log(1.6)  # of the times by which samples of two channels are late
_COARSE = 0.2  # steps over the standard deviation of a channel, from which models get worse
CERTAIN = 0.99  # confidence in what samples show by themselves

NOT_MEASURED = ("computed", "copied")  # codes of what no sensor showed
LATERAL = ("v_y", "r", "delta_f", "a_y")
UNITS = {"v_x": "m/s", "v_y": "m/s", "r": "rad/s", "delta_f": "rad", "delta_r": "rad",
         "a_y": "m/s²"}  # fmt: skip
_ESTIMATED, _SWITCHED = ("v_y", "r"), 2  # channels that may be, how often they are off in a turn


def sample_findings(recording: Recording) -> list[Finding]:
    pieces = driven_pieces(recording)
    words = [one for one in map(computed_v_y, pieces) if one is not None]
    if 2 * len(words) > len(pieces):  # with which nothing else can be found
        return [_found("computed", "v_y", math.nan, CERTAIN, words[0])]
    listed = [*_missing(pieces), *(one for piece in pieces for one in _piece_findings(piece))]
    late = {one.channel: one.size for one in listed if one.code == "jitter"}
    return [
        one
        for one in first_of_each(listed)
        if (one.code != "jitter" or _is_late(one.channel, late, recording.dt))
        # Where several channels are late, all are torn, at every sample.
        and not (len(late) > 1 and one.code == "clock" and one.confidence < CERTAIN)
    ]


def _is_late(name: str, late: Mapping[str, float], dt: float) -> bool:
    """Whether noise that grows with the slope is that of late samples: r has it, and others alike.

    Noise of v_y alone may well grow with the slip, and that of a camera with the speed.
    """
    alike = [one for one, size in late.items() if abs(math.log(size / late[name])) < _ALIKE_DELAYS]
    return "r" in alike and len(alike) > 1 and late[name] > 0.7 * dt


def _found(code: str, channel: str, size: float, confidence: float, text: str) -> Finding:
    unit = "" if code in ("copied", "dropout", "spikes") else "s"
    return Finding(
        code=code, channel=channel, size=size, unit=unit, confidence=confidence, text=text
    )


def _piece_findings(recording: Recording) -> list[Finding]:
    there = [name for name in CHANNELS if getattr(recording, name) is not None]
    moving = {name: one for name in there if np.ptp(one := getattr(recording, name)) > 0.0}
    found = list(_copies(moving))
    named = {*(one.channel for one in found), *_still(recording)}
    jump = _clock_jump(recording, moving)
    if jump is not None:
        found.append(jump)
    for name in there:
        if name not in named:
            found += _channel(name, recording, jump is not None)
    return found


def _missing(pieces: tuple[Recording, ...]) -> Iterator[Finding]:
    """Channels that stand still throughout, or in whole pieces of a long drive, as others move."""
    for name in LATERAL:
        there = [piece for piece in pieces if name in _still(piece)]
        if len(there) < len(pieces):  # a straight road may well leave a coarse channel alone
            usual = facts.swing(np.concatenate([_turning(name, piece) for piece in pieces]))
            there = [piece for piece in there if _moves(name, piece, slice(0, len(piece)), usual)]
        if not there:
            continue
        value = f"{float(getattr(there[0], name)[0]):g} {UNITS[name]}"
        text = (
            f"{name} is {value} throughout while the car moves: no sensor, not connected, or too "
            "few digits"
            if len(there) == len(pieces)
            else _stopped(name, float(there[0].t[0]), there[0].duration)
        )
        length = sum(one.duration for one in there)
        yield _found("frozen", name, length, CERTAIN, text)


def _still(recording: Recording) -> list[str]:
    """Return the lateral channels that never change while two others do."""
    signals = {name: getattr(recording, name) for name in LATERAL}
    there = [name for name, signal in signals.items() if signal is not None]
    still = [name for name in there if not np.ptp(signals[name]) > 0.0]
    return still if len(there) - len(still) > 1 else []


def _stopped(name: str, since: float, duration: float) -> str:
    return (
        f"{name} does not change from {since:.4g} s on for {duration:.3g} s: frozen; cut the log "
        "there"
    )


def _copies(moving: Mapping[str, Array]) -> Iterator[Finding]:
    for one, other in combinations(moving, 2):
        ratio = facts.multiple(moving[one], moving[other])
        if ratio is None:
            continue
        what = "is a copy of" if abs(ratio - 1.0) < facts.COPY else f"is {ratio:.4g} times"
        text = f"{other} {what} {one}, sample by sample: it was computed or mapped, not measured"
        yield _found("copied", other, ratio, CERTAIN, text)


def _channel(name: str, recording: Recording, jumps: bool) -> Iterator[Finding]:
    signal, dt = getattr(recording, name), recording.dt
    noise, step, runs = facts.noise(signal), facts.resolution(signal), facts.Runs.of(signal)
    share = step / max(float(np.std(signal)), 1e-300)
    if name in LATERAL and share > _COARSE:
        text = (
            f"{name} comes in steps of {step:.3g} {UNITS[name]}, {share:.2g} of its standard "
            "deviation: write more digits, or the tires are less exact"
        )
        coarse = _found("quantized", name, step, CERTAIN, text)
        yield replace(coarse, unit=UNITS[name], note=True)
    lost = facts.dropouts(signal, noise)
    if lost.size:
        text = (
            f"{name} drops to 0 for {lost.size} of {signal.size} samples, first at "
            f"{recording.t[lost[0]]:.4g} s: a lost sensor; leave these samples out of the log"
        )
        yield _found("dropout", name, float(lost.size), CERTAIN, text)
        return
    stairs = runs.stairs(signal, step)
    if stairs is not None:
        delay = 0.5 * (stairs - 1) * dt
        text = (
            f"{name} has a new value every {1e3 * stairs * dt:.3g} ms only and repeats it in "
            f"between: so it is {1e3 * delay:.3g} ms late in the mean"
        )
        slow = _found("held", name, stairs * dt, CERTAIN, text)
        yield replace(slow, repair=Repair(delay={name: delay}), sure=True)
    else:
        step = max(step, runs.resolution(signal))
        yield from _repeats(name, runs, step, noise > _NOISY * step, recording)
    spikes = facts.spikes(signal, noise)
    if not jumps and 3 <= spikes.size <= 0.1 * signal.size:
        first = f"first at {recording.t[int(spikes[0])]:.4g} s"
        text = f"{name} has {spikes.size} samples far off their neighbors, {first}"
        yield _found("spikes", name, float(spikes.size), 0.9, text)
    late = None if stairs is not None else facts.lateness(signal, dt, step)
    if late is not None:
        size, z = late
        text = (
            f"samples of {name} are up to {1e3 * size:.2g} ms late at random: stamped on arrival, "
            "not on sampling"
        )
        yield replace(_found("jitter", name, size, 0.9, text), deviation=size / z)


def _repeats(
    name: str, runs: facts.Runs, step: float, noisy: bool, recording: Recording
) -> Iterator[Finding]:
    """A channel that repeats one number: for long, or again and again, as noise never does."""
    signal, dt = getattr(recording, name), recording.dt
    zero = _zero(name, runs, step, recording) if name in _ESTIMATED else None
    if zero is not None:
        yield zero
        return
    lost, chance = runs.lost(signal, step)
    ends = lost.copy()
    ends[-1] |= noisy or not step
    lost &= noisy | (runs.length * dt < _FREEZE)  # what is steered in steps rests between them
    again = int(np.count_nonzero(lost))
    longest = int(np.argmax(runs.length * ends))
    length, at = int(runs.length[longest]), int(runs.first[longest])
    frozen = length * dt >= _FREEZE and ends[longest] and (noisy or name in ("v_y", "r", "a_y"))
    frozen = frozen and _runs_on(name, noisy, recording, slice(at, at + length))
    first = float(recording.t[at])
    of_all = float(np.sum(runs.length[lost] - 1))
    of_others = of_all - (length - 1) * bool(frozen and lost[longest])
    enough = (_CAUGHT_UP if step else _REPEATED) * len(recording)
    if (noisy or step) and of_others * (again - chance) > enough * again and again >= _FEW:
        typical = float(np.median(runs.length[lost])) * dt
        most = f", the longest for {length * dt:.3g} s from {first:.4g} s on" if frozen else ""
        text = (
            f"{name} holds its last value {again} times, typically for {1e3 * typical:.3g} ms "
            f"({100.0 * of_all / len(recording):.2g} % of the log){most}: samples were lost on the "
            "way and repeated"
        ) + ", or it is a command, constant until the next one" * (name == "delta_f")
        yield _found("held", name, typical, 0.95, text)
    elif frozen:
        yield _found("frozen", name, length * dt, 0.95, _stopped(name, first, length * dt))


def _zero(name: str, runs: facts.Runs, step: float, recording: Recording) -> Finding | None:
    """A channel that is exactly 0 for long, again and again, while the car turns.

    No sensor does that: an estimate does, which is switched off there.
    """
    signal, dt = getattr(recording, name), recording.dt
    usual = facts.swing(_turning(name, recording))
    long = (runs.length * dt >= _FREEZE) & (signal[runs.first] == 0.0)
    far = np.concatenate([[False], runs.far(signal, step), [False]])
    long &= far[:-1] | far[1:]
    places = [
        slice(first, first + n)
        for first, n in zip(runs.first[long].tolist(), runs.length[long].tolist(), strict=True)
    ]
    turning = [one for one in places if _moves(name, recording, one, usual)]
    if len(turning) < _SWITCHED:
        return None
    off = np.repeat(long, runs.length)
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
    return _found("zero", name, size, 0.95, text)


def _runs_on(name: str, noisy: bool, recording: Recording, here: slice) -> bool:
    """Whether the drive goes on while a channel stands still: it moves, or another one does."""
    if np.mean(np.abs(recording.v_x[here])) < SLOWEST * usual_speed((recording,)):
        return False
    others = [getattr(recording, one) for one in ("v_y", "r", "delta_f", "v_x") if one != name]
    alive = sum(bool(np.ptp(one[here]) > 0.0) for one in others if one is not None)
    usual = facts.swing(_turning(name, recording))
    return (noisy and alive >= 2) or _moves(name, recording, here, usual)


def _moves(name: str, recording: Recording, here: slice, usual: float) -> bool:
    """Whether the car changes its turn over a segment, by the channels that are not judged."""
    width = max(1, min(round(0.2 / recording.dt), (here.stop - here.start) // 2))
    smooth = np.convolve(_turning(name, recording)[here], np.ones(width) / width, "valid")
    return bool(np.ptp(smooth) > _MOVES * usual > 0.0)


def _turning(name: str, recording: Recording) -> Array:
    """Return what tells how a car turns, other than the channel that is judged."""
    return recording.delta_f if name == "r" else recording.v_x * recording.r


def _clock_jump(recording: Recording, moving: Mapping[str, Array]) -> Finding | None:
    """Return where the clock jumped, None where it did not."""
    again, dt = facts.logged_again(moving), recording.dt
    jump = next(iter(facts.tears(moving)), None) if again is None else None
    if again is not None:
        at, size, confidence, deviation = again[0], -again[1] * dt, CERTAIN, 0.0
    elif jump is not None:
        at, size, confidence, deviation = jump[0], jump[1] * dt, 0.95, 0.5 * abs(jump[1]) * dt
    else:
        return None
    there = f"{recording.t[at]:.4g} s"
    text = f"all channels jump at once at {there}: time is missing or logged twice"
    if again is not None:
        text = f"{-size:.3g} s before {there} are logged twice"
    text = f"the clock jumps: {text}; cut the log into runs there ({there})"
    return replace(_found("clock", "", size, confidence, text), deviation=deviation)
