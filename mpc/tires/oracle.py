"""The true tire of a car as axle curves: what an MPC would use that knows what nobody can measure.

Steady cornering: the side force of an axle and, through the yaw balance, the lateral acceleration
a_y = F/(share of the mass) go together; a_y rolls the body and shifts load to the outer wheels,
where tires make less of it. So F_i(α) is the solution of F = Σ tires(α; loads and camber at F).
"""

from typing import Any, Literal

import casadi as ca
import numpy as np

from models.plant.loads import wheel_loads
from models.tires import MagicFormula, Tire
from models.vehicle import Vehicle, VehicleError
from mpc.tires.ladder import LadderAxles, ladder_weights
from mpc.tires.ladder_fit import fitted_ladder, slip_grid
from mpc.tires.structure import Array, TireModel

SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")
LARGEST_SLIP = 0.5  # rad, where the table ends; less where friction is low
HALVINGS = 50


def oracle_tire(vehicle: Vehicle, tire: Tire | None = None, mu: float = 1.0) -> TireModel:
    """Return the axle curves of a car on its true tires, lagged by their relaxation lengths.

    Load transfer and camber are quasi-steady; drive forces are left out. The sedan's Magic
    Formula is fitted to 0.2 % of its peak, a tire with a kink, as Dugoff's, to 1.2 %.

    Parameters
    ----------
    vehicle : the car, with chassis.
    tire : of all four wheels; None reads the file that the chassis names.
    mu : friction of the road over that of the measurement [-]: scales the peak and its slip.

    Raises
    ------
    VehicleError
        Where the vehicle has no chassis, or names no tire and none is given.
    CurveFitError
        Where a curve is not fitted to 2 %.
    """
    chassis = vehicle.require_chassis()
    if tire is None and chassis.tire is None:
        raise VehicleError(f"vehicle '{vehicle.name}' names no tire file and none was given")
    tire = MagicFormula.from_tir(chassis.tire or "") if tire is None else tire
    alpha = slip_grid(LARGEST_SLIP * min(mu, 1.0))
    grid = np.concatenate([[0.0], alpha])
    force = np.stack([cornering_force(vehicle, tire, axle, grid, mu) for axle in (0, 1)])
    force = force[:, 1:] - force[:, :1]  # wheels that are not mirrored push at zero slip, too
    lengths = np.array([chassis.relaxation_length_front, chassis.relaxation_length_rear])
    return _fitted_tire(vehicle, alpha, force, lengths)


def mounted_tire(vehicle: Vehicle, tire: Tire) -> TireModel:
    """Return two tires an axle at its static load, without lag.

    Parameters
    ----------
    vehicle : the car; it needs no chassis.
    tire : of all four wheels.

    Raises
    ------
    CurveFitError
        Where a curve is not fitted to 2 %.
    """
    alpha = slip_grid(LARGEST_SLIP)
    x = ca.SX.sym("alpha")
    force = []
    for load in vehicle.axle_loads:
        axle = ca.Function("axle", [x], [_both_sides(tire, x, 0.0, (0.5 * load, 0.5 * load), 1.0)])
        force.append(np.array(axle(alpha[None])).ravel())
    return _fitted_tire(vehicle, alpha, np.stack(force), None)


def cornering_force(vehicle: Vehicle, tire: Tire, axle: int, alpha: Array, mu: float) -> Array:
    """Return the side force of an axle in steady cornering [N], (k,).

    Parameters
    ----------
    vehicle : the car, with chassis.
    tire : of both wheels.
    axle : 0 in front, 1 at the rear.
    alpha : slip angles [rad], not negative, (k,).
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
    for _ in range(HALVINGS):  # more side force shifts more load, and less is made: one solution
        middle = 0.5 * (low + high)
        more = np.array(made(alpha[None], middle[None])).ravel() > middle
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    solution: Array = 0.5 * (low + high)
    return solution


def _both_sides(tire: Tire, alpha: Any, camber: Any, loads: Any, mu: float) -> Any:
    on = [tire.mounted(side) if isinstance(tire, MagicFormula) else tire for side in SIDES]
    pairs = zip(on, loads, strict=True)
    return sum(one.forces(alpha, 0.0, camber, load, mu).F_y for one, load in pairs)


def _fitted_tire(vehicle: Vehicle, alpha: Array, force: Array, lengths: Array | None) -> TireModel:
    ladder, W = fitted_ladder(alpha, force)
    least = np.zeros(2) if lengths is None else lengths
    weights = ladder_weights(ladder, W, compliance=np.zeros(2), least=least)
    structure = LadderAxles(units=ladder.size, lagged=lengths is not None)
    return TireModel(structure, weights, vehicle)
