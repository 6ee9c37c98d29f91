"""The bicycle on curves of the axle identifier, many cars and many steerings at a time.

Rows are steerings m and tires k: arrays of lanes (..., m, k).   v_x is held.
m_v (dv_y/dt + v_x r) = F_f cos δ + F_r,   I_z dr/dt = l_f F_f cos δ - l_r F_r,   F_i = F_z,i φ_i(x)
x follows α over the lag of `identifier.axle.slip`, exactly for α linear over a step (first-order
hold); with it its sensitivities to compliance and sway share. Velocities take the force of the slip
at the end of the step (semi-implicit), so that stiff tires at low speed stay stable.
Who drives holds the planned course, which is that of the first car:
u = δ_plan - (2 ω e_ψ + ω² e_y/v_x)/G, G the yaw rate of a steady bend per angle, so that deviations
die out with a double pole at ω, slowly against the swings. The wheels follow what is asked for over
the lag of the steering, T dδ/dt = u - δ, exactly for u linear over a step.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.axle.slip import SHORTEST
from identifier.plan.chosen import CHOSEN
from identifier.plan.tires import PlausibleTires
from models.vehicle import GRAVITY


class Hold(NamedTuple):
    """Steering per deviation from the course: of heading [-], to the left [rad/m]."""

    heading: float
    aside: float

    def steering(self, reference: tuple[Any, Any, Any], now: tuple[Any, Any, Any]) -> Any:
        """Return what is added to the planned angle [rad].
        reference, now : X, Y [m] and heading [rad], as planned and as they are.
        """
        (X, Y, psi), (X_now, Y_now, psi_now) = reference, now
        e_y = (Y_now - Y) * np.cos(psi) - (X_now - X) * np.sin(psi)
        return -self.heading * (psi_now - psi) - self.aside * e_y


NO_HOLD = Hold(0.0, 0.0)


class Guide(NamedTuple):
    """What brings the planned course back to a line along X, so that a long one keeps its lane.

    hold : of the first car.   Y : of the line [m].   rate, angle : that the sum of swings and
    guidance keeps, [rad/s] and [rad].
    """

    hold: Hold
    Y: float
    rate: float
    angle: float


def hold_of(tires: PlausibleTires, v_x: float) -> Hold:
    """Return how the course is held by the first tires.   v_x : speed [m/s]."""
    car, omega = tires.vehicle, CHOSEN.hold / tires.vehicle.froude_time
    c_f, c_r = (tires.W[0] / np.array(tires.method.ladder)).sum(axis=1)
    per_yaw_rate = car.wheelbase / v_x + v_x / GRAVITY * (1.0 / c_f - 1.0 / c_r)  # 1/G [s]
    per_yaw_rate = max(per_yaw_rate, 0.5 * car.wheelbase / v_x)
    return Hold(2.0 * omega * per_yaw_rate, omega**2 / v_x * per_yaw_rate)


class Motion(NamedTuple):
    """What cars do, at n times: lanes (n, m, k), axles (n, 2, m, k).
    slip : lagged x [rad].   force : φ [static axle loads].   slope : dφ/dx [1/rad].
    of_compliance, of_share : ∂x/∂s [rad per m/load] and ∂x/∂k [rad].
    v_y : [m/s].   r : [rad/s].   X, Y : center of gravity [m].   psi : heading [rad].
    asked : of the front wheels [rad]; of the first car it is the plan.
    delta : of the front wheels, behind what is asked of them [rad].
    """

    slip: Array
    force: Array
    slope: Array
    of_compliance: Array
    of_share: Array
    v_y: Array
    r: Array
    X: Array
    Y: Array
    psi: Array
    asked: Array
    delta: Array


class Entry(NamedTuple):
    """Where cars come in: X, Y [m] and heading [rad], (m,) each."""

    X: Array
    Y: Array
    psi: Array


def time_step(tires: PlausibleTires) -> float:
    """Return the step of the simulation [s]."""
    return CHOSEN.step * tires.vehicle.froude_time


def simulate(
    tires: PlausibleTires,
    planned: Array,
    v_x: float,
    entry: Entry,
    hold: Hold,
    guide: Guide | None = None,
) -> Motion:
    """Return the motion of all tires under all steerings.
    planned : angles asked of the front wheels at steps of `time_step` [rad], (n, m).
    v_x : speed [m/s].   guide : what is planned follows it; None plans the angles as they are.
    """
    car, dt, scales = tires.vehicle, time_step(tires), 1.0 / np.array(tires.method.ladder)
    n, m, k = *planned.shape, len(tires.W)
    W = tires.W.transpose(2, 1, 0)[:, :, None, :]  # (units, 2, 1, k)
    inverse = scales[:, None, None, None]
    flattest = CHOSEN.least_slope * (W * inverse).sum(axis=0)
    s, share = (one[:, None, None] for one in (tires.compliance, tires.sway_share))
    loads = np.array(car.axle_loads)
    to_v, to_r = loads / car.mass, np.array([car.l_f, -car.l_r]) * loads / car.yaw_inertia
    arm = np.array([car.l_f, -car.l_r])[:, None, None]
    stiffness, damping, soft, *_ = tires.method.sway.numbers()
    shortest = SHORTEST * car.wheelbase
    lanes, axles = np.zeros((m, k)), np.zeros((2, m, k))
    v_y = r = rho = rho_dot = asked = delta = lanes
    z = dt / tires.steering_lag  # (k,)
    stays = np.exp(-z)
    missed = (1.0 - stays) / z
    x = alpha = p_s = p_k = sway = axles
    force, slope, bend = axles, (W * inverse).sum(axis=0) + axles, axles
    X, Y, psi = (np.repeat(one[:, None], k, axis=1) for one in entry)
    out = Motion(*(np.empty((n, *(one.shape))) for one in (x, x, x, x, x, v_y, r, X, Y, psi, r, r)))
    for i in range(n):
        course = X[:, :1], Y[:, :1], psi[:, :1]
        wanted = planned[i]
        if guide is not None:
            line = X[:, 0], guide.Y, 0.0
            wanted = wanted + guide.hold.steering(line, (X[:, 0], Y[:, 0], psi[:, 0]))
            wanted = np.clip(wanted, -guide.angle, guide.angle)
            reach = guide.rate * dt if i else 0.0
            wanted = np.clip(wanted, asked[:, 0] - reach, asked[:, 0] + reach)
        asked_now = wanted[:, None] + hold.steering(course, (X, Y, psi))
        delta = stays * delta + (1.0 - stays) * asked + (1.0 - missed) * (asked_now - asked)
        asked = asked_now
        # Sway of the body, semi-implicit, and the slip that it makes.
        a = to_v[0] * force[0] + to_v[1] * force[1]
        rho_dot = (rho_dot + dt * stiffness * (a - rho)) / (1.0 + dt * damping)
        rho = rho + dt * rho_dot
        sway_now = -rho_dot * soft / v_x
        alpha_now = np.arctan((v_y + arm * r) / v_x)
        np.negative(alpha_now, out=alpha_now)
        alpha_now[0] += delta
        alpha_now += share * sway_now
        # The lag and its sensitivities.
        C = np.maximum(slope, flattest)
        sigma = s * C + shortest
        z = v_x * dt / sigma
        e = np.exp(-z)
        phi = (1.0 - e) / z
        change = alpha_now - alpha
        by_sigma = ((e - phi) * change - z * e * (alpha - x)) / sigma
        p_s = e * p_s + by_sigma * (C + s * bend * p_s)
        p_k = e * p_k + (1.0 - e) * sway + (1.0 - phi) * (sway_now - sway)
        x = e * x + (1.0 - e) * alpha + (1.0 - phi) * change
        alpha, sway = alpha_now, sway_now
        T = np.tanh(x * inverse)
        slopes = W * (1.0 - T * T) * inverse
        force, slope = (W * T).sum(axis=0), slopes.sum(axis=0)
        bend = np.where(slope < flattest, 0.0, -2.0 * (T * slopes * inverse).sum(axis=0))
        for to, value in zip(
            out, (x, force, slope, p_s, p_k, v_y, r, X, Y, psi, asked, delta), strict=True
        ):
            to[i] = value
        front = force[0] * np.cos(delta)
        v_y = v_y + dt * (to_v[0] * front + to_v[1] * force[1] - v_x * r)
        r = r + dt * (to_r[0] * front + to_r[1] * force[1])
        c, s_ = np.cos(psi + 0.5 * dt * r), np.sin(psi + 0.5 * dt * r)
        X, Y = X + dt * (v_x * c - v_y * s_), Y + dt * (v_x * s_ + v_y * c)
        psi = psi + dt * r
    return out


def steps_of(tires: PlausibleTires, duration: float) -> Array:
    """Return the times of a simulation [s], (n,).   duration : [s]."""
    dt = time_step(tires)
    return dt * np.arange(math.ceil(duration / dt) + 1, dtype=np.float64)
