"""The tire that was learnt, asked: its force, how stiff, how sure, as CasADi functions, as a file.

Slip angles α = δ - (v_y ± l r)/v_x have the paper's sign, the negative of ISO 8855, so that
F = +C α. Axle forces are lateral, in the frame of the body, left positive.
"""

import importlib
import json
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self, overload

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from codegen import markup
from codegen.arrays import Array
from codegen.escape import displayed
from identifier.band import AXLES as AXLES
from identifier.band import Axle as Axle
from identifier.band import Band, of_axle
from identifier.frozen import FORMAT, FrozenModelError, require_alive
from identifier.measured import (
    NOT_IDENTIFIABLE,
    as_printed,
    printed_unit,
    stiffness_words,
    with_doubt,
)
from identifier.setup import Setup
from models.files import write_atomically
from models.recordings import Recording
from models.recordings.portion import Portion
from models.schema import Table, read_json
from models.vehicle import AREAS, BICYCLE, DOWNFORCE_SPEED, Vehicle

if TYPE_CHECKING:  # what some models answer with
    from identifier.day import Day
    from identifier.estimate.latent import LateralVelocity

# As summaries and verdicts name what is learnt of an axle.
STIFFNESS, GRIP, RELAXATION = "cornering stiffness", "grip", "relaxation length"
# A chart of the curves: points, and how far beyond the known slip; where that is unknown, to where.
_POINTS, _REACH, _UNKNOWN_REACH = 81, 1.25, 0.15  # [-], [-], rad


class _TireFunctions(NamedTuple):
    """What a tire is to one's own optimal control problem: named CasADi functions, SI.

    x = [v_y, r] [m/s, rad/s] and, where the force follows a lagged slip, [α'_f, α'_r] [rad].
    """

    force_curve: ca.Function
    """(alpha (2,), v_x) -> axle_force (2,) [N]: steady, the wheels straight ahead."""
    dynamics: ca.Function
    """(x, delta, v_x) -> x_dot, axle_force (2,): what a collocation asks for."""
    step: ca.Function
    """(x, delta, v_x, dt) -> x_next: one step of Runge-Kutta with δ and v_x constant."""


class Fact(NamedTuple):
    """A line of a summary: what, its values in front and at the rear (2,), their unit."""

    title: str
    values: Array
    unit: str

    @property
    def words(self) -> list[str]:
        """The values in three digits, 127000 as such and not as 1.27e+05."""
        return [with_doubt(float(value)) for value in self.values]


class Estimate(NamedTuple):
    """A number of one axle that a drive may have decided.
    sd : its standard deviation, None unknown.
    declared : value in the vehicle file or None.   identified : whether the drive decided it.
    """

    title: str
    axle: Axle
    value: float
    sd: float | None
    unit: str
    declared: float | None
    identified: bool

    @property
    def words(self) -> str:
        """Value and standard deviation in three digits, and whether the drive left it open."""
        value = with_doubt(self.value, self.sd)
        return value if self.identified else f"{value} ({NOT_IDENTIFIABLE})"

    def with_model_error(self, share: float) -> "Estimate":
        """Return the number with the share that is missed of a force in its standard deviation.

        The recursion knows of noise only; what its curves cannot say is in what they miss.
        share : of the force of its axle, rms [-].
        """
        if self.sd is None or self.title not in (STIFFNESS, GRIP):
            return self
        return self._replace(sd=math.hypot(self.sd, share * self.value))


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


class Drives(NamedTuple):
    """What the identification drives of a model were, and what they had beside its tires.

    Parameters
    ----------
    speeds : least and largest [m/s], (2,); None where unknown.
    lengthwise : parameters (p,) with load transfer and ellipse, and covariance (p, p); None where
        there are none.
    elsewhere : from and to [s] of what was driven on another road.
    notes : findings, code and one line of each.
    at_bounds : estimates at active bounds.
    """

    speeds: Array | None = None
    lengthwise: tuple[Array, Array] | None = None
    elsewhere: tuple[tuple[float, float], ...] = ()
    notes: tuple[tuple[str, str], ...] = ()
    at_bounds: tuple[Reached, ...] = ()

    def road_differs(self, t: Array) -> NDArray[np.bool_]:
        """Return at which times `t` [s], (n,), the road was another."""
        found = np.zeros(t.shape, dtype=bool)
        for begin, end in self.elsewhere:
            found |= (t >= begin) & (t <= end)
        return found


class TireModel(ABC):
    """Axle forces from weights that no longer change: the front and the rear tires of one car."""

    __slots__ = ()

    kind = ""  # of model, in files and wherever something is to be had for some kinds only

    if TYPE_CHECKING:  # at run time they would be taken for the defaults of a dataclass's fields

        @property
        def vehicle(self) -> Vehicle:
            """The car."""

        @property
        def min_speed(self) -> float:
            """Below this speed [m/s] the forces read zero."""

    @abstractmethod
    def setup(self, dt: float) -> Setup:
        """Return what a replay needs.

        Parameters
        ----------
        dt : sampling interval of what is replayed [s].
        """

    def estimated_v_y(self, recording: Recording) -> "LateralVelocity | None":
        """Return the v_y of a drive whose sensors show none; None of tires that cannot tell it."""
        del recording
        return None

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the model as plain numbers and words, ready for JSON."""

    @classmethod
    def from_dict(cls, data: dict[str, Any], source: str) -> Self:
        """Return the model that `to_dict` describes.

        Parameters
        ----------
        source : what the data are from, for an error.

        Raises
        ------
        FrozenModelError
            Where a key is missing or a value impossible.
        """
        try:
            return cls._read(Table(data, "", FrozenModelError))
        except KeyError as error:
            raise FrozenModelError(f"{source}: key {error} is missing") from error
        except (TypeError, ValueError) as error:
            raise FrozenModelError(f"{source}: {error}") from error

    @classmethod
    @abstractmethod
    def _read(cls, table: Table) -> Self:
        """Return the model that the table of `to_dict` describes."""

    @abstractmethod
    def curve_expression(self, alpha: Any, v_x: Any) -> Any:
        """Return the steady axle forces (2,) [N] as a CasADi expression.

        Parameters
        ----------
        alpha : slip angles (2,) [rad], the wheels straight ahead.
        v_x : longitudinal speed [m/s].
        """

    @abstractmethod
    def force_expression(
        self, slip: Any, x: Any, delta: Any, v_x: Any, least_lag: Any = 0.0
    ) -> tuple[Any, Any]:
        """Return the axle forces (2,) [N] and the rate of lagged slip [rad/s], CasADi expressions.

        Parameters
        ----------
        slip : lagged slip, (2,) where `lagged`, else empty [rad].
        x : [v_y, r] (2,).
        delta : angle of the front wheels [rad].
        v_x : longitudinal speed [m/s], positive.
        least_lag : time under which no lag falls [s].
        """

    @property
    def lagged(self) -> bool:
        """Whether the force follows a lagged slip, two more states."""
        return False

    scales_with_load = False
    """Whether forces are in static axle loads, so that another car's model scales to a car."""

    def on(self, recording: Recording) -> "Day | None":
        """Return the errors of a log's sensors that `predict` takes off; None: it finds none."""
        del recording
        return None

    def days(self, recording: Recording) -> "tuple[tuple[int, Day], ...]":
        """Return the same of each day of a log: its first sample, and the day; mostly one."""
        del recording
        return ()

    def held_on(self, recording: Recording, part: Portion | None = None) -> "TireModel":
        """Return the model as it reads the sensors of a log, to be asked about it many times.

        Parameters
        ----------
        part : of the log, that it will be asked about; None is the whole.
        """
        del recording, part
        return self

    def mounted_on(self, vehicle: Vehicle) -> "TireModel":
        """Return the tires on another car, their forces scaled by its static axle loads.

        Raises
        ------
        ValueError
            Where forces do not scale with load.
        """
        raise ValueError(
            f"forces of a {type(self).__name__} do not scale with load: {vehicle.name}"
        )

    def require_car(
        self,
        driven: Vehicle,
        name: str = "tire",
        remedy: str = "give that car, or tire.mounted_on(car)",
    ) -> None:
        """Refuse another car than the tires were learnt on, whatever either is called."""
        for key in (*BICYCLE, *AREAS):
            mine, theirs = getattr(self.vehicle, key), getattr(driven, key)
            if mine != theirs:
                apart = f"{key} {mine:.6g}, driven {theirs:.6g}"
                raise ValueError(f"{name} is of another car ({apart}): {remedy}")

    def at_friction(self, ratio: float) -> "TireModel":
        """Return the tires on a road of another friction, φ(α) → μ φ(α/μ): the stiffness stays.

        Parameters
        ----------
        ratio : friction over that of the identification drive, positive [-].

        Raises
        ------
        ValueError
            Where the ratio is not positive, or the model cannot be scaled to another friction.
        """
        raise ValueError(f"a {type(self).__name__} cannot be scaled to a friction of {ratio:g}")

    @property
    def _loads(self) -> Array:
        return np.array(self.vehicle.axle_loads)

    @property
    def _curve_speed(self) -> float:
        """Speed [m/s] of curves that are asked for without one; 0 is under static loads."""
        if self.scales_with_load and self.vehicle.has_downforce:
            return 0.0
        return brisk_speed(self.vehicle, self.min_speed)

    def predict(self, recording: Recording) -> Array:
        """Return lateral axle forces over a recording, (n, 2) [N], frame of the body.

        Parameters
        ----------
        recording : its signals are the input; its forces are not looked at.
        """
        return self.setup(recording.dt).output(recording, "axle_force")

    def lagged_slip(self, recording: Recording) -> Array:
        """Return the slip that makes the force, in the paper's sign, (n, 2) [rad]."""
        return recording.alpha(self.vehicle.l_f, self.vehicle.l_r)

    @overload
    def force(self, alpha: float, axle: Axle, *, v_x: float | None = None) -> float: ...
    @overload
    def force(
        self, alpha: ArrayLike, axle: Axle | None = None, *, v_x: float | None = None
    ) -> Array: ...

    def force(
        self, alpha: ArrayLike, axle: Axle | None = None, *, v_x: float | None = None
    ) -> float | Array:
        """Return the steady lateral force at slip angles, the wheels straight ahead [N].

        Both axles slip alike: only a network that reads more than slip sees a difference.

        Parameters
        ----------
        alpha : slip angles in the paper's sign [rad], a number or an array of any shape.
        axle : "front" or "rear", for a result of the shape of `alpha`; None gives both, (..., 2).
        v_x : speed [m/s]; None is brisk driving, 4 sqrt(g L), and where the car has downforce, of a
            curve of slip, static loads. Else a curve of slip does not look at it.
        """
        slip = np.asarray(alpha, dtype=np.float64)
        speed = self._curve_speed if v_x is None else v_x
        both = self._steady(slip.ravel(), speed) if slip.size else np.zeros((0, 2))
        one = of_axle(both.reshape(*slip.shape, 2), axle)
        return float(one) if one.ndim == 0 else one

    def _steady(self, alpha: Array, v_x: float) -> Array:
        """Return the steady axle forces at slip angles (k,) [rad] and a speed, (k, 2) [N]."""
        pairs = np.tile(alpha, (2, 1))
        return np.array(self._force_curve()(pairs, v_x), dtype=np.float64).T

    @property
    def stiffness(self) -> Array:
        """Cornering stiffness: slope of the steady force at zero slip [N/rad], (2,)."""
        alpha = ca.MX.sym("alpha", 2)
        force = self.curve_expression(alpha, self._curve_speed)
        slope = ca.Function("stiffness", [alpha], [ca.jacobian(force, alpha)])
        both = np.array([1.0, 1.0])  # the axles slip alike
        return np.array(slope(np.zeros(2))) @ both

    @property
    def known_slip(self) -> Array | None:
        """Slip [rad] up to which the forces were identified, (2,); None where unknown."""
        return None

    @property
    def drives(self) -> Drives:
        """What the identification drives were, as far as the model knows."""
        return Drives()

    @property
    def model_error(self) -> Array | None:
        """Error of the model over the force in the motion of the identification drive [-], rms,
        white noise subtracted, (2,); None where not computed: `calibrated` does.
        """
        return None

    @property
    def band(self) -> Band | None:
        """How unsure the forces are; None where the model does not know."""
        return None

    def estimates(self) -> tuple[Estimate, ...]:
        """Return what a verdict tells of each axle: stiffness, without a doubt that is known."""
        declared = self.vehicle.bicycle[4:]
        return tuple(
            Estimate(STIFFNESS, axle, float(C), None, "N/rad", before, not np.isclose(C, before))
            for axle, C, before in zip(AXLES, self.stiffness, declared, strict=True)
        )

    def facts(self) -> tuple[Fact, ...]:
        """Return what `summary` says beside the estimates."""
        if self.known_slip is None:
            return ()
        return (Fact("known up to a slip of", np.degrees(self.known_slip), "deg"),)

    def _of_downforce(self) -> list[Fact]:
        if not self.vehicle.has_downforce:
            return []
        more = 100.0 * (self.vehicle.load_ratio(DOWNFORCE_SPEED) - 1.0)
        return [Fact(f"more of all forces at {DOWNFORCE_SPEED:g} m/s", more, "%")]

    def summary(self) -> str:
        """Return the estimates, in a few lines; ± is one standard deviation.

        It begins with the share of the force that the model misses where that is known: of a
        model of `calibrated`, also stored and read again. Without, ± knows of noise only.
        """
        rows = self._rows()
        widths = [max(len(row[k]) for row in rows) for k in range(3)]
        lines = [f"{type(self).__name__} of {self.vehicle.name!r}"]
        for row in rows:
            cells = (f"{cell:{width}}" for cell, width in zip(row, widths, strict=True))
            lines.append("  ".join(cells).rstrip())
        return "\n".join([*lines, *self._remarks()])

    def _rows(self) -> list[list[str]]:
        """Return the estimates as a table; its first row is the header."""
        error = self.model_error
        rows = [["", *AXLES]]
        if error is not None:
            fact = Fact("model error on the identification drive", 100.0 * error, "%")
            rows.append([f"{fact.title} [{fact.unit}]", *fact.words])
        by_title: dict[str, dict[str, str]] = {}
        for one in as_printed(self.estimates()):
            share = 0.0 if error is None else float(error[AXLES.index(one.axle)])
            title = f"{one.title} [{one.unit}]"
            by_title.setdefault(title, {})[one.axle] = one.with_model_error(share).words
        rows += [[title, *(cells.get(axle, "") for axle in AXLES)]
                 for title, cells in by_title.items()]  # fmt: skip
        rows += [[f"{fact.title} [{fact.unit}]", *fact.words] for fact in self.facts()]
        return rows

    def _remarks(self) -> list[str]:
        band = [] if self.band is None else [f"band: {self.band.origin}"]
        notes = [text for _, text in self.drives.notes]
        return [*notes, *band, *filter(None, [self.vehicle.estimates])]

    def drawn_slip(self) -> tuple[Array, NDArray[np.bool_]]:
        """Return slip angles for a drawing [rad] (k,), and whether each axle knows them (k, 2)."""
        known = np.full(2, np.inf) if self.known_slip is None else self.known_slip
        reach = _REACH * float(known.max())
        slip = np.linspace(-1.0, 1.0, _POINTS) * (reach if 0.0 < reach < np.inf else _UNKNOWN_REACH)
        return slip, np.abs(slip)[:, None] <= known

    def _repr_html_(self, looks: Sequence[str] = ("", "")) -> str:
        slip, known = self.drawn_slip()
        force, ends = self.force(slip), () if self.band is None else self.band.at(slip)
        unit, size = printed_unit("N", force)
        curves = [
            markup.Curve(
                axle,
                color,
                force[:, k] / size,
                known[:, k],
                [end[:, k] / size for end in ends],
            )
            for k, (axle, color) in enumerate(zip(AXLES, markup.AXLE_COLORS, strict=True))
        ]
        return markup.card(
            markup.line(f"of {self.vehicle.name}", type(self).__name__),
            markup.table(self._rows(), ("", *looks)),
            markup.chart(np.degrees(slip), curves, "slip angle [deg]", f"lateral force [{unit}]"),
            *map(markup.line, self._remarks()),
        )

    def casadi_function(self) -> _TireFunctions:
        """Return force curve, equations of motion and prediction step, the weights in them.

        Speed must be positive. `dynamics` is stiff: the lag vanishes where a tire slides. Integrate
        it implicitly or by `step`, which holds the lag above dt/2. An explicit Runge-Kutta of
        `dynamics` goes wrong there unless its steps are far shorter than those of `step`.
        """
        x = ca.MX.sym("x", 4 if self.lagged else 2)
        delta, v_x, dt = ca.MX.sym("delta"), ca.MX.sym("v_x"), ca.MX.sym("dt")
        x_dot, force = self._motion(x, delta, v_x, 0.0)
        dynamics = ca.Function(
            "car_dynamics", [x, delta, v_x], [x_dot, force], ["x", "delta", "v_x"],
            ["x_dot", "axle_force"],
        )  # fmt: skip
        rate = ca.Function("rate", [x, delta, v_x, dt], [self._motion(x, delta, v_x, dt / 2)[0]])
        at = (delta, v_x, dt)
        k1 = rate(x, *at)
        k2 = rate(x + dt / 2 * k1, *at)
        k3 = rate(x + dt / 2 * k2, *at)
        k4 = rate(x + dt * k3, *at)
        step = ca.Function(
            "car_step", [x, *at], [x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)],
            ["x", "delta", "v_x", "dt"], ["x_next"],
        )  # fmt: skip
        return _TireFunctions(self._force_curve(), dynamics.expand(), step.expand())

    def _force_curve(self) -> ca.Function:
        alpha, v_x = ca.MX.sym("alpha", 2), ca.MX.sym("v_x")
        force = ca.densify(self.curve_expression(alpha, v_x))
        ports = (["alpha", "v_x"], ["axle_force"])
        return ca.Function("tire_force_curve", [alpha, v_x], [force], *ports).expand()

    def _motion(self, x: Any, delta: Any, v_x: Any, least_lag: Any) -> tuple[Any, Any]:
        """Return ẋ and the axle forces; m (v̇_y + v_x r) = F_f + F_r, I_z ṙ = l_f F_f - l_r F_r."""
        m, I_z, l_f, l_r = self.vehicle.bicycle[:4]
        force, slip_rate = self.force_expression(x[2:], x[:2], delta, v_x, least_lag)
        v_y_dot = (force[0] + force[1]) / m - v_x * x[1]
        r_dot = (l_f * force[0] - l_r * force[1]) / I_z
        return ca.densify(ca.vertcat(v_y_dot, r_dot, slip_rate)), ca.densify(force)

    def save(self, path: str | PathLike[str], *, valid: bool | None = None) -> None:
        """Write the model as JSON.

        Parameters
        ----------
        valid : the verdict on it, stored in the file; None where there is none.
        """
        given = {} if valid is None else {"valid": valid}
        write_atomically(path, json.dumps(self.to_dict() | given, indent=2) + "\n")

    @staticmethod
    def load(path: str | PathLike[str]) -> "TireModel":
        """Read a model of any kind, as `save` wrote it.

        Raises
        ------
        FrozenModelError
            Where the file is not such a model; one line that names it.
        """
        return load_model(path)

    def __repr__(self) -> str:
        known = (
            ""
            if self.known_slip is None
            else ", known to {:.1f} / {:.1f} deg".format(*np.degrees(self.known_slip))
        )
        name = f"{type(self).__name__} of {self.vehicle.name!r}"
        return f"<{name}: stiffness {stiffness_words(self.stiffness)}{known}>"


class StaticModel(TireModel):
    """A model whose forces follow the state at once: nothing lags."""

    __slots__ = ()

    @abstractmethod
    def static_force(self, x: Any, delta: Any, v_x: Any) -> Any:
        """Return the axle forces (2,) [N] as a CasADi expression of x = [v_y, r], δ_f and v_x."""

    def curve_expression(self, alpha: Any, v_x: Any) -> Any:
        return self.static_force(drift(self.vehicle, alpha, v_x), 0.0, v_x)

    def force_expression(
        self, slip: Any, x: Any, delta: Any, v_x: Any, least_lag: Any = 0.0
    ) -> tuple[Any, Any]:
        del slip, least_lag
        return self.static_force(x, delta, v_x), ca.MX(0, 1)


def require_band(model: TireModel) -> Band:
    """Return the band of a model; refuse one that has none."""
    if model.band is None:
        raise ValueError(f"a {type(model).__name__} cannot tell how sure it is: it has no band")
    return model.band


def brisk_speed(vehicle: Vehicle, min_speed: float) -> float:
    """Return 4 sqrt(g L), but no speed at which forces read zero [m/s].
    min_speed : below which they do [m/s].
    """
    return max(4.0 * vehicle.froude_speed, min_speed)


def drift(vehicle: Vehicle, slope: Any, v_x: Any) -> Any:
    """Return x = [v_y, r] at which straight wheels meet the road at some slopes, (2,).
    slope : -(v_y ± l r)/v_x at the axles, (2,): the slip angle where it is small.
    v_x : longitudinal speed [m/s].
    """
    r = v_x * (slope[1] - slope[0]) / vehicle.wheelbase
    return ca.vertcat(-v_x * slope[0] - vehicle.l_f * r, r)


# Frozen models as JSON files: weights.json, whatever kind of model it holds.

MODELS: Mapping[str, tuple[str, str]] = {  # module and class by kind, imported where one is read
    "network": ("identifier.paper.network", "NetworkModel"),
    "axle": ("identifier.axle.model", "AxleModel"),
    "linear": ("identifier.baselines.linear", "LinearModel"),
    "curve": ("identifier.baselines.curves", "CurveModel"),
    "fit": ("identifier.estimate.model", "FittedModel"),
}


def load_model(path: str | PathLike[str]) -> TireModel:
    """Read a frozen model of any kind.   path : a file that the `save` of a frozen model wrote."""
    path = Path(path)
    table = _stored(path)
    _verdict_of(table)
    kind = table.text("kind")
    if kind == "onnx":
        table.refuse("kind", "is an ONNX network: make it a method, as examples/own_network.py")
    if kind not in MODELS:
        table.refuse("kind", f"must be one of {list(MODELS)}, it is {displayed(kind)}")
    module, name = MODELS[kind]
    model: TireModel = getattr(importlib.import_module(module), name).from_dict(
        dict(table.data), str(path)
    )
    try:
        require_alive(FrozenModelError, model.force, model.vehicle)
    except FrozenModelError as error:
        raise FrozenModelError(f"{path}: {error}") from None
    return model


def stored_verdict(path: str | PathLike[str]) -> bool | None:
    """Return whether a stored model was found valid when it was learnt; None where nobody judged.
    path : a file that the `save` of a frozen model wrote.
    """
    return _verdict_of(_stored(Path(path)))


def _stored(path: Path) -> Table:
    """Return the table of a file that says it is a frozen model."""
    table = Table(read_json(path, FrozenModelError), f"{path}: ", FrozenModelError)
    if "format" not in table or table.value("format") != FORMAT:
        raise FrozenModelError(f"{path}: not a frozen model, format must be {FORMAT!r}")
    return table


def _verdict_of(table: Table) -> bool | None:
    valid = table.value("valid") if "valid" in table else None
    if valid is not None and not isinstance(valid, bool):
        table.refuse("valid", f"must be true or false, it is {displayed(valid)}")
    return valid
