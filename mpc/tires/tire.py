"""What a tire is to the prediction: a structure of formulas, and numbers that fill it at run time.

v_y [m/s], r [rad/s] and δ of the front wheel [rad] make slip angles α = δ - (v_y ± l r)/v_x in the
paper's sign, the negative of ISO 8855, and slip makes lateral axle forces F = +C α [N] in the frame
of the body. Only the structure is compiled; the car and the weights are read while driving.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from codegen.arrays import Array
from models.vehicle import Vehicle

N_DOUBTS = 26  # slips at which the uncertainty of the forces is given
DOUBT_STEP = 0.02  # rad, between these slips
_RELATIVE = 0.066  # of the force: half a band of 90 % of what a learnt tire misses at best
_FLOOR = 0.016  # of a static axle load, likewise
_FLAT = 0.05  # of the slope at zero: the peak is reached within a per cent or two of its force
LEAST_RISE = 0.04  # of the slope at zero; a little less than where slip ends to be of use
_SPEED = 15.0  # m/s; curves of slip do not depend on it, but where the car has downforce

Pair: TypeAlias = tuple[Any, Any]  # front, rear: SX expressions or numbers


class Car(NamedTuple):
    """What the equations of motion read: m [kg], I_z [kg m²], l_f and l_r [m]."""

    m: Any
    I_z: Any
    l_f: Any
    l_r: Any


class Point(NamedTuple):
    """Where a tire is asked: v_y [m/s], r [rad/s], δ in front [rad], v_x > 0 [m/s], car, w."""

    v_y: Any
    r: Any
    delta: Any
    v_x: Any
    car: Car
    w: Any


class TireStructure:
    """Formulas of the axle forces, hashable and equal where they compile to the same code.

    Written with `ca.tanh`, `ca.atan` and the like: the stage replaces them by our own, after it has
    taken the derivatives. Force follows the slip of the wheels at once, on one friction, where a
    structure does not say otherwise.
    """

    __slots__ = ()
    angle: Callable[[Any], Any] = staticmethod(ca.atan)  # of travel [rad], by its tangent
    lagged: bool = False  # whether force follows a lagged slip, two more states [rad]
    saturates = False  # whether it is judged at any slip, not only as far as the car slipped

    @property
    def n_weights(self) -> int:
        raise NotImplementedError

    def slip(self, at: Point) -> Pair:
        """Return the kinematic slip angles α = δ - atan((v_y ± l r)/v_x) [rad], paper's sign."""
        v_y, r, delta, v_x, car, _ = at
        per_speed = 1 / v_x
        front = delta - self.angle((v_y + car.l_f * r) * per_speed)
        return front, -self.angle((v_y - car.l_r * r) * per_speed)

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body.
        slip : what makes the force [rad]: lagged slip where `lagged`, else the kinematic one.
        """
        raise NotImplementedError

    def lag_length(self, slip: Pair, at: Point) -> Pair:
        """Return the relaxation lengths [m] at a lagged slip [rad]; asked only where `lagged`."""
        del slip, at
        return 0.0, 0.0

    def at_friction(self, weights: Array, ratio: float) -> Array | None:
        """Return the weights where friction is another; None where that is not offered.

        Similarity: φ(α) = μ φ₀(α/μ): the stiffness stays, force and slip of the peak shrink.
        weights : (n_weights,).   ratio : friction over the one that the weights have [-].
        """
        del weights, ratio
        return None

    def similar(self, at: Point, ratio: Any) -> Point | None:
        """Return where the force is read of which `ratio` times is that of another friction.

        The slip is over `ratio` there, and so is what else the force follows as it follows slip.
        None where `at_friction` is not offered.
        """
        del at, ratio
        return None


class SmallSlip(TireStructure):
    """A structure whose slip is that of the paper's (3), α = δ - (v_y ± l r)/v_x [rad]."""

    __slots__ = ()

    angle = staticmethod(lambda tangent: tangent)


class PredictionTire(NamedTuple):
    """A structure with its weights (n_weights,), and the car that they are of.
    doubt : half the band of 90 % of the axle forces at slips 0, 0.02, … 0.5 rad [N], (2, 26); None
        where none is given.
    """

    structure: TireStructure
    weights: Array
    vehicle: Vehicle
    doubt: Array | None = None

    @property
    def car(self) -> Array:
        """The numbers of `Car`, (4,)."""
        return np.array(self.vehicle.bicycle[:4])

    def doubt_or_declared(self) -> Array:
        """Return the doubt (2, 26) [N]; where none is given, that of a tire learnt well."""
        if self.doubt is not None:
            return self.doubt
        slip = DOUBT_STEP * np.arange(N_DOUBTS, dtype=np.float64)
        floor = _FLOOR * np.array(self.vehicle.axle_loads)[:, None]
        return np.hypot(_RELATIVE * curves_at(self, slip), floor)


# How far slip is of use, and what the tracker believes beyond: a curve that goes on rising.
#
# Beyond the peak of its curve an axle gives less, and more slip is the wrong way out. A tracker
# that linearizes there and wants less force steers on, farther from where it has to go, and stays
# there. So it believes F(x) + rise (α - x) beyond the slip x that is of use: more slip never gives
# less.

SLIPS = np.linspace(0.0, 0.5, 251)  # rad


class ValidSlip(NamedTuple):
    """Slip up to which curves are believed [rad], their slope beyond [N/rad]; (2,) each.
    grip : friction over the one that the curves have, by which all of that scales [-].
    """

    slip: Array
    rise: Array
    grip: float = 1.0


ALL = ValidSlip(np.full(2, np.inf), np.zeros(2))  # the curves as they are


def valid_slip(tire: PredictionTire, most: tuple[float, float]) -> ValidSlip:
    """Return how far the curves of a tire are believed, and how they go on.

    They go on straight, but never with less than 4 % of their slope at zero.
    most : slip beyond which no curve is believed [rad], front and rear.
    """
    slopes = curve_slopes(tire)
    flat = slopes < _FLAT * slopes[:, :1]
    ends = np.where(flat.any(axis=1), SLIPS[flat.argmax(axis=1)], np.inf)
    slip = np.minimum(most, np.where(slopes[:, 0] > 0.0, ends, np.inf))
    there = [np.interp(x, SLIPS, axle) for x, axle in zip(slip, slopes, strict=True)]
    return ValidSlip(slip, np.maximum(np.maximum(there, LEAST_RISE * slopes[:, 0]), 0.0))


def curves_at(tire: PredictionTire, slip: Array, v_x: float = _SPEED) -> Array:
    """Return the axle forces at slips, of a car that slides sideways without yawing, (2, k) [N].
    slip : of both axles [rad], (k,).   v_x : speed [m/s].
    """
    return np.array(_curves(tire.structure)(slip[None], v_x, tire.car, tire.weights))


@cache
def _curves(structure: TireStructure) -> ca.Function:
    """Return the axle forces (2, k) [N] of slips (1, k), sliding sideways without yawing."""
    x, v_x, numbers = ca.SX.sym("slip"), ca.SX.sym("v_x"), ca.SX.sym("car", 4)
    w = ca.SX.sym("w", structure.n_weights)
    at = Point(-v_x * ca.tan(x), 0.0, 0.0, v_x, Car(*ca.vertsplit(numbers)), w)
    force = ca.densify(ca.vertcat(*structure.force((x, x), at)))
    return ca.Function("curves", [x, v_x, numbers, w], [force])


def curve_slopes(tire: PredictionTire) -> Array:
    """Return dF/dα of the axles at `SLIPS` (2, k) [N/rad], straight ahead."""
    return np.array(_slopes(tire.structure)(SLIPS[None], tire.car, tire.weights))


def believed(
    structure: TireStructure, slip: Pair, at: Point, max_slip: Any, rise: Any, grip: Any
) -> tuple[Any, Pair]:
    """Return the axle forces [N], (2,), and relaxation lengths [m] that the tracker believes.

    Beyond the slip that is of use the lag stays that of its edge.
    slip : what makes the force [rad].
    max_slip : slip up to which its curves are believed [rad], (2,).
    rise : slope beyond [N/rad], (2,).
    grip : friction over the one that the weights have [-]; not looked at where the structure offers
        no other.
    """
    there = structure.similar(at, grip)
    if there is None:
        there, grip = at, 1
    x, alpha = ca.SX.sym("x", 2), ca.vertcat(*slip) * (1 / grip)
    curves = ca.vertcat(*structure.force((x[0], x[1]), there))
    lengths = ca.SX(ca.vertcat(*structure.lag_length((x[0], x[1]), there)))
    if ca.is_linear(curves, x):  # goes on as it is
        inside = alpha
    else:
        inside = ca.fmin(ca.fmax(alpha, -max_slip), max_slip)
        curves += rise * (alpha - inside)
    force, lengths = ca.substitute([curves, lengths], [x], [inside])
    return grip * force, (lengths[0], lengths[1])


@cache
def _slopes(structure: TireStructure) -> ca.Function:
    """Return dF/dα (2, k) of slips (1, k), straight ahead."""
    slip, w, numbers = ca.SX.sym("slip"), ca.SX.sym("w", structure.n_weights), ca.SX.sym("car", 4)
    at = Point(0.0, 0.0, 0.0, _SPEED, Car(*ca.vertsplit(numbers)), w)
    force = ca.vertcat(*structure.force((slip, slip), at))
    slope = ca.Function("slope", [slip, numbers, w], [ca.densify(ca.jacobian(force, slip))])
    return slope.map(SLIPS.size, [False, True, True], [False])
