"""What every way to identify has in common: a compiled step, where it starts, what it freezes to.

The laws of the paper, the better laws and the baselines run, are recorded, frozen and compared by
the same code; they differ in the `Method` that is handed over.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import asdict, is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self, TypeGuard, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from codegen.arrays import Array, blocks, large
from identifier.certificate import Certificate
from identifier.driving import Driving
from identifier.refused import NOWHERE, judges_samples, with_rests
from identifier.tire_model import Axle, TireModel
from identifier.tuning import Range, with_numbers
from models.recordings import Recording
from models.recordings.record import ALL
from models.rules import LARGEST_FORCE
from models.schema import Table
from models.vehicle import BICYCLE, Vehicle

if TYPE_CHECKING:
    from identifier.axle.guarantee import HalfSpaces
    from identifier.inertial.beliefs import Body
    from identifier.run import History  # which runs methods


class CannotFreezeError(ValueError):
    """The method estimates a signal: there is no model of the tire to freeze."""


Model = TypeVar("Model", bound=TireModel)


def resumed(start: TireModel, kind: type[Model], refusal: str, **structure: Any) -> Model:
    """Return a stored model to begin with, of the kind and structure that a method learns.

    Parameters
    ----------
    start : the stored model.
    kind : of model that the method learns.
    refusal : what to say of another.
    structure : what the method and the model must agree on, by attribute of the model.

    Raises
    ------
    ValueError
        Where the model is of another kind or structure.
    """
    if not fits(start, kind, **structure):
        raise ValueError(refusal)
    return start


def fits(start: TireModel, kind: type[Model], **structure: Any) -> TypeGuard[Model]:
    """Return whether a stored model is of the kind and structure that a method learns.

    Parameters
    ----------
    start, kind, structure : as of `resumed`.
    """
    return isinstance(start, kind) and all(
        getattr(start, name) == value for name, value in structure.items()
    )


OTHER_STRUCTURE = "the stored weights are of another structure than the design's"


class Setup(NamedTuple):
    """A run, ready to go: the compiled step, the values it carries at the start, its constants.

    The step reads x = [v_y, r] (2,), u = [δ_f, δ_r] (2,), v_x and, where it can use it, a_y (NaN
    where there is none) sample by sample, SI: `shown`. It has an output axle_force (2,) [N].
    An observer that starts at the first measurement carries zero until that is known: `observe`
    takes its x and returns the carried values that begin with it, by port.
    Carried ports of `only_with_a_y` change no other one, and no output, where a_y is never there.
    Between stretches of a drive the step is shown `rest` samples, after which it begins anew with
    what it has learnt (`identifier.refused`): a step that judges samples itself as many as end a
    run of it, `ends_run`, every other one.
    """

    scan: Scan
    carry: Mapping[str, Array]
    constants: Mapping[str, Array]
    observe: Callable[[Array], Mapping[str, Array]] | None = None
    only_with_a_y: tuple[str, ...] = ()
    ends_run: int | None = None

    @property
    def rest(self) -> int:
        """Samples that the step is shown between stretches of a drive.

        Raises
        ------
        ValueError
            Where the step judges samples and `ends_run` is not told.
        """
        if not judges_samples(self.carry):
            return 1
        if self.ends_run is None:
            raise ValueError("a step that judges samples must tell how many end a run: ends_run")
        return self.ends_run

    def begin(self, x: Array) -> "Setup":
        """Return the setup whose observers begin at a measurement.

        Parameters
        ----------
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

        Parameters
        ----------
        recording : its signals are the input; its forces are not looked at.
        parts : of the recording, one after the other; None takes all of it in `blocks`.
        carry : values that are carried into the first part; None begins with the recording.
        ports : carried ones and outputs that are recorded; None records all.
        """
        following = self.begun(recording) if carry is None else dict(carry)
        for part in blocks(len(recording)) if parts is None else parts:
            shown = self.shown(recording, part)
            values = {**following, **shown.signals, **self.constants}
            record = self.scan(shown.samples, values, ports=ports)
            following = {port: record[f"{port}_final"] for port in self.scan.carry}
            yield Block(
                part=part,
                state={
                    port: shown.of_recording(record[f"{port}_all"])
                    for port in self.scan.carry
                    if port in record
                },
                outputs={
                    port: shown.of_recording(record[port])
                    for port in self.scan.outputs
                    if port in record
                },
                after=following,
            )

    def output(self, recording: Recording, port: str) -> Array:
        """Return an output that is a column, over a recording, (n, size).

        Parameters
        ----------
        recording : its signals are the input; its forces are not looked at.
        port : of the output.
        """
        told = large((len(recording), self.scan.step.numel_out(port)))
        for block in self.run(recording, ports=(port,)):
            told[block.part] = block.outputs[port]
        return told

    def last(self, recording: Recording, n: int) -> dict[str, Array]:
        """Return the values that are carried after the first n samples, by port; nothing else.

        Parameters
        ----------
        recording : its signals are the input.
        n : samples that are taken.
        """
        following = self.begun(recording)
        for block in self.run(recording, blocks(n), ports=()):
            following = dict(block.after)
        return following

    def begun(self, recording: Recording) -> dict[str, Array]:
        """Return what is carried into the first sample of a recording, by port.

        Parameters
        ----------
        recording : its first sample is looked at.
        """
        v_y = math.nan if recording.v_y is None else recording.v_y[0]
        return dict(self.begin(np.array([v_y, recording.r[0]])).carry)

    def shown(self, recording: Recording, part: slice = ALL) -> "Shown":
        """Return what the step is shown of a recording.

        Parameters
        ----------
        recording : its signals are the input.
        part : samples that are shown.
        """
        judges = judges_samples(self.carry)
        return shown(recording, self.scan.over, rest=self.rest, judges=judges, part=part)


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
        return Before(self.state)


class Before(Mapping[str, Array]):
    """Carried values in effect at each sample, of those that have a row after the last.

    Parameters
    ----------
    state : by port (k + 1, ...).
    """

    def __init__(self, state: Mapping[str, Array]) -> None:
        self._state = state

    def __getitem__(self, port: str) -> Array:
        return self._state[port][:-1]

    def __iter__(self) -> Iterator[str]:
        return iter(self._state)

    def __len__(self) -> int:
        """Return how many ports there are."""
        return len(self._state)


class Shown(NamedTuple):
    """What a step is shown of a part of a recording: samples, and rests between its stretches.

    signals : by port of `over`, (N, ...).   samples : N, rests included.
    at : which of these each sample of the part is (n,); None where there is no rest.
    """

    signals: dict[str, Array]
    samples: int
    at: NDArray[np.intp] | None

    def place(self, k: int) -> int:
        """Return which of what is shown a sample of the part is.

        Parameters
        ----------
        k : from 0 to n, that after the last.
        """
        if self.at is None:
            return k
        return int(self.at[k]) if k < self.at.size else self.samples

    def of_recording(self, values: Array) -> Array:
        """Return what was recorded at the samples of the part, without rests.

        Parameters
        ----------
        values : of all that was shown, (N, ...) or (N + 1, ...) with that after the last.
        """
        if self.at is None:
            return values
        after = len(values) == self.samples + 1
        return values[np.append(self.at, self.samples) if after else self.at]

    def with_rests(self, values: Array) -> Array:
        """Return values of the part's samples with zeros at rests, (N, ...).

        Parameters
        ----------
        values : (n, ...).
        """
        if self.at is None:
            return values
        padded = np.zeros((self.samples, *values.shape[1:]))
        padded[self.at] = values
        return padded


def shown(
    recording: Recording, over: Iterable[str], *, rest: int, judges: bool, part: slice = ALL
) -> Shown:
    """Return a recording as a step is shown it: before each stretch but the first it rests.

    A rest is a sample that no gate believes, or one at standstill for a step without a gate, so
    that no difference over the gap is ever taken for one over a sampling interval.

    Parameters
    ----------
    recording : its samples.
    over : ports that are read: x (N, 2), u (N, 2), v_x (N,), a_y (N,); v_y and a_y are NaN where
        there is none.
    rest : samples of a rest.
    judges : whether the step judges samples itself.
    part : samples that are shown; a stretch that begins with the first of them has its rest.
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
        return Shown({port: signals[port] for port in over}, n, None)
    rows, resting, at = with_rests(n, breaks, rest)
    padded = {port: np.array(signal[rows]) for port, signal in signals.items()}
    padded["v_x"][resting] = NOWHERE if judges else 0.0
    padded["a_y"][resting] = np.nan
    return Shown({port: padded[port] for port in over}, rows.size, at)


# Rules of numbers that are taken over from elsewhere: a file, another controller.
COVARIANCE, FACTORS, NOT_NEGATIVE = "covariance", "factors of a covariance", "not negative"


class Port(NamedTuple):
    """An output or a carried value of a step: what stands in it.

    name : of the port, in C, FMU and JSON.   unit : of its numbers, "U" the force unit.
    words : what it is.   learnt : whether it holds its value while adaptation is off.
    rule : what its numbers must be to be taken over; empty: finite.
    """

    name: str
    unit: str
    words: str
    learnt: bool = False
    rule: str = ""


AXLE_FORCE = Port(
    "axle_force", "N", "lateral axle forces, front and rear, left positive, frame of the body"
)
HALF_BAND = Port(
    "half_band",
    "N",
    "half the width of the 90 % band around axle_force, front and rear; 0 where forces read zero",
)


def force_unit_name(force_unit: float) -> str:
    """Return the name of a unit of force.

    Parameters
    ----------
    force_unit : U [N].
    """
    return {1.0: "N", 1000.0: "kN"}.get(force_unit, f"{force_unit:g} N")


def in_force_unit(ports: Iterable[Port], force_unit: float) -> tuple[Port, ...]:
    """Return ports with the name of the force unit in place of U.

    Parameters
    ----------
    ports : with units in which U stands for it.
    force_unit : U [N].
    """
    name = force_unit_name(force_unit)
    return tuple(port._replace(unit=port.unit.replace("U", name)) for port in ports)


class Track(NamedTuple):
    """What was learnt of both axles, instant by instant: what, its unit, its values (n, 2)."""

    title: str
    unit: str
    values: Array


class Reached(NamedTuple):
    """A learnt number at its bound: of which axle (None: the car), what, how much, what that means.

    refuses : whether an answer that rests on it is not valid.
    """

    axle: Axle | None
    title: str
    value: float
    unit: str
    meaning: str
    refuses: bool


class Method(ABC):
    """A way to identify axle forces: everything that is chosen before the car drives."""

    __slots__ = ()

    if TYPE_CHECKING:  # at run time they would be taken for the defaults of a dataclass's fields

        @property
        def dt(self) -> float:
            """Sampling interval [s]."""

        @property
        def min_speed(self) -> float:
            """Below this speed [m/s] learning rests and forces read zero."""

    judged_by = ""  # what gives the certificate, where a package cannot hold it
    estimates = ""  # what a method tells that learns no tire

    @property
    def needs_v_y(self) -> bool:
        """Whether it learns nothing from a recording without a lateral velocity; else tells it."""
        return True

    @property
    def needs_a_y(self) -> bool:
        """Whether it learns nothing from a recording without an accelerometer."""
        return False

    @property
    def remark(self) -> str:
        """What a table of methods must say of it beside its name; empty: nothing."""
        return ""

    def setup_with_band(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs whose step tells `half_band` (2,) [N] beside its force.

        Parameters
        ----------
        vehicle : the car, as far as the identifier knows it.
        start : as of `setup`; its calibration is that of the band.

        Raises
        ------
        ValueError
            Where the method cannot tell how sure it is, or stored weights are those of another
            structure.
        """
        del vehicle, start
        raise ValueError(f"{type(self).__name__} cannot tell how sure it is: it has no band")

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return (AXLE_FORCE,)

    def certify(self, vehicle: Vehicle, driving: Driving | None = None) -> Certificate:
        """Return what is proven of it: nothing, where a method does not say more.

        Parameters
        ----------
        driving : how hard it is driven; None takes what the method was designed for.
        """
        del vehicle, driving
        return Certificate()

    def certify_along(self, history: "History") -> Certificate:
        """Return what is proven of what a run of it taught: nothing, where it does not say more.

        Parameters
        ----------
        history : of this method.
        """
        del history
        return Certificate()

    @property
    def tunables(self) -> Mapping[str, Range]:
        """What a search may vary, around the numbers that it has; empty: nothing."""
        return {}

    def tuned(self, values: Mapping[str, float]) -> Self:
        """Return the method with other numbers.

        Parameters
        ----------
        values : by name of its `tunables`; empty leaves it as it is.
        """
        return with_numbers(self, values)

    def numbers(self) -> dict[str, Any]:
        """Return all that was chosen, as plain data: gains, network, the rest and the seed.

        Without a network and random weights those two are None; numbers that are no parts of a
        design of the paper's stand under gains.
        """
        everything: dict[str, Any] = asdict(cast(Any, self)) if is_dataclass(self) else {}
        return {
            "gains": everything,
            "network": everything.get("network"),
            "design": {"dt_s": self.dt, "min_speed_m_s": self.min_speed},
            "seed": everything.get("seed"),
        }

    def tracks(self, vehicle: Vehicle, state: Mapping[str, Array]) -> tuple[Track, ...]:
        """Return what was learnt of the axles over a run, to be drawn over time.

        Parameters
        ----------
        state : carried values by port, at each of n instants (n, ...).
        """
        del vehicle, state
        return ()

    def reached(self, vehicle: Vehicle, state: Mapping[str, Array]) -> tuple[Reached, ...]:
        """Return the learnt numbers that rest at their bounds: none, where there are no bounds.

        Parameters
        ----------
        state : carried values by port at one instant.
        """
        del vehicle, state
        return ()

    def road_push(self, state: Mapping[str, Array]) -> Array | None:
        """Return what a banked road pushed to the left by the accelerometer, (n,) [weights].

        What learning did not take for a force of the tires; None where a method takes all for one.

        Parameters
        ----------
        state : carried values by port at n + 1 instants, of a run.
        """
        del state
        return None

    def beside_force(self, state: Mapping[str, Array]) -> Array | None:
        """Return what an accelerometer showed beside the forces of the tires, (n,) [weights].

        Bias, and the roll of the body, as far as they were found; None where a method finds none.

        Parameters
        ----------
        state : carried values by port at n + 1 instants, of a run.
        """
        del state
        return None

    learns_kind = ""  # kind of model that it learns, and that a run of it can begin with

    def resumes(self, model: TireModel) -> bool:
        """Return whether a run can begin with a stored model: with none, if it does not say more.

        Parameters
        ----------
        model : its weights.
        """
        del model
        return False

    def possible_tires(self) -> "HalfSpaces | None":
        """Return the weights that the curve of a tire can have; None where it learns no curves."""
        return None

    def believed_body(self, vehicle: Vehicle) -> "Body | None":
        """Return how a car's body is believed to roll; None where no accelerometer tells v_y.

        Parameters
        ----------
        vehicle : the car, as far as the method knows it.
        """
        del vehicle
        return None

    def port(self, name: str) -> Port:
        """Return what stands in an output or a carried value.

        Parameters
        ----------
        name : of the port.

        Raises
        ------
        KeyError
            Where the method does not describe it.
        """
        for port in (*self.ports, HALF_BAND):
            if port.name == name:
                return port
        raise KeyError(f"{type(self).__name__} has no port {name!r}")

    @abstractmethod
    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car, as far as the method knows it.
        start : model whose weights the run begins with; None begins with those of the method.

        Raises
        ------
        ValueError
            Where no run can begin with that model.
        """

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> TireModel:
        """Return the model that carried values make: none, where a method does not say more.

        Parameters
        ----------
        state : values of the carried ports at one instant.

        Raises
        ------
        CannotFreezeError
            For a method that estimates a signal.
        """
        del vehicle, state
        raise CannotFreezeError(f"it estimates {self.estimates}, not a tire")

    def require_fresh(self, start: TireModel | None) -> None:
        """Refuse to begin a run with a stored model, where no tire is learnt.

        Parameters
        ----------
        start : None, or the model.

        Raises
        ------
        ValueError
            Where it is a model.
        """
        if start is not None:
            raise ValueError("what learns no tire cannot begin with a stored model")


# The format of stored frozen models, and the error of a file that does not keep it.

FORMAT = "tireid frozen model 1"


class FrozenModelError(ValueError):
    """A file does not hold a frozen model; the message names the file and what is wrong."""


DEAD = 0.02  # of the stated stiffness, below which an axle does not push
PROBE = 0.02  # rad, a slip at which every tire pushes back
WIDE = 0.3  # rad, beyond the slip of every tire's peak
LARGEST_MIN_SPEED = 50.0  # m/s: above it, a car would have forces on motorways only

VEHICLE_KEYS = ("name", *BICYCLE)


def vehicle_numbers(vehicle: Vehicle) -> dict[str, Any]:
    """Return the name and the six numbers of the bicycle by the words of a vehicle file, SI.

    Where some of them are estimated, `estimated` lists which.
    """
    numbers = {key: getattr(vehicle, key) for key in VEHICLE_KEYS}
    return numbers | ({"estimated": list(vehicle.estimated)} if vehicle.estimated else {})


def vehicle_from(data: Mapping[str, Any]) -> Vehicle:
    """Return the car that `vehicle_numbers` describes.

    Parameters
    ----------
    data : as from `vehicle_numbers`.

    Raises
    ------
    ValueError
        Where a key is missing or unknown, or a value has a wrong type or is impossible.
    """
    table = Table(data, "", FrozenModelError, "vehicle.")
    return Vehicle(**table.record(Vehicle, skip=("chassis",)))


class SteadyTires(Protocol):
    """What has steady axle forces at slip angles, and knows the linear tires of its car."""

    @property
    def vehicle(self) -> Vehicle:
        """The car, with the cornering stiffnesses that are stated of it."""

    def force_at(self, alpha: Array) -> Array:
        """Return the steady axle forces at slip angles, (k, 2) [N].

        Parameters
        ----------
        alpha : slip angles in the paper's sign [rad], (k,).
        """


def require_alive(refusal: type[ValueError], tires: SteadyTires) -> None:
    """Refuse tires that no road has: forces that are not finite or too large, or a dead axle.

    Parameters
    ----------
    refusal : class of the error to raise.
    tires : both axles.

    Raises
    ------
    ValueError
        Of that class, with the forces or the stiffness.
    """
    force = np.asarray(tires.force_at(np.array([-WIDE, -PROBE, PROBE, WIDE])))
    if not (np.abs(force) <= LARGEST_FORCE).all():
        raise refusal(
            f"axle forces must be finite and below {LARGEST_FORCE:g} N, at {WIDE} rad of slip and "
            f"less they reach {np.abs(force).max():g} N"
        )
    if not (force[2] > force[1]).all():
        raise refusal(
            f"axle forces must rise with slip, at {-PROBE} and {PROBE} rad they are "
            f"{force[1].tolist()} and {force[2].tolist()} N: check units, the order of inputs, "
            "and the sign of slip (slip_sign)"
        )
    slope = (force[2] - force[1]) / (2.0 * PROBE)
    for axle, here, said in zip(("front", "rear"), slope, tires.vehicle.bicycle[4:], strict=True):
        if not here >= DEAD * said:
            raise refusal(
                f"the {axle} axle does not push: it has {here:.4g} N/rad, its vehicle {said:.4g}; "
                "check the units of force and slip"
            )


def require_min_speed(speed: float) -> None:
    """Refuse a lowest speed [m/s] that is not positive, or that no car drives at.

    Parameters
    ----------
    speed : below which forces read zero.

    Raises
    ------
    ValueError
        Where it is not above zero, or above `LARGEST_MIN_SPEED`.
    """
    if not 0.0 < speed <= LARGEST_MIN_SPEED:
        raise ValueError(
            f"min_speed must be positive and at most {LARGEST_MIN_SPEED:g} m/s, it is {speed:g}"
        )
