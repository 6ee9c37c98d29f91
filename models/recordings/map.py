"""How a log is read: channels, units, axes, gaps, filter and repair, as log.toml holds them.

[file]
axes = "SAE"                    # y to the right, z down; ISO where nothing is said
[signals.v_y]
channel = "Vel Lat"
unit = "km/h"                   # that of the file where nothing is said
[signals.delta_f]
channel = ["SteerFL", "SteerFR"]
[repair.offset]
r = 0.004
"""

import math
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

from codegen.escape import displayed
from models.files import resolved, write_atomically
from models.logs.door import open_log
from models.logs.log import LogFile, RecordingError
from models.logs.signals import (
    COLUMNS,
    INSTEAD,
    NEEDED,
    QUANTITIES,
    Signal,
    given_by,
    quantity_of,
    require_fitting,
    signal_name,
)
from models.logs.units import to_si
from models.recordings.repair import Repair
from models.recordings.wheels import Wheels
from models.schema import Table, changed, read_toml, toml_table

LONGEST_GAP = 0.1  # [s]
LARGEST_PACKET = 1 << 16  # bytes, of a live source; a datagram has less

AXES = {"ISO": 1.0, "SAE": -1.0}  # sign of all but v_x and a_x: y left and z up, or both turned
_REFUSE, CUT = "refuse", "cut"  # what becomes of cells without a value
MEND = "mend"  # what may become of stamps that do not rise
# By table of a log.toml: its keys, and the fields of a `LogMap` that they are.
_SECTIONS = {
    "file": {"axes": "axes", "run": "run", "dbc": "dbc"},
    "clock": {
        "channel": "clock", "unit": "clock_unit", "rate": "rate", "longest_gap": "longest_gap",
        "holes": "holes", "order": "order",
    },
    "filters": {"low_pass": "low_pass"},
    "packet": {"format": "packet", "fields": "fields"},
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class LogMap:
    """How a log is read; what is not said is as the file and the standard names have it.

    Parameters
    ----------
    signals : by our name (v_x or wheels, v_y or beta, r, delta_f, delta_r, a_y, a_x, Fyf, Fyr) how
        it is read.
    axes : of the file: "ISO" (y to the left, z up) or "SAE" (y to the right, z down).
    run : which of the file's runs; empty where there is one.
    dbc : database of a CAN log, a path, in a log.toml from its folder; empty where there is none.
    clock : channel that is the time, where it is not what the format takes for it; empty else.
    clock_unit : of that channel; empty takes that of the file, seconds where it has none.
    rate : of the samples [Hz], where no channel is a time; None where not declared.
    longest_gap : the log is cut where a channel has no sample for longer [s].
    holes : "refuse" a channel of which some cells have no value (NaN), or "cut" them out: then it
        has no sample there.
    order : "refuse" times that decrease or repeat, or "mend" them: samples are sorted by time, of
        those that share a stamp the first stays, and where the clock goes back for a second or more
        the rest follows after a gap.
    low_pass : cut-off of a low pass on all signals [Hz]; None filters nothing. All pass the same
        one, of second order, which looks at no later sample: so none is late against another.
    packet, fields : of a live source, how numbers are packed, as Python's struct writes it ("<d4f";
        empty where packets are JSON), and the channel that each is.
    wheels : what they are, where v_x is made of their speeds.
    repair : corrections of the recording and of the car, after reading.
    """

    signals: Mapping[str, Signal] = field(default_factory=dict)
    axes: str = "ISO"
    run: str = ""
    dbc: str = ""
    clock: str = ""
    clock_unit: str = ""
    rate: float | None = None
    longest_gap: float = LONGEST_GAP
    holes: str = _REFUSE
    order: str = _REFUSE
    low_pass: float | None = None
    packet: str = ""
    fields: tuple[str, ...] = ()
    wheels: Wheels = field(default_factory=Wheels)
    repair: Repair = field(default_factory=Repair)

    def __post_init__(self) -> None:
        require_fitting(self.signals, "")
        if self.axes not in AXES:
            raise RecordingError(
                f"axes must be one of {', '.join(AXES)}, not {displayed(self.axes)}"
            )
        for name, unit in (("longest_gap", ""), ("rate", "in Hz, "), ("low_pass", "")):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise RecordingError(f"{name} must be positive and finite, {unit}it is {value}")
        if self.rate is not None and self.clock:
            raise RecordingError("rate replaces a time: give it or the channel of the clock")
        for name, other in (("holes", CUT), ("order", MEND)):
            value = getattr(self, name)
            if value not in (_REFUSE, other):
                raise RecordingError(f"{name} must be {_REFUSE} or {other}, not {displayed(value)}")
        for name, signal in self.signals.items():
            if signal.unit:
                to_si(signal.unit, quantity_of(name, signal.unit), f"signals.{name}")
        if self.packet or self.fields:
            _require_numbers(self.packet, self.fields)

    def opened(self, path: str | PathLike[str]) -> LogFile:
        """Open a log, its time as the map tells it."""
        return open_log(
            Path(path),
            self.dbc or None,
            mend=self.order == MEND,
            clock=self.clock,
            clock_unit=self.clock_unit,
            rate=self.rate or 0.0,
        )

    @property
    def is_complete(self) -> bool:
        """Whether every needed signal is declared: then no other is read."""
        return set(NEEDED) <= given_by(self.signals)

    def with_signals(self, signals: Mapping[str, Signal]) -> "LogMap":
        """Return the map with some signals declared otherwise; v_y and beta replace one another."""
        merged = dict(self.signals)
        for name in signals:
            merged.pop(INSTEAD.get(name, ""), None)
        return replace(self, signals={**merged, **signals})

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> "LogMap":
        """Read a log.toml."""
        data = read_toml(Path(path), RecordingError)
        try:
            declared = cls._of_table(Table(data, "", RecordingError))
        except RecordingError as error:
            raise RecordingError(f"{path}: {error}") from None
        beside = Path(path).parent / declared.dbc
        return replace(declared, dbc=str(beside)) if declared.dbc and beside.is_file() else declared

    @classmethod
    def _of_table(cls, table: Table) -> "LogMap":
        table.only(*_SECTIONS, "signals", "wheels", "repair")
        given: dict[str, Any] = {}
        for section, keys in _SECTIONS.items():
            if section in table:
                inner = table.table(section)
                inner.only(*keys)
                given |= {
                    keys[key]: inner.typed(cls, keys[key], value, key)
                    for key, value in inner.data.items()
                }
        if "signals" in table:
            inner = table.table("signals")
            inner.only(*QUANTITIES)
            given["signals"] = {key: _signal(inner.table(key), key) for key in inner.data}
        if "wheels" in table:
            given["wheels"] = Wheels.of_table(table.table("wheels"))
        if "repair" in table:
            given["repair"] = Repair.of_table(table.table("repair"))
        return cls(**given)

    def toml(self, folder: str | PathLike[str] | None = None) -> str:
        """Return the text of the log.toml that `from_toml` reads back bit for bit.

        Parameters
        ----------
        folder : where the log.toml shall lie: a DBC file in it, or below, is named from there, any
            other by its whole path. None names it as given.
        """
        if self.dbc and folder is not None:
            file, below = Path(self.dbc), Path(folder).resolve()
            whole = resolved(file) if file.is_file() else file
            inside = file.is_file() and whole.is_relative_to(below)
            named = whole.relative_to(below).as_posix() if inside else str(whole)
            return replace(self, dbc=named).toml()
        declared = changed(self)
        tables: dict[str, dict[str, Any]] = {
            section: {key: declared[one] for key, one in keys.items() if one in declared}
            for section, keys in _SECTIONS.items()
        }
        for name in QUANTITIES:
            if name in self.signals:
                channel = self.signals[name].channel
                first = {"channel": channel[0] if len(channel) == 1 else channel}
                tables[f"signals.{name}"] = changed(self.signals[name]) | first
        repair = self.repair.tables()
        inner = {key: value for key, value in repair.items() if isinstance(value, dict)}
        tables["wheels"] = self.wheels.table()
        tables["repair"] = {key: value for key, value in repair.items() if key not in inner}
        tables |= {f"repair.{key}": value for key, value in inner.items()}
        return "\n".join(toml_table(name, values) for name, values in tables.items() if values)

    def to_toml(self, path: str | PathLike[str]) -> None:
        """Write a log.toml; the file appears whole or not at all.

        Parameters
        ----------
        path : of the file; what is there is replaced.
        """
        write_atomically(path, self.toml(Path(path).parent))


def _require_numbers(packet: str, fields: Sequence[str]) -> None:
    """Refuse a packet that is not a number for each field."""
    try:
        size = struct.calcsize(packet)
        numbers = struct.unpack(packet, bytes(size)) if size <= LARGEST_PACKET else ()
    except (struct.error, ValueError):
        numbers = ()
    if not numbers or not all(type(one) in (int, float) for one in numbers):
        raise RecordingError(
            'packet.format must hold numbers alone, as Python\'s struct writes them ("<d4f"; skip '
            f"bytes by x), in at most {LARGEST_PACKET} bytes, not {displayed(packet)}"
        )
    if not len(set(fields)) == len(fields) == len(numbers):
        raise RecordingError(
            f"packet.fields must name each of the {len(numbers)} numbers of packet.format once, "
            f"not {displayed(', '.join(fields))}"
        )


_RULES = {
    "channel": "must be a text or a list of texts",
    "table": "must be pairs [hand wheel, road wheel] in rad",
}


def _signal(table: Table, name: str) -> Signal:
    """Return how a document says that a signal is read."""
    given = table.record(Signal, alone=("channel",), rules=_RULES)
    if given.get("table") == ():
        table.refuse("table", f"{_RULES['table']}, it is empty")
    try:
        return Signal(**given)
    except RecordingError as error:
        raise RecordingError(f"signals.{name}: {error}") from None


# Signals as a command line tells them: NAME=CHANNEL [UNIT] /RATIO.


def given_signals(pairs: Sequence[str]) -> dict[str, Signal]:
    """Return signals as they are given on a command line.

    "vy=Vel Lat [km/h]", "delta_f=SteerAngle [deg] /14.6", "r=Gyro Z *-1",
    "delta_f=SteerFL + SteerFR": NAME=CHANNEL, and behind it a unit in brackets, a factor behind a
    star, an offset in SI behind a minus, a ratio of the steering behind a slash; sign(CHANNEL) of
    an amount whose sign another channel has. Of several channels, with blanks about each plus, the
    mean is taken, of forces the sum.
    """
    found: dict[str, Signal] = {}
    for pair in pairs:
        name, equals, rest = (part.strip() for part in pair.partition("="))
        ours = signal_name(name)
        if not (name and equals and rest):
            raise RecordingError(f'--columns wants "NAME=COLUMN [UNIT]", not {displayed(pair)}')
        if ours is None:
            known = ", ".join(["t", *(COLUMNS.get(one, one) for one in QUANTITIES)])
            raise RecordingError(f"{displayed(name)} is no column of ours: {known}")
        if ours in found:
            raise RecordingError(f"--columns gives {name} twice")
        found[ours] = given_channel(rest)
    require_fitting(found, "--columns: ")
    return found


_CHANGE = re.compile(r"\s+(?P<sign>[/*-])\s*(?P<number>[+-]?[\d.]+(?:e[+-]?\d+)?)$", re.IGNORECASE)
_SIGN = re.compile(r"\s*(?:\*\s*)?\bsign\((?P<channel>.+)\)(?:\s*\*)?\s*")
_UNIT = re.compile(r"\s+\[(?P<unit>[^\[\]]*)\]$")


def given_channel(text: str) -> Signal:
    """Return what stands behind the name in one word of a command line."""
    pair = text
    given: dict[str, Any] = {}
    keys = {"/": "ratio", "*": "factor", "-": "offset"}
    while found := _CHANGE.search(text):
        key, text = keys[found["sign"]], text[: found.start()]
        if key in given:
            raise RecordingError(f"--columns gives the {key} of {displayed(pair)} twice")
        try:
            given[key] = float(found["number"])
        except ValueError:
            raise RecordingError(f"--columns: {displayed(found['number'])} is no number") from None
    if found := _UNIT.search(text):
        given["unit"], text = found["unit"].strip(), text[: found.start()]
    if found := _SIGN.search(text):
        given["sign"] = found["channel"].strip()
        text = text[: found.start()] + text[found.end() :]
    try:
        return Signal(channel=tuple(part.strip() for part in text.split(" + ")), **given)
    except RecordingError as error:
        raise RecordingError(f"--columns {displayed(pair)}: {error}") from None
