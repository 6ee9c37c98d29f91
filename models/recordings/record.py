"""One recording of a car's lateral motion on a uniform time grid.

x = [v_y, r]: lateral velocity [m/s], yaw rate [rad/s].   u = [delta_f, delta_r]: steering [rad].
ISO axes: x forward, y left, z up; r and delta turn left when positive, forces push left.
"""

import csv
import importlib
import io
import math
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen import markup
from codegen.arrays import LONG, Array, blocks, filled, large
from models.bicycle import measured_slip
from models.files import write_atomically
from models.logs.log import RecordingError
from models.logs.signals import COLUMNS, ESTIMATED, MEANINGS, QUANTITIES, signal_name
from models.logs.units import FORCE, SI, TABLES
from models.rules import LARGEST_FORCE

MINIMUM_SAMPLES = 10  # of a segment: fewer are no recording
_PAUSE = 1.0  # [s] between logs that are joined and whose clocks overlap
_JITTER = 0.02  # largest departure of a sample from the uniform grid, as a share of one step
_ON_GRID = 0.01  # share of a step within which time stamps are those of the grid, with jitter
_SAME = 1e-6  # share of a step within which they already are the grid, but for rounding

ALL = slice(None)
_OPTIONAL = ("v_y", "a_x", "a_y", "axle_force")
_MISSING = {
    "v_y": "so slip angles are not known; tireid identify estimates it from ay",
    "a_y": "which is needed where vy is not measured",
}

# Beyond these, in SI, a number is no signal of a car whatever its unit: degrees, g and km/h fit.
_MOST: Mapping[str, float] = TABLES["largest"] | {FORCE: LARGEST_FORCE}
LARGEST = {name: _MOST[quantity] for name, quantity in QUANTITIES.items()}
LARGEST |= {"t": 1e12, "axle_force": LARGEST_FORCE}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Recording:
    """Signals of one drive, all of the same length n, uniformly sampled and read-only.

    A drive may consist of segments, where the log has gaps or there were several: time is uniform
    in each, and nothing is ever differenced from one to the next.

    Arrays that nobody may write, as those of a file that is mapped, are kept as they are; others
    are copied.

    Parameters
    ----------
    name : "FILE:RUN", or "FILE" when the file has no run column.
    t : time [s], shape (n,), uniform to 2 % of one step in each segment, and rising.
    v_x : forward speed at the center of gravity [m/s], shape (n,).
    v_y : lateral velocity at the center of gravity [m/s], positive to the left, shape (n,), or
        None when it was not logged.
    r : yaw rate [rad/s], positive to the left, shape (n,).
    delta_f : front road-wheel angle [rad], positive to the left, shape (n,).
    delta_r : rear road-wheel angle [rad], positive to the left, shape (n,).
    a_y : what an accelerometer at the center of gravity shows [m/s^2], positive to the left, shape
        (n,), or None when it was not logged. It feels tires and wind: v̇_y + v_x r on a level road,
        less g sin of its angle on one that falls to the left.
    a_x : the same forward [m/s^2], shape (n,), or None when it was not logged. It feels what tires
        push lengthwise, less the drag of the air: v̇_x - v_y r on a level road.
    axle_force : front and rear lateral axle force [N], positive to the left, shape (n, 2), or
        None when there is no truth.
    breaks : index of the first sample of each segment but the first, rising.
    notes : what was taken or done in reading beyond the words of the file, one sentence each.
    estimated : signals that a method estimated, not a sensor: v_y only. No method gets them.
    v_y_sd : standard deviation of a v_y that was smoothed, its delay removed [m/s], else 0.

    Raises
    ------
    RecordingError
        If lengths differ, a value is not finite or beyond `LARGEST`, time is not uniform, or a
        segment has fewer than 10 samples.
    """

    name: str
    t: Array
    v_x: Array
    v_y: Array | None = None
    r: Array
    delta_f: Array
    delta_r: Array
    a_y: Array | None = None
    a_x: Array | None = None
    axle_force: Array | None = None
    breaks: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    estimated: tuple[str, ...] = ()
    v_y_sd: float = 0.0

    def __post_init__(self) -> None:
        n = np.size(self.t)
        if not set(self.estimated) <= {"v_y"}:
            raise RecordingError(f"{self.name}: estimated may name v_y, not {self.estimated}")
        for piece in self.segments:
            count = min(piece.stop, n) - piece.start
            if count < MINIMUM_SAMPLES:
                whole = "a recording" if not self.breaks else "each segment of a recording"
                raise RecordingError(
                    f"{self.name}: {whole} needs at least {MINIMUM_SAMPLES} samples, it has "
                    f"{max(count, 0)}"
                )
        for name in _SIGNALS:
            value = getattr(self, name)
            if value is None:
                if name in _OPTIONAL:
                    continue
                raise RecordingError(f"{self.name}: {name} is needed, it is None")
            array = _read_only(value)
            shape = (n, 2) if name == "axle_force" else (n,)
            if array.shape != shape:
                raise RecordingError(
                    f"{self.name}: {name} must have shape {shape}, it has {array.shape}"
                )
            bad = sum(np.count_nonzero(~np.isfinite(array[part])) for part in blocks(n))
            if bad:
                raise RecordingError(
                    f"{self.name}: {name} must be finite, {bad} of its values are not"
                )
            largest = peak(array)
            if largest > LARGEST[name]:
                raise RecordingError(
                    f"{self.name}: {name} must be of a car, within +-"
                    f"{LARGEST[name]:g}, its peak is {largest:.4g}"
                )
            object.__setattr__(self, name, array)
        step = self._step
        for piece in self.segments:
            off_grid = _off_grid(self.t[piece], step)
            if not (step > 0.0 and off_grid <= _JITTER * step):
                raise RecordingError(
                    f"{self.name}: t must rise in equal steps, mean step {step:.6g} s, "
                    f"largest departure {off_grid:.3g} s; read the log with read_recording"
                )
            if piece.start and not self.t[piece.start] > self.t[piece.start - 1]:
                raise RecordingError(
                    f"{self.name}: t must rise from one segment to the next, "
                    f"{self.t[piece.start]:.9g} s comes after {self.t[piece.start - 1]:.9g} s"
                )

    def __len__(self) -> int:
        return int(self.t.size)

    @property
    def segments(self) -> tuple[slice, ...]:
        """Samples of each segment: slices from one break to the next, one where there is none."""
        return tuple(
            slice(first, end) for first, end in pairwise((0, *self.breaks, int(np.size(self.t))))
        )

    def within_a_segment(self, starts: NDArray[np.intp], n: int) -> NDArray[np.bool_]:
        """Return whether samples from each start to n later lie in one segment, (m,).

        Parameters
        ----------
        starts : indices of first samples (m,).
        n : steps from the first to the last sample.
        """
        breaks = np.array(self.breaks, dtype=np.intp)
        first, last = (np.searchsorted(breaks, at, side="right") for at in (starts, starts + n))
        return first == last

    @property
    def x(self) -> Array:
        """State [v_y, r] [m/s, rad/s], shape (n, 2); it needs a v_y."""
        return side_by_side(self.needed("v_y"), self.r)

    @property
    def logged_v_y(self) -> Array | None:
        """Lateral velocity that a sensor showed [m/s], (n,); None where there was none."""
        return None if "v_y" in self.estimated else self.v_y

    def as_logged(self) -> "Recording":
        """Return it without estimated signals, as the input of methods."""
        return replace(self, v_y=self.logged_v_y, estimated=()) if self.estimated else self

    def needed(self, name: str) -> Array:
        """Return a signal that a recording may lack.

        Parameters
        ----------
        name : "v_y" [m/s] or "a_y" [m/s²].
        """
        signal: Array | None = getattr(self, name)
        if signal is None:
            raise RecordingError(
                f"{self.name}: there is no {name.replace('_', '')}, {_MISSING[name]}"
            )
        return signal

    @property
    def u(self) -> Array:
        """Steering [delta_f, delta_r] [rad], shape (n, 2)."""
        return side_by_side(self.delta_f, self.delta_r)

    @property
    def dt(self) -> float:
        """Sample time T_s [s], rounded to a nanosecond so that 100 Hz gives exactly 0.01."""
        return round(self._step, 9)

    @property
    def _step(self) -> float:
        """Mean step of time within the segments [s]."""
        return self.duration / (self.t.size - 1 - len(self.breaks))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, without what lies between segments [s]."""
        return sum(float(self.t[piece.stop - 1] - self.t[piece.start]) for piece in self.segments)

    def alpha(self, l_f: float, l_r: float, part: slice | NDArray[Any] = ALL) -> Array:
        """Slip angles of the axles in the paper's sign, the negative of ISO 8855.

        alpha = delta - atan2(v_y +- l r, v_x), so that F_y = +C alpha. Meaningless at standstill.

        Parameters
        ----------
        l_f : distance from the center of gravity to the front axle [m].
        l_r : distance from the center of gravity to the rear axle [m].
        part : samples that are asked for.

        Returns
        -------
        Array
            [alpha_f, alpha_r] [rad], shape (n, 2).
        """
        names = ("v_x", "v_y", "r", "delta_f", "delta_r")
        signals = {name: self.needed(name)[part] for name in names}

        def slip(some: slice) -> Array:
            return measured_slip(l_f, l_r, **{name: one[some] for name, one in signals.items()})

        return filled(len(signals["r"]), slip, 2)

    def between(self, t0: float, t1: float) -> "Recording":
        """Return the part with t0 <= t <= t1; what it leaves of a segment as of `taken`.

        Parameters
        ----------
        t0 : first time [s], on the recording's own clock.
        t1 : last time [s], included (to a millionth of a step).
        """
        slack = 1e-6 * self.dt
        first = int(np.searchsorted(self.t, t0 - slack, side="left"))
        last = int(np.searchsorted(self.t, t1 + slack, side="right"))
        count = max(last - first, 0)
        if count < MINIMUM_SAMPLES:
            raise RecordingError(
                f"{self.name}: between {t0:g} and {t1:g} s there are {count} "
                f"samples, at least {MINIMUM_SAMPLES} are needed; the recording runs from "
                f"{self.t[0]:g} to {self.t[-1]:g} s"
            )
        return self.taken(slice(first, last))

    def __getitem__(self, times: slice) -> "Recording":
        """Return the part between two times [s], both included, as label slices of pandas have it.
        times : `log[5.0:20.0]`, on the recording's own clock; what is left out is the begin or end.
        """
        if not isinstance(times, slice) or times.step is not None:
            raise TypeError(f"a recording is sliced by time in s, as log[5.0:20.0], not {times!r}")
        t0 = self.t[0] if times.start is None else times.start
        t1 = self.t[-1] if times.stop is None else times.stop
        return self.between(float(t0), float(t1))

    def to_dataframe(self) -> Any:
        """Return it as a data frame of pandas, by the columns of `write_recording`.

        A v_y that a method estimated is in column vy_estimated, which `read_recording` ignores.

        Raises
        ------
        ImportError
            Where pandas is not installed.
        """
        try:
            pandas = importlib.import_module("pandas")
        except ImportError:
            raise ImportError("a data frame needs pandas: pip install pandas") from None
        names = {COLUMNS[name]: ESTIMATED for name in self.estimated}
        return pandas.DataFrame(_columns(replace(self, estimated=()))).rename(columns=names)

    def taken(self, kept: slice | NDArray[np.intp]) -> "Recording":
        """Return some of the samples; where some are left out between, a segment begins.

        What is left of a segment is left out too where it has fewer than 10 samples, and a note
        says so.

        Parameters
        ----------
        kept : consecutive samples as a slice, which is not copied, or indices that rise.
        """
        pieces = self._pieces(kept)
        whole = [piece for piece in pieces if piece.stop - piece.start >= MINIMUM_SAMPLES]
        if not whole:
            raise RecordingError(
                f"{self.name}: each segment of a recording needs at least {MINIMUM_SAMPLES} "
                f"samples, of {len(self)} samples none is left that has them"
            )
        scraps = len(pieces) - len(whole)
        if isinstance(kept, slice):  # what is cut off short lies at its ends
            first = kept.indices(len(self))[0]
            kept = slice(first + whole[0].start, first + whole[-1].stop)
        elif scraps:
            kept = np.concatenate([kept[piece] for piece in whole])
        ends = np.cumsum([piece.stop - piece.start for piece in whole])
        cut: dict[str, Any] = {
            name: signal[kept] if isinstance(kept, slice) else _rows(signal, kept)
            for name in _SIGNALS
            if (signal := getattr(self, name)) is not None
        }
        notes = self.notes
        if scraps:
            several = "s" if scraps > 1 else ""
            notes += (f"left out: {scraps} segment{several} of under {MINIMUM_SAMPLES} samples",)
        return replace(self, **cut, breaks=tuple(int(k) for k in ends[:-1]), notes=notes)

    def _pieces(self, kept: slice | NDArray[np.intp]) -> list[slice]:
        """Return the segments that samples make, counted from the first of them."""
        if isinstance(kept, slice):
            first, end, _ = kept.indices(len(self))
            n, begins = max(end - first, 0), [k - first for k in self.breaks if first < k < end]
        else:
            segment = np.searchsorted(np.array(self.breaks, dtype=np.intp), kept, side="right")
            new = (np.diff(segment) > 0) | (np.diff(kept) > 1)
            n, begins = kept.size, (np.flatnonzero(new) + 1).tolist()
        return [slice(a, b) for a, b in pairwise((0, *begins, n))]

    def __repr__(self) -> str:
        truth = "" if self.axle_force is None else ", with axle forces"
        pieces = f" in {len(self.segments)} segments" if self.breaks else ""
        return (
            f"<Recording {self.name!r}: {self.t.size} samples{pieces} of {self.dt:g} s at "
            f"{self.v_x.min():.3g} to {self.v_x.max():.3g} m/s{truth}>"
        )

    def _repr_html_(self) -> str:
        segments = f" in {len(self.segments)} segments" if self.breaks else ""
        size = f"{self.duration:.4g} s{segments}, {len(self)} samples at {1.0 / self.dt:.4g} Hz"
        rows = [["signal", "", "unit", "from", "to"]]
        for column, signal in list(_columns(replace(self, estimated=())).items())[1:]:
            name = signal_name(column) or column
            ends = (f"{one:.4g}" for one in (signal.min(), signal.max()))
            label = f"{name} (estimated)" if name in self.estimated else name
            rows.append([label, MEANINGS[name], SI[QUANTITIES[name]].replace("^2", "²"), *ends])
        notes = markup.folded(f"{len(self.notes)} notes", self.notes)
        return markup.card(markup.line(size, self.name), markup.table(rows), notes)


def peak(signal: Array) -> float:
    """Return the largest size of a signal.   signal : samples, any shape (...)."""
    return max(abs(float(signal.min())), abs(float(signal.max())))


CHANNELS = ("v_x", "v_y", "r", "delta_f", "delta_r", "a_y")  # what may be faulty, and repaired
_SIGNALS = ("t", *CHANNELS, "a_x", "axle_force")


def joined(recordings: Sequence[Recording], name: str | None = None) -> Recording:
    """Return several recordings as one drive in segments, in their order.

    Each keeps its own time where it begins after the one before; else its time is moved to begin
    1 s after that one ends. Signals that one lacks are left out of all.
    recordings : sampled alike; at least one.   name : of the drive; None takes all their names.
    """
    first = recordings[0]
    name = " + ".join(one.name for one in recordings) if name is None else name
    if len(recordings) == 1:
        return replace(first, name=name)
    t = large((sum(map(len, recordings)),))
    n, end, breaks, notes = 0, -math.inf, list[int](), list[str]()
    for one in recordings:
        if abs(one.dt - first.dt) > _JITTER * first.dt / len(one):
            raise RecordingError(
                f"{one.name} is sampled at {one.dt:g} s, {first.name} at {first.dt:g} s: logs that "
                f"are used together need one sampling interval"
            )
        moved = 0.0 if one.t[0] > end + first.dt else end + _PAUSE - float(one.t[0])
        np.add(one.t, moved, out=t[n : n + len(one)])
        breaks += [n, *(n + k for k in one.breaks)]
        notes += [note for note in one.notes if note not in notes]
        if moved:
            notes.append(f"the time of {one.name} is moved by {moved:.6g} s, to follow on")
        n += len(one)
        end = float(t[n - 1])
    t.setflags(write=False)
    signals: dict[str, Any] = {
        name: _in_a_row([getattr(one, name) for one in recordings])
        for name in _SIGNALS[1:]
        if all(getattr(one, name) is not None for one in recordings)
    }
    for missing in ("v_y", "a_y", "a_x"):
        without = [one.name for one in recordings if getattr(one, missing) is None]
        if missing not in signals and len(without) < len(recordings):
            column = missing.replace("_", "")
            notes.append(f"{column} is left out, {', '.join(without)} has none")
    return Recording(
        name=name,
        t=t,
        **signals,
        breaks=tuple(breaks[1:]),
        notes=tuple(notes),
        estimated=tuple(sorted({signal for one in recordings for signal in one.estimated})),
        v_y_sd=max(one.v_y_sd for one in recordings),
    )


def _in_a_row(signals: Sequence[Array]) -> Array:
    """Return signals one after the other, as what nobody may write."""
    row = large((sum(map(len, signals)), *signals[0].shape[1:]))
    np.concatenate(signals, out=row)
    row.setflags(write=False)
    return row


def _rows(signal: Array, kept: NDArray[np.intp]) -> Array:
    """Return some samples of a signal, as what nobody may write."""
    return filled(kept.size, lambda part: signal[kept[part]], *signal.shape[1:])


def _read_only(value: object) -> Array:
    """Return an array of float64 that nobody may write, a copy where somebody may."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and _nobody_writes(value):
        return np.asarray(value)
    array = np.array(value, dtype=np.float64)
    array.setflags(write=False)
    return array


def _nobody_writes(array: NDArray[Any]) -> bool:
    """Return whether an array and, where it is a view, what it looks at cannot be written."""
    one: Any = array
    while isinstance(one, np.ndarray) and not isinstance(one, np.memmap):
        if one.flags.writeable:
            return False
        one = one.base
    return True


def side_by_side(first: Array, second: Array) -> Array:
    """Return two signals as columns that nobody may write, (n, 2).
    first, second : signals (n,).
    """
    return filled(first.size, lambda part: np.column_stack([first[part], second[part]]), 2)


def _off_grid(t: Array, step: float) -> float:
    """Return how far times lie at most from the uniform grid of a step that begins with them."""
    return max(
        float(np.abs(t[part] - t[0] - step * np.arange(part.start, part.stop)).max())
        for part in blocks(t.size)
    )


# Write a recording as a CSV.


def write_recording(recording: Recording, path: str | Path) -> Path:
    """Write t [s], vx, vy [m/s], r [rad/s], delta_f, delta_r [rad], ay, ax [m/s^2], Fyf, Fyr [N].

    Columns that the recording lacks are left out. Numbers are the shortest that read back the
    same: `read_recording` gives the recording back bit for bit at its own interval, a drive in
    segments where each lasts a second and time leaps by more than 0.1 s between them. Over a
    shorter gap a reader draws a line, unless its map tells a shorter `longest_gap`, and shorter
    segments it leaves out. The file appears whole or not at all; an existing one is replaced.
    """
    path = Path(path)
    if not path.name.lower().endswith((".csv", ".csv.gz")):
        raise RecordingError(f"{path}: the name must end in .csv or .csv.gz")
    text = _csv(_columns(recording))
    write_atomically(path, _packed(text) if path.name.lower().endswith(".gz") else text)
    return path


def _columns(recording: Recording) -> dict[str, Array]:
    """Return the signals that there are, by the standard names of columns."""
    logged = recording.as_logged()
    columns = {
        COLUMNS.get(name, name): signal
        for name in _SIGNALS[:-1]
        if (signal := getattr(logged, name)) is not None
    }
    if recording.axle_force is not None:
        columns["Fyf"], columns["Fyr"] = recording.axle_force.T
    return columns


def _csv(columns: Mapping[str, Array]) -> Iterator[bytes]:
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    for part in blocks(len(columns["t"])):
        table.writerows(np.column_stack([one[part] for one in columns.values()]).tolist())
        yield text.getvalue().encode()
        text.seek(0)
        text.truncate()


def _packed(parts: Iterable[bytes]) -> Iterator[bytes]:
    """Yield bytes as gzip packs them, without a time stamp: same recording, same bytes."""
    packing = zlib.compressobj(9, zlib.DEFLATED, 16 + zlib.MAX_WBITS)
    for part in parts:
        yield packing.compress(part)
    yield packing.flush()


# Bring the columns of a log to a uniform grid.
#
# Linear interpolation when the log is slower than the grid. When it is faster, every value is the
# mean over one step about its instant: no phase, 1.6 % loss at a tenth of the sampling frequency,
# zeros at its multiples. The ends keep the logged values.


def resample(t: Array, columns: dict[str, Array], dt: float) -> tuple[Array, dict[str, Array]]:
    """Return time and columns on the grid t[0], t[0] + dt, ...

    Time stamps that are that grid keep their bits. Those that only jitter about it, or drift by
    less than 1 % of a step, are replaced by it, and the values stay.
    t : rising time stamps [s], shape (n,).   columns : name -> values, shape (n,).
    dt : step of the grid [s].
    """
    off = _off_grid(t, dt)
    if off <= _ON_GRID * dt:
        return (t if off <= _SAME * dt else _grid(t[0], dt, t.size)), columns
    count = int(np.floor((t[-1] - t[0]) / dt + 1e-6)) + 1
    grid = _grid(t[0], dt, count, t[-1])
    slower = float(np.median(np.diff(t[: LONG + 1]))) > dt / 1.5
    resampled = {}
    for name, value in columns.items():
        area = None if slower else _area(t, value)
        resampled[name] = filled(count, partial(_at, grid, t, value, area, dt))
    return grid, resampled


def _grid(begin: float, dt: float, count: int, end: float = math.inf) -> Array:
    """Return times of equal steps, none beyond an end."""
    return filled(
        count, lambda part: np.minimum(begin + dt * np.arange(part.start, part.stop), end)
    )


def _at(grid: Array, t: Array, value: Array, area: Array | None, dt: float, part: slice) -> Array:
    """Return the value at some instants of the grid, or the mean over a step about each."""
    grid = grid[part]
    new = np.interp(grid, t, value)
    if area is None:
        return new
    half = np.minimum(dt / 2.0, np.minimum(grid - t[0], t[-1] - grid))
    inside = half > 1e-9 * dt
    ends = (_integral(t, value, area, (grid + side * half)[inside]) for side in (1.0, -1.0))
    new[inside] = (next(ends) - next(ends)) / (2.0 * half[inside])
    return new


def _area(t: Array, value: Array) -> Array:
    """Return the integral of the straight lines between samples from t[0] to each sample."""
    total = large((t.size,))
    total[0] = 0.0
    for part in blocks(t.size, overlap=1):
        here, signal = t[part], value[part]
        steps = np.diff(here) * (signal[1:] + signal[:-1]) / 2.0
        total[part] = np.cumsum(np.concatenate([[total[part.start]], steps]))
    return total


def _integral(t: Array, value: Array, total: Array, at: Array) -> Array:
    """Integrate the straight lines between samples from t[0] to each time `at`, exactly."""
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
    ahead = at - t[k]
    slope = (value[k + 1] - value[k]) / (t[k + 1] - t[k])
    return total[k] + ahead * (value[k] + slope * ahead / 2.0)
