"""The predicted motion against its differential equations, written out and integrated finely."""

import casadi as ca
import numpy as np
import pytest

from identifier.axle.car import Car, car_numbers
from identifier.axle.curve import LADDER, doublings, hidden_units, of_units
from identifier.axle.slip import SHORTEST
from identifier.inertial.motion import (
    MOVING,
    SENSORS,
    Along,
    Laws,
    Sample,
    _size,
    expected_signals,
    predicted,
    static_load,
    unknowns,
)
from models.vehicle import sedan

G, CAR, N = 9.81, sedan(), len(LADDER)
STEPS = doublings(LADDER)
SCALES = ca.SX(ca.DM(1.0 / np.array(LADDER)[None]))
LAWS = {"roll_stiffness": 60.0, "roll_damping": 4.0}
BANK_TIME = 2.0  # s
SWAY = 0.2 / LAWS["roll_stiffness"]  # s^2
V_X, TURN = 20.0, 0.3  # m/s, rad/s of steering


def places():
    """Where in z the first of each kind of number stands."""
    first = MOVING + 2 * N
    after = ("compliance", "compliance_rear", *SENSORS)
    return {"W": MOVING, "W_rear": MOVING + N} | {name: first + i for i, name in enumerate(after)}


def state():
    z = np.zeros(_size(N))
    z[:MOVING] = [-0.4, 0.25, 0.03, 0.025, 0.02, -0.01, 0.03]
    at = places()
    z[at["W"] : at["W"] + N] = [0.1, 0.5, 0.2, 0.1]
    z[at["W_rear"] : at["W_rear"] + N] = [0.2, 0.5, 0.15, 0.1]
    z[at["compliance"]], z[at["compliance_rear"]] = 0.03, 0.02
    z[at["bias"]], z[at["roll"]], z[at["steering"]] = 0.01, 0.1, 0.004
    z[at["gyro"]] = 0.002
    return z


def car():
    return Car(*ca.horzsplit(ca.SX(ca.DM(car_numbers(CAR)))))


def laws(dt):
    """The error of the forces stays as it is, the accelerometer sits 0.4 m ahead and 0.2 aside."""
    bank = np.exp(-dt / BANK_TIME)
    return Laws(
        forgets=1.0, bank=bank, sway=SWAY, ahead=0.4, aside=0.2, late=0.0, steering_gain=0.0, **LAWS
    )


def stepped(z, tilt, t, dt):
    """State and tilt a step later, by the symbols of the filter."""
    symbol, old = ca.SX.sym("z", z.size), ca.SX.sym("tilt", 2)
    before, now = (Sample(ca.SX(V_X), ca.vertcat(0.02 + TURN * at, 0.0)) for at in (t, t + dt))
    ahead = predicted(
        car(), laws(dt), dt, unknowns(symbol, N), (old[0], old[1]), before, now, SCALES, STEPS
    )
    f = ca.Function("f", [symbol, old], [ahead.moving, ca.vertcat(ahead.tilt, ahead.tilt_rate)])
    moving, tilt = f(z, tilt)
    return np.concatenate([np.array(moving).ravel(), z[MOVING:]]), np.array(tilt).ravel()


def curve(x, w):
    T = np.tanh(x / np.array(LADDER))
    return w @ T, w @ ((1 - T**2) / np.array(LADDER))


def by_hand(z, tilt, t):
    """Time derivatives of what moves and of the rolling body."""
    v_y, r, x_f, x_r, e_f, e_r, p = z[:MOVING]
    at = places()
    delta = 0.02 + TURN * t
    share = np.array([CAR.l_r, CAR.l_f]) / CAR.wheelbase
    alpha = np.array(
        [
            delta + z[at["steering"]] - np.arctan((v_y + CAR.l_f * r) / V_X),
            -np.arctan((v_y - CAR.l_r * r) / V_X),
        ]
    )
    alpha -= SWAY * tilt[1] / V_X
    force, slip_rate = np.zeros(2), np.zeros(2)
    for i, (x, W, s) in enumerate(((x_f, "W", "compliance"), (x_r, "W_rear", "compliance_rear"))):
        phi, slope = curve(x, z[at[W] : at[W] + N])
        force[i] = phi * np.cos((delta, 0.0)[i]) + (e_f, e_r)[i]
        sigma = z[at[s]] * slope + SHORTEST * CAR.wheelbase
        slip_rate[i] = V_X / sigma * (alpha[i] - x)
    F = force * np.array(CAR.axle_loads)
    a = F.sum() / CAR.mass
    np.testing.assert_allclose(a, G * share @ force)
    turn = (CAR.l_f * F[0] - CAR.l_r * F[1]) / CAR.yaw_inertia
    moving = [a - V_X * r + G * p, turn, *slip_rate, 0, 0, -p / BANK_TIME]
    rolling = LAWS["roll_stiffness"] * (a - tilt[0]) - LAWS["roll_damping"] * tilt[1]
    return np.array(moving), np.array([tilt[1], rolling]), a, turn


def integrated(z, tilt, duration, dt=1e-4):
    z, tilt = z.copy(), tilt.copy()
    for k in range(round(duration / dt)):
        moving, rolling, *_ = by_hand(z, tilt, k * dt)
        middle, body = z.copy(), tilt + dt / 2 * rolling
        middle[:MOVING] += dt / 2 * moving
        moving, rolling, *_ = by_hand(middle, body, (k + 0.5) * dt)
        z[:MOVING] += dt * moving
        tilt = tilt + dt * rolling
    return z, tilt


def walked(dt):
    z, tilt = state(), np.array([2.0, 1.0])
    for k in range(round(0.08 / dt)):
        z, tilt = stepped(z, tilt, k * dt, dt)
    return z, tilt


def test_motion_follows_its_equations_and_halving_the_step_more_than_halves_the_error():
    """Force and v_x r half a sample apart would be off by 0.008 m/s, of first order."""
    exact, _ = integrated(state(), np.array([2.0, 1.0]), 0.08)
    coarse, fine = (np.abs(walked(dt)[0] - exact)[:2] for dt in (0.01, 0.005))
    assert (coarse < (2e-3, 2e-3)).all()
    assert (coarse / fine > 2.2).all()


def expected(z, tilt=3.0, delta=0.05):
    symbol = ca.SX.sym("z", z.size)
    now = Sample(ca.SX(V_X), ca.SX(ca.DM([delta, 0.0])))
    named = unknowns(symbol, N)
    at = of_units(hidden_units(named.slip, SCALES, STEPS), named.W, SCALES)
    seen = expected_signals(car(), laws(0.01), named, tilt, now, at)
    return np.array(ca.Function("f", [symbol], [ca.vertcat(seen.r, seen.a_y)])(z)).ravel()


def test_an_accelerometer_shows_forces_roll_bias_and_where_it_sits():
    z, delta = state(), 0.05
    _, _, a, turn = by_hand(z, np.zeros(2), (delta - 0.02) / TURN)
    r, a_y = expected(z)
    assert r == pytest.approx(0.25 + 0.002)
    assert a_y == pytest.approx(a + 0.1 * 3.0 + 0.01 * G + 0.4 * turn - 0.2 * 0.25**2, rel=1e-4)


def test_a_bank_moves_the_car_and_not_the_accelerometer():
    level, banked = state(), state()
    banked[6] += 0.1
    np.testing.assert_array_equal(expected(level), expected(banked))
    moved = stepped(banked, np.zeros(2), 0.0, 0.01)[0] - stepped(level, np.zeros(2), 0.0, 0.01)[0]
    assert moved[0] == pytest.approx(0.01 * G * 0.1, rel=0.05)


def test_braking_and_power_change_load_and_grip_as_a_fit_says():
    """Of a car whose axles brake and are driven in different shares, against the formula."""
    along = Along(-0.1, 0.15, brake_f=0.9, brake_r=0.4, drive_f=0.0, drive_r=0.8, drag=1e-3)
    for a_x, use in ((-6.0, (0.9, 0.4)), (4.0, (0.0, 0.8))):
        f = (a_x + 1e-3 * V_X**2) / G
        wanted = [(1 - 0.1 * f), (1 + 0.15 * f)] * np.sqrt(1 - np.square(use) * f**2)
        found = ca.DM(along.moved(static_load, a_x, V_X))
        np.testing.assert_allclose(np.array(found).ravel(), wanted, rtol=1e-12)
