"""Any curve of an axle as a ladder of tanh, and the true tire of a car, fitted by one."""

from typing import Any, Literal

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.plant import tire_of
from models.plant.dynamics import own_lengths, relaxation_lengths, wheel_loads
from models.tires import MagicFormula, Tire
from models.vehicle import Vehicle
from mpc.tires.axles import LadderAxles, curve_weights
from mpc.tires.tire import PredictionTire

_UNITS = 6  # of the ladder
_NARROWEST = 0.25  # α_1 over the slip F_max/C at which the linear tire would reach the peak force
_WORST = 0.02  # largest error of a fit over the largest force
_SAMPLES = 400  # of a curve that is fitted
_SMALL = 1e-3  # rad; the slope at zero is read here, well above rounding
_STRAIGHT = 0.1  # of that slip F_max/C; a slope that is read beyond it is no longer C
_LARGEST_SLIP = 0.5  # rad, where the table ends; less where friction is low
_HALVINGS = 50  # of an interval: 1e-15 of it is left


class CurveFitError(TireidError, ValueError):
    """A force curve is not one that a ladder of tanh can follow."""


def slip_grid(largest: float) -> Array:
    """Return slips from near 0 to the largest [rad], dense where the curve bends, (k,).
    largest : end of the grid [rad].
    """
    return largest * (np.arange(1, _SAMPLES + 1) / _SAMPLES) ** 2


def fitted_ladder(alpha: Array, force: Array) -> tuple[Array, Array]:
    """Return slip scales α_j (n,) for curves of both axles, and w_j [N] (2, n).
    alpha : slips [rad], positive and rising, (k,).
    force : of the axles at these slips [N], (2, k).
    """
    first = min(int(np.searchsorted(alpha, _SMALL)), alpha.size - 1)
    peak = np.abs(force).max(axis=1)
    while True:
        stiffness = force[:, first] / alpha[first]
        if not (stiffness > 0.0).all():
            raise CurveFitError(
                f"force must rise with slip at zero, its slope is {stiffness} N/rad"
            )
        bends = peak / stiffness
        if first == 0 or alpha[first] <= _STRAIGHT * bends.min():
            break
        first //= 2
    narrowest = _NARROWEST * float(bends.min())
    units = _UNITS + int(np.log2(bends.max() / bends.min()))  # both axles share the scales
    ladder = np.array([narrowest * 2.0**j for j in range(units)])
    T = np.tanh(alpha[:, None] / ladder)
    W = np.empty((2, units))
    for i, name in enumerate(("front", "rear")):
        W[i] = np.linalg.lstsq(T, force[i], rcond=None)[0]
        error = np.abs(T @ W[i] - force[i]).max() / peak[i]
        if not error <= _WORST:
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


def oracle_tire(
    vehicle: Vehicle, tire: Tire | None = None, mu: float = 1.0, *, rear: Tire | None = None
) -> PredictionTire:
    """Return the axle curves of a car on its true tires, lagged by their relaxation lengths.

    Load transfer and camber are quasi-steady; drive forces are left out. With downforce curves are
    those of the static load, and forces in proportion with load. The sedan's Magic
    Formula is fitted to 0.2 % of its peak, a tire with a kink, as Dugoff's, to 1.2 %.
    tire : of all four wheels; None reads the file that the chassis names.
    mu : friction of the road over that of the measurement [-]: scales the peak and its slip.
    rear : of the rear wheels, where they have another.
    """
    tire = tire_of(vehicle) if tire is None else tire
    tires = tire, tire if rear is None else rear
    alpha = slip_grid(_LARGEST_SLIP * min(mu, 1.0))
    grid = np.append(0.0, alpha)
    pairs = enumerate(tires)
    force = np.stack([cornering_force(vehicle, one, axle, grid, mu) for axle, one in pairs])
    force = force[:, 1:] - force[:, :1]  # wheels that are not mirrored push at zero slip, too
    lengths = np.array(relaxation_lengths(vehicle, tires))
    return _fitted_tire(vehicle, alpha, force, lengths)


def mounted_tire(vehicle: Vehicle, tire: Tire, rear: Tire | None = None) -> PredictionTire:
    """Return two tires an axle at its static load, lagged where both files say by how much.
    vehicle : the car; it needs no chassis.   rear : tire of the rear axle; None takes the same.
    """
    alpha = slip_grid(_LARGEST_SLIP)
    x = ca.SX.sym("alpha")
    force, tires = [], (tire, tire if rear is None else rear)
    for one, load in zip(tires, vehicle.axle_loads, strict=True):
        axle = ca.Function("axle", [x], [_both_sides(one, x, 0.0, (0.5 * load, 0.5 * load), 1.0)])
        force.append(np.array(axle(alpha[None])).ravel())
    lengths = own_lengths(vehicle, tires)
    lagged = np.array(lengths) if min(lengths) > 0.0 else None
    return _fitted_tire(vehicle, alpha, np.stack(force), lagged)


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
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        more = np.array(made(alpha[None], middle[None])).ravel() > middle
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    return 0.5 * (low + high)


def _both_sides(tire: Tire, alpha: Any, camber: Any, loads: Any, mu: float) -> Any:
    on = [tire.mounted(side) if isinstance(tire, MagicFormula) else tire for side in SIDES]
    pairs = zip(on, loads, strict=True)
    return sum(one.forces(alpha, 0.0, camber, load, mu).F_y for one, load in pairs)


def _fitted_tire(
    vehicle: Vehicle, alpha: Array, force: Array, lengths: Array | None
) -> PredictionTire:
    ladder, W = fitted_ladder(alpha, force)
    least = np.zeros(2) if lengths is None else lengths
    curves = np.hstack([np.tile(1.0 / ladder, (2, 1)), W])
    weights = curve_weights(curves, downforce=vehicle.downforce, shortest=least)
    structure = LadderAxles(units=ladder.size, lagged=lengths is not None)
    return PredictionTire(structure, weights, vehicle)
