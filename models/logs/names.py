"""Which channel of a log is probably which signal, by its name, its unit and what is in it.

A name is cut into small words ("Car.YawRate" is car, yaw, rate) and set beside how loggers call
things: MoTeC, AiM, VBOX, OxTS, Kistler, CarMaker, veDYNA, dSPACE, openpilot, ROS messages, CAN
databases, in English and German, by their plain words in French, Italian and Spanish. The unit must
be one of the signal's; the numbers must be those of a car. A proposal says how sure it is; of two
that are equal none is taken.
"""

import itertools
import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array, root_mean_square
from models.logs.axes import Triad, along_axes, ground, triads
from models.logs.clock import kept, without_codes
from models.logs.log import Channel, Heading, LogFile, RecordingError
from models.logs.signals import (
    BETA,
    COLUMNS,
    ESTIMATED,
    POSE,
    QUANTITIES,
    WHEELS,
    Signal,
    quantity_of,
)
from models.logs.spelling import unit_in_name, without_units
from models.logs.stamps import typical_rate
from models.logs.units import (
    ACCELERATION,
    ANGLE,
    FORCE,
    HAND_WHEEL,
    LENGTH,
    RATE,
    SPEED,
    are_same,
    is_given,
    quantities,
    rows_of,
    to_si,
    unit_of_range,
)

SURE = 0.8  # confidence from which a proposal is used without being declared
_STANDARD = 1.0  # confidence in our own name of a channel
_KNOWN = 0.95  # confidence in the name that a logger gives
_NAMES_WORDS = 0.9  # confidence in the words of a name
_VAGUE = 0.82  # confidence in one such word
HINT = 0.5  # a word of the name beside a unit that fits: named, never taken
_NO_UNIT_LOSS = 0.25  # of confidence, where neither file nor name tells the unit
_SECOND_LOSS = 0.08  # of confidence, so that what was filtered or commanded stands back
STILL = 0.25  # of confidence that is left to a channel that never changes
_APART = 0.04  # of confidence: nearer ones are equal
_LARGEST_ROAD = 1.2  # [rad]: an angle that goes further is that of a hand wheel
_LOOKED_AT = 20_000  # samples at most, in telling contents apart
_SPIKES = 1e-3  # share of samples that say nothing of the unit
_LONGEST = 17.5  # [m]: wheelbase, with understeer at speed, that v_x δ / r can be, as in checks
_FASTEST = 430.0  # [km/h]
_SAME = 2e-3  # of their size: by less two channels differ that are one, but for rounding

_Seen = Mapping[str, Channel]  # channels as they were read, by name

_HAND = "steering wheel"  # an angle that wants a ratio
# Units that are met where none is given, "" SI.
_ASSUMED = {"v_x": ("", "km/h"), "r": ("", "deg/s"), "a_y": ("", "g")}
_OBLIQUE = "its box is mounted obliquely: no axis of it is one of the car"


class _Rule(NamedTuple):
    """How a signal is called.
    known : whole names, words joined.   vague : names that may mean something else.
    never : words that mean something else.   words : sets of words that all occur; "a|b" is either.
    """

    known: frozenset[str]
    vague: frozenset[str]
    never: frozenset[str]
    words: tuple[str, ...]


_TABLES = rows_of("names.toml")
_WORDS = {name: some.replace("|", " ").split() for name, some in _TABLES["words"].items()}


def _spelled(text: str, apart: str = "|") -> str:
    """Return a text of the table with the words that stand in braces for."""
    while "{" in text:
        text = re.sub(r"{(\w+)}", lambda found: apart.join(_WORDS[found[1]]), text)
    return text


_REFERENCE, _CORNERS, _SOURCES, _FILTERED, _SIGN, _COMMANDS = (
    frozenset(_WORDS[name])
    for name in ("reference", "corners", "sources", "filtered", "sign", "commands")
)


def _rule(one: Mapping[str, Any]) -> _Rule:
    known, vague, never = (
        frozenset(_spelled(one.get(key, ""), " ").split()) for key in ("known", "vague", "never")
    )
    return _Rule(known, vague, never, tuple(map(_spelled, one.get("words", ()))))


_RULES: Mapping[str, _Rule] = {name: _rule(one) for name, one in _TABLES["signals"].items()}
_PER_WHEEL = _TABLES["per_wheel"]
_HINTS = {name: tuple(some.split()) for name, some in _TABLES["hints"].items()}
_SIDES = {name: [pair.split() for pair in v.split(",")] for name, v in _TABLES["sides"].items()}
# German words are written together: "Querbeschl", "Lenkradwinkel", "Sollgierrate".
_FIRST = "soll|ist|fahrzeug|fahr|quer|laengs|gier|vertikal|hoch|radlenk|lenkrad|lenk|schwimm|rad"
_LAST = "beschleunigung|beschl|geschwindigkeit|geschw|rate|winkel|moment|kraft"
_COMPOUND = re.compile(f"(?:{_FIRST})+(?:{_LAST})+")
_PARTS = re.compile(f"{_FIRST}|{_LAST}")
# CarSim says left or right and the number of the axle: "Steer_L1", "Fy_R2".
_SIDE_AND_AXLE = re.compile(r"(?<![A-Za-z0-9])([LR])([12])(?![A-Za-z0-9])")
_SPIN = re.compile(r"(?<![A-Za-z])AV[xyz](?![A-Za-z])")  # and "AVy_L1" of the spin of a wheel
_GENERIC = ("data", "value")  # a field that says nothing, as of std_msgs: its topic is its name
_UMLAUTS = str.maketrans(_TABLES["letters"])


_WHEELS = _TABLES["wheels"]
_PLACES = {
    name: [frozenset(way.split()) for way in _WHEELS[name].split(",")] for name in WHEELS[:-1]
}
_ANYWHERE = frozenset(word for ways in _PLACES.values() for way in ways for word in way)
_PLACES[WHEELS[-1]] = [frozenset()]
_WHEEL, _TURNING, _SPEEDS, _BOTH, _ENCODER, _OTHERS = (
    frozenset(_WHEELS[name].split())
    for name in ("wheel", "turns", "speeds", "both", "encoder", "others")
)


def _wheel_words(signal: str, words: Sequence[str]) -> bool:
    parts = set(words)
    for word in words:
        for stem, corner in ((word[:-2], word[-2:]), (word[2:], word[:2])):
            if corner in _CORNERS and stem in _BOTH:
                parts = parts - {word} | {stem, corner}
    listed = frozenset(parts)
    if listed & _OTHERS:
        return False
    for place in _PLACES[signal]:
        rest = listed - place
        if listed >= place and not rest & _ANYWHERE:
            alone = (rest <= _WHEEL or rest <= _SPEEDS) if place else rest == {signal}
            turns = rest & (_BOTH if place else _ENCODER) or (rest & _WHEEL and rest & _TURNING)
            return bool(turns or (rest and alone))
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Guess:
    """A channel, or the channels of two wheels, that may be a signal.
    confidence : from 0 to 1.
    unit : of the file, or what the numbers look like where it tells none.
    sign : channel that has the sign of the amounts in this one; empty where there is none.
    factor : -1 of an axis that points the other way.
    """

    channel: tuple[str, ...]
    confidence: float
    hand: bool = False
    unit: str = ""
    sign: str = ""
    factor: float = 1.0
    why: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """What the channels of a log probably are.
    rivals : by signal, all that are as good as the best, it included, where there are several.
    """

    guesses: Mapping[str, Guess] = field(default_factory=dict)
    rivals: Mapping[str, tuple[Guess, ...]] = field(default_factory=dict)

    def is_sure(self, name: str) -> bool:
        """Whether a signal is found beyond doubt; an angle of the hand wheel wants its ratio."""
        guess = self.guesses.get(name)
        return (
            guess is not None
            and name not in self.rivals
            and guess.confidence >= SURE
            and not guess.hand
        )

    def signals(self) -> dict[str, Signal]:
        """Return how each signal that is sure is read; v_y is not made of beta where both are."""
        kept = [name for name in QUANTITIES if self.is_sure(name)]
        if "v_y" in kept and BETA in kept:
            kept.remove(BETA)
        return {
            name: Signal(channel=one.channel, unit=one.unit, sign=one.sign, factor=one.factor)
            for name in kept
            for one in [self.guesses[name]]
        }


def _words_of(name: str) -> tuple[str, ...]:
    """Return a name as small words: "Car.YawRate" is car, yaw, rate."""
    plain = unicodedata.normalize("NFC", name).translate(_UMLAUTS)
    plain = "".join(one if one in "ÄÖÜ" else unicodedata.normalize("NFD", one)[0] for one in plain)
    plain = re.sub(r"\(([xyzXYZ])\)", r" \1 ", plain)  # "G(x)"
    plain = re.sub(r"\[[^]]*\]|\([^)]*\)", " ", plain)  # a unit in brackets
    plain = _SPIN.sub(lambda found: f" {found[0].lower()} ", plain)
    plain = _SIDE_AND_AXLE.sub(lambda found: f" {' fr'[int(found[2])]}{found[1].lower()} ", plain)
    plain = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", plain)
    plain = re.sub(r"([A-Z]+)([A-Z][a-z])", r"\1 \2", plain)
    return tuple(re.findall(r"[a-z]+|\d+", plain.lower().translate(_UMLAUTS)))


def _with_parts(words: Sequence[str]) -> frozenset[str]:
    """Return words, and what German ones are made of: "gierrate" is gier and rate too."""
    parts = (_PARTS.findall(word) for word in words if _COMPOUND.fullmatch(word))
    return frozenset(words).union(*parts)


def _field(name: str) -> str:
    """Return what a name of ROS says of itself, behind its topic; the topic of a lone number."""
    if not name.startswith("/"):
        return name
    topic, _, field = name.rpartition("/")
    return topic.rpartition("/")[2] if field.lower() in _GENERIC else field


def is_commanded(name: str) -> bool:
    """Return whether a name is a command's, of ROS a field of one: of a /cmd_vel, "drive.speed"."""
    if not name.startswith("/"):
        return not _COMMANDS.isdisjoint(_words_of(name))
    topic, _, field = name.rpartition("/")
    parts = (topic.rpartition("/")[2], *field.split(".")[:-1])
    return "drive" in parts or not _COMMANDS.isdisjoint(_words_of(" ".join(parts)))


def _matches(group: str, words: frozenset[str]) -> bool:
    """Return whether all parts of "a|b;c" occur."""
    return all(words & set(part.split("|")) for part in group.split(";"))


def _name_confidence(signal: str, name: str) -> float:
    """Return how sure a name alone says that a channel is a signal, 0 where it does not.
    signal : one of `_RULES`, or a wheel.
    """
    ours = (COLUMNS.get(signal, signal), signal)
    if name in ours:
        return _STANDARD
    listed = _words_of(name)
    if not listed or name == ESTIMATED:
        return 0.0
    if signal in WHEELS:
        return _NAMES_WORDS if _wheel_words(signal, listed) else 0.0
    while name.startswith("/") and len(listed) > 1 and listed[-1] in _GENERIC:
        listed = listed[:-1]
    rule, words = _RULES[signal], _with_parts(listed)
    commanded = name.startswith("/") and is_commanded(name)
    if signal not in ("delta_f", _HAND) and commanded:
        return 0.0
    stems = [listed]
    while len(listed) > 1 and listed[-1] in _SOURCES:
        listed = listed[:-1]
        stems.append(listed)
    ends = ["".join(one[k:]) for one in stems for k in range(len(one))]
    if rule.known & {ends[0], "".join(listed)}:
        return _KNOWN
    if _with_parts(_words_of(_field(name))).union(ends) & rule.never:
        return 0.0
    if (
        len(ends) > 1 and name[-2:-1] not in "./" and name[-1:] != "v"
    ):  # the R of "M_Mtr_D2_R" is a side, or anything
        ends = [end for end in ends if len(end) > 1]
    loss = _SECOND_LOSS if commanded or words & _FILTERED else 0.0
    if rule.known & set(ends) or any(_matches(group, words) for group in rule.words):
        return _NAMES_WORDS - loss
    return _VAGUE if rule.vague & set(ends) else 0.0


def called(signal: str, headings: Sequence[Heading]) -> list[str]:
    """Return the channels that name and unit alone let be a signal, the surest first."""
    found = [one for one in _candidates(signal, headings) if one.confidence > HINT]
    return [one.channel[0] for one in sorted(found, key=lambda one: -one.confidence)]


def _is_hint(signal: str, one: Heading) -> bool:
    """Return whether a word of a name and its unit let a channel be what no rule knows."""
    words = _with_parts(_words_of(_field(one.name)))
    starts = _HINTS.get(signal, ())
    fits = is_given(one.unit) and QUANTITIES[signal] in quantities(one.unit)
    named = any(word.startswith(starts) and "wind" not in word for word in words)
    named |= signal == "r" and bool(quantities(one.name))  # it has no other name than "deg/s"
    return fits and named and not words & _RULES[signal].never


def propose(
    log: LogFile, headings: Sequence[Heading] | None = None, run: str | None = None
) -> Proposal:
    """Return what the channels of a log probably are.
    log : as a format reads it; numbers are read of the channels that are in question.
    headings : names and units to choose from; None all of the log.
    run : which of its runs is looked at; None the only one, or the first.
    """
    headings = log.headings() if headings is None else headings
    candidates = {name: _candidates(name, headings) for name in QUANTITIES if name not in POSE}
    requested = {name for found in candidates.values() for guess in found for name in guess.channel}
    given = {one.name: _with_given_unit(one).unit for one in headings}
    names = {name: _words_of(without_units(name, unit)[0]) for name, unit in given.items()}
    bad = _REFERENCE | _CORNERS
    boxes = triads({name: one for name, one in names.items() if not bad & set(one)}, given)
    requested |= {name for box in boxes for name in box.names.values()}
    posed = [some.values() for some in poses(headings).values() if "z" in some]
    requested |= {one[0].name for some in posed for one in some}
    seen = _seen(log, [one.name for one in headings if one.name in requested], run)
    candidates = {
        name: [_looked(name, guess, seen) for guess in found] for name, found in candidates.items()
    }
    candidates = _along_axes(_with_signs(candidates, headings, seen), boxes, given, seen)
    candidates = _beside_turning(candidates, seen)
    guesses: dict[str, Guess] = {}
    rivals: dict[str, tuple[Guess, ...]] = {}
    for name, found in candidates.items():
        ranked = sorted((one for one in found if one.confidence > 0.0), key=_rank)
        if not ranked:
            continue
        hand, least = _rank(ranked[0])[0], ranked[0].confidence - _APART
        equal = [one for one in ranked if one.confidence > least and _rank(one)[0] == hand]
        rates = {one: np.nan_to_num(typical_rate(seen[one.channel[0]].t)) for one in equal}
        equal.sort(key=lambda one: -float(f"{rates[one]:.1g}"))  # but for jitter
        guesses[name] = equal[0]
        others = [one for one in equal[1:] if not _are_one(name, equal[0], one, seen)]
        if others:
            rivals[name] = (equal[0], *others)
    pose = _pose(headings, seen, _likeliest(candidates["delta_f"]))
    return Proposal(guesses={**guesses, **pose}, rivals=rivals)


_FORMS = [
    (re.compile(_TABLES["pose"][form]), quantity, mark)
    for form, quantity, mark in (("place", LENGTH, ""), ("angle", ANGLE, "h"), ("turn", ANGLE, "q"))
]
_TURNED = {"h", "qy", "qw"}
_NO_POSE = set(_TABLES["pose"]["never"].split())


def poses(headings: Sequence[Heading]) -> dict[str, dict[str, list[Heading]]]:
    """Return channels of poses by the sensor that they name: x, y, h of the heading, qx to qw."""
    groups: dict[str, dict[str, list[Heading]]] = {}
    for one in map(_with_given_unit, headings):
        words = "_".join(_words_of(without_units(one.name, one.unit)[0]))
        plausible = quantities(one.unit) if is_given(one.unit) else (LENGTH, ANGLE)
        for form, wanted, mark in _FORMS:
            found = form.fullmatch(words)
            of = set((found["of"] or "").split("_")) if found else set()
            if found and wanted in plausible and not of & _NO_POSE:
                axis = "" if mark == "h" else found["axis"]
                key = mark + {"e": "x", "n": "y"}.get(axis[:1], axis)
                groups.setdefault(found["of"] or "", {}).setdefault(key, []).append(one)
                break
    return groups


def _pose(headings: Sequence[Heading], seen: _Seen, steering: str) -> dict[str, Guess]:
    """Return x, y and heading of one sensor: of a tracker before odometry; a lone one is sure.

    Of a world with y up z is y, turned as the steering does.
    """
    whole = {
        name: {key: listed[0] for key, listed in some.items()}
        for name, some in poses(headings).items()
        if "x" in some and ("y" in some or "z" in some) and _TURNED & set(some)
    }
    measured = [name for name in whole if "odom" not in name] or list(whole)
    if not measured:
        return {}
    some, sign = whole[measured[0]], 1.0
    place = {key: some[key].name for key in "xyz" if key in some}
    about = some.get("h") or (None if "qw" in some else some["qy"])
    heading = about.name if about else ""
    if "z" in some and {*place.values(), heading} - {""} <= set(seen):
        level, sign = ground(seen, place, heading, steering)
        if level == "z":
            swapped = {"qz": "qy", "qy": "qz", "y": "z"}
            some |= {key: some[of] for key, of in swapped.items() if of in some}
            some |= {"h": about} if about else {}
    if not ("y" in some and ("h" in some or {"qz", "qw"} <= set(some))):
        return {}
    why = "there are several poses" if len(measured) > 1 else ""
    why = why or ("" if sign else "seen from above or, *-1, from below?")
    sure = HINT if why else _KNOWN
    lost = _NO_UNIT_LOSS if measured[0] and not is_given(some["x"].unit) else 0.0
    turned = [
        some[key] for key in (("h",) if "h" in some else ("qx", "qy", "qz", "qw")) if key in some
    ]
    turned = turned if len(turned) == 4 else turned[-2:]
    return {
        name: Guess(
            channel=tuple(one.name for one in listed),
            confidence=sure - lost,
            unit=listed[0].unit.strip() * (len(listed) == 1),
            factor=(sign or 1.0) if name == "y" else 1.0,
            why=why,
        )
        for name, listed in (("x", [some["x"]]), ("y", [some["y"]]), ("heading", turned))
    }


def _with_signs(
    candidates: Mapping[str, list[Guess]], headings: Sequence[Heading], seen: _Seen
) -> dict[str, list[Guess]]:
    """Return the guesses; amounts with the channel of their sign, which is called as they are."""
    signs = {
        words - _SIGN: one.name
        for one in headings
        if (words := frozenset(_words_of(one.name))) & _SIGN and not is_given(one.unit)
    }

    def completed(guess: Guess) -> Guess:
        name = guess.channel[0]
        sign = signs.get(frozenset(_words_of(name)), "")
        if not sign or name not in seen or np.min(seen[name].values, initial=0.0) < 0.0:
            return guess
        return replace(_said(guess, f"its sign is in {sign!r}"), sign=sign)

    return {name: [completed(one) for one in found] for name, found in candidates.items()}


def _along_axes(
    candidates: Mapping[str, list[Guess]],
    boxes: Sequence[Triad],
    units: Mapping[str, str],
    seen: _Seen,
) -> dict[str, list[Guess]]:
    """Return the guesses; of boxes whose letters mislead those that their numbers tell."""
    if not boxes:
        return dict(candidates)
    within = {name for box in boxes for name in box.names.values()}

    def best(name: str) -> str:
        return _likeliest([one for one in candidates[name] if not within & set(one.channel)])

    speed = best("v_x") or _likeliest(candidates["v_x"])
    found = along_axes(boxes, seen, speed, best("r"), best("a_y"), best("delta_f"))
    mended = {
        name: [
            replace(_said(one, _OBLIQUE), confidence=min(one.confidence, HINT))
            if found.oblique & set(one.channel)
            else one
            for one in some
            if not found.misled & set(one.channel)
        ]
        for name, some in candidates.items()
    }
    for one in found.axes:
        unit = units[one.name].strip()
        sure = _KNOWN - (0.0 if is_given(unit) else _NO_UNIT_LOSS)
        mended[one.signal].append(
            Guess(channel=(one.name,), confidence=sure, unit=unit, factor=one.factor, why=one.why)
        )
    return mended


def _surest(found: Sequence[Guess]) -> list[Guess]:
    """Return the surest guess; none where there is hardly any."""
    best = sorted(found, key=lambda one: -one.confidence)[:1]
    return [one for one in best if one.confidence > STILL]


def _likeliest(found: Sequence[Guess]) -> str:
    """Return the channel of the surest guess; "" where there is none."""
    return next((one.channel[0] for one in _surest(found)), "")


def _rank(guess: Guess) -> tuple[bool, float]:
    """Return what guesses are sorted by: a clear one that needs no ratio first, then the surest."""
    return guess.hand or guess.confidence < _NAMES_WORDS, -guess.confidence


def _are_one(name: str, one: Guess, other: Guess, seen: _Seen) -> bool:
    """Return whether two guesses are one channel, as SPEED_KPH and SPEED_MPH: name and numbers."""
    if len(one.channel) + len(other.channel) > 2 or _is_given(one) != _is_given(other):
        return False
    names = (_words_of(without_units(guess.channel[0], guess.unit)[0]) for guess in (one, other))
    if len(set(names)) > 1:
        return False
    first, second = (seen[guess.channel[0]] for guess in (one, other))
    if not first.t.size or not second.t.size:
        return False
    scales = [to_si(guess.unit, quantity_of(name, guess.unit), name) for guess in (one, other)]
    here = scales[0] * first.values
    beside = scales[1] * np.interp(first.t, second.t, second.values)
    return root_mean_square(here - beside) <= _SAME * root_mean_square(here)


def _seen(log: LogFile, names: list[str], run: str | None) -> dict[str, Channel]:
    """Return channels by name, of samples that have a value; without those that cannot be read."""
    runs = log.runs()
    chosen = run if run is not None or not runs else runs[0]
    if not names:
        return {}
    try:
        read = log.read(names, chosen)
        coded = (without_codes(one)[0] for one in read)
        return {one.name: kept(one, np.isfinite(one.values)) for one in coded}
    except RecordingError:
        if len(names) == 1:
            return {}
    return {key: one for name in names for key, one in _seen(log, [name], run).items()}


def _candidates(signal: str, headings: Sequence[Heading]) -> list[Guess]:
    """Return the channels whose names and units may be a signal."""
    found = []
    listed = [_with_given_unit(one) for one in headings]
    for one in listed:
        bare, other = without_units(one.name, one.unit)
        names = {bare} | ({one.name} if are_same(other or one.unit, "g") else set())  # as "lat_g"
        by_name = max(_name_confidence(signal, name) for name in names)
        if signal == "v_x" and quantities(one.name) == (SPEED,) and one.name.lower() != "fps":
            by_name = max(by_name, _VAGUE)  # its unit is its name
        by_hand = max(_name_confidence(_HAND, name) for name in names) * (signal == "delta_f")
        if best := max(by_name, by_hand):
            guess = Guess(channel=(one.name,), confidence=best, hand=by_hand > by_name)
            guess = _with_unit(signal, one, guess)
            if other and max(_name_confidence(key, bare) for key in (signal, _HAND)):
                why = f"its name says {other}, its unit is {one.unit.strip()}: which is it?"
                guess = replace(guess, confidence=min(guess.confidence, HINT), why=why)
            found.append(guess)
        elif _is_hint(signal, one):
            unit, why = one.unit.strip(), "by a word of its name and its unit"
            found.append(Guess(channel=(one.name,), confidence=HINT, unit=unit, why=why))
    if signal in _PER_WHEEL and all(one.hand or one.confidence < _NAMES_WORDS for one in found):
        found += _pairs(signal, listed)
    return found


def _with_given_unit(one: Heading) -> Heading:
    """Return a heading with the unit that its name ends in, where the file tells none."""
    return one if is_given(one.unit) else Heading(one.name, unit_in_name(one.name))


def _with_unit(signal: str, one: Heading, guess: Guess) -> Guess:
    quantity = quantity_of(signal, one.unit)
    if not is_given(one.unit):
        if guess.confidence == _STANDARD:  # names of ours are in SI, as the documents say
            return guess
        loss = guess.confidence - _NO_UNIT_LOSS
        return replace(guess, confidence=loss, why="no unit in the file")
    plausible, unit = quantities(one.unit), one.unit.strip()
    if quantity in plausible:
        return replace(guess, unit=unit)
    near = quantity == RATE and ANGLE in plausible  # as some databases have it
    return replace(
        guess,
        unit=f"{unit}/s" * near,
        confidence=0.5 * guess.confidence * near,
        why=f"its unit {unit} is none of a {quantity}",
    )


def _corner(words: tuple[str, ...]) -> tuple[str, frozenset[str]] | None:
    """Return the corner of the car that a name speaks of, and its other words."""
    rest = frozenset(words)
    for pair, short in _TABLES["corners"].items():
        if rest >= set(pair.split()):
            return short, rest - set(pair.split())
    corners = [word for word in words if word in _CORNERS]
    return (corners[-1], rest - {corners[-1]}) if corners else None


def _pairs(signal: str, listed: Sequence[Heading]) -> list[Guess]:
    """Return pairs of channels of the left and the right wheel of an axle."""
    by_corner: dict[tuple[str, frozenset[str]], Heading] = {}
    quantity = QUANTITIES[signal]
    why = "sum of two wheels" if quantity == FORCE else "mean of two wheels"
    for one in listed:
        found = _corner(_words_of(one.name))
        fits = not is_given(one.unit) or quantity in quantities(one.unit)
        if found and fits and not found[1] & _REFERENCE:
            by_corner.setdefault(found, one)
    pairs = []
    for (corner, rest), left in by_corner.items():
        for first, second in _SIDES[signal]:
            right = by_corner.get((second, rest))
            named = any(_matches(group, rest) for group in _PER_WHEEL[signal])
            if corner == first and right is not None and named:
                guess = Guess(channel=(left.name, right.name), confidence=_NAMES_WORDS)
                pairs.append(_said(_with_unit(signal, left, guess), why))
    return pairs


def _said(guess: Guess, why: str) -> Guess:
    return replace(guess, why="; ".join(part for part in (why, guess.why) if part))


def _looked(signal: str, guess: Guess, seen: _Seen) -> Guess:
    size = usual = 0.0
    for name in guess.channel:
        if name not in seen:
            return replace(guess, confidence=0.0)
        values = seen[name].values
        values = values[:: max(1, values.size // _LOOKED_AT)]
        if not values.size or (signal != "delta_r" and np.ptp(values) == 0.0):
            left = guess.confidence * (STILL if guess.confidence < _STANDARD else 1.0)
            return replace(_said(guess, "it never changes"), confidence=left)
        size = max(size, float(np.abs(values).max()))
        usual = max(usual, _usual(values))
    if guess.confidence == _STANDARD or signal in WHEELS:
        return guess
    if not guess.unit:
        return _by_range(signal, guess, size, usual)
    if QUANTITIES[signal] == RATE and guess.confidence <= _VAGUE:
        usual *= to_si(guess.unit, RATE, signal)  # wheels and shafts turn faster than any car
        if unit_of_range(RATE, usual):
            return replace(_said(guess, f"goes to {usual:.3g} rad/s"), confidence=0.0)
    if QUANTITIES[signal] == ANGLE and signal != BETA and not guess.hand:
        largest = size * to_si(guess.unit, ANGLE, signal)
        if largest > _LARGEST_ROAD:
            why = f"goes to {math.degrees(largest):.0f} deg, as a hand wheel does"
            return replace(_said(guess, why), hand=True)
    return guess


def _by_range(signal: str, guess: Guess, size: float, usual: float) -> Guess:
    """Return a guess without a unit by how far its numbers go, and all but a few of them.

    A name that may mean hand or road wheels, as "steer", means these where it stays as near.
    """
    quantity = QUANTITIES[signal]
    vague = max(_name_confidence(_HAND, name) for name in guess.channel) <= _VAGUE
    if guess.hand and vague and not unit_of_range(quantity, usual):
        return _said(replace(guess, hand=False), f"goes to {size:.3g}, as road wheels do in rad")
    if quantity == ACCELERATION:
        return guess  # `_beside_turning` sets it beside v_x and r
    unit = unit_of_range(HAND_WHEEL if guess.hand else quantity, usual)
    if unit == "km/h" and usual > _FASTEST:
        guess = replace(_said(guess, "in tenths, as no car is so fast"), factor=0.1)
    if unit and quantity == ANGLE and signal != BETA and not guess.hand:
        guess = replace(guess, hand=usual * to_si(unit, quantity, signal) > _LARGEST_ROAD)
    if not unit:
        return _said(guess, f"goes to {size:.3g}") if quantity in (ANGLE, SPEED) else guess
    far = f"goes to {size:.3g}, " + ("as a hand wheel does in" if guess.hand else "so in")
    return _said(replace(guess, unit=unit), f"{far} {unit}")


def _beside_turning(candidates: Mapping[str, list[Guess]], seen: _Seen) -> dict[str, list[Guess]]:
    """Return the guesses; those without a unit in the one with which a_y is nearest to v_x r.

    Where they cannot be set beside each other, how far a_y goes tells whether it is in g.
    """
    best = {name: one for name in ("v_x", "r", "a_y") for one in _surest(candidates[name])}
    mended = dict(candidates)
    if {"v_x", "r"} <= set(best):
        mended["delta_f"] = [_levered(one, best, seen) for one in candidates["delta_f"]]
    for name in _ASSUMED:
        mended[name] = [
            guess
            if _is_given(guess) or guess.confidence == 0.0
            else _in_turning(name, {**best, name: guess}, seen)
            for guess in candidates[name]
        ]
    for name, like in (("v_y", "v_x"), ("a_x", "a_y")):
        channel = best[like].channel if like in best else ()
        first = next((one for one in mended[like] if one.channel == channel), None)
        if first is not None and first.unit and best[like].confidence < SURE:
            mended[name] = [
                guess if _is_given(guess) else replace(_said(guess, f"as {like}"), unit=first.unit)
                for guess in candidates[name]
            ]
    return mended


def _levered(guess: Guess, best: Mapping[str, Guess], seen: _Seen) -> Guess:
    """Return a guess of the steering, of the hand wheel where it turns too far for the car's bend.

    v_x δ / r is the wheelbase, and more of a car that understeers; a_y, where its unit is given,
    tells v_x r whatever the unit of r.
    """
    if guess.hand or guess.confidence <= STILL:
        return guess
    turning = "a_y" if "a_y" in best and _is_given(best["a_y"]) else "r"
    there = {"v_x": best["v_x"], turning: best[turning], "delta_f": guess}
    v, turn, delta = (
        root_mean_square(seen[one.channel[0]].values) * to_si(one.unit, QUANTITIES[name], name)
        for name, one in there.items()
    )
    turn = turn if turning == "r" else turn / max(v, 1e-9)
    if not v * delta > _LONGEST * turn > 0.0:
        return guess
    return replace(_said(guess, "too far for how the car turns"), hand=True)


def _is_given(guess: Guess) -> bool:
    """Return whether the unit of a guess is known; names of ours are in SI."""
    return bool(guess.unit) or guess.confidence == _STANDARD


def _in_turning(name: str, there: Mapping[str, Guess], seen: _Seen) -> Guess:
    """Return the guess of one of them in the unit that v_x, r and a_y together have."""
    guess = there[name]
    sizes = {one: root_mean_square(seen[there[one].channel[0]].values) for one in there}
    if len(there) < 3 or not all(sizes.values()):
        usual = _usual(seen[guess.channel[0]].values)
        return replace(guess, unit=unit_of_range(QUANTITIES[name], usual))

    def far(units: tuple[str, ...]) -> float:
        in_si = {
            one: sizes[one] * to_si(unit, QUANTITIES[one], one)
            for one, unit in zip(there, units, strict=True)
        }
        return abs(math.log(in_si["a_y"] / (in_si["v_x"] * in_si["r"])))

    choices = [(one.unit,) if _is_given(one) else _ASSUMED[key] for key, one in there.items()]
    unit = min(itertools.product(*choices), key=far)[list(there).index(name)]
    named = unit == "g" and "g" in _words_of(guess.channel[0])
    if named and all(one.confidence >= SURE for key, one in there.items() if key != name):
        return replace(guess, confidence=guess.confidence + _NO_UNIT_LOSS, unit=unit, why="")
    return replace(_said(guess, f"so in {unit}, by vx r = ay"), unit=unit) if unit else guess


def _usual(values: Array) -> float:
    """Return how far they go from zero, but for spikes."""
    return float(np.quantile(np.abs(values), 1.0 - _SPIKES)) if values.size else 0.0
