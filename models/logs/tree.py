"""Numbers in structs of structs, as MATLAB and HDF5 files hold them, and the channels among them.

A clock is a vector called t or time; it is the clock of what has its length beside it and in the
structs below it, the nearest first. A struct of data, with a time or a unit beside it, is one
channel: so are a timeseries that was made a struct, and each signal of a Simulink or dSPACE log.
A matrix is a channel for each column, or row. What has no clock is no channel.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from models.logs.stamps import NAMES
from models.logs.units import TABLES

_LEAST_RATE = 1.0  # [Hz]
_MOST_RATE = 1e5  # [Hz]
_MOST_COLUMNS = 1000  # of a matrix that is a table of signals

# Of a variable: a name that a clock has, and the unit that may follow it.
_CLOCK = re.compile(r"([a-z_ ]+?)(?:_?(s|sec|ms|us|ns))?")
_OTHER_CLOCKS = ("tout", "timestep")
HEAD = 200  # times by which a clock is known
_DATA, _NAME, _UNIT, _COLUMNS, _RATES, _STEPS = (row.split() for row in TABLES["struct"].values())


@dataclass(frozen=True, slots=True, kw_only=True)
class Leaf:
    """An array of real numbers that is not read yet.   load : reads it, (rows, columns) float64."""

    shape: tuple[int, int]
    load: Callable[[], Array]


@dataclass(frozen=True, slots=True)
class Unread:
    """What is not read: an object, a sparse or complex array."""

    kind: str


Tree = Leaf | Unread | str | list["Tree"] | dict[str, "Tree"]
_Struct = dict[str, Tree]


class Clock(NamedTuple):
    """Times of samples.
    leaf, column: where they are; unit: that is given of it, "" for none.
    """

    name: str
    leaf: Leaf
    column: int | None
    unit: str


class Signal(NamedTuple):
    """A channel of a tree.
    place: which column, or row where `along` is 1, of the leaf.
    """

    name: str
    unit: str
    leaf: Leaf
    place: int
    along: int
    clock: Clock

    @property
    def samples(self) -> int:
        return self.leaf.shape[self.along]


class _Found(NamedTuple):
    """What a tree holds: signals, names of vectors without clock, names of what is not read."""

    signals: list[Signal]
    clockless: list[str]
    unread: list[str]
    said: tuple[str, ...] = ()


def signals_of(tree: Mapping[str, Tree], rate: float) -> _Found:
    """Return the channels of a tree, in its order; their names may repeat.
    rate : of vectors of one length that have no time beside them [Hz]; 0 takes a number fs, dt or
        the like of the tree, if there is one.
    """
    walk = _Walk()
    walk.struct(dict(tree), "", ())
    rate = rate or walk.rate
    if not rate or not walk.clockless:
        return _Found(walk.signals, list(walk.clockless), walk.unread)
    sizes = Counter(max(leaf.shape) for _, _, leaf, _ in walk.clockless.values())
    ((samples, _),) = sizes.most_common(1)
    even = Leaf(shape=(samples, 1), load=lambda: (np.arange(samples) / rate).reshape(-1, 1))
    clock = Clock(f"even {rate:g} Hz", even, None, "s")
    rest = _Walk()
    for name, unit, leaf, columns in walk.clockless.values():
        rest.leaf(leaf, name, unit, (clock,), columns)
    said = (f"time is even at {rate:g} Hz of vectors without a time of their own",)
    return _Found(walk.signals + rest.signals, list(rest.clockless), walk.unread, said)


def times_of(clock: Clock) -> Array:
    """Read the times of a clock as they are in the file, (n,)."""
    values, (rows, width) = clock.leaf.load(), clock.leaf.shape
    if clock.column is None:
        return values.reshape(-1)
    return values[:, clock.column] if rows >= width else values[clock.column]


_Columns = tuple[list[str], list[str]] | None  # names and units of those of a matrix
_Clockless = tuple[str, str, Leaf, _Columns]


class _Walk:
    def __init__(self) -> None:
        self.signals: list[Signal] = []
        self.clockless: dict[str, _Clockless] = {}
        self.unread: list[str] = []
        self.rate = 0.0

    def struct(self, node: _Struct, path: str, clocks: tuple[Clock, ...]) -> None:
        """Collect the channels of a struct; clocks: of the structs around it, the nearest first."""
        clocks = (*_clocks_of(node, path), *clocks)
        clock_leaves = [clock.leaf for clock in clocks]
        columns = _columns(node)
        data = _pick(node, _DATA)
        if any(data is leaf for leaf in clock_leaves):
            return
        if isinstance(data, Leaf) and (clocks or _text(node, _UNIT)) and not _several(node):
            label = _text(node, _NAME) or path
            self.leaf(data, label, _unit(node), clocks, columns)
            return
        for key, child in node.items():
            name = f"{path}.{key}" if path else key
            if not isinstance(child, Leaf):
                self.other(child, name, clocks)
            elif not any(child is leaf for leaf in clock_leaves):
                self.leaf(child, name, _unit_of_field(node, key), clocks, columns)

    def other(self, node: Tree, path: str, clocks: tuple[Clock, ...]) -> None:
        if isinstance(node, Leaf):
            self.leaf(node, path, "", clocks, None)
        elif isinstance(node, Unread):
            self.unread.append(f"{path} ({node.kind})")
        elif isinstance(node, dict):
            self.struct(node, path, clocks)
        elif isinstance(node, list):
            structs = all(isinstance(one, dict) for one in node)
            for k, one in enumerate(node, start=1):
                self.other(one, f"{path}({k})" if structs else f"{path}{{{k}}}", clocks)

    def leaf(
        self,
        leaf: Leaf,
        name: str,
        unit: str,
        clocks: tuple[Clock, ...],
        columns: _Columns,
    ) -> None:
        rows, width = leaf.shape
        if rows * width < 2:  # it may be the rate of samples, or the time between them
            word = re.sub("[^a-z]", "", name.rpartition(".")[2].lower())
            if word in _RATES + _STEPS and leaf.shape == (1, 1):
                value = float(leaf.load()[0, 0])
                rate = value if word in _RATES or not value else 1.0 / value
                if _LEAST_RATE <= rate <= _MOST_RATE:
                    self.rate = rate
            return
        for clock in clocks:
            samples = max(clock.leaf.shape)
            if samples not in leaf.shape:
                continue
            along = 0 if rows == samples else 1
            if leaf.shape[1 - along] > _MOST_COLUMNS:
                break
            self.signals += _lines(leaf, name, unit, along, clock, columns)
            return
        inside = _clock_inside(leaf, name)
        if inside is not None:
            along = 0 if rows >= width else 1
            lines = _lines(leaf, name, unit, along, inside, columns)
            self.signals += [signal for signal in lines if signal.place != inside.column]
        else:
            self.clockless[name] = (name, unit, leaf, columns)


def _lines(
    leaf: Leaf, name: str, unit: str, along: int, clock: Clock, columns: _Columns
) -> Iterator[Signal]:
    """Yield the signal of a vector, or those of the columns or rows of a matrix."""
    width = leaf.shape[1 - along]
    if width == 1:
        yield Signal(name, unit, leaf, 0, along, clock)
        return
    names, units = columns or ([], [])
    for k in range(width):
        place = f"(:,{k + 1})" if along == 0 else f"({k + 1},:)"
        of_line = names[k] if len(names) == width else name + place
        unit_of = units[k] if len(units) == width else unit
        yield Signal(of_line, unit_of, leaf, k, along, clock)


def line_of(values: Array, signal: Signal) -> Array:
    """Return the values of a channel, (n,).   values : of its leaf, (rows, columns)."""
    line = values[:, signal.place] if signal.along == 0 else values[signal.place]
    return np.array(line, dtype=np.float64)


def _clocks_of(node: _Struct, path: str) -> Iterator[Clock]:
    for key, child in node.items():
        if (unit := _unit_of_clock(key)) is None:
            continue
        if isinstance(child, dict):
            unit, child = _unit(child) or unit, _pick(child, _DATA) or child
        if isinstance(child, Leaf) and 1 in child.shape and max(child.shape) > 1:
            name = f"{path}.{key}" if path else key
            yield Clock(name, child, None, _unit_of_field(node, key) or unit)
    x, y = node.get("X"), node.get("Y")  # of dSPACE: the clock is X, the signals are Y(k)
    if isinstance(x, dict) and isinstance(y, dict | list):
        data = _pick(x, _DATA)
        if isinstance(data, Leaf) and 1 in data.shape:
            yield Clock(f"{path}.X" if path else "X", data, None, "")


def _unit_of_clock(name: str) -> str | None:
    """Return the unit that the name of a clock tells, "" for none; None where it names no clock."""
    found = _CLOCK.fullmatch(name.strip().lower())
    if found is None:
        return None
    word = re.sub("[^a-z]", "", found[1])
    return (found[2] or "") if word in NAMES or word in _OTHER_CLOCKS else None


def _clock_inside(leaf: Leaf, name: str) -> Clock | None:
    """Return the first column of a matrix, or row of a wide one, where it rises as a clock does."""
    if min(leaf.shape) < 2 or min(leaf.shape) > _MOST_COLUMNS or max(leaf.shape) < 3:
        return None
    clock = Clock(name, leaf, 0, "")
    steps = np.diff(times_of(clock))
    return clock if (steps > 0.0).all() and (steps != 1.0).any() else None  # 1: rows, not seconds


def _pick(node: _Struct, names: Sequence[str]) -> Tree | None:
    """Return the first of a struct's fields that has one of these names, whatever its case."""
    lower = {key.lower(): child for key, child in reversed(list(node.items()))}
    return next((lower[name] for name in names if name in lower), None)


def _several(node: _Struct) -> bool:
    """Whether a struct holds other vectors than one signal and its time."""
    return any(
        isinstance(child, Leaf)
        and max(child.shape) > 1
        and key.lower() not in (*_DATA, "dimensions", "x", "quality")
        and _unit_of_clock(key) is None
        for key, child in node.items()
    )


def _text(node: _Struct, names: Sequence[str]) -> str:
    found = _pick(node, names)
    return found.strip() if isinstance(found, str) else ""


def _unit(node: _Struct) -> str:
    """Return the unit of a struct that is a signal; a timeseries has it in DataInfo."""
    about = _pick(node, ("datainfo",))
    return _text(node, _UNIT) or (_text(about, _UNIT) if isinstance(about, dict) else "")


def _unit_of_field(node: _Struct, key: str) -> str:
    """Return the unit of a field of a struct that holds those of its fields."""
    units = _pick(node, _UNIT)
    return _text(units, (key.lower(),)) if isinstance(units, dict) else ""


def _columns(node: _Struct) -> _Columns:
    """Return the names and units that a struct tells of the columns of its matrix."""

    def words(names: Sequence[str]) -> list[str]:
        found = _pick(node, names)
        if not isinstance(found, list) or not all(isinstance(one, str) for one in found):
            return []
        return [str(one).strip() for one in found]

    names = words(_COLUMNS)
    return (names, words(_UNIT)) if names else None
