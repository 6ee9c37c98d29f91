"""A method over a recording, with all outputs and states, and beside a car that drives."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from codegen import Stepper
from codegen.arrays import Array, blocks, large
from codegen.errors import TireidError
from identifier.method import Method, Track
from identifier.refused import NOWHERE, STALE_TIME, SampleLimits, judges_samples, stale_samples
from identifier.rerun import Recalled, Rerun, holds
from identifier.setup import Block, Setup
from identifier.tire_model import TireModel
from models.recordings import Recording, RecordingError
from models.vehicle import Vehicle

_IMPOSSIBLE_FORCE = 100.0  # times the car's weight: no tire reaches it, so the method has diverged


class DivergedError(TireidError, ArithmeticError):
    """The method diverged before the instant that was asked for."""


def state_index(recording: Recording, t: float) -> int:
    """Return which carried values are in effect at a time: those before that sample; n at the end.
    t : time in the recording's own clock [s].
    """
    if not isinstance(t, Real):
        raise TypeError(f"a time to freeze at is a number of seconds, not {t!r}")
    times, tolerance = recording.t, 1e-6 * recording.dt
    if not t >= times[0]:
        raise ValueError(f"cannot freeze at {t:g} s, the recording begins at {times[0]:g} s")
    if t > times[-1] - tolerance:
        return int(times.size)
    return int(np.searchsorted(times, t + tolerance, side="right")) - 1


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class History:
    """An online run over n samples.
    recording : what it ran over, with the v_y that the method estimated where there was none.
    axle_force : forces that were identified online (n, 2) [N].
    state : by port, the carried values in effect at each sample and after the last (n + 1, ...).
    outputs : by port, the other outputs of the step at each sample (n, ...).
        `identify` computes both again where they are asked for, port by port; of a long recording
        `blocks` and `state_at` do so without having all of its samples at once.
    start : the stored model that the run began with; None where it began afresh.
    """

    vehicle: Vehicle
    method: Method
    recording: Recording
    axle_force: Array
    state: Mapping[str, Array]
    outputs: Mapping[str, Array]
    start: TireModel | None = None
    models: dict[int, TireModel] = field(default_factory=dict)
    """Of a method that learns from whole logs: the model by number of samples that taught it."""

    @property
    def online(self) -> bool:
        """Whether forces were identified sample by sample, not from the whole recording at once."""
        return not self.method.whole

    @property
    def diverged_at(self) -> float | None:
        """Time [s] from which a force is not finite or a hundred times the weight, or None."""
        for part in blocks(len(self.recording)):
            plausible = np.abs(self.axle_force[part]) < _IMPOSSIBLE_FORCE * self.vehicle.weight
            sane = plausible.all(axis=1)
            if not sane.all():
                return float(self.recording.t[part][np.argmin(sane)])
        return None

    def tracks_over(self, block: Block) -> tuple[Track, ...]:
        """Return what the method says it had learnt of the axles over a block of the run."""
        return self.method.tracks(self.vehicle, block.before)

    def blocks(self, samples: NDArray[np.intp] | None = None) -> Iterator[Block]:
        """Yield the run block by block: state and outputs over parts of the recording.
        samples : rising indices; blocks without one are left out. None yields all.
        """
        if isinstance(self.state, Recalled):
            yield from self.state.run.blocks(samples)
            return
        for part in blocks(len(self.recording)):
            if not holds(part, samples):
                continue
            around = slice(part.start, part.stop + 1)
            yield Block(
                part=part,
                state={name: values[around] for name, values in self.state.items()},
                outputs={name: values[part] for name, values in self.outputs.items()},
                after={name: values[part.stop] for name, values in self.state.items()},
            )

    def state_at(self, t: float) -> dict[str, Array]:
        """Return the carried values in effect at a time; from the end on, those after the last.
        t : time in the recording's own clock [s].
        """
        index = state_index(self.recording, t)
        if isinstance(self.state, Recalled):
            return self.state.run.state_at(index)
        return {name: values[index] for name, values in self.state.items()}

    def freeze(self, t: float | None = None) -> TireModel:
        """Return the model with the weights in effect at a time.
        t : time in the recording's own clock [s]; None is the end.
        """
        t = float(self.recording.t[-1]) if t is None else t
        if (whole := self.method.whole) is not None:
            n = max(state_index(self.recording, t), 1)
            if n not in self.models:
                driven = self.recording.taken(slice(0, n))
                self.models[n] = whole.fitted(driven, self.vehicle, self.start, None)
            return self.models[n]
        state = self.state_at(t)
        diverged_at = self.diverged_at
        if diverged_at is not None and diverged_at <= t:
            raise DivergedError(f"the method diverged at {diverged_at:g} s, before {t:g} s")
        return self.method.frozen(self.vehicle, state)

    def evaluated(self, recording: Recording, t: float | None = None) -> "History":
        """Return what the model frozen at a time says of another recording, which teaches nothing.
        t : time of the freeze in this recording's own clock [s]; None is the end.
        """
        if (whole := self.method.whole) is None:
            raise ValueError(
                "a run that learns sample by sample cannot be asked about another drive: "
                "freeze it and predict"
            )
        model = self.freeze(t)
        known = whole.reads(recording.as_logged(), self.vehicle)
        recording, outputs = _with_v_y(known, model)
        force = model.predict(recording)
        return replace(
            self,
            recording=recording,
            axle_force=force,
            outputs=outputs,
            models={len(recording): model},
        )

    def parts(self, recordings: Sequence[Recording]) -> "list[History]":
        """Return the run over each of the recordings that the drive was joined of."""
        found, first = [], 0
        for one in recordings:
            end = first + len(one)
            whole = self.recording
            if one.v_y is None or (self.method.whole and not whole.estimated):
                v_y = whole.needed("v_y")[first:end]
                one = replace(one, v_y=v_y, estimated=whole.estimated)
            state, outputs = self.state, self.outputs
            if isinstance(state, Recalled) and isinstance(outputs, Recalled):
                state, outputs = state.of(first, end), outputs.of(first, end)
            else:
                state = {name: values[first : end + 1] for name, values in state.items()}
                outputs = {name: values[first:end] for name, values in outputs.items()}
            force = self.axle_force[first:end]
            found.append(
                replace(
                    self, recording=one, axle_force=force, state=state, outputs=outputs, models={}
                )
            )
            first = end
        return found

    def __repr__(self) -> str:
        diverged = "" if self.diverged_at is None else f", diverged at {self.diverged_at:g} s"
        return f"<{type(self.method).__name__} over {self.recording!r}{diverged}>"


# Running a method over a recording, in compiled code.


def check_recording(recording: Recording, method: Method) -> None:
    """Refuse a recording that a method cannot run over."""
    if abs(recording.dt - method.dt) > 1e-6 * method.dt:
        raise ValueError(
            f"{recording.name} is sampled at {recording.dt:g} s, the method at {method.dt:g} s"
        )
    for name in method.needs if method.whole is None else ():
        if getattr(recording, name) is None:
            raise RecordingError(
                f"{recording.name}: there is no {name.replace('_', '')}, from which "
                f"{type(method).__name__} learns"
            )


def identify(
    recording: Recording,
    vehicle: Vehicle,
    method: Method,
    start: TireModel | None = None,
    *,
    progress: Callable[[float], None] | None = None,
) -> History:
    """Run a method over a recording, sample by sample.
    recording : signals, sampled at the method's interval; its forces are not looked at.
    method : a `PaperIdentifier` of the paper's identifier, or any other.
    start : stored weights to begin with; None begins afresh.
    progress : called now and then with the share that is done, 0 to 1.
    """
    recording, whole = _read(recording, vehicle, method), method.whole
    if whole is not None:
        model = whole.fitted(recording, vehicle, start, progress)
        recording, outputs = _with_v_y(recording, model)
        return History(
            vehicle=vehicle,
            method=method,
            recording=recording,
            axle_force=model.predict(recording),
            state={},
            outputs=outputs,
            start=start,
            models={len(recording): model},
        )
    setup = method.setup(vehicle, start)
    v_y = None if recording.v_y is not None else large((len(recording),))
    force, begins = large((len(recording), 2)), []
    following: Mapping[str, Array] = setup.begun(recording)
    ports = ("axle_force",) if v_y is None else ("axle_force", "v_y")
    parts = tuple(blocks(len(recording)))
    for block in setup.run(recording, parts, ports=ports):
        force[block.part] = block.outputs["axle_force"]
        if v_y is not None:
            v_y[block.part] = block.outputs["v_y"].ravel()
        begins.append(following)
        following = block.after
        if progress is not None:
            progress(block.part.stop / len(recording))
    run = Rerun(
        setup=setup,
        recording=recording,
        parts=parts,
        begins=tuple(begins),
        last=following,
        first=0,
        end=len(recording),
    )
    if v_y is not None and np.isfinite(v_y).all():
        v_y.setflags(write=False)
        recording = replace(recording, v_y=v_y, estimated=("v_y",))
    return History(
        vehicle=vehicle,
        method=method,
        recording=recording,
        axle_force=force,
        state=Recalled(run, "state"),
        outputs=Recalled(run, "outputs"),
        start=start,
    )


def _read(recording: Recording, vehicle: Vehicle, method: Method) -> Recording:
    """Return a log as a method reads it; refuse one that it cannot run over."""
    recording = recording.as_logged()
    if method.whole is not None:
        recording = method.whole.reads(recording, vehicle)
    check_recording(recording, method)
    return recording


def _with_v_y(recording: Recording, model: TireModel) -> tuple[Recording, Mapping[str, Array]]:
    """Return a recording with the v_y that a model tells where there is none, and how well."""
    found = model.estimated_v_y(recording) if recording.v_y is None else None
    if found is None:
        return recording, {}
    names = ("v_y", "v_y_sd", "side_slip_observable")
    outputs = {
        name: np.asarray(values, dtype=np.float64)[:, None]
        for name, values in zip(names, found[:3], strict=True)
    }
    return replace(recording, v_y=found.v_y, estimated=("v_y",)), outputs


def learn(
    recording: Recording,
    vehicle: Vehicle,
    method: Method,
    start: TireModel | None = None,
    t: float | None = None,
) -> TireModel:
    """Return what a method has learnt, without a record of the way there: `identify` and freeze.
    t : time of the freeze in the recording's own clock [s]; None is the end.
    """
    recording = _read(recording, vehicle, method)
    n = len(recording) if t is None else state_index(recording, t)
    if method.whole is not None:
        return method.whole.fitted(recording.taken(slice(0, max(n, 1))), vehicle, start, None)
    state = method.setup(vehicle, start).last(recording, n)
    if not all(np.isfinite(value).all() for value in state.values()):
        raise DivergedError(f"the method diverged within {n} samples")
    return method.frozen(vehicle, state)


# A method beside a car that drives: sample in, axle forces out, and the model learnt so far.
#
# The compiled step is that of `identify`, so that a drive and its recording teach the same bits.
# What becomes of samples that are refused is in `identifier.refused`.


@dataclass(slots=True)
class Counts:
    """What became of the samples.
    refused : that held a number which is not finite or beyond what any car reaches.
    """

    samples: int = 0
    refused: int = 0
    refused_in_row: int = 0


class OnlineIdentifier:
    """A method that takes sample by sample; attributes vehicle, method, counts, limits.
    dt : interval at which `update` is called [s].
    start : stored weights to begin with; None begins afresh.
    stale_time : time of refused samples after which forces read zero [s].
    """

    def __init__(
        self,
        method: Method,
        vehicle: Vehicle,
        dt: float,
        start: TireModel | None = None,
        *,
        stale_time: float = STALE_TIME,
    ) -> None:
        if not abs(dt - method.dt) <= 1e-6 * method.dt:
            raise ValueError(f"samples come every {dt:g} s, the method wants {method.dt:g} s")
        if not 0.0 < stale_time < math.inf:
            raise ValueError(f"stale_time must be positive and finite, it is {stale_time}")
        self.vehicle, self.method, self.counts = vehicle, method, Counts()
        self.limits = SampleLimits.of(vehicle)
        self.stale_time = stale_time
        self._most_refused = stale_samples(stale_time, method.dt)
        self._start = start
        self._force = np.zeros(2)
        self._stepper: Stepper | None = None
        self._judges = False
        self._diverged = False

    def update(self, x: Array, u: Array, v_x: float, a_y: float | None = None) -> Array:
        """Take a sample; return the axle forces (2,) [N], with the weights before it.

        Where the sample is refused, those of the last one it took, and zero once it is `stale`.
        x : [v_y, r] (2,) [m/s, rad/s]; v_y NaN where there is none, if the method tells it itself.
        u : [δ_f, δ_r] (2,), angles of the road wheels [rad].   v_x : longitudinal speed [m/s].
        a_y : of an accelerometer at the center of gravity, positive to the left [m/s²]; None, or a
            number that is not finite, where there is none. No sample is refused for it.
        """
        (v_y, r), (delta_f, delta_r) = x, u
        felt = math.nan if a_y is None else float(a_y)
        needs_v_y = "v_y" in self.method.needs
        if not self.limits.accept(v_x, v_y, r, delta_f, delta_r, needs_v_y=needs_v_y):
            return self._refused()
        v_y = self.limits.plausible(v_y)
        if self._stepper is None:
            self._begun(np.array([v_y, r]))
        elif self.counts.refused_in_row and not self._judges:
            self._take((v_y, r), (delta_f, delta_r), 0.0)  # a rest, so that the step begins anew
        self._take((v_y, r), (delta_f, delta_r), v_x, felt)
        self.counts.samples += 1
        self.counts.refused_in_row = 0
        return self._force.copy()

    def _take(
        self, x: tuple[float, float], u: tuple[float, float], v_x: float, a_y: float = math.nan
    ) -> None:
        stepper = self._stepper
        assert stepper is not None
        values = {"x": x, "u": u, "v_x": (v_x,), "a_y": (a_y,)}
        for port, array in stepper.inputs.items():
            array[:] = values[port]
        stepper.advance()
        self._force = stepper.outputs["axle_force"].copy()
        if not np.abs(self._force).max() < _IMPOSSIBLE_FORCE * self.vehicle.weight:
            self._diverged = True

    def _refused(self) -> Array:
        """Let time go on without a sample; return the forces."""
        self.counts.refused += 1
        self.counts.refused_in_row += 1
        if self._stepper is not None and self._judges:
            v_y = 0.0 if "v_y" in self.method.needs else math.nan
            self._take((v_y, 0.0), (0.0, 0.0), NOWHERE)
        if self.stale:
            self._force = np.zeros(2)
        return self._force.copy()

    @property
    def stale(self) -> bool:
        """Whether samples have been refused for so long that forces read zero."""
        return self.counts.refused_in_row >= self._most_refused

    def _begun(self, x: Array) -> None:
        """Set the step up where `identify` would: at the first sample."""
        setup = self._setup().begin(x)
        self._stepper = Stepper(setup.scan, {**setup.carry, **setup.constants})
        self._judges = judges_samples(setup.carry)

    def _setup(self) -> Setup:
        return self.method.setup(self.vehicle, self._start)

    def prepare(self) -> None:
        """Compile the step before the first sample comes, where that takes a while."""
        if self._stepper is None:
            self._begun(np.zeros(2))
            self._stepper = None

    @property
    def start(self) -> TireModel | None:
        """Stored weights that the run began with, None where it began afresh."""
        return self._start

    def restart(self, start: TireModel | None) -> None:
        """Begin again at the next sample; the counts go on.
        start : stored weights to begin with; None begins afresh.
        """
        self._start, self._stepper, self._diverged = start, None, False

    @property
    def diverged(self) -> bool:
        """Whether a force was not finite or a hundred times the weight."""
        return self._diverged

    @property
    def outputs(self) -> dict[str, Array]:
        """Outputs of the step at the last sample, by port, matrices by columns; copies.

        Zero while it is `stale`.
        """
        if self._stepper is None:
            return {}
        found = {name: array.copy() for name, array in self._stepper.outputs.items()}
        return (
            {name: np.zeros_like(array) for name, array in found.items()} if self.stale else found
        )

    def state(self) -> dict[str, Array]:
        """Return the values that the next sample will meet, by port; copies.

        Before the first sample those of a car that rolls straight ahead.
        """
        if self._stepper is None:
            carry = self._setup().carry
            return {name: np.array(value) for name, value in carry.items()}
        return self._stepper.state()

    def model(self) -> TireModel:
        if self._diverged:
            raise DivergedError(f"the method diverged within {self.counts.samples} samples")
        if self._stepper is None and self._start is not None:
            return self._start
        return self.method.frozen(self.vehicle, self.state())
