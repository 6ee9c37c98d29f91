"""Which channels of a log become which signals: declared, by standard names, or beyond doubt.

What is given by a map holds; then the standard names; then what the names of the channels propose,
where every signal that is needed is sure. What was proposed is said in the recording's notes; where
something is not sure, the error says what it may be, and the word that tells it.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from codegen.escape import displayed
from models.logs.log import Heading, LogFile, RecordingError, some
from models.logs.memory import ARRAYS
from models.logs.names import HINT, STILL, Proposal, called, propose
from models.logs.signals import (
    BETA,
    COLUMNS,
    INSTEAD,
    NEEDED,
    POSE,
    QUANTITIES,
    SPARED,
    WHEELS,
    Signal,
    given_by,
    require_fitting,
    signal_name,
)
from models.logs.spelling import without_unit
from models.logs.units import RATE, SI, to_si
from models.recordings.checks import world_axes
from models.recordings.map import LogMap
from models.recordings.record import Recording, resample

_SAME = 0.02  # of a speed, by which two sensors of it differ
_DT = 0.01  # [s], of a look at the directions of velocities

_INVERSE = {"Fyf_inv": "Fyf", "Fyr_inv": "Fyr"}  # computed backwards from the motion


_OF_STRUCTS = ("MATLAB", "MATLAB 7.3", "HDF5", "NumPy")


class _Reading(NamedTuple):
    """How the signals of a log are read, and what of it nobody declared."""

    signals: dict[str, Signal]
    notes: tuple[str, ...]


def column_of(name: str) -> str:
    """Return what a signal is called where columns are given."""
    return COLUMNS.get(name, name)


def chosen_signals(
    log: LogFile, headings: Sequence[Heading], log_map: LogMap, run: str | None
) -> _Reading:
    names = [one.name for one in headings]
    by_map = as_listed(log, log_map.signals, names)
    headings, turned, world = of_the_car(log, headings, run)
    names = [one.name for one in headings]
    lost: tuple[str, ...] = ()
    if "v_x" in log_map.signals and "v_x" not in by_map:
        channels = displayed(" + ".join(log_map.signals["v_x"].channel))
        lost = (f"there is no column {channels}: vx is computed from the wheels",)
    if log_map.is_complete:
        return _Reading(by_map, lost)
    lost += (world,) * bool(world)
    given = _without_wheels(_beside({**standard_signals(log, names), **turned}, by_map), by_map)
    missing = missing_signals(given)
    if has_v_y(given) and not missing:
        return _Reading(given, lost)
    for column in map(column_of, missing if has_v_y(given) else ["v_y", *missing]):
        if column in log.unlisted:  # it is there and not numeric: by its first word
            log.read([column], run)
            raise RecordingError(f"{log.path}: {column} must be numeric, its cells are words")
    proposal = propose(log, headings, run)
    found = _without_wheels(likely_signals(given, proposal), by_map)
    if missing := missing_signals(found):
        raise RecordingError(_missing_text(log, missing, proposal, names))
    notes = list(lost)
    for name, one in found.items():
        if name not in given:
            channels = " + ".join(map(without_unit, one.channel))
            unit = f" [{one.unit}]" if one.unit else ""
            unit += " with its sign turned" if one.factor < 0.0 else ""
            notes.append(f"{column_of(name)} is taken from {channels}{unit}, by its name")
    notes.append(aside(found, proposal)[0])
    return _Reading(found, tuple(filter(None, notes)))


def of_the_car(
    log: LogFile, headings: Sequence[Heading], run: str | None
) -> tuple[Sequence[Heading], dict[str, Signal], str]:
    """Return headings less a velocity of the world's axes beside one of the car's, this one where
    it is in SI as that is, and a note: both are of one size, and one turns as the car does.
    run : of the log; None its only one.
    """
    along, across, turns = (called(name, headings) for name in ("v_x", "v_y", "r"))
    pairs, found = list(zip(along, across, turns[:1] * 2, strict=False)), {}
    with suppress(RecordingError):  # of channels that cannot be read
        for x, y, r in pairs * (len(pairs) > 1):
            *both, turn = log.read([x, y, r], run)
            v_x, v_y = (np.interp(turn.t, one.t, one.values) for one in both)
            rate = to_si(turn.unit, RATE, r) * turn.values
            motion = {"v_x": v_x, "v_y": v_y, "r": rate}
            motion |= dict.fromkeys(("delta_f", "delta_r"), 0.0 * rate)
            t, even = resample(turn.t, motion, _DT)
            drive = Recording(name="", t=t, **dict[str, Any](even))
            found[bool(world_axes(drive))] = (x, y), np.hypot(v_x, v_y)
    if len(found) < 2:
        return headings, {}, ""
    (ours, speed), (world, size) = found[False], found[True]
    alike = np.mean(np.abs(speed - size)) < _SAME * np.mean(size) and all(map(signal_name, world))
    sure = {name: Signal(channel=(one,)) for name, one in zip(("v_x", "v_y"), ours, strict=True)}
    said = f"{world[0]} and {world[1]} are of the world's axes, as they turn with the car: "
    left = [one for one in headings if one.name not in world]
    return left, sure if alike else {}, f"{said}{ours[0]} and {ours[1]} are of the car's"


def as_listed(
    log: LogFile, signals: Mapping[str, Signal], names: Sequence[str]
) -> dict[str, Signal]:
    """Return signals with the names of their channels as the log lists them.

    A channel that is listed with its unit, "Vel Lat [km/h]", may be declared without. A v_x that is
    not there is left out where wheels are given.
    """
    bare: dict[str, list[str]] = {}
    for one in names:
        bare.setdefault(without_unit(one), []).append(one)
    found = {}
    for name, signal in signals.items():
        channels = []
        for channel in signal.requested:
            likely = [channel] if channel in names else bare.get(channel, [])
            if not likely and name == "v_x" and has_wheels(signals):
                break
            if len(likely) != 1:
                raise RecordingError(
                    f"{log.path}: there is no column {displayed(channel)} to read as "
                    f"{column_of(name)}; {_listing(likely or names)}"
                )
            channels += likely
        else:
            sign = channels.pop() if signal.sign else ""
            found[name] = replace(signal, channel=tuple(channels), sign=sign)
    return found


def likely_signals(given: Mapping[str, Signal], proposal: Proposal) -> dict[str, Signal]:
    """Return what is given, and what a proposal is sure of beside it, in the order of signals."""
    sure = {name: one for name, one in proposal.signals().items() if name not in given}
    out = {"v_x"} if has_wheels(given) else set()
    if has_v_y(given) or {"v_y", BETA} & set(sure):  # a pose is for what no sensor shows
        out |= set(POSE)
    if "v_x" in given_by(given) or "v_x" in proposal.guesses:
        out |= set(WHEELS)
    found = _beside({name: one for name, one in sure.items() if name not in out}, given)
    lone = [some for some in (("Fyf", "Fyr"), POSE) if not set(some) <= set(found)]
    out = {name for some in lone for name in some}
    return {name: found[name] for name in QUANTITIES if name in found and name not in out}


def with_wheels(signals: Mapping[str, Signal], proposal: Proposal) -> dict[str, Signal]:
    """Return signals and, beside a v_x, the wheels of which it tells how they roll."""
    if "v_x" not in signals:
        return dict(signals)
    there = {channel for one in signals.values() for channel in one.channel}
    more = {
        name: one
        for name, one in proposal.signals().items()
        if name in WHEELS and not there & set(one.channel)
    }
    return {**more, **signals}


def has_wheels(signals: Iterable[str]) -> bool:
    """Return whether there is the speed of a wheel, of which v_x can be made."""
    return any(name in WHEELS for name in signals)


def _without_wheels(found: Mapping[str, Signal], by_map: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return signals without wheels that v_x has no need of and nobody asked to identify."""
    if "v_x" not in found:
        return dict(found)
    return {name: one for name, one in found.items() if name not in WHEELS or name in by_map}


def standard_signals(log: LogFile, names: list[str]) -> dict[str, Signal]:
    found = {}
    for name in QUANTITIES:
        column = column_of(name)
        if f"{column} (2)" in names:
            if name in SPARED:
                continue
            raise RecordingError(f"{log.path}: column {column} appears more than once")
        if column in names and name not in (BETA, *POSE):
            found[name] = Signal(channel=(column,))
    if log.format in _OF_STRUCTS and not found:
        found = _in_struct(names)
    if not {"Fyf", "Fyr"} & set(names) and set(_INVERSE) <= set(names):
        found |= {ours: Signal(channel=(name,)) for name, ours in _INVERSE.items()}
    require_fitting(found, f"{log.path}: ")
    return found


def _in_struct(names: Sequence[str]) -> dict[str, Signal]:
    """Return the signals whose standard names are fields of structs; of two that of the fuller."""
    fields = [(*one.rpartition("."), one) for one in names]
    known = {*QUANTITIES} - {BETA, *POSE}
    found = [
        (name, struct, one)
        for struct, dot, field, one in fields
        if dot and (name := signal_name(field)) in known
    ]
    count = Counter(struct for _, struct, _ in found)
    result = {}
    for name, struct, one in found:
        fuller = [
            other for like, other, _ in found if like == name and count[other] >= count[struct]
        ]
        if len(fuller) == 1:
            result[name] = Signal(channel=(one,))
    return result


def _beside(more: Mapping[str, Signal], given: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return signals that are given, and more where they are not; beta and v_y exclude another."""
    kept = {name: one for name, one in more.items() if INSTEAD.get(name) not in given}
    found = {**kept, **given}
    if "v_y" in found:
        found.pop(BETA, None)
    return found


def has_v_y(signals: Mapping[str, Signal]) -> bool:
    """Return whether a lateral velocity is read, or the sideslip angle in its place."""
    return "v_y" in given_by(signals)


def missing_signals(signals: Mapping[str, Signal]) -> list[str]:
    """Return the needed signals that are not there; without v_y it is estimated from a_y."""
    there = given_by(signals) | ({"v_y"} if "a_y" in signals else set())
    return [name for name in NEEDED if name not in there]


def _listing(names: Sequence[str]) -> str:
    """Return what channels there are, the first of many."""
    return f"columns found: '{some(names)}'" if names else "there is none but the time"


def aside(found: Mapping[str, Signal], proposal: Proposal) -> tuple[str, list[str]]:
    """Return what was left aside that may be v_y, or beside it a_y: in words, and the signals."""
    if has_v_y(found):
        a_y = proposal.guesses.get("a_y")
        if "a_y" in found or a_y is None or a_y.confidence < HINT:
            return "", []
        names, said = ["a_y"], "ay is left aside, as it is not sure: {};"
    else:
        names = [name for name in stand_ins("v_y", proposal) if name != "a_y"]
        said = "no lateral velocity is read: a method estimates vy"
        if not names:
            return said, []
        said += "; if {} is one,"
    said = said.format(likely_text(names[0], proposal))
    return f"{said} declare it by --columns {column_word(names[0], proposal)}", names


def stand_ins(name: str, proposal: Proposal) -> list[str]:
    """Return what a channel may tell of a signal: itself; of v_y it or beta, and a_y."""
    there = {one: guess.confidence for one, guess in proposal.guesses.items()}
    if name != "v_y":
        return [name] if name in there else []
    measured = [one for one in ("v_y", BETA) if there.get(one, 0.0) > STILL]
    best = [max(measured, key=lambda one: there[one])] if measured else []
    return best + ["a_y"] * (there.get("a_y", 0.0) > STILL)


def _missing_text(log: LogFile, missing: list[str], proposal: Proposal, names: list[str]) -> str:
    """Return the error of a log in which not every signal is found: what may be it, what to do."""
    likely = [one for name in missing for one in stand_ins(name, proposal)]
    parts = [likely_text(one, proposal) for one in likely]
    words = [column_word(one, proposal) for one in likely]
    columns = ", ".join(column_of(name) for name in missing)
    if missing == ["v_y"] or (missing[0] == "v_y" and "a_y" in likely):
        columns = columns.replace("vy", "vy (or ay, from which it is estimated)", 1)
    said = f"{log.path}: column {columns} is missing; "
    if parts:
        said += f"did you mean {', '.join(parts)}? declare it by --columns {' '.join(words)}; "
    elif log.format != ARRAYS:
        said += f"tireid channels {log.path} lists what is there; "
    return said + _listing(names)


def likely_text(name: str, proposal: Proposal) -> str:
    """Return which channels may be a signal, in words; empty where none may."""
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
    """Return the word of --columns that would tell a signal; empty where no channel may be it."""
    guess = proposal.guesses.get(name)
    if guess is None:
        return ""
    si = SI[QUANTITIES[name]]
    one = Signal(channel=guess.channel, unit=guess.unit or si, factor=guess.factor, sign=guess.sign)
    words = declaration(name, one, " /RATIO" * guess.hand)
    known = guess.unit or signal_name(guess.channel[0])
    return words if known else words.replace(f" [{si}]", " [UNIT]")


def declaration(name: str, one: Signal, ratio: str = "") -> str:
    """Return the word of --columns that declares a signal.   ratio : where it is not known."""
    words = column_of(name) + "=" + " + ".join(map(without_unit, one.channel))
    words += f" sign({one.sign})" * bool(one.sign) + f" [{one.unit}]" * bool(one.unit)
    words += ratio or f" /{one.ratio:g}" * (one.ratio != 1.0)
    words += f" *{one.factor:g}" * (one.factor != 1.0) + f" - {one.offset:g}" * bool(one.offset)
    return f'"{words}"'
