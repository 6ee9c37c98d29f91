"""The plant against Newton, Euler, the linear bicycle and formulas on paper.

What the plant computes inside is never called here: the recorded motion is differentiated and
compared with the recorded forces, or both with a closed form.
"""

import math
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from models.friction import Friction, FrictionChange, place_change
from models.maneuvers import RandomSteer, Slalom, StepSteer
from models.plant import Plant, tire_of
from models.plant.dynamics import _relax, _tire_force
from models.sensors import Sensor, Sensors
from models.tires import DugoffTire, FialaTire, LinearTire, MagicFormula, TirError
from models.vehicle import GRAVITY, Vehicle, sedan
from tests.refused import line_about

CAR = sedan()
CHASSIS = CAR.require_chassis()
PLANT = Plant(CAR)
FOUR_WHEELS = Vehicle(
    **{key: getattr(CAR, key) for key in CAR.__slots__ if key != "chassis"},
    chassis=replace(CHASSIS, drive_front_share=0.4, track_rear=1.45),
)

HARD = RandomSteer(
    amplitude=0.16, frequency=0.8, seed=1, onset=0.5, rate_limit=2.0, duration=10.0, rear_ratio=0.2
)


@pytest.fixture(scope="module")
def hard_run():
    """Near the limit, both axles steering and driving, every millisecond."""
    run = Plant(FOUR_WHEELS).simulate(HARD, speed=20.0, sample_time=1e-3)
    assert np.abs(run.a_y).max() > 0.75 * GRAVITY and run.F_x.sum(axis=1).max() > 500.0
    assert np.degrees(np.abs(run.alpha)).max() > 6.0
    return run


def slope(y, dt=1e-3):
    """Fourth-order central difference, without two samples at each end."""
    return (y[:-4] - 8.0 * y[1:-3] + 8.0 * y[3:-1] - y[4:]) / (12.0 * dt)


def body_forces(run):
    """Wheel forces turned into the body frame by hand: longitudinal and lateral, (n, 4)."""
    delta = np.column_stack((run.delta_f, run.delta_f, run.delta_r, run.delta_r))
    along = run.F_x * np.cos(delta) - run.F_y * np.sin(delta)
    aside = run.F_y * np.cos(delta) + run.F_x * np.sin(delta)
    return along, aside


def test_lateral_and_longitudinal_motion_obey_newton(hard_run):
    run, m, middle = hard_run, FOUR_WHEELS.mass, slice(2, -2)
    across, along = run.axle_force.sum(axis=1), body_forces(run)[0].sum(axis=1)
    for rate, turn, force, share in (
        (slope(run.v_y), run.v_x * run.r, across, 2e-4),
        (slope(run.v_x), -run.v_y * run.r, along, 5e-4),
    ):
        away = np.abs(m * (rate + turn[middle]) - force[middle])
        assert away.max() < share * np.abs(force).max()
    np.testing.assert_allclose(m * run.a_y, across, rtol=1e-12, atol=1e-9)


def yaw_moment(run, car):
    """Moment of the four wheel forces about the center of gravity, x F_y - y F_x."""
    c = car.chassis
    along, aside = body_forces(run)
    x = np.array([car.l_f, car.l_f, -car.l_r, -car.l_r])
    y = 0.5 * np.array([c.track_front, -c.track_front, c.track_rear, -c.track_rear])
    return (x * aside - y * along).sum(axis=1)


def test_yaw_motion_obeys_euler_and_a_wrong_arm_is_noticed(hard_run):
    I_z, middle = FOUR_WHEELS.yaw_inertia, slice(2, -2)
    inertial = I_z * slope(hard_run.r)
    moment = yaw_moment(hard_run, FOUR_WHEELS)
    assert np.abs(inertial - moment[middle]).max() < 1e-3 * np.abs(moment).max()
    longer = replace(FOUR_WHEELS, l_f=FOUR_WHEELS.l_f + 0.02)
    wrong = yaw_moment(hard_run, longer)
    assert np.abs(inertial - wrong[middle]).max() > 1e-2 * np.abs(moment).max()


def test_axle_forces_are_the_turned_wheel_forces(hard_run):
    aside = body_forces(hard_run)[1]
    by_hand = np.column_stack((aside[:, :2].sum(axis=1), aside[:, 2:].sum(axis=1)))
    np.testing.assert_allclose(hard_run.axle_force, by_hand, rtol=1e-12, atol=1e-9)
    wheel_frame = hard_run.F_y[:, :2].sum(axis=1)
    assert np.abs(wheel_frame - by_hand[:, 0]).max() > 20.0  # the turn is not nothing


def test_position_is_the_integral_of_the_turned_velocity(hard_run):
    run = hard_run
    X_dot = run.v_x * np.cos(run.psi) - run.v_y * np.sin(run.psi)
    Y_dot = run.v_x * np.sin(run.psi) + run.v_y * np.cos(run.psi)
    trapezoid = [np.trapezoid(rate, dx=1e-3) for rate in (X_dot, Y_dot, run.r)]
    assert run.X[-1] == pytest.approx(trapezoid[0], abs=1e-4)
    assert run.Y[-1] == pytest.approx(trapezoid[1], abs=1e-4)
    assert run.psi[-1] == pytest.approx(trapezoid[2], abs=1e-5)


def test_roll_is_a_driven_oscillator_about_the_center_of_gravity(hard_run):
    run, c, h, middle = hard_run, FOUR_WHEELS.chassis, FOUR_WHEELS.roll_arm, slice(2, -2)
    inertial = c.roll_inertia * slope(run.roll_rate)
    moment = FOUR_WHEELS.mass * h * (run.a_y + GRAVITY * run.roll)
    moment -= c.roll_stiffness * run.roll + c.roll_damping * run.roll_rate
    assert np.abs(inertial - moment[middle]).max() < 2e-3 * np.abs(inertial).max()


def test_slip_angles_have_the_papers_sign(hard_run):
    run, car = hard_run, FOUR_WHEELS
    v_y = run.v_y + car.roll_arm * run.roll_rate  # on the roll axis
    left = run.v_x - 0.5 * car.chassis.track_front * run.r
    right = run.v_x + 0.5 * car.chassis.track_rear * run.r
    front_left = run.delta_f - np.arctan2(v_y + car.l_f * run.r, left)
    rear_right = run.delta_r - np.arctan2(v_y - car.l_r * run.r, right)
    np.testing.assert_allclose(run.alpha[:, 0], front_left, atol=1e-13)
    np.testing.assert_allclose(run.alpha[:, 3], rear_right, atol=1e-13)


def test_the_steady_force_is_that_of_the_slip_angle():
    """Once the lag is over, a tire pulls with C alpha at any angle, though the lag is in tan."""
    stiffness, tire = 60e3, LinearTire(C_alpha=60e3, C_kappa=1e6)
    for delta, velocity in ((0.6, (20.0, 1.0)), (-0.3, (15.0, 9.0)), (0.1, (25.0, 0.0))):
        at_zero, at_one = (float(_relax(s, delta, velocity, 0.5)) for s in (0.0, 1.0))
        steady = at_zero / (at_zero - at_one)  # the lag is linear in the slip
        expected = stiffness * (delta - math.atan2(velocity[1], velocity[0]))
        F_y = float(_tire_force(tire, steady, 0.0, 0.0, 4000.0, 1.0)[1])
        assert F_y == pytest.approx(expected, rel=1e-12)
        as_angle = float(_tire_force(tire, math.tan(steady), 0.0, 0.0, 4000.0, 1.0)[1])
        assert as_angle != pytest.approx(expected, rel=1e-5)


def test_side_force_follows_slip_over_the_relaxation_length():
    sigma, speed, stiffness = 0.6, 20.0, 60e3
    stiff = {"cornering_stiffness_front": 1e8, "cornering_stiffness_rear": 1e8}  # not read here
    chassis = replace(CHASSIS, roll_stiffness=1e9)
    heavy = replace(CAR, mass=1e6, yaw_inertia=1e7, chassis=chassis, **stiff)
    tire = LinearTire(C_alpha=stiffness, C_kappa=1e9)
    step = StepSteer(amplitude=0.01, onset=0.2, rate_limit=10.0, duration=1.0)
    fast = replace(heavy, chassis=replace(heavy.chassis, steering_lag=0.002))
    run = Plant(fast, tire).simulate(step, speed=speed, sample_time=1e-3)
    late = np.interp(0.2 + 0.0005 + 0.002 + sigma / speed, run.t, run.F_y[:, 0])
    assert late == pytest.approx(stiffness * 0.01 * (1.0 - math.exp(-1.0)), rel=0.01)


@pytest.mark.parametrize(
    "tire",
    [
        PLANT.tire,
        LinearTire(C_alpha=6e4, C_kappa=8e4),
        FialaTire(C_alpha=6e4, C_kappa=8e4, friction=1.0),
        DugoffTire(C_alpha=6e4, C_kappa=8e4, friction=1.0),
    ],
    ids=lambda tire: type(tire).__name__,
)
def test_steady_turning_is_that_of_the_linear_bicycle_on_any_tire(tire):
    front, rear = CAR.axle_loads
    C_f, C_r = (2.0 * tire.cornering_stiffness(load / 2.0) for load in (front, rear))
    speed, delta = 20.0, 0.002
    gradient = front / C_f - rear / C_r  # understeer per g [rad]
    r = delta * speed / (CAR.wheelbase + gradient * speed**2 / GRAVITY)
    step = StepSteer(amplitude=delta, onset=0.1, rate_limit=0.5, duration=8.0)
    # Without roll camber and with drive behind, the car is the bicycle up to second order.
    plain = replace(CHASSIS, roll_camber_front=0.0, roll_camber_rear=0.0, drive_front_share=0.0)
    run = Plant(replace(CAR, chassis=plain), tire).simulate(step, speed=speed)
    assert run.r[-1] == pytest.approx(r, rel=0.01)
    assert run.a_y[-1] == pytest.approx(speed * r, rel=0.01)


def test_downforce_adds_to_the_loads_of_its_axle_by_the_square_of_speed():
    racer = replace(CAR, downforce_area_front=1.5, downforce_area_rear=2.5)
    run = Plant(racer).simulate(replace(HARD, amplitude=0.05), speed=lambda t: 40.0 - t)
    pushes = 0.5 * 1.2 * run.v_x**2
    np.testing.assert_allclose(run.F_z.sum(axis=1), CAR.weight + 4.0 * pushes, rtol=1e-12)
    along = CAR.mass * run.a_x * CHASSIS.cg_height / CAR.wheelbase  # a few samples behind
    front = CAR.axle_loads[0] + 1.5 * pushes - along
    np.testing.assert_allclose(run.F_z[:, :2].sum(axis=1), front, atol=60.0)
    assert np.ptp(pushes) > 20.0


def test_wheels_lift_at_extreme_steer_and_the_loads_stay_physical():
    """A high car on sticky tires: inner wheels leave the road, the sum of loads stays."""
    high = replace(
        CAR, chassis=replace(CHASSIS, cg_height=0.7, track_front=1.3, roll_stiffness=60e3)
    )
    step = StepSteer(amplitude=0.3, onset=0.2, rate_limit=2.0, duration=4.0)
    run = Plant(high, PLANT.tire).simulate(step, speed=25.0, friction=Friction(scale=1.5))
    assert run.F_z.min() == 0.0
    np.testing.assert_allclose(run.F_z.sum(axis=1), high.weight, rtol=1e-13)
    assert np.all(run.F_x[run.F_z == 0.0] == 0.0)
    assert np.all(run.F_y[run.F_z == 0.0] == 0.0)


def test_load_transfer_in_a_steady_turn_is_the_formula_on_paper():
    step = StepSteer(amplitude=0.03, onset=0.1, rate_limit=0.5, duration=10.0)
    run = PLANT.simulate(step, speed=20.0)
    m, h, a_y = CAR.mass, CAR.roll_arm, run.a_y[-1]
    roll = m * h * a_y / (CHASSIS.roll_stiffness - m * GRAVITY * h)
    assert run.roll[-1] == pytest.approx(roll, rel=1e-3)
    share, track = CHASSIS.roll_stiffness_front_share, CHASSIS.track_front
    front = share * CHASSIS.roll_stiffness * roll
    front += CHASSIS.roll_center_height_front * run.axle_force[-1, 0]
    assert run.F_z[-1, 1] - run.F_z[-1, 0] == pytest.approx(2.0 * front / track, rel=1e-3)
    # All four wheels hold the body's moment: m a_y at its height, weight at its lean.
    moment = 0.5 * (run.F_z[-1] * [-track, track, -track, track]).sum()
    by_hand = m * a_y * CHASSIS.cg_height + m * GRAVITY * h * run.roll[-1]
    assert moment == pytest.approx(by_hand, rel=1e-3)


def test_the_integration_is_of_fourth_order():
    """Under a constant input the error falls by 16 for each halving of the step."""
    at_once = StepSteer(amplitude=0.05, onset=0.0, rate_limit=1e9, duration=0.16)

    def end(dt):
        run = PLANT.simulate(at_once, speed=20.0, dt=dt, sample_time=0.016)
        return np.array([run.v_x[-1], run.v_y[-1], run.r[-1], run.roll[-1], run.Y[-1]])

    exact = end(0.00025)
    errors = np.array([np.abs(end(dt) - exact) for dt in (0.004, 0.002)])
    ratio = errors[0] / errors[1]
    assert np.all((ratio > 12.0) & (ratio < 24.0))
    assert np.all(errors[1] < 1e-6)


@pytest.mark.parametrize("scale", [1.0, 0.7, 0.4])
def test_friction_sets_the_limit_of_the_front_axle(scale):
    """The largest axle force is what the two tires can do at best at their loads and camber."""
    turn = StepSteer(amplitude=0.15, onset=0.2, rate_limit=0.02, duration=9.0)
    rear_drive = replace(CAR, chassis=replace(CHASSIS, drive_front_share=0.0))
    run = Plant(rear_drive).simulate(turn, speed=20.0, friction=Friction(scale=scale))
    k = int(np.argmax(run.axle_force[:, 0]))
    camber, slips = CHASSIS.roll_camber_front * run.roll[k], np.linspace(0.02, 0.4, 400)
    limit = 0.0
    for side, load in (("left", run.F_z[k, 0]), ("right", run.F_z[k, 1])):
        tire = PLANT.tire.mounted(side)
        limit += max(float(tire.forces(slip, 0.0, camber, load, scale).F_y) for slip in slips)
    side_force = run.F_y[k, :2].sum()
    assert 0.98 * limit < side_force < 1.001 * limit


def test_the_axles_share_driving_and_braking_as_the_chassis_says():
    straight = StepSteer(amplitude=0.0, onset=0.1, rate_limit=1.0, duration=6.0)
    shares = replace(CHASSIS, drive_front_share=0.2, brake_front_share=0.7)
    run = Plant(replace(CAR, chassis=shares)).simulate(
        straight, speed=lambda t: 20.0 + np.interp(t, [1.0, 3.0, 5.0], [0.0, 4.0, 0.0])
    )
    along = body_forces(run)[0]
    front, total = along[:, :2].sum(axis=1), along.sum(axis=1)
    driven, braked = total > 0.1 * CAR.mass, total < -0.1 * CAR.mass
    assert driven.sum() > 100 and braked.sum() > 100
    np.testing.assert_allclose(front[driven] / total[driven], 0.2, atol=0.01)
    np.testing.assert_allclose(front[braked] / total[braked], 0.7, atol=0.01)


def test_each_wheel_meets_a_change_at_its_place():
    turn = StepSteer(amplitude=0.08, onset=0.2, rate_limit=1.0, duration=2.5)
    there = Friction(changes=(FrictionChange(scale=0.5, at_place=25.0),))
    run = PLANT.simulate(turn, speed=20.0, friction=there, sample_time=1e-3)
    x = [CAR.l_f, CAR.l_f, -CAR.l_r, -CAR.l_r]
    y = 0.5 * CHASSIS.track_front * np.array([1.0, -1.0, 1.0, -1.0])
    for wheel in range(4):
        k = int(np.argmax(np.abs(np.diff(run.F_y[:, wheel]))))
        place = [
            run.X[i] + x[wheel] * np.cos(run.psi[i]) - y[wheel] * np.sin(run.psi[i])
            for i in (k, k + 1)
        ]
        assert place[0] < 25.0 <= place[1]


def test_a_wide_change_over_the_place_is_the_one_cubic_that_starts_and_ends_flat():
    """Four conditions fix it: both ends, and no slope at either. Two ramps add up."""
    first = FrictionChange(scale=0.5, at_place=10.0, width=4.0)
    road = Friction(scale=0.9, changes=(first, replace(first, scale=0.8, at_place=30.0)))
    X = ca.SX.sym("X")
    change = place_change(road.over_place(), X)
    scale, slope = (
        ca.Function("f", [X], [f]).map(400) for f in (0.9 + change, ca.gradient(change, X))
    )
    places = np.linspace(5.0, 40.0, 400)
    expected = np.empty(400)
    for k, place in enumerate(places):
        expected[k] = 0.9 if place < 10.0 else 0.5 if place < 30.0 else 0.8
        for start, before, after in ((10.0, 0.9, 0.5), (30.0, 0.5, 0.8)):
            if start <= place < start + 4.0:
                ends = np.vander([start, start + 4.0], 4)
                flat = [[3 * at**2, 2 * at, 1.0, 0.0] for at in (start, start + 4.0)]
                cubic = np.linalg.solve(np.vstack([ends, flat]), [before, after, 0.0, 0.0])
                expected[k] = np.polyval(cubic, place)
    np.testing.assert_allclose(np.array(scale(places)).ravel(), expected, atol=1e-8)
    steepest = np.abs(np.array(slope(places))).max()
    assert steepest == pytest.approx(1.5 * 0.4 / 4.0, rel=1e-3)  # of a straight ramp: 0.4/4


def test_a_wide_change_is_smooth_and_meets_its_ends():
    change = Friction(changes=(FrictionChange(scale=0.5, at_time=1.0, width=2.0),))
    scale = change.over_time(np.array([0.0, 1.0, 1.5, 2.0, 3.0, 9.0]))
    np.testing.assert_allclose(scale, [1.0, 1.0, 1.0 - 0.5 * 0.15625, 0.75, 0.5, 0.5])


def test_the_driver_holds_and_reaches_a_speed():
    straight = StepSteer(amplitude=0.0, onset=0.0, rate_limit=1.0, duration=12.0)
    run = PLANT.simulate(straight, speed=lambda t: np.where(t < 1.0, 20.0, 25.0))
    assert run.v_x[-1] == pytest.approx(25.0, abs=0.1)
    assert run.a_x.max() == pytest.approx(PLANT.driver.acceleration_limit, rel=0.1)
    assert run.v_x.max() < 25.8  # no wind-up


def test_a_car_that_slows_to_walking_pace_stays_finite_and_quiet():
    turn = StepSteer(amplitude=0.1, onset=0.5, rate_limit=1.0, duration=12.0)
    run = PLANT.simulate(turn, speed=lambda t: np.maximum(6.0 - t, 0.3))
    assert run.v_x[-1] == pytest.approx(0.3, abs=0.1)
    assert run.r[-1] == pytest.approx(run.v_x[-1] * 0.1 / CAR.wheelbase, rel=0.1)
    assert np.ptp(run.a_y[-100:]) < 0.02


def test_a_log_of_a_run_carries_the_truth_and_goes_through_sensors(rng):
    slalom = Slalom(amplitude=0.03, frequency=0.5, onset=0.5, rate_limit=0.5, duration=4.0)
    run = PLANT.simulate(slalom, speed=20.0, name="slalom")
    exact = run.recording()
    assert exact.name == "slalom"
    assert len(exact.t) == 401
    np.testing.assert_array_equal(exact.axle_force, run.axle_force)
    np.testing.assert_array_equal(exact.delta_f, run.delta_f)
    noisy = run.recording(Sensors(v_y=Sensor(noise=0.05)), rng)
    assert np.std(noisy.v_y - run.v_y) == pytest.approx(0.05, rel=0.15)
    with pytest.raises(ValueError, match="rng"):
        run.recording(Sensors())


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("FNOMIN", "4", "cornering stiffness under a front wheel of sedan, 4224 N, must be 0.5 to"),
        ("FNOMIN", "1e-300", "must be 0.5 to 500 times that load, it is 0 times: check FNOMIN"),
        ("LFZO", "1e-300", "must be 0.5 to 500 times that load, it is 0 times"),
        ("PKY1", "-1e-300", "cornering stiffness under a front wheel"),
        ("PKX3", "1e5", "slip stiffness under a front wheel of sedan"),
        ("LMUY", "1e-9", "largest side force under a front wheel of sedan"),
    ],
)
def test_a_tire_that_carries_no_wheel_of_the_car_is_refused_by_its_file(tmp_path, key, value, says):
    """FNOMIN = 4 without its kN is a tire of four newtons."""
    lines = Path(CHASSIS.tire).read_text().splitlines()
    path = tmp_path / "other.tir"
    kept = [line for line in lines if line.split("=")[0].strip() != key]
    path.write_text("\n".join([*kept, f"{key} = {value}"]))
    car = replace(CAR, chassis=replace(CHASSIS, tire=path))
    for make in (Plant, tire_of):
        assert says in line_about(path, TirError, lambda _, make=make: make(car))
    path.write_text("\n".join(lines))
    assert tire_of(car).coefficients == MagicFormula.from_tir(CHASSIS.tire).coefficients
