"""What a log must tell of a car, and how one of these signals is read from channels.

SI, ISO axes: v_x, v_y [m/s], r [rad/s], angles of the road wheels δ_f, δ_r [rad], a_y, a_x [m/s²],
axle forces [N]; sideslip β [rad] stands in for v_y = v_x tan β. Left is positive.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from codegen.arrays import Array, filled
from codegen.escape import displayed
from models.logs.log import RecordingError
from models.logs.units import FORCE, RATE, TURNS, quantities, rows_of

BETA = "beta"
INSTEAD = {"v_y": BETA, BETA: "v_y"}  # one of them is read, never both
AXLES = (("wheel_fl", "wheel_fr"), ("wheel_rl", "wheel_rr"))
WHEELS = (*AXLES[0], *AXLES[1], "wheel")  # turns or speeds, the last of one encoder: for v_x
POSE = ("x", "y", "heading")  # position and angle from x to y, of which v_x, v_y and r are made
NEEDED = ("v_x", "v_y", "r", "delta_f")  # beta may stand in for v_y, or a_y, less surely
_TABLE = rows_of("signals.toml")
QUANTITIES: Mapping[str, str] = {name: one["quantity"] for name, one in _TABLE.items()}
# What a column is called where it differs.
COLUMNS: Mapping[str, str] = {n: one["column"] for n, one in _TABLE.items() if "column" in one}
ESTIMATED = "vy_estimated"  # column of what a method estimated: never read as a sensor's
MEANINGS: Mapping[str, str] = {name: one["meaning"] for name, one in _TABLE.items()}
SPARED = ("a_x",)  # nobody needs it: where it cannot be read and nobody declared it, it is left out
_LARGEST_RATIO = 1e3  # of hand wheel over road wheel, either way


def given_by(signals: Iterable[str]) -> set[str]:
    """Return what signals tell, by name; beta tells v_y, wheels v_x, a pose v_x, v_y and r."""
    stands_for = {BETA: "v_y", **dict.fromkeys(WHEELS, "v_x")}
    given = {stands_for.get(name, name) for name in signals}
    return given | {"v_x", "v_y", "r"} if set(POSE) <= given else given


def has_speed(signals: Iterable[str]) -> bool:
    """Return whether signals tell v_x without wheels: themselves, or by a pose."""
    there = set(signals)
    return "v_x" in there or set(POSE) <= there


def quantity_of(name: str, unit: str) -> str:
    """Return what a signal is; of wheels a speed or a rate, as the unit has it."""
    turns = [one for one in quantities(unit) if one in (RATE, TURNS)]
    return turns[-1] if name in WHEELS and turns else QUANTITIES[name]


def signal_name(name: str) -> str | None:
    """Return our name of a signal by its own or by that of its column; None where it has neither.
    name : for example "vy" or "v_y".
    """
    by_column = {column: ours for ours, column in COLUMNS.items()}
    ours = by_column.get(name, name)
    return ours if ours in QUANTITIES else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """How a signal is read: of which channels, in which unit, and what is done to the numbers.

    In SI it is (mean or sum of the channels) · factor - offset; by `ratio` or `table` the angle of
    the road wheels, where that of the hand wheel was logged.
    channel : names in the file; of several, forces are added and anything else is averaged.
    unit : as users write units; empty takes that of the file, SI where it tells none.
    factor : the numbers are multiplied by it [-]; -1 turns a sign.
    offset : what the channel shows at zero, in SI; it is taken off.
    ratio : angle of the hand wheel over that of the road wheels [-], of steering; below zero it
        turns the sign.
    table : pairs of angles of hand wheel and road wheels [rad], rising, in place of a ratio.
    sign : channel that has the sign of one that holds amounts: below zero, or 1 of 0 and 1, is
        negative; empty where there is none.
    """

    channel: tuple[str, ...]
    unit: str = ""
    factor: float = 1.0
    offset: float = 0.0
    ratio: float = 1.0
    table: tuple[tuple[float, float], ...] = ()
    sign: str = ""

    def __post_init__(self) -> None:
        if not self.channel or not all(self.channel):
            raise RecordingError("channel must name at least one channel of the log")
        if len(set(self.channel)) < len(self.channel):
            raise RecordingError(f"channel must name each once, not {', '.join(self.channel)}")
        if not (math.isfinite(self.factor) and self.factor != 0.0):
            raise RecordingError(f"factor must be finite and not zero, it is {self.factor}")
        if not math.isfinite(self.offset):
            raise RecordingError(f"offset must be finite, it is {self.offset}")
        if not 1.0 / _LARGEST_RATIO <= abs(self.ratio) <= _LARGEST_RATIO:
            raise RecordingError(
                f"ratio must be hand wheel over road wheel, within {1.0 / _LARGEST_RATIO:g} and "
                f"{_LARGEST_RATIO:g} (below zero it turns the sign), it is {self.ratio}"
            )
        if self.table and self.ratio != 1.0:
            raise RecordingError("ratio and table say the same: give one of them")
        if self.table:
            rises = np.diff(self.table, axis=0) > 0.0
            if len(self.table) < 2 or not (rises.all() and np.isfinite(self.table).all()):
                raise RecordingError(
                    "table must hold at least two pairs [hand wheel, road wheel] in rad that rise, "
                    f"not {displayed(str(self.table))}"
                )

    @property
    def requested(self) -> tuple[str, ...]:
        """The channels that are read, that of the sign last."""
        return (*self.channel, self.sign) if self.sign else self.channel

    def value(self, parts: Sequence[Array], quantity: str) -> Array:
        """Return the signal of its channels.   parts : each channel in SI, on one clock (n,)."""
        plain = Signal(channel=self.channel[:1], unit=self.unit, sign=self.sign)
        if len(parts) == 1 and self == plain:
            return parts[0]
        return filled(
            parts[0].size, lambda part: self._value([one[part] for one in parts], quantity)
        )

    def _value(self, parts: Sequence[Array], quantity: str) -> Array:
        total = (np.sum if quantity == FORCE else np.mean)(parts, axis=0)
        total = total * self.factor - self.offset
        if self.table:
            hand, road = np.array(self.table).T
            inside: Array = np.interp(total, hand, road)
            first, last = np.diff(road)[[0, -1]] / np.diff(hand)[[0, -1]]
            below, above = np.minimum(total - hand[0], 0.0), np.maximum(total - hand[-1], 0.0)
            return np.asarray(inside + first * below + last * above)
        return np.asarray(total / self.ratio)


def signed(amounts: Array, t: Array, sign_t: Array, sign: Array) -> Array:
    """Return amounts with the sign that another channel has then, (n,).
    t : times of the amounts [s], (n,).
    sign_t, sign : times and values of the other channel, (m,).
    """
    last = np.maximum(np.searchsorted(sign_t, t, side="right") - 1, 0)
    negative = sign < 0.0 if (sign < 0.0).any() else sign > 0.5 * np.nanmax(sign, initial=1.0)
    return np.where(negative[last], -amounts, amounts)


def require_fitting(signals: Mapping[str, Signal], where: str) -> None:
    """Refuse signals that are no signals of ours, or that contradict one another."""
    for name, signal in signals.items():
        if name not in QUANTITIES:
            raise RecordingError(
                f"{where}signals.{name} is unknown, known are {', '.join(QUANTITIES)}"
            )
        if (signal.table or signal.ratio != 1.0) and name not in ("delta_f", "delta_r"):
            raise RecordingError(f"{where}signals.{name} can have no ratio or table: no steering")
    if BETA in signals and "v_y" in signals:
        raise RecordingError(f"{where}signals.beta replaces v_y: give one of them")
    if 0 < len(set(POSE) & set(signals)) < len(POSE):
        raise RecordingError(f"{where}x, y and heading are a pose together: give all three")
    if ("Fyf" in signals) != ("Fyr" in signals):
        lonely = "Fyf" if "Fyf" in signals else "Fyr"
        raise RecordingError(f"{where}{lonely} needs its partner, give both Fyf and Fyr or neither")
