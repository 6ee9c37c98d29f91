"""Which axis of a sensor is which of the car's, by what is measured along it, not by its letter.

Games have x to the right and z forward, a box may lie on its side, cameras look along z. Of three
channels that are called alike but for x, y and z: the speed is forward; the mean of an acceleration
is up; about up the yaw rate is measured, and v_x r is the lateral acceleration. The common sign of
r and a_y is that of the steering, without one that of up. Where letters and signs are as ISO has
them (x forward, z up) or numbers do not tell, nothing is said.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from models.logs.log import Channel
from models.logs.units import ACCELERATION, FACTORS, RATE, SPEED, TABLES, is_given, quantities

_STEP = 0.1  # [s] between instants
_WINDOW = 0.3  # [s] over which means are taken there
_MOST, _FEWEST = 20_000, 50  # instants
_SLOW = 3.0  # [m/s]: slower samples tell nothing
_CLEAR = 3.0  # times that the speed is larger than what is measured across it
_SURE = 0.7  # correlation from which axes are known
_LIKELY = 0.4  # correlation from which their signs are known
_NEAR = 0.25  # share of gravity by which a mean of it may be off
_TILT = 0.4  # share of it along another axis from which a box lies oblique

_LETTERS = "xyz"
_GRAVITY = FACTORS[ACCELERATION]["g"]
_STEMS = {quantity: set(some.split()) for quantity, some in TABLES["stems"].items()}


class Triad(NamedTuple):
    """Channels of three axes or of a plane: names by letter, of which quantity, shared words."""

    names: dict[str, str]
    quantity: str
    words: tuple[str, ...]


class _Axis(NamedTuple):
    """What a channel is: of which signal, with which sign, and why."""

    name: str
    signal: str
    factor: float
    why: str


class _Found(NamedTuple):
    """What numbers tell: channels whose letters mislead, and what they are where that is known.
    oblique: of a box that lies so that no axis is one of the car's.
    """

    misled: frozenset[str]
    axes: tuple[_Axis, ...]
    oblique: frozenset[str] = frozenset()


def triads(words: Mapping[str, Sequence[str]], units: Mapping[str, str]) -> list[Triad]:
    """Return the channels that are called alike but for x, y and z, or x and z of a ground plane.
    words : of each channel's name.   units : of each channel, "" where none is given.
    """
    found: dict[tuple[str, ...], dict[str, str]] = {}
    quantity_of: dict[tuple[str, ...], str] = {}
    for name, listed in words.items():
        split = _letter(listed)
        if split is None:
            continue
        letter, rest = split
        likely = quantities(units[name])
        if not is_given(units[name]):
            likely = tuple(one for one, some in _STEMS.items() if some & set(rest))
        quantity = next((one for one in (RATE, ACCELERATION, SPEED) if one in likely), "")
        if quantity:
            found.setdefault(rest, {}).setdefault(letter, name)
            quantity_of[rest] = quantity
    plane = any(set(names) == {"x", "z"} for names in found.values())  # of a world with y up
    return [
        Triad(names, quantity_of[rest], rest)
        for rest, names in found.items()
        if len(names) == len(_LETTERS)
        or (plane and set(names) == ({"y"} if quantity_of[rest] == RATE else {"x", "z"}))
    ]


def _letter(listed: Sequence[str]) -> tuple[str, tuple[str, ...]] | None:
    """Return the letter of an axis in a name, and its words without; None where it has none."""
    stems = set[str]().union(*_STEMS.values())
    for k in range(len(listed) - 1, -1, -1):
        word = listed[k]
        if word in _LETTERS or (word[-1] in _LETTERS and word[:-1] in stems):
            stem = (word[:-1], "?") if word[:-1] else ("?",)
            return word[-1], (*listed[:k], *stem, *listed[k + 1 :])
    return None


def _gridded(seen: Mapping[str, Channel], names: Sequence[str]) -> dict[str, Array]:
    """Return channels at the same instants, (n,), means over `_WINDOW`; none of a few instants."""
    there = [seen[name].t for name in names if seen[name].t.size > 1]
    begin = max((float(t[0]) for t in there), default=0.0)
    end = min((float(t[-1]) for t in there), default=0.0)
    at = begin + _STEP * np.arange(max(min((end - begin) // _STEP, _MOST), 0.0))
    found: dict[str, Array] = {}
    for name in names if at.size >= _FEWEST else ():
        t, values = seen[name].t, seen[name].values
        found[name] = np.full(at.size, np.nan)
        if t.size > 1:
            steps = np.diff(t) * (values[1:] + values[:-1]) / 2.0
            total = np.concatenate([[0.0], np.cumsum(steps)])
            low, high = (np.clip(at + side * _WINDOW / 2.0, t[0], t[-1]) for side in (-1, 1))
            mean = np.interp(high, t, total) - np.interp(low, t, total)
            found[name] = mean / np.maximum(high - low, 1e-9)
    return found


def _alike(one: Array, other: Array) -> float:
    """Return the correlation of two signals, 0 where one never changes."""
    good = np.isfinite(one) & np.isfinite(other)
    if good.sum() < 10 or np.ptp(one[good]) == 0.0 or np.ptp(other[good]) == 0.0:
        return 0.0
    return float(np.corrcoef(one[good], other[good])[0, 1])


def _sign(correlation: float) -> float:
    """Return the sign of a correlation, 0 where there is hardly any."""
    return math.copysign(1.0, correlation) if abs(correlation) > _LIKELY else 0.0


def ground(
    seen: Mapping[str, Channel], place: Mapping[str, str], heading: str, steering: str
) -> tuple[str, float]:
    """Return which axis is level beside x, and of z the sign with which it turns as the steering.

    It is that along which the travel goes as the heading. 0.0 : the drive tells no sign.
    place : channels of a position by letter.   heading, steering : "" where there is none.
    """
    t = seen[place["x"]].t
    used = [*place.values(), *filter(None, (heading, steering))]
    few = min(seen[name].t.size for name in used) < _FEWEST
    if few or ("y" in place and not heading):
        return "y", 1.0
    lag = max(1, int(_WINDOW / float(np.median(np.diff(t)))))

    def at(name: str) -> Array:
        return np.interp(t, seen[name].t, seen[name].values)

    psi = at(heading)[lag // 2 : lag // 2 - lag] if heading else np.zeros(t.size - lag)
    psi = np.radians(psi) if np.abs(psi).max() > 2.0 * math.pi + 0.1 else psi
    way, off = dict[str, Array](), dict[str, float]()
    for one in {"y", "z"} & set(place):
        z = at(place["x"]) + 1j * at(place[one])
        way[one] = z[lag:] - z[:-lag]
        along = max(abs(np.sum(way[one] * np.exp(sense * psi))) for sense in (1j, -1j))
        off[one] = 1.0 - float(along / max(np.sum(np.abs(way[one])), 1e-9))
    if "y" in off and not off["z"] * _CLEAR < off["y"]:
        return "y", 1.0
    turning = way["z"][lag:] * way["z"][:-lag].conj()
    return "z", _sign(_alike(np.angle(turning), at(steering)[lag:-lag])) if steering else 0.0


def along_axes(
    found: Sequence[Triad],
    seen: Mapping[str, Channel],
    speed: str,
    yaw_rate: str,
    lateral: str,
    steering: str,
) -> _Found:
    """Return what the channels of triads are by their numbers, where their letters mislead.
    speed, yaw_rate, lateral, steering : channels of the forward speed, r, a_y and δ by their names;
        but for the speed in no triad; "" where there is none.
    """
    there = {name for name, one in seen.items() if one.t.size > 1}
    usable = [one for one in found if there.issuperset(one.names.values())]
    in_triads = [name for one in usable for name in one.names.values()]
    named = [one for one in (speed, yaw_rate, lateral, steering) if one]
    grid = _gridded(seen, [*in_triads, *named])
    if not grid:
        return _Found(frozenset(), ())
    misled, oblique = set[str](), set[str]()
    axes, across = list[_Axis](), list[str]()
    v = np.abs(grid[speed]) if speed and speed not in in_triads else None
    for one in usable:
        if one.quantity == SPEED and (forward := _forward(grid, one, v)):
            misled |= set(one.names.values())
            letter, sign = forward
            axes.append(_Axis(one.names[letter], "v_x", sign, f"{letter} goes as the speed"))
            v = np.abs(grid[one.names[letter]]) if v is None else v
            across = [name for key, name in one.names.items() if key != letter]
    v = np.abs(grid[speed]) if v is None and speed else v
    if v is None:
        return _Found(frozenset(misled), tuple(axes))
    for one in usable:
        if one.quantity == ACCELERATION:
            rates = [other for other in usable if other.quantity == RATE]
            means = {letter: float(np.nanmean(grid[name])) for letter, name in one.names.items()}
            up = _up(means) if "y" in means else ("y", 0.0)
            same_box = [other for other in rates if set(other.words) & set(one.words) - {"?"}]
            likely = same_box or rates
            gyro = likely[0] if len(likely) == 1 else None  # of several none is known to be its own
            channels = {*one.names.values(), *(gyro.names.values() if gyro else ())}
            if up[0] == "?":
                oblique |= channels
                continue
            given = _of_a_box(grid, one, gyro, up, v, yaw_rate, steering)
            if given is not None:
                misled |= channels | {axis.name for axis in given}
                axes += given
    known = {"r": grid[yaw_rate]} if yaw_rate else {}
    known |= {one.signal: one.factor * grid[one.name] for one in axes}
    known |= {"a_y": grid[lateral]} if lateral else {}
    if across and {"r", "a_y"} <= set(known):
        axes += _sideways(grid, across, v * known["r"], known["a_y"])
    return _Found(frozenset(misled), tuple(axes), frozenset(oblique))


def _forward(grid: Mapping[str, Array], triad: Triad, v: Array | None) -> tuple[str, float] | None:
    """Return the axis of a velocity that is forward, and its sign; None of x, or if unclear."""
    values = {letter: grid[name] for letter, name in triad.names.items()}
    sizes = {letter: math.sqrt(float(np.nanmean(one**2))) for letter, one in values.items()}
    best = max(sizes, key=sizes.__getitem__)
    second = sorted(sizes.values())[-2]
    if best == "x" or sizes[best] < _CLEAR * second or not sizes[best] > 0.0:
        return None
    if v is not None and _alike(np.abs(values[best]), v) < 0.0:
        return None
    return best, math.copysign(1.0, float(np.nanmean(values[best])))


def _sideways(
    grid: Mapping[str, Array], names: Sequence[str], turning: Array, lateral: Array
) -> list[_Axis]:
    """Return which velocity is v_y: its change is what a_y has beside v_x r."""
    slope = float(np.nanmean(turning * lateral) / max(float(np.nanmean(turning**2)), 1e-12))
    if not np.nanstd(turning) or not slope:
        return []
    residual = lateral / slope - turning  # in the units of v r, which may be no SI: signs are asked
    alike = {name: _alike(np.gradient(grid[name], _STEP), residual) for name in names}
    best = max(alike, key=lambda name: abs(alike[name]))
    why = "its change is what ay has beside vx r"
    axis = _Axis(best, "v_y", math.copysign(1.0, alike[best]), why)
    return [axis] if abs(alike[best]) >= _SURE else []


def _up(means: Mapping[str, float]) -> tuple[str, float]:
    """Return the axis that is up by the means of an acceleration in g or m/s², and its sign.

    "" where gravity is not in it, "?" where the box lies oblique.
    """
    size = math.sqrt(sum(one * one for one in means.values()))
    if not any(abs(size / one - 1.0) < _NEAR for one in (1.0, _GRAVITY)):
        return "", 0.0
    best = max(means, key=lambda letter: abs(means[letter]))
    rest = math.sqrt(max(size * size - means[best] ** 2, 0.0))
    return (best if rest < _TILT * size else "?"), math.copysign(1.0, means[best])


def _of_a_box(
    grid: Mapping[str, Array],
    box: Triad,
    gyro: Triad | None,
    up: tuple[str, float],
    v: Array,
    yaw_rate: str,
    steering: str,
) -> list[_Axis] | None:
    """Return what the channels of a box are; None where they are what their letters say."""
    moving = v > (_SLOW / 2.0 if np.nanmax(v) > _SLOW else -1.0)
    values = {letter: grid[name] for letter, name in box.names.items()}
    turns = {"": yaw_rate} if yaw_rate else gyro.names if gyro else {}
    pairs = {
        (about, along): _alike((v * grid[turn])[moving], one[moving])
        for about, turn in turns.items()
        if yaw_rate or up[0] in ("", about)
        for along, one in values.items()
        if along not in (about, up[0])
    }
    about, along = max(pairs, key=lambda pair: abs(pairs[pair]), default=("", ""))
    if abs(pairs.get((about, along), 0.0)) < _SURE:
        return None if up[0] in ("", "z") or "y" not in values else []
    as_lettered = along == "y" and "z" in (about or "z", up[0] or "z")
    if as_lettered and (not up[1] or (up[1] > 0.0 and pairs[about, along] > 0.0)):
        return None
    sign = 0.0
    if steering and (about or "y" not in values):
        sign = _sign(_alike((v * grid[steering])[moving], grid[turns[about]][moving]))
    if not sign and "y" not in values:  # the plane may be seen from above or from below
        return []
    sign = sign or (about and up[1]) or 1.0
    axes = []
    if about and gyro is not None:
        axes.append(_Axis(gyro.names[about], "r", sign, f"about {about}, which is up"))
    elif sign < 0.0:
        axes.append(_Axis(yaw_rate, "r", sign, "as the steering turns"))
    side = sign * math.copysign(1.0, pairs[about, along])
    axes.append(_Axis(box.names[along], "a_y", side, f"along {along} it goes as vx r"))
    vertical = about or up[0]
    left = next(one for one in values if one not in (along, vertical))
    change = _alike(np.gradient(v, _STEP)[moving], values[left][moving])
    if vertical and abs(change) > _LIKELY:
        why = f"along {left} it goes as the change of the speed"
        axes.append(_Axis(box.names[left], "a_x", math.copysign(1.0, change), why))
    return axes
