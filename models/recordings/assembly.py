"""From a log to a recording: the channels that were chosen in SI, on one clock, in segments."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array, filled
from models.logs.clock import (
    Raw,
    Segment,
    gaps,
    holes,
    on_one_clock,
    typical_step,
    without_codes,
    without_empty,
)
from models.logs.log import Channel, Clock, Heading, LogFile, RecordingError, one_run
from models.logs.signals import (
    BETA,
    POSE,
    QUANTITIES,
    SPARED,
    WHEELS,
    Signal,
    has_speed,
    quantity_of,
    signed,
)
from models.logs.spelling import without_unit
from models.logs.stamps import not_rising
from models.logs.units import PER_SECOND, is_given, to_si
from models.recordings.choice import chosen_signals, column_of, has_wheels, missing_signals
from models.recordings.map import AXES, CUT, LogMap
from models.recordings.pose import with_pose
from models.recordings.record import (
    CHANNELS,
    LARGEST,
    MINIMUM_SAMPLES,
    Recording,
    joined,
    resample,
    side_by_side,
)
from models.recordings.rolled import rolled
from models.recordings.wheels import Scale, identified_scales, scale_text, wheel_factor
from models.schema import require_few

_SLOWEST_CHANNEL = 0.11  # [s]: longest typical interval of a channel, 10 Hz with jitter
_FASTEST = 5e-4  # [s]: shortest step by which a unit of the time is guessed
_SHORTEST = 1.0  # [s]: a segment of less teaches nothing, since learning waits half a second
_LEAST_LOW_PASS = 0.01  # Hz: nothing of a drive passes, and the filter's numbers are still right


class _Segments(NamedTuple):
    """Those that are kept, and how many are too short to be."""

    kept: list[Segment]
    short: int


def recording_of(
    log: LogFile, name: str, log_map: LogMap, *, run: str | None, dt: float
) -> Recording:
    """Return one run of a log on a uniform clock, not yet judged by physics.
    name : of the recording, without its run.
    run : name of the run; None where the map names it, or there is only one.
    dt : sample time T_s of the result [s].
    """
    if not (isinstance(dt, Real) and np.isfinite(dt) and dt > 0.0):
        raise RecordingError(f"{log.path}: the sample time dt must be positive, it is {dt!r}")
    run = one_run(log.path, log.runs(), run or log_map.run or None)
    label = str(log.path) if run is None else f"{log.path}:{run}"
    headings = log.headings()
    reading = chosen_signals(log, headings, log_map, run)
    signals, learnt = reading.signals, ""
    if has_speed(signals):
        if has_wheels(signals):
            try:
                learnt = scale_text(wheel_scales(log, signals, log_map, run))
            except RecordingError as error:
                learnt = f"the wheels are not used: {error}"
        signals = {name: one for name, one in signals.items() if name not in WHEELS}
    spared = ""

    def on_one_clock(
        chosen: Mapping[str, Signal],
    ) -> tuple[dict[str, Signal], dict[str, list[Raw]], tuple[str, ...], _Segments]:
        channels = _channels(log, label, chosen, log_map, run)
        named, raws, said = with_pose(label, chosen, channels, "heading" in log_map.signals)
        for raw in {id(raw.t): raw for listed in raws.values() for raw in listed}.values():
            if raw.t.size < MINIMUM_SAMPLES:
                raise RecordingError(
                    f"{label}: there are {raw.t.size} rows, at least {MINIMUM_SAMPLES} needed"
                )
            if not (np.diff(raw.t) > 0.0).all():
                raise RecordingError(f"{label}: t {not_rising(raw.t, raw.rows, raw.place)}")
            require_often(label, raw.t, log.clock)
        return named, raws, said, _segments(label, named, raws, log_map, dt)

    try:
        signals, parts, posed, segments = on_one_clock(signals)
    except RecordingError as error:
        spare = {*SPARED, *POSE} & set(signals) - set(log_map.signals)
        needed = {key: one for key, one in signals.items() if key not in spare}
        if not spare or missing_signals(needed):
            raise
        left = ", ".join(column_of(key) for key in signals if key in spare)
        spared = f"{left} is left aside: {error}"
        signals, parts, posed, segments = on_one_clock(needed)
    rolls = ""
    if has_wheels(signals):
        kept, rolls = _on_wheels(label, segments.kept, log_map, dt)
        segments = segments._replace(kept=kept)
    of_pose = {column_of(name) for name, one in signals.items() if one.channel == ("pose",)}
    kept = (one for one in reading.notes if one.partition(" is taken from ")[0] not in of_pose)
    short = segments.short
    holes, gaps = _hole_note(parts), _gap_note(segments.kept)
    notes = *_notes(log), *kept, holes, gaps, *posed, learnt, rolls, spared
    if short:
        several = "s" if short > 1 else ""
        notes += (f"left out: {short} segment{several} of less than {_shortest(dt):g} s",)
    notes = tuple(filter(None, notes))
    recordings = [
        _recording(name if run is None else f"{name}:{run}", one, log_map, dt)
        for one in segments.kept
    ]
    whole = joined(recordings, recordings[0].name)
    return replace(whole, notes=notes) if notes else whole


def _notes(log: LogFile) -> tuple[str, ...]:
    """Return what a format says of what it took or mended."""
    clock = log.clock
    if clock is None or (clock.unit == "s" and ";" not in clock.words):
        return tuple(log.notes)
    return (f"time is {clock.words}", *log.notes)


def _channels(
    log: LogFile, label: str, signals: Mapping[str, Signal], log_map: LogMap, run: str | None
) -> dict[str, list[Raw]]:
    """Return by signal its channels in SI, each on its own clock.

    Turns of wheels become speeds, where there is no v_x that tells their radius.
    """
    names = list(dict.fromkeys(one for signal in signals.values() for one in signal.requested))
    by_name = dict(zip(names, log.read(names, run), strict=True))
    found: dict[str, list[Raw]] = {}
    for ours, signal in signals.items():
        found[ours] = []
        for name in signal.channel:
            logged, codes = without_codes(by_name[name])
            cut, coded = log_map.holes == CUT, by_name[name].values.size - logged.values.size
            channel = without_empty(logged, cut=cut)
            unit = signal.unit if is_given(signal.unit) else channel.unit
            what = f"{label}: {column_of(ours)}"
            what += "" if name == column_of(ours) else f" (channel {name!r})"
            factor = to_si(unit, quantity_of(ours, unit), what)
            if ours in WHEELS and not has_speed(signals):
                factor *= wheel_factor(what, ours, unit, log_map.wheels)
            _require_finite(label, column_of(ours), channel)
            values = _scaled(channel.values, factor)
            if signal.sign:
                sign = by_name[signal.sign]
                values = signed(values, channel.t, sign.t, sign.values)
            _require_of_a_car(label, ours, values, channel)
            empty = coded + (holes(logged).size if cut else 0)
            found[ours].append(Raw(channel.t, values, channel.place, channel.rows, empty, codes))
    return found


def _scaled(values: Array, factor: float) -> Array:
    """Return values times a factor; themselves where it is one.   values : (n,)."""
    if factor == 1.0:
        return values
    return filled(values.size, lambda part: values[part] * factor)


def _require_finite(label: str, name: str, channel: Channel) -> None:
    for what, values, remedy in (
        (name, channel.values, 'fill them, or cut them out: --cut-holes, LogMap(holes="cut")'),
        ("t", channel.t, "fill or cut them out"),
    ):
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise RecordingError(
                f"{label}: {what} must be finite, {bad.size} of {values.size} values are empty, "
                f"NaN or infinite, the first in {channel.place} {channel.rows[bad[0]]}; {remedy}"
            )


def _require_of_a_car(label: str, name: str, values: Array, channel: Channel) -> None:
    most = LARGEST[name]
    bad = np.flatnonzero(np.abs(values) > most)
    if bad.size:
        raise RecordingError(
            f"{label}: {column_of(name)} must be of a car, within +-{most:g}, {channel.place} "
            f"{channel.rows[bad[0]]} has {values[bad[0]]:.4g}"
        )


def _segments(
    label: str,
    signals: Mapping[str, Signal],
    parts: Mapping[str, list[Raw]],
    log_map: LogMap,
    dt: float,
) -> _Segments:
    """Return the signals on one clock, in the segments between gaps; at least one."""
    raws = {f"{name}/{k}": raw for name, listed in parts.items() for k, raw in enumerate(listed)}
    every = list(raws.values())
    span = (max(raw.t[-1] for raw in every) - min(raw.t[0] for raw in every)) / dt
    require_few(RecordingError, label, span, "samples", f"steps of {dt:g} s")

    def combined(values: Mapping[str, Array]) -> dict[str, Array]:
        return {
            name: signal.value(
                [values[f"{name}/{k}"] for k in range(len(signal.channel))], QUANTITIES[name]
            )
            for name, signal in signals.items()
        }

    t = every[0].t
    if all(raw.t is t or np.array_equal(raw.t, t) for raw in every):
        found = []
        columns = combined({key: raw.values for key, raw in raws.items()})
        for begin, end in pairwise([0, *gaps(t, log_map.longest_gap).tolist(), t.size]):
            if end - begin > 1:
                cut = {name: values[begin:end] for name, values in columns.items()}
                found.append(Segment(*resample(t[begin:end], cut, dt)))
    else:
        separate = on_one_clock(raws, dt, log_map.longest_gap)
        found = [Segment(one.t, combined(one.signals)) for one in separate]
    if not found:
        raise RecordingError(
            f"{label}: at no time are all channels sampled: they must overlap in time"
        )
    longest = max(found, key=lambda one: one.t.size)
    kept = [one for one in found if one.t.size * dt >= _shortest(dt)] or [longest]
    if longest.t.size < MINIMUM_SAMPLES:
        t = longest.t
        raise RecordingError(
            f"{label}: the run lasts {t[-1] - t[0]:.4g} s, at least {MINIMUM_SAMPLES} "
            f"steps of {dt:g} s are needed"
        )
    return _Segments(kept, len(found) - len(kept))


def _shortest(dt: float) -> float:
    """Return how long a segment must be [s]: to teach something, and to be a recording."""
    return max(_SHORTEST, MINIMUM_SAMPLES * dt)


def require_often(label: str, t: Array, clock: Clock | None) -> None:
    """Refuse samples that are too rare, and say in which unit of the time they were not.
    t : rising [s], (n,).
    """
    typical = typical_step(t)
    if typical > _SLOWEST_CHANNEL:
        name, unit = (clock.name, clock.unit) if clock else ("CHANNEL", "s")
        step = typical * PER_SECOND.get(unit, 1.0)
        other = (
            u for u in ("ms", "us", "ns") if _FASTEST <= step / PER_SECOND[u] <= _SLOWEST_CHANNEL
        )
        remedy = "".join(f'; --columns "t={without_unit(name)} [{u}]"?' for u in other)
        raise RecordingError(
            f"{label}: t must be in s with at least 10 samples per second, its typical step is "
            f"{typical:.6g}{remedy}"
        )


def _hole_note(parts: Mapping[str, list[Raw]]) -> str:
    """Return what is to be said of cells without a value that were cut out."""
    given = ", ".join(
        f"{raw.holes} of {column_of(name)}" + f" ({raw.codes} means no value)" * bool(raw.codes)
        for name, raws in parts.items()
        for raw in raws
        if raw.holes
    )
    return given and f"cells without a value are cut out: {given}"


def _gap_note(segments: list[Segment]) -> str:
    if len(segments) < 2:
        return ""
    times = [after.t[0] - before.t[-1] for before, after in pairwise(segments)]
    longest = int(np.argmax(times))
    return (
        f"gaps cut the log into {len(segments)} segments that are used as one drive; the "
        f"longest lasts {times[longest]:.3g} s, after {segments[longest].t[-1]:.6g} s"
    )


def _recording(name: str, segment: Segment, log_map: LogMap, dt: float) -> Recording:
    """Return one segment as a recording, in ISO axes, filtered where the map says so."""
    t, sign = segment.t, AXES[log_map.axes]
    signals = {
        key: values if key in ("v_x", "a_x") else _scaled(values, sign)
        for key, values in segment.signals.items()
    }
    if log_map.low_pass is not None:
        signals = {key: _low_pass(name, one, log_map.low_pass, dt) for key, one in signals.items()}
    if BETA in signals:
        v_x, beta = signals["v_x"], signals[BETA]
        signals["v_y"] = filled(t.size, lambda part: v_x[part] * np.tan(beta[part]))
    force = side_by_side(signals["Fyf"], signals["Fyr"]) if "Fyf" in signals else None
    signals.setdefault("delta_r", np.zeros(t.size))
    for values in (t, *signals.values()):  # kept as they are, not copied
        values.setflags(write=False)
    given: dict[str, Any] = {key: signals[key] for key in (*CHANNELS, "a_x") if key in signals}
    return Recording(name=name, t=t, axle_force=force, **given)


def wheel_scales(
    log: LogFile, signals: Mapping[str, Signal], log_map: LogMap, run: str | None
) -> dict[str, Scale]:
    """Return how wheels roll by the v_x that is logged as well, by name of the wheel.
    signals : v_x, wheels, and r where it is there; others are not looked at.
    """
    of_wheels = {name: signals[name] for name in ("v_x", "r", *WHEELS) if name in signals}
    parts = _channels(log, str(log.path), of_wheels, log_map, run)
    return identified_scales(parts, of_wheels, units_of(log.headings(), of_wheels))


def units_of(headings: Sequence[Heading], signals: Mapping[str, Signal]) -> dict[str, str]:
    """Return the unit of each signal: as it is declared, or that of its first channel."""
    units = {one.name: one.unit for one in headings}
    return {
        name: one.unit if is_given(one.unit) else units.get(one.channel[0], "")
        for name, one in signals.items()
    }


def _on_wheels(
    label: str, segments: Sequence[Segment], log_map: LogMap, dt: float
) -> tuple[list[Segment], str]:
    """Return segments with v_x in place of wheels, and how far these were trusted, in words."""
    found, gated, untrusted, n = [], 0, 0, 0
    wheels, repair, sign = log_map.wheels, log_map.repair, AXES[log_map.axes]
    for one in segments:
        still = np.zeros(one.t.size)
        speeds = {name: values for name, values in one.signals.items() if name in WHEELS}
        turns = {  # as they were driven: wheels are brought to the center of gravity by them
            name: sign * repair.factor.get(name, 1.0) * one.signals.get(name, still)
            - repair.offset.get(name, 0.0)
            for name in ("r", "delta_f", "delta_r")
        }
        try:
            given = rolled(speeds, **turns, wheels=wheels, dt=dt)
        except RecordingError as error:
            raise RecordingError(f"{label}: {error}") from None
        others = {name: values for name, values in one.signals.items() if name not in WHEELS}
        found.append(one._replace(signals={"v_x": given.v_x, **others}))
        gated, untrusted, n = gated + given.gated, untrusted + given.untrusted, n + one.t.size
    names = ", ".join(name for name in WHEELS if name in segments[0].signals)
    return found, (
        f"vx is computed from {names}: at {100.0 * gated / n:.2g} % of the samples a wheel "
        f"slipped and was left out, at {100.0 * untrusted / n:.2g} % all were, and the speed went "
        "on as before"
    )


def _low_pass(name: str, signal: Array, cut_off: float, dt: float) -> Array:
    """Return a signal behind a Butterworth filter of second order that begins at its value."""
    if not _LEAST_LOW_PASS <= cut_off < 0.5 / dt:
        raise RecordingError(
            f"{name}: low_pass of the map must be at least {_LEAST_LOW_PASS:g} Hz and below "
            f"half the sampling rate, {0.5 / dt:g} Hz, it is {cut_off:g}"
        )
    from scipy.signal import butter, lfilter, lfilter_zi  # takes longer than to read a short log

    b, a = butter(2, cut_off, fs=1.0 / dt)
    filtered, _ = lfilter(b, a, signal, zi=lfilter_zi(b, a) * signal[0])
    return filtered
