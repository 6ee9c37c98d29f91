"""Axles as ladders of tanh, lagged or not: frozen models, and any curve fitted by one.

F = λ Σ_j w_j tanh(α'/α_j) cos δ per axle; lag σ = max(s λ Σ_j w_j/α_j (1 - tanh²) + σ_0, σ_least).
λ = 1 + κ v_x² is the load of the axle over the static one, 1 where the car has no downforce.
"""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from identifier.axle.dynamics import series_compliance
from identifier.axle.model import AxleModel
from identifier.axle.slip import SHORTEST
from models.plant import tire_of
from models.plant.dynamics import wheel_loads
from models.tires import MagicFormula, Tire
from models.vehicle import Vehicle, load_ratio
from mpc.tires.chosen import CHOSEN
from mpc.tires.tire import Pair, Point, PredictionTire, TireStructure


class Axle(NamedTuple):
    """Weights of an axle: compliance s [m/N], least lag [m], w_j [N] (n,)."""

    compliance: Any
    least: Any
    W: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class LadderAxles(TireStructure):
    """Weights: [δ_0, b, σ_0], 1/α_j (n,), `Axle` in front and at the rear; where pressed, κ (2,);
    where mounted, [β, g].

    δ_0 [rad]: zero of the steering. b [m/s]: bias of v_y. β [rad]: mounting angle of its sensor.
    g: relative error of the steering. They were learnt as errors of sensors, and the tracker reads
    the same sensors.
    lagged : whether the slip lags; else the lag's weights are there and do nothing.
    """

    saturates = True

    units: int
    lagged: bool = True
    pressed: bool = False
    mounted: bool = False

    @property
    def n_weights(self) -> int:
        """3 + n + 2 (2 + n), 2 more where pressed, and 2 where mounted."""
        return self._static + 2 * self.pressed + 2 * self.mounted

    @property
    def _static(self) -> int:
        return CHOSEN.n_common + self.units + 2 * (CHOSEN.n_axle + self.units)

    def slip(self, at: Point) -> Pair:
        """Return the slip angles, errors of the sensors taken off [rad]."""
        v_y, delta = at.v_y - at.w[1], at.delta
        if self.mounted:
            angle, gain = at.w[self.n_weights - 2], at.w[self.n_weights - 1]
            v_y, delta = v_y - angle * at.v_x, (1 + gain) * delta
        front, rear = TireStructure.slip(self, at._replace(v_y=v_y, delta=delta))
        return front + at.w[0], rear

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        per_scale, axles = self._weights(at.w)
        front, rear = (
            load * ca.dot(axle.W, ca.tanh(per_scale * x))
            for axle, x, load in zip(axles, slip, self._loads(at), strict=True)
        )
        delta = (1 + at.w[self.n_weights - 1]) * at.delta if self.mounted else at.delta
        cos_delta = 1 - delta**2 / 2 + delta**4 / 24  # as the frozen axle model has it
        return front * cos_delta, rear

    def lag_length(self, slip: Pair, at: Point) -> Pair:
        """Return the relaxation lengths [m], which shorten with the slope of the curve."""
        per_scale, axles = self._weights(at.w)
        lengths = []
        for axle, x, load in zip(axles, slip, self._loads(at), strict=True):
            T = ca.tanh(per_scale * x)
            slope = load * ca.dot(axle.W * per_scale, 1 - T * T)
            lengths.append(ca.fmax(axle.compliance * slope + at.w[2], axle.least))
        return lengths[0], lengths[1]

    def at_friction(self, weights: Array, ratio: float) -> Array:
        """Return `weights` (n_weights,) of another friction: 1/α_j over it, W times it."""
        w, n = weights.copy(), self.units
        w[CHOSEN.n_common : CHOSEN.n_common + n] /= ratio  # 1/α_j
        axles = w[CHOSEN.n_common + n : self._static].reshape(2, -1)  # a view
        axles[:, CHOSEN.n_axle :] *= ratio
        return w

    def similar(self, at: Point, ratio: Any) -> Point:
        """Return `at`: nothing but slip makes the force."""
        del ratio
        return at

    def _loads(self, at: Point) -> Pair:
        """Return λ of the axles [-]; CasADi makes nothing of a factor of 1."""
        if not self.pressed:
            return 1, 1
        front, rear = (load_ratio(at.w[self._static + i], at.v_x) for i in range(2))
        return front, rear

    def _weights(self, w: Any) -> tuple[Any, tuple[Axle, Axle]]:
        n, size = self.units, CHOSEN.n_axle + self.units
        start = CHOSEN.n_common + n
        front, rear = (w[start + i * size : start + (i + 1) * size] for i in (0, 1))
        return w[CHOSEN.n_common : start], (
            Axle(front[0], front[1], front[2:]),
            Axle(rear[0], rear[1], rear[2:]),
        )


def ladder_weights(
    ladder: Array,
    W: Array,
    *,
    compliance: Array,
    least: Array,
    shortest: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0),
    downforce: tuple[float, ...] = (),
) -> Array:
    """Return w of `LadderAxles`.
    ladder : α_j [rad], (n,).   W : w_j [N], front and rear (2, n).   compliance : s [m/N], (2,).
    least : least lag [m], (2,).   shortest : σ_0 [m].   offset : δ_0 [rad] and b [m/s].
    downforce : κ of front and rear [s²/m²] where pressed, else nothing.
    """
    axles = np.column_stack([compliance, least, W])
    scales = 1.0 / np.asarray(ladder)
    return np.concatenate([offset, [shortest], scales, axles.ravel(), downforce])


def axle_tire(model: AxleModel) -> PredictionTire:
    """Return the prediction tire of a frozen axle model.

    The sway of its body takes k ρ'/(ω² v_x) off the slip, ρ in steady cornering the force of the
    axle over its load times g: the body gives way in series with the carcass, and k g/ω² adds to
    the compliance. That is without the inertia of the roll: ω is above what steering asks for.
    """
    load, ladder = np.array(model.vehicle.axle_loads), np.array(model.ladder)
    W, shortest = model.W * load[:, None], SHORTEST * model.vehicle.wheelbase
    gives = series_compliance(model.compliance, model.sway_share, model.sway.frequency)
    compliance = gives / load
    slope = np.maximum((model.W / ladder).sum(axis=1), 0.1) * load
    weights = ladder_weights(
        ladder,
        W,
        compliance=compliance,
        least=compliance * 0.02 * slope + shortest,  # the slope is held up as when it was learnt
        shortest=shortest,
        offset=(model.offset[0], model.offset[1]),
        downforce=_downforce(model.vehicle),
    )
    mounted = any((model.sensors.v_y_angle, model.sensors.steering_gain))
    if mounted:
        weights = np.append(weights, [model.sensors.v_y_angle, model.sensors.steering_gain])
    doubt = model.band.half(CHOSEN.doubt_step * np.arange(CHOSEN.n_doubts, dtype=np.float64)).T
    pressed = model.vehicle.has_downforce
    structure = LadderAxles(units=ladder.size, pressed=pressed, mounted=mounted)
    return PredictionTire(structure, weights, model.vehicle, doubt)


def _downforce(vehicle: Vehicle) -> tuple[float, ...]:
    return vehicle.downforce if vehicle.has_downforce else ()


class CurveFitError(TireidError, ValueError):
    """A force curve is not one that a ladder of tanh can follow."""


def slip_grid(largest: float) -> Array:
    """Return slips from near 0 to the largest [rad], dense where the curve bends, (k,).
    largest : end of the grid [rad].
    """
    grid: Array = largest * (np.arange(1, CHOSEN.samples + 1) / CHOSEN.samples) ** 2
    return grid


def fitted_ladder(alpha: Array, force: Array) -> tuple[Array, Array]:
    """Return slip scales α_j (n,) for curves of both axles, and w_j [N] (2, n).
    alpha : slips [rad], positive and rising, (k,).
    force : of the axles at these slips [N], (2, k).
    """
    first = min(int(np.searchsorted(alpha, CHOSEN.small)), alpha.size - 1)
    peak = np.abs(force).max(axis=1)
    while True:
        stiffness = force[:, first] / alpha[first]
        if not (stiffness > 0.0).all():
            raise CurveFitError(
                f"force must rise with slip at zero, its slope is {stiffness} N/rad"
            )
        bends = peak / stiffness
        if first == 0 or alpha[first] <= CHOSEN.straight * bends.min():
            break
        first //= 2
    narrowest = CHOSEN.narrowest * float(bends.min())
    units = CHOSEN.units + int(np.log2(bends.max() / bends.min()))  # both axles share the scales
    ladder = np.array([narrowest * 2.0**j for j in range(units)])
    T = np.tanh(alpha[:, None] / ladder)
    W = np.empty((2, units))
    for i, name in enumerate(("front", "rear")):
        W[i] = np.linalg.lstsq(T, force[i], rcond=None)[0]
        error = np.abs(T @ W[i] - force[i]).max() / peak[i]
        if not error <= CHOSEN.worst:
            raise CurveFitError(
                f"the {name} force curve is fitted to {100 * error:.2g} % of its peak only"
            )
    return ladder, W


# The true tire of a car as axle curves: what an MPC would use that knows what nobody can measure.
#
# Steady cornering: the side force of an axle and, through the yaw balance, the lateral acceleration
# a_y = F/(share of the mass) go together; a_y rolls the body and shifts load to the outer wheels,
# where tires make less of it. So F_i(α) is the solution of F = Σ tires(α; loads and camber at F).

SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")


def oracle_tire(vehicle: Vehicle, tire: Tire | None = None, mu: float = 1.0) -> PredictionTire:
    """Return the axle curves of a car on its true tires, lagged by their relaxation lengths.

    Load transfer and camber are quasi-steady; drive forces are left out. With downforce curves are
    those of the static load, and forces in proportion with load. The sedan's Magic
    Formula is fitted to 0.2 % of its peak, a tire with a kink, as Dugoff's, to 1.2 %.
    tire : of all four wheels; None reads the file that the chassis names.
    mu : friction of the road over that of the measurement [-]: scales the peak and its slip.
    """
    chassis = vehicle.require_chassis()
    tire = tire_of(vehicle) if tire is None else tire
    alpha = slip_grid(CHOSEN.largest_slip * min(mu, 1.0))
    grid = np.concatenate([[0.0], alpha])
    force = np.stack([cornering_force(vehicle, tire, axle, grid, mu) for axle in (0, 1)])
    force = force[:, 1:] - force[:, :1]  # wheels that are not mirrored push at zero slip, too
    lengths = np.array([chassis.relaxation_length_front, chassis.relaxation_length_rear])
    return _fitted_tire(vehicle, alpha, force, lengths)


def mounted_tire(vehicle: Vehicle, tire: Tire, rear: Tire | None = None) -> PredictionTire:
    """Return two tires an axle at its static load, without lag.
    vehicle : the car; it needs no chassis.   rear : tire of the rear axle; None takes the same.
    """
    alpha = slip_grid(CHOSEN.largest_slip)
    x = ca.SX.sym("alpha")
    force = []
    for one, load in zip((tire, tire if rear is None else rear), vehicle.axle_loads, strict=True):
        axle = ca.Function("axle", [x], [_both_sides(one, x, 0.0, (0.5 * load, 0.5 * load), 1.0)])
        force.append(np.array(axle(alpha[None])).ravel())
    return _fitted_tire(vehicle, alpha, np.stack(force), None)


def cornering_force(vehicle: Vehicle, tire: Tire, axle: int, alpha: Array, mu: float) -> Array:
    """Return the side force of an axle in steady cornering [N], (k,).
    axle : 0 in front, 1 at the rear.   alpha : slip angles [rad], not negative, (k,).
    mu : friction of the road over that of the measurement [-].
    """
    c, h = vehicle.require_chassis(), vehicle.roll_arm
    x, F = ca.SX.sym("alpha"), ca.SX.sym("F")
    lateral = F * vehicle.weight / vehicle.axle_loads[axle]  # m a_y
    roll = lateral * h / (c.roll_stiffness - vehicle.weight * h)
    forces = [lateral * load / vehicle.weight for load in vehicle.axle_loads]
    loads = wheel_loads(vehicle, roll, 0.0, ca.vertcat(*forces), 0.0)[2 * axle : 2 * axle + 2]
    camber = (c.roll_camber_front, c.roll_camber_rear)[axle] * roll
    made = ca.Function("axle", [x, F], [_both_sides(tire, x, camber, ca.vertsplit(loads), mu)])
    low, high = np.zeros_like(alpha), np.full_like(alpha, 3.0 * max(mu, 1.0) * vehicle.weight)
    # More side force shifts more load, and less is made: one solution.
    for _ in range(CHOSEN.halvings):
        middle = 0.5 * (low + high)
        more = np.array(made(alpha[None], middle[None])).ravel() > middle
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    solution: Array = 0.5 * (low + high)
    return solution


def _both_sides(tire: Tire, alpha: Any, camber: Any, loads: Any, mu: float) -> Any:
    on = [tire.mounted(side) if isinstance(tire, MagicFormula) else tire for side in SIDES]
    pairs = zip(on, loads, strict=True)
    return sum(one.forces(alpha, 0.0, camber, load, mu).F_y for one, load in pairs)


def _fitted_tire(
    vehicle: Vehicle, alpha: Array, force: Array, lengths: Array | None
) -> PredictionTire:
    ladder, W = fitted_ladder(alpha, force)
    least = np.zeros(2) if lengths is None else lengths
    given, pressed = _downforce(vehicle), vehicle.has_downforce
    weights = ladder_weights(ladder, W, compliance=np.zeros(2), least=least, downforce=given)
    structure = LadderAxles(units=ladder.size, lagged=lengths is not None, pressed=pressed)
    return PredictionTire(structure, weights, vehicle)
