"""Equations of motion of the double-track car as one CasADi function of state and input.

State (18): v_x, v_y [m/s] of the center of gravity, r [rad/s], roll [rad], roll rate [rad/s],
X, Y [m], heading psi [rad], the lagged slip tan(α') of four wheels [-], the actual steering of the
two axles [rad], the lagged side force of the two axles [N] and acceleration a_x [m/s^2] that the
wheel loads follow, and the driver's integral [m].
The wheel loads follow the forces through a lag of 10 ms, the vertical motion of wheel and tire;
it also breaks the algebraic loop between load and force. Downforce adds to them at once.
Assumed away: pitch, steer by the suspension, aligning moments of the tires, spin of the wheels
(longitudinal slip follows from the wanted force at once), rolling and air resistance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from models.friction import MAX_PLACES, place_change
from models.rules import require_not_negative, require_positive
from models.tires import MagicFormula, Tire
from models.vehicle import Vehicle, load_ratio

_LEAST_SPEED = 1.0  # below this wheel speed slip decays as if at it [m/s]
_LEAST_LOAD = 1.0  # a tire is asked at this load or more, and its force scaled down below it [N]
_LARGEST_KAPPA = 0.1  # about where a passenger tire has its largest longitudinal force [-]
N_STATES = 18  # of the car
_LOAD_LAG = 0.01  # unsprung mass on the tire spring, about 15 Hz [s]

# Slip and force of the four wheels in the paper's sign: α = δ - atan2(v_y, v_x), F_y = +C α.
#
# The tires of the two sides mirror each other: what a tire does at zero slip (conicity, ply steer)
# pulls both inwards or both outwards and cancels straight ahead.


class _Wheel(NamedTuple):
    """Position [m] in the body frame, y > 0 left, and the axle it belongs to (0 front, 1 rear)."""

    x: float
    y: float
    axle: int

    def velocity(self, v_x: Any, v_y: Any, r: Any) -> tuple[Any, Any]:
        """Velocity of the wheel center [m/s] in the body frame.
        v_x, v_y : velocity of the center of gravity, body frame [m/s].   r : yaw rate [rad/s].
        """
        return v_x - self.y * r, v_y + self.x * r


def _wheels(vehicle: Vehicle) -> tuple[_Wheel, _Wheel, _Wheel, _Wheel]:
    """Return the wheels: front left, front right, rear left, rear right."""
    c = vehicle.require_chassis()
    front, rear = 0.5 * c.track_front, 0.5 * c.track_rear
    return (
        _Wheel(vehicle.l_f, front, 0),
        _Wheel(vehicle.l_f, -front, 0),
        _Wheel(-vehicle.l_r, rear, 1),
        _Wheel(-vehicle.l_r, -rear, 1),
    )


def own_lengths(vehicle: Vehicle, tires: Sequence[Tire]) -> tuple[float, ...]:
    """Return the relaxation lengths that tires have in their files [m], 0 for none.
    tires : front and rear.
    """
    return tuple(
        float(tire.relaxation_length(0.5 * load)) if isinstance(tire, MagicFormula) else 0.0
        for tire, load in zip(tires, vehicle.axle_loads, strict=True)
    )


def relaxation_lengths(vehicle: Vehicle, tires: Sequence[Tire]) -> tuple[float, ...]:
    """Return the relaxation lengths of both axles [m], of the tires or else of the chassis."""
    c = vehicle.require_chassis()
    declared = c.relaxation_length_front, c.relaxation_length_rear
    own = own_lengths(vehicle, tires)
    return tuple(one if one > 0.0 else other for one, other in zip(own, declared, strict=True))


def _relax(slip: Any, delta: Any, velocity: tuple[Any, Any], length: float) -> Any:
    """Return the derivative [1/s] of the lagged lateral slip tan(α').

    σ d(tan α')/dt + |V_cx| tan α' = -V_cy with the velocity V_c of the contact point in the frame
    of the wheel (Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 7.2; no division by speed,
    so it is well posed down to standstill).
    slip : lagged slip tan(α') [-].   delta : steering angle of the wheel [rad].
    velocity : of the wheel, body frame [m/s].   length : relaxation length σ [m].
    """
    v_x, v_y = velocity
    along = v_x * ca.cos(delta) + v_y * ca.sin(delta)
    aside = v_y * ca.cos(delta) - v_x * ca.sin(delta)
    return (-aside - ca.fmax(ca.fabs(along), _LEAST_SPEED) * slip) / length


def _tire_force(tire: Tire, slip: Any, camber: Any, drive: Any, load: Any, mu: Any) -> Any:
    """Return [F_x, F_y] [N] of one tire in the frame of the wheel.
    slip : lagged slip tan(α') [-].   camber : γ > 0 when the top leans right [rad].
    drive : wanted longitudinal force [N]; the tire gives less at large side slip.
    load : vertical load [N].   mu : friction over the tire's own [-].
    """
    floored = ca.fmax(load, _LEAST_LOAD)
    # A tire may push at zero slip (its shifts); a free wheel then slips to where it does not.
    at_rest = tire.forces(0.0, 0.0, 0.0, floored, mu)[0]
    kappa = (drive - at_rest) / tire.slip_stiffness(floored)
    kappa = ca.fmin(ca.fmax(kappa, -_LARGEST_KAPPA), _LARGEST_KAPPA)
    F_x, F_y = tire.forces(ca.atan(slip), kappa, camber, floored, mu)
    return ca.vertcat(F_x, F_y) * (load / floored)


# Vertical load of each wheel from roll, axle side force and longitudinal acceleration.
#
# Order of wheels everywhere: front left, front right, rear left, rear right.


def _downforce(vehicle: Vehicle, v_x: Any) -> tuple[Any, Any]:
    """Return what the air adds to the loads of front and rear axle [N]; 0 of a car without.
    v_x : longitudinal speed [m/s].
    """
    if not vehicle.has_downforce:
        return 0.0, 0.0
    more = load_ratio(ca.DM(vehicle.downforce), v_x) - 1
    return vehicle.axle_loads[0] * more[0], vehicle.axle_loads[1] * more[1]


def wheel_loads(
    vehicle: Vehicle,
    roll: Any,
    roll_rate: Any,
    axle_force: Any,
    a_x: Any,
    pressed: tuple[Any, Any] = (0.0, 0.0),
) -> Any:
    """Return the four wheel loads [N]; none is negative, their sum is m g and downforce exactly.

    An axle takes its share of the spring and damper moment and, through its roll center, the
    moment of its own side force. A wheel that would pull on the road is lifted: its load is zero
    and the other wheel of the axle carries all; the moment beyond that is lost.
    roll, roll_rate : angle [rad] and rate [rad/s] of the body, positive when the right side dips.
    axle_force : side force of the front and the rear axle, body frame, (2,) [N].
    a_x : longitudinal acceleration [m/s^2].   pressed : downforce of front and rear axle [N].
    """
    c = vehicle.require_chassis()
    total = vehicle.weight + pressed[0] + pressed[1]
    share = c.roll_stiffness_front_share
    body_moment = c.roll_stiffness * roll + c.roll_damping * roll_rate
    to_rear = vehicle.mass * a_x * c.cg_height / vehicle.wheelbase
    front = ca.fmin(ca.fmax(vehicle.axle_loads[0] + pressed[0] - to_rear, 0.0), total)
    rear = total - front
    loads = []
    for axle, part, force, height, track in (
        (front, share, axle_force[0], c.roll_center_height_front, c.track_front),
        (rear, 1.0 - share, axle_force[1], c.roll_center_height_rear, c.track_rear),
    ):
        transfer = (part * body_moment + height * force) / track
        right = ca.fmin(ca.fmax(0.5 * axle + transfer, 0.0), axle)
        loads += [axle - right, right]
    return ca.vertcat(*loads)


# The driver who holds the speed: proportional plus integral, with a limit and no wind-up.


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """Gains of the speed controller; the defaults hold the speed within about 0.1 m/s.
    gain : acceleration per speed error [1/s].
    integral_gain : acceleration per integrated speed error [1/s^2], zero for none.
    acceleration_limit : largest demand, driving and braking [m/s^2].
    """

    gain: float = 2.0
    integral_gain: float = 0.5
    acceleration_limit: float = 3.0

    def __post_init__(self) -> None:
        require_positive(ValueError, gain=self.gain, acceleration_limit=self.acceleration_limit)
        require_not_negative(ValueError, integral_gain=self.integral_gain)

    def demand(self, error: Any, integral: Any) -> tuple[Any, Any]:
        """Return the demanded acceleration [m/s^2] and the derivative of the integral [m/s].
        error : wanted minus actual speed [m/s].   integral : of the error [m].
        """
        unlimited = self.gain * error + self.integral_gain * integral
        limit = self.acceleration_limit
        demand = ca.fmin(ca.fmax(unlimited, -limit), limit)
        return demand, error + (demand - unlimited) / self.gain  # the integral stops at the limit


_OUTPUTS = {"F_x": 4, "F_y": 4, "F_z": 4, "alpha": 4, "axle_force": 2, "acceleration": 2}


def _rotate(x: Any, y: Any, angle: Any) -> tuple[Any, Any]:
    """Return the components of a wheel-frame vector in the body frame.
    angle : steering angle of the wheel [rad].
    """
    c, s = ca.cos(angle), ca.sin(angle)
    return x * c - y * s, x * s + y * c


def dynamics(vehicle: Vehicle, tires: tuple[Tire, Tire], driver: Driver) -> ca.Function:
    """Return f(x, command, v_ref, mu, places, slope) -> (x_dot, *OUTPUTS), an SX function.

    `slope` is what a banked road pulls the body to the left [m/s^2]: no accelerometer feels it.
    """
    m, I_z, l_f, l_r = vehicle.mass, vehicle.yaw_inertia, vehicle.l_f, vehicle.l_r
    c, h = vehicle.require_chassis(), vehicle.roll_arm
    x = ca.SX.sym("x", N_STATES)
    command, v_ref, mu = ca.SX.sym("command", 2), ca.SX.sym("v_ref"), ca.SX.sym("mu")
    places, slope = ca.SX.sym("places", 3, MAX_PLACES), ca.SX.sym("slope")
    v_x, v_y, r, roll, roll_rate, X, _, psi = ca.vertsplit(x[:8])
    slip, delta, F_lagged, a_x_lagged, integral = x[8:12], x[12:14], x[14:16], x[16], x[17]

    demand, integral_dot = driver.demand(v_ref - v_x, integral)
    front = ca.if_else(demand > 0.0, c.drive_front_share, c.brake_front_share)
    drive = [m * demand * share for share in (front, 1.0 - front)]
    pressed = _downforce(vehicle, v_x)
    F_z = wheel_loads(vehicle, roll, roll_rate, F_lagged, a_x_lagged, pressed)

    F_x, F_y, alpha, slip_dot = [], [], [], []
    force, axle_force, moment = 0.0, [0.0, 0.0], 0.0
    sway = v_y + h * roll_rate  # on the roll axis, below the center of gravity
    for k, wheel in enumerate(_wheels(vehicle)):
        angle, axle = delta[wheel.axle], wheel.axle
        velocity = wheel.velocity(v_x, sway, r)
        length = relaxation_lengths(vehicle, tires)[axle]
        slip_dot.append(_relax(slip[k], angle, velocity, length))
        alpha.append(angle - ca.atan2(velocity[1], velocity[0]))
        here = X + wheel.x * ca.cos(psi) - wheel.y * ca.sin(psi)
        grip = mu + place_change(places, here)
        camber = (c.roll_camber_front, c.roll_camber_rear)[axle] * roll
        tire = tires[axle]
        if isinstance(tire, MagicFormula):  # only measured tires have sides
            tire = tire.mounted("left" if wheel.y > 0.0 else "right")
        of_tire = _tire_force(tire, slip[k], camber, 0.5 * drive[axle], F_z[k], grip)
        F_x.append(of_tire[0])
        F_y.append(of_tire[1])
        forward, sideward = _rotate(of_tire[0], of_tire[1], angle)
        force += forward
        axle_force[axle] += sideward
        moment -= wheel.y * forward

    a_x, a_y = force / m, (axle_force[0] + axle_force[1]) / m
    r_dot = (l_f * axle_force[0] - l_r * axle_force[1] + moment) / I_z
    # About the center of gravity: the roll arm carries what the tires push, not what pushes at the
    # center itself, and the weight of the leaning body.
    restoring = c.roll_stiffness * roll + c.roll_damping * roll_rate
    roll_acceleration = (m * h * a_y + vehicle.weight * h * roll - restoring) / c.roll_inertia
    X_dot, Y_dot = _rotate(v_x, v_y, psi)
    x_dot = ca.vertcat(
        a_x + v_y * r,
        a_y + slope - v_x * r,
        r_dot,
        roll_rate,
        roll_acceleration,
        X_dot,
        Y_dot,
        r,
        *slip_dot,
        (command - delta) / c.steering_lag,
        (ca.vertcat(*axle_force) - F_lagged) / _LOAD_LAG,
        (a_x - a_x_lagged) / _LOAD_LAG,
        integral_dot,
    )
    outputs = [ca.vertcat(*v) for v in (F_x, F_y)] + [F_z]
    outputs += [ca.vertcat(*v) for v in (alpha, axle_force, (a_x, a_y))]
    return ca.Function(
        "car", [x, command, v_ref, mu, places, slope], [x_dot, *outputs],
        ["x", "command", "v_ref", "mu", "places", "slope"], ["x_dot", *_OUTPUTS],
    )  # fmt: skip


def runge_kutta(car: ca.Function, dt: float) -> ca.Function:
    """Return one classical fourth-order step as an MX function which calls `car` four times.

    Its outputs are those of the state before the step.
    car : from `dynamics`.   dt : step [s].
    """
    x = ca.MX.sym("x", N_STATES)
    rest = [ca.MX.sym(car.name_in(i), *car.size_in(i)) for i in range(1, car.n_in())]
    k1, *outputs = car(x, *rest)
    k2 = car(x + 0.5 * dt * k1, *rest)[0]
    k3 = car(x + 0.5 * dt * k2, *rest)[0]
    k4 = car(x + dt * k3, *rest)[0]
    x_next = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return ca.Function(
        "plant",
        [x, *rest],
        [x_next, *(ca.densify(v) for v in outputs)],
        list(car.name_in()),
        ["x_next", *_OUTPUTS],
    )
