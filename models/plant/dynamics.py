"""Equations of motion of the double-track car as one CasADi function of state and input.

State (18): v_x, v_y [m/s] of the center of gravity, r [rad/s], roll [rad], roll rate [rad/s],
X, Y [m], heading psi [rad], the lagged slip tan(α') of four wheels [-], the actual steering of the
two axles [rad], the lagged side force of the two axles [N] and acceleration a_x [m/s^2] that the
wheel loads follow, and the driver's integral [m].
The wheel loads follow the forces through a lag of 10 ms, the vertical motion of wheel and tire;
it also breaks the algebraic loop between load and force.
Assumed away: pitch, steer by the suspension, aligning moments of the tires, spin of the wheels
(longitudinal slip follows from the wanted force at once), rolling and air resistance.
"""

from typing import Any

import casadi as ca

from models.friction import MAX_PLACES, place_change
from models.plant.driver import Driver
from models.plant.loads import wheel_loads
from models.plant.wheels import mounted, relax, tire_force, wheels
from models.tires import Tire
from models.vehicle import Vehicle

N_STATES = 18
LOAD_LAG = 0.01  # unsprung mass on the tire spring, about 15 Hz [s]

OUTPUTS = {"F_x": 4, "F_y": 4, "F_z": 4, "alpha": 4, "axle_force": 2, "acceleration": 2}


def rotate(x: Any, y: Any, angle: Any) -> tuple[Any, Any]:
    """Return the components of a wheel-frame vector in the body frame.

    Parameters
    ----------
    x, y : components in the frame of the wheel.
    angle : steering angle of the wheel [rad].
    """
    c, s = ca.cos(angle), ca.sin(angle)
    return x * c - y * s, x * s + y * c


def dynamics(vehicle: Vehicle, tire: Tire, driver: Driver) -> ca.Function:
    """Return f(x, command, v_ref, mu, places) -> (x_dot, *OUTPUTS), an SX function.

    Parameters
    ----------
    vehicle : the car, with chassis.
    tire : mounted on all four wheels.
    driver : who holds the speed.
    """
    m, I_z, l_f, l_r = vehicle.mass, vehicle.yaw_inertia, vehicle.l_f, vehicle.l_r
    c, h = vehicle.require_chassis(), vehicle.roll_arm
    x = ca.SX.sym("x", N_STATES)
    command, v_ref, mu = ca.SX.sym("command", 2), ca.SX.sym("v_ref"), ca.SX.sym("mu")
    places = ca.SX.sym("places", 3, MAX_PLACES)
    v_x, v_y, r, roll, roll_rate, X, _, psi = ca.vertsplit(x[:8])
    slip, delta, F_lagged, a_x_lagged, integral = x[8:12], x[12:14], x[14:16], x[16], x[17]

    demand, integral_dot = driver.demand(v_ref - v_x, integral)
    drive = [m * demand * share for share in (c.drive_front_share, 1.0 - c.drive_front_share)]
    F_z = wheel_loads(vehicle, roll, roll_rate, F_lagged, a_x_lagged)

    F_x, F_y, alpha, slip_dot = [], [], [], []
    force, axle_force, moment = 0.0, [0.0, 0.0], 0.0
    sway = v_y + h * roll_rate  # on the roll axis, below the center of gravity
    for k, wheel in enumerate(wheels(vehicle)):
        angle, axle = delta[wheel.axle], wheel.axle
        velocity = wheel.velocity(v_x, sway, r)
        length = (c.relaxation_length_front, c.relaxation_length_rear)[axle]
        slip_dot.append(relax(slip[k], angle, velocity, length))
        alpha.append(angle - ca.atan2(velocity[1], velocity[0]))
        here = X + wheel.x * ca.cos(psi) - wheel.y * ca.sin(psi)
        grip = mu + place_change(places, here)
        camber = (c.roll_camber_front, c.roll_camber_rear)[axle] * roll
        of_tire = tire_force(mounted(tire, wheel), slip[k], camber, 0.5 * drive[axle], F_z[k], grip)
        F_x.append(of_tire[0])
        F_y.append(of_tire[1])
        forward, sideward = rotate(of_tire[0], of_tire[1], angle)
        force += forward
        axle_force[axle] += sideward
        moment -= wheel.y * forward

    a_x, a_y = force / m, (axle_force[0] + axle_force[1]) / m
    r_dot = (l_f * axle_force[0] - l_r * axle_force[1] + moment) / I_z
    # About the center of gravity: the roll arm carries a_y and the weight of the leaning body.
    restoring = c.roll_stiffness * roll + c.roll_damping * roll_rate
    roll_acceleration = (m * h * a_y + vehicle.weight * h * roll - restoring) / c.roll_inertia
    X_dot, Y_dot = rotate(v_x, v_y, psi)
    x_dot = ca.vertcat(
        a_x + v_y * r,
        a_y - v_x * r,
        r_dot,
        roll_rate,
        roll_acceleration,
        X_dot,
        Y_dot,
        r,
        *slip_dot,
        (command - delta) / c.steering_lag,
        (ca.vertcat(*axle_force) - F_lagged) / LOAD_LAG,
        (a_x - a_x_lagged) / LOAD_LAG,
        integral_dot,
    )
    outputs = [ca.vertcat(*v) for v in (F_x, F_y)] + [F_z]
    outputs += [ca.vertcat(*v) for v in (alpha, axle_force, (a_x, a_y))]
    return ca.Function(
        "car",
        [x, command, v_ref, mu, places],
        [x_dot, *outputs],
        ["x", "command", "v_ref", "mu", "places"],
        ["x_dot", *OUTPUTS],
    )


def runge_kutta(car: ca.Function, dt: float) -> ca.Function:
    """Return one classical fourth-order step as an MX function which calls `car` four times.

    Its outputs are those of the state before the step.

    Parameters
    ----------
    car : from `dynamics`.
    dt : step [s].
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
        ["x_next", *OUTPUTS],
    )
