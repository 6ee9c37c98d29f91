"""From a log to a recording: its channels in SI, on one clock, in stretches, judged.

What is told by a map holds; then the standard names; then what the names of the channels propose,
where every signal that is needed is sure. What was proposed is said in the recording's notes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi

from codegen.arrays import Array, by_blocks
from models.logs.clock import (
    SLOWEST,
    Raw,
    Stretch,
    are_one_clock,
    gaps,
    on_one_clock,
    require_rising,
    without_empty,
)
from models.logs.log import Channel, Listed, LogFile, RecordingError
from models.logs.names import Proposal, propose
from models.logs.signals import BETA, COLUMNS, NEEDED, QUANTITIES, Signal, require_fitting
from models.logs.units import SI, TIME, is_told, to_si
from models.recordings.map import AXES, LogMap
from models.recordings.record import (
    LARGEST,
    MINIMUM_SAMPLES,
    Recording,
    joined,
    resample,
    side_by_side,
)
from models.schema import require_few, shown

INVERSE = {"Fyf_inv": "Fyf", "Fyr_inv": "Fyr"}  # computed backwards from the motion
SHORTEST = 1.0  # [s]: a stretch of less teaches nothing, since learning waits half a second
SOME = 12  # names in a message
FIELDS = {"Fyf": "axle_force", "Fyr": "axle_force", BETA: "delta_f"}


class Reading(NamedTuple):
    """How the signals of a log are read, and what of it nobody told."""

    signals: dict[str, Signal]
    notes: tuple[str, ...]


class Stretches(NamedTuple):
    """Those that are kept, and how many are too short to be."""

    kept: list[Stretch]
    short: int


def column_of(name: str) -> str:
    """Return what a signal is called where columns are told.

    Parameters
    ----------
    name : ours.
    """
    return COLUMNS.get(name, name)


def chosen_signals(
    log: LogFile, listed: Sequence[Listed], log_map: LogMap, run: str | None
) -> Reading:
    """Return how each signal is read.

    Parameters
    ----------
    log : as a format reads it.
    listed : its channels.
    log_map : what is told.
    run : of the log.

    Raises
    ------
    RecordingError
        Where a signal that is needed is neither told nor there beyond doubt.
    """
    names = [one.name for one in listed]
    for name, signal in log_map.signals.items():
        for channel in signal.channel:
            if channel not in names:
                raise RecordingError(
                    f"{log.path}: there is no column {shown(channel)} to read as "
                    f"{column_of(name)}; {_listing(names)}"
                )
    if log_map.is_complete:
        return Reading(dict(log_map.signals), ())
    told = _beside(standard_signals(log, names), log_map.signals)
    missing = missing_signals(told)
    if not missing:
        return Reading(told, ())
    _refuse_words(log, names, missing, run)
    proposal = propose(log, listed, run)
    found = likely_signals(told, proposal)
    if missing := missing_signals(found):
        raise RecordingError(missing_text(log, missing, proposal, names))
    taken = [name for name in found if name not in told]
    return Reading(found, tuple(_taken_text(name, found[name]) for name in taken))


def likely_signals(told: Mapping[str, Signal], proposal: Proposal) -> dict[str, Signal]:
    """Return what is told, and what a proposal is sure of beside it, in the order of signals.

    Parameters
    ----------
    told : by our name.
    proposal : of the same log.
    """
    sure = {name: one for name, one in proposal.signals().items() if name not in told}
    found = _beside(sure, told)
    if ("Fyf" in found) != ("Fyr" in found):
        found = {name: one for name, one in found.items() if name not in ("Fyf", "Fyr")}
    return {name: found[name] for name in QUANTITIES if name in found}


def _refuse_words(log: LogFile, names: list[str], missing: list[str], run: str | None) -> None:
    """Refuse columns of standard names that are there and not numeric, with their first word."""
    unlisted = set(getattr(log, "names", ())) - set(names)
    for column in map(column_of, missing):
        if column in unlisted:
            log.read([column], run)
            raise RecordingError(f"{log.path}: {column} must be numeric, its cells are words")


def standard_signals(log: LogFile, names: list[str]) -> dict[str, Signal]:
    """Return the signals that bear the standard names of columns.

    Parameters
    ----------
    log : for messages.
    names : of the channels.

    Raises
    ------
    RecordingError
        Where a name is there twice, or one axle alone has a force.
    """
    found = {}
    for name in QUANTITIES:
        column = column_of(name)
        if f"{column} (2)" in names:
            raise RecordingError(f"{log.path}: column {column} appears more than once")
        if column in names and name != BETA:
            found[name] = Signal(channel=(column,))
    if not {"Fyf", "Fyr"} & set(names) and set(INVERSE) <= set(names):
        found |= {ours: Signal(channel=(name,)) for name, ours in INVERSE.items()}
    require_fitting(found, f"{log.path}: ")
    return found


def _beside(more: Mapping[str, Signal], told: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return signals that are told, and more where they are not; beta and v_y exclude another."""
    instead = {"v_y": BETA, BETA: "v_y"}
    kept = {name: one for name, one in more.items() if instead.get(name) not in told}
    found = {**kept, **told}
    if "v_y" in found:
        found.pop(BETA, None)
    return found


def missing_signals(signals: Mapping[str, Signal]) -> list[str]:
    """Return the needed signals that are not there; beta stands in for v_y.

    Parameters
    ----------
    signals : by our name.
    """
    there = {"v_y" if name == BETA else name for name in signals}
    return [name for name in NEEDED if name not in there]


def _listing(names: list[str]) -> str:
    listing = ", ".join(names[:SOME]) + (", ..." if len(names) > SOME else "")
    return f"columns found: {listing[:200]!r}"


def _taken_text(name: str, signal: Signal) -> str:
    unit = f" [{signal.unit}]" if signal.unit else ""
    return f"{column_of(name)} is taken from {' + '.join(signal.channel)}{unit}, by its name"


def missing_text(log: LogFile, missing: list[str], proposal: Proposal, names: list[str]) -> str:
    """Return the error of a log in which not every signal is found: what may be it, what to do.

    Parameters
    ----------
    log : that was looked at.
    missing : signals that are needed.
    proposal : what the channels probably are.
    names : of the channels.
    """
    parts = [said for name in missing if (said := likely_text(name, proposal))]
    words = [word for name in missing if (word := column_word(name, proposal))]
    columns = ", ".join(column_of(name) for name in missing)
    said = f"{log.path}: column {columns} is missing; "
    if parts:
        said += f"did you mean {', '.join(parts)}? tell it by --columns {' '.join(words)}; "
    else:
        said += f"tireid channels {log.path} lists what is there; "
    return said + _listing(names)


def likely_text(name: str, proposal: Proposal) -> str:
    """Return which channels may be a signal, in words; empty where none may.

    Parameters
    ----------
    name : of the signal.
    proposal : what the channels probably are.
    """
    guess, rivals = proposal.guesses.get(name), proposal.rivals.get(name, ())
    if rivals:
        listed = " or ".join(repr(" + ".join(one.channel)) for one in rivals[:3])
        return f"{listed} for {column_of(name)}, equally"
    if guess is None:
        return ""
    why = f" ({guess.why})" if guess.why else ""
    hand = " of the hand wheel" if guess.hand else ""
    return f"{' + '.join(guess.channel)!r}{hand} for {column_of(name)}{why}"


def column_word(name: str, proposal: Proposal) -> str:
    """Return the word of --columns that would tell a signal; empty where no channel may be it.

    Parameters
    ----------
    name : of the signal.
    proposal : what the channels probably are.
    """
    guess = proposal.guesses.get(name)
    if guess is None:
        return ""
    unit, ratio = guess.unit or SI[QUANTITIES[name]], " /RATIO" if guess.hand else ""
    return f'"{column_of(name)}={" + ".join(guess.channel)} [{unit}]{ratio}"'


def recording_of(
    log: LogFile,
    name: str,
    log_map: LogMap,
    *,
    run: str | None,
    dt: float,
) -> Recording:
    """Return one run of a log on a uniform clock, not yet judged by physics.

    Parameters
    ----------
    log : as a format reads it.
    name : of the recording, without its run.
    log_map : how it is read.
    run : name of the run; None where the map names it, or there is only one.
    dt : sample time T_s of the result [s].

    Raises
    ------
    RecordingError
        One line: file and run, column, rule, value, remedy.
    """
    if not (np.isfinite(dt) and dt > 0.0):
        raise RecordingError(f"{log.path}: the sample time dt must be positive, it is {dt}")
    run = _one_run(log, run or log_map.run or None)
    label = str(log.path) if run is None else f"{log.path}:{run}"
    listed = log.listed()
    reading = chosen_signals(log, listed, log_map, run)
    wants_clock = _wants_clock(log, listed, log_map.clock)
    parts = _channels(log, label, reading.signals, log_map if wants_clock else None, run)
    stretches = _stretches(label, reading.signals, parts, log_map, dt)
    notes = (*_notes(log), *reading.notes, *_gap_notes(stretches.kept))
    if stretches.short:
        several = "es" if stretches.short > 1 else ""
        notes += (f"left out: {stretches.short} stretch{several} of less than {SHORTEST:g} s",)
    recordings = [
        _recording(name if run is None else f"{name}:{run}", one, log_map, dt)
        for one in stretches.kept
    ]
    whole = joined(recordings, recordings[0].name)
    return replace(whole, notes=notes) if notes else whole


def _notes(log: LogFile) -> tuple[str, ...]:
    """Return what a format says of what it took or mended."""
    clock = getattr(log, "clock", None)
    said = () if clock is None or clock.unit == "s" else (f"time is {clock.words}",)
    return (*said, *log.notes)


def _wants_clock(log: LogFile, listed: Sequence[Listed], clock: str) -> bool:
    """Return whether the time is another channel than the one that the format takes for it."""
    names = [one.name for one in listed]
    own = getattr(getattr(log, "clock", None), "name", clock)
    if clock and clock not in names and clock != own:
        raise RecordingError(
            f"{log.path}: there is no column {shown(clock)} to read as t; {_listing(names)}"
        )
    return clock in names


def _one_run(log: LogFile, run: str | None) -> str | None:
    """Return the run that is read, None where a log has none."""
    names = log.runs()
    if not names:
        if run is not None:
            raise RecordingError(
                f"{log.path}: there is no column run, so no run {run!r}; leave it out"
            )
        return None
    some = ", ".join(names[:30]) + (f", ... ({len(names)})" if len(names) > 30 else "")
    if run is None and len(names) > 1:
        raise RecordingError(f"{log.path}: name one of its runs: {some}")
    if run is not None and run not in names:
        raise RecordingError(f"{log.path}: there is no run {shown(run)}, the runs are: {some}")
    return names[0] if run is None else run


def _channels(
    log: LogFile, label: str, signals: Mapping[str, Signal], timed: LogMap | None, run: str | None
) -> dict[str, list[Raw]]:
    """Return by signal its channels in SI, each on its own clock, or on that which a map names."""
    names = list(dict.fromkeys(one for signal in signals.values() for one in signal.channel))
    asked = names if timed is None else [*names, timed.clock]
    by_name = dict(zip(asked, log.read(asked, run), strict=True))
    if timed is not None:
        clock = by_name[timed.clock]
        unit = timed.clock_unit or clock.unit
        stamps = clock.values * to_si(unit, TIME, f"{label}: t (channel {clock.name!r})")
        by_name = {name: _timed(label, by_name[name], clock, stamps) for name in names}
    found: dict[str, list[Raw]] = {}
    for ours, signal in signals.items():
        found[ours] = []
        for name in signal.channel:
            channel = without_empty(by_name[name])
            unit = signal.unit if is_told(signal.unit) else channel.unit
            what = f"{label}: {column_of(ours)}"
            what += "" if name == column_of(ours) else f" (channel {name!r})"
            factor = to_si(unit, QUANTITIES[ours], what)
            _require_finite(label, column_of(ours), channel)
            values = scaled(channel.values, factor)
            _require_of_a_car(label, ours, values, channel)
            found[ours].append(Raw(channel.t, values, channel.place, channel.rows))
    return found


def scaled(values: Array, factor: float) -> Array:
    """Return values times a factor; themselves where it is one.

    Parameters
    ----------
    values : (n,).
    factor : of all of them.
    """
    if factor == 1.0:
        return values
    return by_blocks(values.size, lambda part: values[part] * factor)


def _timed(label: str, channel: Channel, clock: Channel, stamps: Array) -> Channel:
    """Return a channel on the time that another one tells."""
    if channel.values.size != stamps.size:
        raise RecordingError(
            f"{label}: {clock.name!r} must have a sample for each of {channel.name!r} to be its "
            f"time, it has {stamps.size} of {channel.values.size}"
        )
    return Channel(
        name=channel.name,
        unit=channel.unit,
        t=stamps,
        values=channel.values,
        place=channel.place,
        rows=channel.rows,
    )


def _require_finite(label: str, name: str, channel: Channel) -> None:
    bad = np.flatnonzero(~np.isfinite(channel.values))
    if bad.size:
        raise RecordingError(
            f"{label}: {name} must be finite, {bad.size} of {channel.values.size} values are "
            f"empty, NaN or infinite, the first in {channel.place} {channel.rows[bad[0]]}; fill "
            "or cut them out"
        )
    bad = np.flatnonzero(~np.isfinite(channel.t))
    if bad.size:
        raise RecordingError(
            f"{label}: t must be finite, {bad.size} of {channel.t.size} values are empty, NaN or "
            f"infinite, the first in {channel.place} {channel.rows[bad[0]]}; fill or cut them out"
        )


def _require_of_a_car(label: str, name: str, values: Array, channel: Channel) -> None:
    most = LARGEST[FIELDS.get(name, name)]
    bad = np.flatnonzero(np.abs(values) > most)
    if bad.size:
        raise RecordingError(
            f"{label}: {column_of(name)} must be of a car, within +-{most:g}, {channel.place} "
            f"{channel.rows[bad[0]]} has {values[bad[0]]:.4g}"
        )


def _stretches(
    label: str,
    signals: Mapping[str, Signal],
    parts: Mapping[str, list[Raw]],
    log_map: LogMap,
    dt: float,
) -> Stretches:
    """Return the signals on one clock, in the stretches between gaps; at least one."""
    raws = {f"{name}/{k}": raw for name, listed in parts.items() for k, raw in enumerate(listed)}
    for raw in {id(raw.t): raw for raw in raws.values()}.values():
        _judge_time(label, raw)
    one_clock = are_one_clock(list(raws.values()))
    first = next(iter(raws.values()))
    span = (max(raw.t[-1] for raw in raws.values()) - min(raw.t[0] for raw in raws.values())) / dt
    require_few(RecordingError, label, span, "samples", f"steps of {dt:g} s")

    def combined(values: Mapping[str, Array]) -> dict[str, Array]:
        return {
            name: signal.value(
                [values[f"{name}/{k}"] for k in range(len(signal.channel))], QUANTITIES[name]
            )
            for name, signal in signals.items()
        }

    if one_clock:
        found = []
        columns = combined({key: raw.values for key, raw in raws.items()})
        for piece in _pieces(first.t, log_map.longest_gap):
            if piece.stop - piece.start > 1:
                cut = {name: values[piece] for name, values in columns.items()}
                found.append(Stretch(*resample(first.t[piece], cut, dt)))
    else:
        separate = on_one_clock(raws, dt, log_map.longest_gap)
        found = [Stretch(one.t, combined(one.signals)) for one in separate]
    if not found:
        raise RecordingError(
            f"{label}: at no time are all channels sampled: they must overlap in time"
        )
    longest = max(found, key=lambda one: one.t.size)
    kept = [one for one in found if one.t.size * dt >= SHORTEST] or [longest]
    if longest.t.size < MINIMUM_SAMPLES:
        t = longest.t
        raise RecordingError(
            f"{label}: the run lasts {t[-1] - t[0]:.4g} s, at least {MINIMUM_SAMPLES} steps of "
            f"{dt:g} s are needed"
        )
    return Stretches(kept, len(found) - len(kept))


def _judge_time(label: str, raw: Raw) -> None:
    """Refuse time that does not rise, is not in seconds, or too coarse."""
    if raw.t.size < MINIMUM_SAMPLES:
        raise RecordingError(
            f"{label}: there are {raw.t.size} rows, at least {MINIMUM_SAMPLES} needed"
        )
    require_rising(label, raw)
    typical = float(np.median(np.diff(raw.t)))
    if typical > SLOWEST:
        raise RecordingError(
            f"{label}: t must be in s with at least 10 samples per second, its typical step is "
            f"{typical:.6g}" + ("; milliseconds? divide by 1000" if typical >= 1.0 else "")
        )


def _pieces(t: Array, longest: float) -> list[slice]:
    ends = [0, *gaps(t, longest).tolist(), t.size]
    return [slice(first, end) for first, end in pairwise(ends)]


def _gap_notes(stretches: list[Stretch]) -> tuple[str, ...]:
    """Return what is to be said of gaps."""
    if len(stretches) < 2:
        return ()
    times = [after.t[0] - before.t[-1] for before, after in pairwise(stretches)]
    longest = int(np.argmax(times))
    return (
        f"gaps cut the log into {len(stretches)} stretches that are learnt on as one drive; the "
        f"longest lasts {times[longest]:.3g} s, after {stretches[longest].t[-1]:.6g} s",
    )


def _recording(name: str, stretch: Stretch, log_map: LogMap, dt: float) -> Recording:
    """Return one stretch as a recording, in ISO axes, filtered where the map says so."""
    t, sign = stretch.t, AXES[log_map.axes]
    signals = {
        key: values if key == "v_x" else scaled(values, sign)
        for key, values in stretch.signals.items()
    }
    if log_map.low_pass is not None:
        signals = {key: _low_pass(one, log_map.low_pass, dt) for key, one in signals.items()}
    if BETA in signals:
        v_x, beta = signals["v_x"], signals[BETA]
        signals["v_y"] = by_blocks(t.size, lambda part: v_x[part] * np.tan(beta[part]))
    force = side_by_side(signals["Fyf"], signals["Fyr"]) if "Fyf" in signals else None
    for values in (t, *signals.values()):  # kept as they are, not copied
        values.setflags(write=False)
    return Recording(
        name=name,
        t=t,
        v_x=signals["v_x"],
        v_y=signals["v_y"],
        r=signals["r"],
        delta_f=signals["delta_f"],
        delta_r=signals["delta_r"] if "delta_r" in signals else np.zeros(t.size),
        a_y=signals.get("a_y"),
        axle_force=force,
    )


def _low_pass(signal: Array, cut_off: float, dt: float) -> Array:
    """Return a signal behind a Butterworth filter of second order that begins at its value."""
    if not cut_off < 0.5 / dt:
        raise RecordingError(
            f"low_pass must be below half the sampling rate, {0.5 / dt:g} Hz, it is {cut_off:g}"
        )
    b, a = butter(2, cut_off, fs=1.0 / dt)
    filtered, _ = lfilter(b, a, signal, zi=lfilter_zi(b, a) * signal[0])
    smooth: Array = filtered
    return smooth
