"""A run, ready to go: the compiled step, what stands in its ports, and what it is shown."""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from codegen.arrays import Array, blocks, large
from identifier.refused import NOWHERE, judges_samples, with_rests
from models.recordings import Recording
from models.recordings.record import ALL

# Rules of numbers that are taken over from elsewhere: a file, another controller.
COVARIANCE, FACTORS, NOT_NEGATIVE = "covariance", "factors of a covariance", "not negative"


class Port(NamedTuple):
    """An output or a carried value of a step: what stands in it.
    unit : of its numbers, "U" the force unit.
    rule : what its numbers must be to be taken over; empty: finite.
    """

    name: str
    unit: str
    words: str
    learnt: bool = False
    rule: str = ""


class Range(NamedTuple):
    """What learnt numbers of a port keep: low <= Σ shares_i x_i <= high.
    first : of them, in the port by rows.   shares : one for each number in turn.
    """

    port: str
    first: int
    low: float
    high: float
    shares: tuple[float, ...] = (1.0,)


AXLE_FORCE = Port(
    "axle_force", "N", "lateral axle forces, front and rear, left positive, frame of the body"
)
HALF_BAND = Port(
    "half_band",
    "N",
    "half the width of the 90 % band around axle_force, front and rear; 0 where forces read zero",
)


def force_unit_name(force_unit: float) -> str:
    """Return the name of a unit of force.   force_unit : U [N]."""
    return {1.0: "N", 1000.0: "kN"}.get(force_unit, f"{force_unit:g} N")


def in_force_unit(ports: Iterable[Port], force_unit: float) -> tuple[Port, ...]:
    """Return ports with the name of the force unit in place of U.
    ports : with units in which U stands for it.   force_unit : U [N].
    """
    name = force_unit_name(force_unit)
    return tuple(port._replace(unit=port.unit.replace("U", name)) for port in ports)


class Setup(NamedTuple):
    """A run, ready to go: the compiled step, the values it carries at the start, its constants.

    The step reads x = [v_y, r] (2,), u = [δ_f, δ_r] (2,), v_x and, where it can use it, a_y (NaN
    where there is none) sample by sample, SI: `sampled`. It has an output axle_force (2,) [N].
    An observer that starts at the first measurement carries zero until that is known: `observe`
    takes its x and returns the carried values that begin with it, by port.
    Carried ports of `only_with_a_y` change no other one, and no output, where a_y is never there.
    Between segments of a drive the step is shown `rest` samples, after which it begins anew with
    what it has learnt (`identifier.refused`): a step that judges samples itself as many as end a
    run of it, `ends_run`, every other one.
    ranges : where numbers that are taken over must lie, beside the rules of their ports.
    """

    scan: Scan
    carry: Mapping[str, Array]
    constants: Mapping[str, Array]
    observe: Callable[[Array], Mapping[str, Array]] | None = None
    only_with_a_y: tuple[str, ...] = ()
    ends_run: int | None = None
    ranges: tuple[Range, ...] = ()

    @property
    def rest(self) -> int:
        """Samples that the step is shown between segments of a drive."""
        if not judges_samples(self.carry):
            return 1
        if self.ends_run is None:
            raise ValueError("a step that judges samples must state how many end a run: ends_run")
        return self.ends_run

    def begin(self, x: Array) -> "Setup":
        """Return the setup whose observers begin at a measurement.
        x : [v_y, r] of the first sample (2,) [m/s, rad/s].
        """
        if self.observe is None:
            return self
        return self._replace(carry={**self.carry, **self.observe(x)})

    def run(
        self,
        recording: Recording,
        parts: Iterable[slice] | None = None,
        carry: Mapping[str, Array] | None = None,
        *,
        ports: Collection[str] | None = None,
    ) -> Iterator["Block"]:
        """Yield what the compiled step records over a recording, block by block.

        Values are carried from block to block: the bits are those of one piece.
        recording : its signals are the input; its forces are not looked at.
        parts : of the recording, one after the other; None takes all of it in `blocks`.
        carry : values that are carried into the first part; None begins with the recording.
        ports : carried ones and outputs that are recorded; None records all.
        """
        following = self.begun(recording) if carry is None else dict(carry)
        for part in blocks(len(recording)) if parts is None else parts:
            sampled = self.sampled(recording, part)
            values = {**following, **sampled.signals, **self.constants}
            record = self.scan(sampled.samples, values, ports=ports)
            following = {port: record[f"{port}_final"] for port in self.scan.carry}
            yield Block(
                part=part,
                state={
                    port: sampled.of_recording(record[f"{port}_all"])
                    for port in self.scan.carry
                    if port in record
                },
                outputs={
                    port: sampled.of_recording(record[port])
                    for port in self.scan.outputs
                    if port in record
                },
                after=following,
            )

    def output(self, recording: Recording, port: str) -> Array:
        """Return an output that is a column, over a recording, (n, size).
        recording : its signals are the input; its forces are not looked at.
        """
        given = large((len(recording), self.scan.step.numel_out(port)))
        for block in self.run(recording, ports=(port,)):
            given[block.part] = block.outputs[port]
        return given

    def last(self, recording: Recording, n: int) -> dict[str, Array]:
        """Return the values that are carried after the first n samples, by port; nothing else.
        n : samples that are taken.
        """
        following = self.begun(recording)
        for block in self.run(recording, blocks(n), ports=()):
            following = dict(block.after)
        return following

    def begun(self, recording: Recording) -> dict[str, Array]:
        """Return what is carried into the first sample of a recording, by port."""
        v_y = math.nan if recording.v_y is None else recording.v_y[0]
        return dict(self.begin(np.array([v_y, recording.r[0]])).carry)

    def sampled(self, recording: Recording, part: slice = ALL) -> "_Sampled":
        """Return a recording as the step is shown it: before each segment but the first it rests.

        A rest is a sample that no gate believes, or one at standstill for a step without a gate, so
        that no difference over the gap is ever taken for one over a sampling interval.
        part : samples that are shown; a segment that begins with the first of them has its rest.
        """
        first, last, _ = part.indices(len(recording))
        v_x, n = recording.v_x[part], last - first
        v_y, a_y = (
            np.full(n, np.nan) if signal is None else signal[part]
            for signal in (recording.v_y, recording.a_y)
        )
        signals = {
            "x": np.column_stack([v_y, recording.r[part]]),
            "u": np.column_stack([recording.delta_f[part], recording.delta_r[part]]),
            "v_x": v_x,
            "a_y": a_y,
        }
        breaks = [k - first for k in recording.breaks if first <= k < last]
        if not breaks:
            return _Sampled({port: signals[port] for port in self.scan.over}, n, None)
        rows, resting, at = with_rests(n, breaks, self.rest)
        padded = {port: np.array(signal[rows]) for port, signal in signals.items()}
        padded["v_x"][resting] = NOWHERE if judges_samples(self.carry) else 0.0
        padded["a_y"][resting] = np.nan
        return _Sampled({port: padded[port] for port in self.scan.over}, rows.size, at)


class Block(NamedTuple):
    """What a step records over a part of a recording, k samples.

    part : the samples.   state : by port, the carried values in effect at each sample and after the
    last (k + 1, ...).   outputs : by port, the other outputs at each sample (k, ...).   after : by
    port, all values that are carried on.
    """

    part: slice
    state: Mapping[str, Array]
    outputs: Mapping[str, Array]
    after: Mapping[str, Array]

    @property
    def before(self) -> Mapping[str, Array]:
        """Carried values in effect at each sample, by port, (k, ...)."""
        return OnDemand(self.state, lambda port: self.state[port][:-1])


class OnDemand(Mapping[str, Array]):
    """Values by port, each computed when it is asked for."""

    def __init__(self, ports: Iterable[str], compute: Callable[[str], Array]) -> None:
        self._ports, self._compute = tuple(ports), compute

    def __getitem__(self, port: str) -> Array:
        if port not in self._ports:
            raise KeyError(port)
        return self._compute(port)

    def __iter__(self) -> Iterator[str]:
        return iter(self._ports)

    def __len__(self) -> int:
        """Return how many ports there are."""
        return len(self._ports)

    def __contains__(self, port: object) -> bool:
        """Return whether there is such a port, without computing it."""
        return port in self._ports


class _Sampled(NamedTuple):
    """What a step is shown of a part of a recording: samples, and rests between its segments.
    signals : by port of `over`, (N, ...).   samples : N, rests included.
    at : which of these each sample of the part is (n,); None where there is no rest.
    """

    signals: dict[str, Array]
    samples: int
    at: NDArray[np.intp] | None

    def of_recording(self, values: Array) -> Array:
        """Return what was recorded at the samples of the part, without rests.
        values : of all that was shown, (N, ...) or (N + 1, ...) with that after the last.
        """
        if self.at is None:
            return values
        after = len(values) == self.samples + 1
        return values[np.append(self.at, self.samples) if after else self.at]
