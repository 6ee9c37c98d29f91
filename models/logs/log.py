"""What a logger wrote, before anything of it is understood: named channels, each on its own clock.

A format reads a file and gives a `LogFile`; what the channels mean (which is v_y, in which unit,
from which sensor) is given by a map, and only then a `Recording` in SI is made of them.
"""

import difflib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.escape import displayed, visible
from models.schema import require_dense, require_few

_SOME = 12  # names in a message
_LONGEST = 200  # characters of them

_T = TypeVar("_T")


class RecordingError(TireidError, ValueError):
    """A log or a recording breaks a rule; one line: file or name, column, rule, value, remedy."""


def few(path: object, count: float, limit: str, what: str) -> None:
    """Refuse more of a log than a limit allows, as `require_few`."""
    require_few(RecordingError, str(path), count, limit, what)


def require_small(path: Path, numbers: float) -> None:
    """Refuse numbers that in sum swell as those of no log, as arrays that were never written.
    numbers : how many are read, of all channels.
    """
    size = sum(one.stat().st_size for one in (path, *path.glob("*")) if one.is_file())
    if size:  # it is no data frame
        dense(path, 8.0 * numbers, size, "what is read of it")


def dense(path: object, size: float, packed: float, what: str) -> None:
    """Refuse data of a log that swell as none does, as `require_dense`."""
    require_dense(RecordingError, str(path), size, packed, what)


class Heading(NamedTuple):
    """What a channel is called, and the unit that the file tells of it, "" where it tells none."""

    name: str
    unit: str


class Clock(NamedTuple):
    """The column that is the time.
    column: from 0; name: as in the file; unit: of `units.PER_SECOND`, "hhmmss" or "instant"; words:
    for people, what is unusual behind a semicolon; summed: whether it holds the time since the
    sample before.
    """

    column: int
    name: str
    unit: str
    words: str
    summed: bool = False


@dataclass(frozen=True, slots=True)
class Listed:
    """A channel as a file lists it.
    name : as in the file, unique in it; a message's field has its topic before it.
    unit : as in the file, "" where it tells none.
    rate : typical samples per second [Hz], NaN where it is not known without reading them.
    """

    name: str
    unit: str
    samples: int
    rate: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One signal as it was written.
    t : time of each sample [s], (n,), on the clock of the log; channels of one clock share it.
    values : (n,) float64 as in the file, NaN for an empty cell.
    place : what a sample is in the file, for messages: "line", "row", "message" or "sample".
    rows : which one each sample is in, (n,).
    """

    name: str
    unit: str
    t: Array
    values: Array
    place: str
    rows: NDArray[np.int64]


class LogFile(Protocol):
    """What every format answers; nothing is read beyond what was asked for."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def format(self) -> str:
        """Its format as users call it, for example "CSV" or "MDF4"."""

    @property
    def dialect(self) -> tuple[str, ...]:
        """How the file is written, as it was detected, for people; empty where nothing was."""

    @property
    def clock(self) -> Clock | None:
        """The column that is the time of all channels; None where the format has no such one."""

    @property
    def unlisted(self) -> tuple[str, ...]:
        """Names of what stands in the file as a channel does and is none, as columns of words."""

    def headings(self) -> tuple[Heading, ...]:
        """Return names and units of the channels that are listed; the samples are not looked at."""

    def listed(self) -> tuple[Listed, ...]:
        """Return the numeric channels in the order of the file, but for the clock."""

    def runs(self) -> tuple[str, ...]:
        """Return the names of the runs that the file holds apart; empty where it holds one."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What is left out, taken for granted, or was mended in what has been read, a line each."""

    def read(self, names: Sequence[str], run: str | None = None) -> tuple[Channel, ...]:
        """Return channels in the order of their names.
        run : one of `runs`; None where there are none.
        """


def chosen(path: Path, names: Sequence[str], known: Mapping[str, _T]) -> list[_T]:
    for name in names:
        if name not in known:
            similar = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            there = f"; did you mean {displayed(similar[0])}?" if similar else ""
            there = there or f", there are '{some(list(known))}'"
            raise RecordingError(f"{path}: there is no channel {displayed(name)}{there}")
    return [known[name] for name in names]


def one_run(path: Path, runs: Sequence[str], run: str | None) -> str | None:
    """Return the run that is read: the one that is asked for, or the only one; None of none."""
    if not runs:
        if run is not None:
            raise RecordingError(
                f"{path}: holds one run without a name, so no run {displayed(run)}; leave it out"
            )
        return None
    if run is None and len(runs) > 1:
        raise RecordingError(f"{path}: name one of its runs: {some(runs)}")
    if run is not None and run not in runs:
        raise RecordingError(
            f"{path}: there is no run {displayed(run)}, the runs are: {some(runs)}"
        )
    return runs[0] if run is None else run


def some(names: Sequence[str], most: int = _SOME) -> str:
    """Return names for a message, the first of many, on one line."""
    first = names[:most]
    while len(listing := visible(", ".join(first))) > _LONGEST and len(first) > 1:
        first = first[:-1]
    cut = len(names) > len(first) or len(listing) > _LONGEST
    return listing[:_LONGEST] + (f", ... ({len(names)})" if cut else "")


def unique(names: Iterable[str]) -> tuple[str, ...]:
    """Return names, each once: the second "v" is "v (2)"."""
    found: dict[str, None] = {}
    last: Counter[str] = Counter()
    for name in names:
        one = name
        while one in found:
            last[name] += 1
            one = f"{name} ({last[name] + 1})"
        found[one] = None
    return tuple(found)
