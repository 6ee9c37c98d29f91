"""A run that is computed again where it is asked for, port by port.

Of the numbers of a sample, more than a hundred, a user looks at a dozen; to write all of them into
memory takes as long as to compute them. Only what was carried into each block is kept of the way.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, large
from identifier.setup import AXLE_FORCE, Block, OnDemand, Setup
from models.recordings import Recording

Kind = Literal["state", "outputs"]


class _Found(NamedTuple):
    """What has been computed of a block, by port, and how much of it comes before its part."""

    cut: int
    values: dict[Kind, dict[str, Array]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Rerun:
    """A run that is computed again, block by block, or a part of it.
    last : values carried after the last sample of the recording, by port.
    """

    setup: Setup
    recording: Recording
    parts: tuple[slice, ...]
    begins: tuple[Mapping[str, Array], ...]
    last: Mapping[str, Array]
    first: int
    end: int
    _wanted: set[str] = field(default_factory=set, init=False)
    _found: dict[int, _Found] = field(default_factory=dict, init=False)

    def __len__(self) -> int:
        return self.end - self.first

    def ports(self, kind: Kind) -> tuple[str, ...]:
        """Return the names of the carried ports, or of the outputs but for the axle forces."""
        scan = self.setup.scan
        outputs = tuple(port for port in scan.outputs if port != AXLE_FORCE.name)
        return scan.carry if kind == "state" else outputs

    def blocks(self, samples: NDArray[np.intp] | None = None) -> Iterator[Block]:
        """Yield the run block by block, counted from the first sample of the part.

        A port of a block is computed when it is asked for, together with those that were asked for
        of blocks before. Of a run that is one block it is kept.
        samples : rising indices; blocks without one are left out. None yields all.
        """
        for k, whole in enumerate(self.parts):
            begins, ends = max(whole.start, self.first), min(whole.stop, self.end)
            part = slice(begins - self.first, ends - self.first)
            if begins >= ends or not holds(part, samples):
                continue
            found = self._found.get(k) or _Found(begins - whole.start, {"state": {}, "outputs": {}})
            if len(self.begins) == 1:
                self._found[k] = found
            of = partial(self._of_block, k, found)
            state = OnDemand(self.ports("state"), partial(of, "state"))
            outputs = OnDemand(self.ports("outputs"), partial(of, "outputs"))
            after = OnDemand(self.ports("state"), partial(_last, state))
            yield Block(part, state, outputs, after)

    def _of_block(self, k: int, found: _Found, kind: Kind, port: str) -> Array:
        if port not in found.values[kind]:
            self._wanted.add(port)
            missing = self._wanted.difference(*found.values.values())
            part = slice(self.parts[k].start, min(self.parts[k].stop, self.end))
            (block,) = self.setup.run(self.recording, [part], self.begins[k], ports=missing)
            for values, computed in (
                (found.values["state"], block.state),
                (found.values["outputs"], block.outputs),
            ):
                values |= {name: rows[found.cut :] for name, rows in computed.items()}
        return found.values[kind][port]

    def state_at(self, index: int) -> dict[str, Array]:
        """Return the carried values in effect at a sample, or after the last.
        index : of the sample, counted from the first of the part; as many as there are is the end.
        """
        sample, after = self.first + index, int(index == len(self))
        if sample == len(self.recording):
            return dict(self.last)
        taken = sample - after  # after the last: no rest before the sample that follows
        whole = zip(self.parts, self.begins, strict=True)
        part, carry = next(one for one in whole if one[0].start <= taken < one[0].stop)
        if part.start < taken:
            way = self.setup.run(self.recording, [slice(part.start, taken)], carry, ports=())
            carry = next(way).after
        (block,) = self.setup.run(self.recording, [slice(taken, taken + 1)], carry)
        return {port: values[after - 2] for port, values in block.state.items()}


def holds(part: slice, samples: NDArray[np.intp] | None) -> bool:
    """Return whether one of the samples lies in a part.
    samples : rising indices; None are all.
    """
    if samples is None:
        return True
    first, last = np.searchsorted(samples, [part.start, part.stop])
    return bool(first < last)


def _last(state: Mapping[str, Array], port: str) -> Array:
    return state[port][-1]


class Recalled(OnDemand):
    """By port, what a run records: computed again when it is asked for.
    kind : "state" or "outputs".
    """

    def __init__(self, run: Rerun, kind: Kind) -> None:
        super().__init__(run.ports(kind), self._joined)
        self.run, self._kind = run, kind

    def _joined(self, port: str) -> Array:
        n, found = len(self.run), np.empty(0)
        for block in self.run.blocks():
            values = getattr(block, self._kind)[port]
            if len(values) >= n:
                return values
            if not found.size:
                found = large((n + (self._kind == "state"), *values.shape[1:]))
            found[block.part.start : block.part.start + len(values)] = values
        return found

    def of(self, first: int, end: int) -> "Recalled":
        return Recalled(replace(self.run, first=first, end=end), self._kind)
