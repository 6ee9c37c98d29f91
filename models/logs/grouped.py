"""A log of channels, each group of them on its own clock: what measurement files, buses, bags are.

A format lists its channels with where each is in the file, and reads those that are asked for,
group by group; the clock of a group is judged and mended once, and its channels share it.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from codegen.arrays import Array
from models.logs.foreign import one_line
from models.logs.log import (
    Channel,
    Clock,
    Heading,
    Listed,
    RecordingError,
    chosen,
    few,
    one_run,
    require_small,
    some,
    unique,
)
from models.logs.stamps import Stamps, seconds
from models.logs.units import TIME, to_si

_MOST_NOTED = 5  # names that a note lists

_P = TypeVar("_P")


class Samples(NamedTuple):
    """What was asked for on one clock.
    clock: its name, for messages; t: times as in the file [s], (n,); values: by name as listed,
    (n,).
    """

    clock: str
    t: Array
    values: Mapping[str, Array]


@dataclass(frozen=True)
class GroupedLog(Generic[_P]):
    """A log of groups of channels, as `LogFile` says.
    place : what a sample is in the file: "message" or "sample".
    found : the group of each channel, the channel, and where the format finds it; names may repeat.
    said : what is left out or taken for granted.
    samples : reads channels; a list, so that a file is not open any more when it is returned.
    missing, remedy : what the file does not hold where there are none, and what to do.
    mend : whether stamps that do not rise are mended, and not refused; not a clock of several that
        starts again.
    received : whether samples lie in the order in which they came: then their stamps sort them.
    clock_name, clock_unit : of the channel that is the time of all; empty leaves each its own.
    """

    dialect = ()
    clock = None
    unlisted = ()

    path: Path
    format: str
    what: str
    place: str
    found: Sequence[tuple[str, Listed, _P]]
    said: tuple[str, ...]
    samples: Callable[[Sequence[tuple[Listed, _P]]], list[Samples]]
    missing: str
    remedy: str = ""
    mend: bool = False
    received: bool = False
    clock_name: str = ""
    clock_unit: str = ""
    _mended: list[str] = field(default_factory=list, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.found:
            why = "".join(f"; {one}" for one in (*self.said, self.remedy) if one)
            raise RecordingError(f"{self.path}: holds no {self.missing}{why}")
        few(self.path, len(self.found), "columns", "channels")

    @cached_property
    def channels(self) -> tuple[tuple[Listed, _P], ...]:
        """The channels; the names that several share have that of their group before them."""
        count = Counter(listed.name for _, listed, _ in self.found)
        names = unique(
            one.name if count[one.name] == 1 else f"{group}/{one.name}"
            for group, one, _ in self.found
        )
        return tuple(
            (replace(listed, name=name), where)
            for name, (_, listed, where) in zip(names, self.found, strict=True)
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What is left out or taken for granted, and what was mended in what has been read."""
        return (*self.said, *dict.fromkeys(self._mended))

    def headings(self) -> tuple[Heading, ...]:
        return tuple(Heading(listed.name, listed.unit) for listed, _ in self.channels)

    def listed(self) -> tuple[Listed, ...]:
        """Return the numeric channels that have a clock."""
        return tuple(listed for listed, _ in self.channels)

    def runs(self) -> tuple[str, ...]:
        return ()

    def read(self, names: Sequence[str], run: str | None = None) -> tuple[Channel, ...]:
        """Return channels in the order of their names; those of one clock share its times.
        run : None.
        """
        one_run(self.path, self.runs(), run)
        if self.clock_name:
            return self._timed(names)
        requested = chosen(self.path, names, {one[0].name: one for one in self.channels})
        require_small(self.path, sum(one.samples for one, _ in requested))
        units = {one.name: one.unit for one, _ in requested}
        found: dict[str, Channel] = {}
        with one_line(self.path, self.what):
            for clock, t, values in self.samples(requested):
                rows, what = np.arange(1, t.size + 1), Clock(0, f"the clock of {clock}", "s", "")
                mend = self.mend or self.received
                stamps = seconds(
                    str(self.path), what, t, rows, self.place, mend=mend, restarts=False
                )
                self._mended.extend(stamps.notes)
                rows = stamps.of(rows)
                for name, one in values.items():
                    found[name] = Channel(
                        name=name, unit=units[name], t=stamps.t, values=stamps.of(one),
                        place=self.place, rows=rows,
                    )  # fmt: skip
        return tuple(map(found.__getitem__, names))

    def _timed(self, names: Sequence[str]) -> tuple[Channel, ...]:
        clock, *found = replace(self, clock_name="").read([self.clock_name, *names])
        label = f"{self.path}: t (channel {clock.name!r})"
        t = clock.values * to_si(self.clock_unit or clock.unit, TIME, label)
        stamps = Stamps(t, ())
        if self.mend:
            what = Clock(0, "t", "s", "")
            stamps = seconds(str(self.path), what, t, clock.rows, clock.place, mend=True)
            self._mended.extend(stamps.notes)
        for one in found:
            if one.values.size != clock.values.size:
                raise RecordingError(
                    f"{self.path}: {clock.name!r} must have a sample for each of {one.name!r} to "
                    f"be its time, it has {clock.values.size} of {one.values.size}"
                )
        return tuple(
            replace(one, t=stamps.t, values=stamps.of(one.values), rows=stamps.of(one.rows))
            for one in found
        )


def noted(what: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return a note of names, none where there are none.
    names : all of them; the first few are listed.
    """
    if not names:
        return ()
    return (f"{what}: {some(names, _MOST_NOTED)}",)


def require_room(path: Path, samples: float, width: float) -> None:
    """Refuse what is read whole where it is too large."""
    few(path, samples, "samples", "samples of a channel")
    few(path, samples * width / 1e6, "block", "megabytes of a block")
