"""What every way to identify has in common: a compiled step, where it starts, what it freezes to.

The laws of the paper, the better laws and the baselines run, are recorded, frozen and compared by
the same code; they differ in the `Method` that is handed over.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict, is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from codegen.arrays import Array
from codegen.errors import TireidError
from identifier.certificate import Certificate
from identifier.driving import Driving
from identifier.setup import AXLE_FORCE, HALF_BAND, Port, Setup
from identifier.tire_model import Reached, TireModel
from models.recordings import Recording
from models.vehicle import Vehicle

if TYPE_CHECKING:
    from identifier.inertial.beliefs import Body


class CannotFreezeError(TireidError, ValueError):
    """The method estimates a signal: there is no model of the tire to freeze."""


Model = TypeVar("Model", bound=TireModel)


def resumed(start: TireModel, kind: type[Model], refusal: str, **structure: Any) -> Model:
    """Return a stored model to begin with, of the kind and structure that a method learns.
    structure : what the method and the model must agree on, by attribute of the model.
    """
    if not isinstance(start, kind) or any(
        getattr(start, name) != value for name, value in structure.items()
    ):
        raise ValueError(refusal)
    return start


OTHER_STRUCTURE = "the stored weights are of another structure than the design's"


class Track(NamedTuple):
    """What was learnt of both axles, instant by instant: what, its unit, its values (n, 2)."""

    title: str
    unit: str
    values: Array


class Accelerometer(NamedTuple):
    """What of an accelerometer's a_y a method takes for no force of the tires.

    beside_force : of carried values by port at n + 1 instants of a run: what it found to be none,
    to the left (n,) [car weights]: what a banked road pushes, bias, roll of the body.   body : of a
    car the prior of how its body rolls; None where v_y is not estimated.
    """

    beside_force: Callable[[Mapping[str, Array]], Array]
    body: "Callable[[Vehicle], Body] | None" = None


class Limits(NamedTuple):
    """Where the estimates of a method stay, whatever is measured.

    boxes : least and largest of each number, by name and unit.   active : of carried values the
    estimates at active bounds.
    """

    boxes: Mapping[str, Any]
    active: Callable[[Mapping[str, Array]], tuple[Reached, ...]] = lambda _: ()


class WholeLog(NamedTuple):
    """How a method learns from a whole log.

    reads : of a log and its car the log as the method reads it: a whole one may be read better than
    its samples.   fitted : of that log, its car, what is believed before or None, and None or what
    is called now and then with the share that is done, 0 to 1: the tires.
    """

    reads: Callable[[Recording, Vehicle], Recording]
    fitted: Callable[
        [Recording, Vehicle, TireModel | None, Callable[[float], None] | None], TireModel
    ]


def require_fresh(start: TireModel | None) -> None:
    """Refuse a stored model as the beginning of a run, where no tire is identified."""
    if start is not None:
        raise ValueError("what learns no tire cannot begin with a stored model")


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

    needs: tuple[str, ...] = ("v_y",)
    """Channels that its step needs to learn, beside v_x, r and steering."""

    @property
    def remark(self) -> str:
        """What a table of methods must say of it beside its name; empty: nothing."""
        return ""

    @property
    def whole(self) -> WholeLog | None:
        """How it learns from a whole log at once; None: sample by sample, by its step."""
        return None

    @property
    def accelerometer(self) -> Accelerometer | None:
        """What it explains of an accelerometer's a_y; None where it takes all for a force."""
        return None

    @property
    def limits(self) -> Limits | None:
        """Where its estimates stay; None where they have no bounds."""
        return None

    @property
    def setup_with_band(self) -> Callable[[Vehicle, TireModel | None], Setup] | None:
        """As `setup`, of a step that outputs `half_band` (2,) [N], too; None: it has no band."""
        return None

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return (AXLE_FORCE,)

    def certify(self, vehicle: Vehicle, driving: Driving | None = None) -> Certificate:
        """Return what is proven of it: its limits, where a method does not say more."""
        del vehicle, driving
        return Certificate(limits={} if self.limits is None else self.limits.boxes)

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
        """Return the estimates of the axles over a run, to be drawn over time.

        Parameters
        ----------
        state : carried values by port, at each of n instants (n, ...).
        """
        del vehicle, state
        return ()

    def port(self, name: str) -> Port:
        """Return what stands in an output or a carried value."""
        for port in (*self.ports, HALF_BAND):
            if port.name == name:
                return port
        raise KeyError(f"{type(self).__name__} has no port {name!r}")

    @abstractmethod
    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        start : model whose weights the run begins with; None begins with those of the method.

        Raises
        ------
        ValueError
            Where no run can begin with that model.
        """

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> TireModel:
        """Return the model that carried values make: none, where a method does not say more.

        Raises
        ------
        CannotFreezeError
            For a method that estimates a signal.
        """
        del vehicle, state
        raise CannotFreezeError(f"it estimates {self.estimates}, not a tire")
