"""The v_y of a car that nothing measures it of: told, with a band that holds what it says."""

import math

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.inertial import InertialIdentifier
from identifier.inertial.beliefs import Body
from identifier.run import OnlineIdentifier, identify
from models.faults import SensorFault
from models.friction import Friction, FrictionChange
from models.recordings import Recording
from models.vehicle import GRAVITY, sedan
from mpc.cars import CarState, DoubleTrackCar
from mpc.handover.learner import Learner
from mpc.handover.supervisor import Supervisor
from mpc.loop.drive import drive
from mpc.loop.lateral import LateralEstimate, LateralVelocity, Localization
from mpc.loop.sensing import CarSensors, FaultySensors, Measured, imu_and_localization
from mpc.path import iso_3888_1
from mpc.realtime import Tracker
from mpc.tires import prediction_tire

CAR, DT = sedan(), 0.01
SPEED = 20.0


@pytest.fixture(scope="module")
def swings():
    """A car on a field, steered left and right, up to 7 m/s² and more."""
    car = DoubleTrackCar(CAR)
    driven = [car.start(SPEED)]
    for k in range(1199):
        angle = 0.06 * math.sin(2.0 * math.pi * 0.35 * k * DT) * min(0.3 * k * DT, 1.0)
        driven.append(car.step(driven[-1], angle, SPEED))
    return driven


def lateral(localization=None, start=None, body=None):
    method = InertialIdentifier.for_vehicle(CAR, dt=DT)
    return LateralVelocity(OnlineIdentifier(method, CAR, DT, start), localization, body)


def told_over(driven, *faults):
    """What was told of a drive, by name, with the errors of v_y and the times."""
    rng, teller = np.random.default_rng(0), lateral()
    sensors = FaultySensors(imu_and_localization(np.random.default_rng([0, 9])), faults)
    rows = np.array([teller.tell(sensors.measure(state, rng)) for state in driven])
    found = dict(zip(LateralEstimate._fields, rows.T, strict=True))
    t, v_y, a_y = np.array([(state.t, state.v_y, state.a_y) for state in driven]).T
    errors = {"error": found["v_y"] - v_y, "inertial": found["inertial_v_y"] - v_y}
    return {**found, **errors, "leveled": found["a_y"] - a_y, "t": t, "true_a_y": a_y}


@pytest.fixture(scope="module")
def told(swings):
    return told_over(swings)


# The sensors.


def test_an_accelerometer_on_the_body_feels_what_it_leans(rng):
    """Gravity along an axis that leans by φ, from a rotation of both vectors."""
    roll, a_y = 0.07, 5.0
    state = CarState(0, 0, 0, 0, SPEED, 0.1, 0.2, 0.01, 0.0, a_y, roll, np.zeros(2), None)
    left = np.array([math.cos(roll), math.sin(roll)])  # of the body, to the left and up
    felt = left @ np.array([a_y, GRAVITY])  # what is pushed against: the road holds the car up
    assert imu_and_localization(None).measure(state, rng).a_y == pytest.approx(felt, rel=1e-12)
    assert CarSensors().measure(state, rng).a_y == a_y


# What is told.


def test_v_y_is_told_and_its_band_holds_the_errors(told):
    assert np.sqrt(np.mean(told["error"] ** 2)) < 0.035  # the optical sensor has 0.03 m/s of noise
    within = np.abs(told["error"]) < 2.0 * told["v_y_sd"]
    assert within.mean() > 0.93
    assert told["v_y_sd"][200:].max() < 0.08
    assert told["observable"][200:].all()


def test_the_acceleration_is_told_in_the_plane_of_the_road(told):
    late = slice(400, None)
    assert np.std(told["leveled"][late]) < 0.14  # of which noise is 0.10
    assert abs(np.mean(told["leveled"][late])) < 0.03
    gradient = np.polyfit(told["true_a_y"][late], told["a_y"][late], 1)[0]
    assert gradient == pytest.approx(1.0, abs=0.015)


@pytest.mark.sweep("r", "X", "a_y")
@pytest.mark.parametrize("channel", ["X", "psi", "v_x", "r", "delta", "a_y"])
def test_a_lost_channel_widens_the_band_and_is_driven_through(swings, channel, told):
    fault = SensorFault(channel=channel, kind="lost", start=4.0, duration=0.5)
    found = told_over(swings, fault)
    lost = fault.active(found["t"])
    assert np.isfinite(found["v_y"]).all() and np.isfinite(found["v_y_sd"]).all()
    assert found["v_y_sd"][lost][-1] >= told["v_y_sd"][lost][-1]
    assert np.abs(found["error"]).max() < 0.6
    assert np.mean(np.abs(found["error"]) < 3.0 * found["v_y_sd"]) > 0.9
    assert np.abs(found["error"][-200:]).max() < 0.12


def test_a_body_rolls_as_its_equation_says():
    """Against the closed form of a step, of second order."""
    body, a = Body(frequency=11.0, damping=0.3, roll=0.1, sd_roll=0.02), 4.0
    now, dt, times = (0.0, 0.0), 1e-4, np.arange(1, 8001) * 1e-4
    rolled = []
    for _ in times:
        now = body.step(now, a, dt)
        rolled.append(now[0])
    w, z = 11.0, 0.3
    wd = w * math.sqrt(1.0 - z**2)
    free = np.cos(wd * times) + z * w / wd * np.sin(wd * times)
    np.testing.assert_allclose(rolled, a * (1.0 - np.exp(-z * w * times) * free), atol=0.01)


def test_it_is_what_all_measurements_at_once_say(monkeypatch, rng):
    """On a straight, without the identifier: the Gaussian mean and variance from one big matrix."""
    monkeypatch.setattr(OnlineIdentifier, "outputs", property(lambda self: {}))
    trust, stiff = Localization(clip=1e6), Body(10.0, 0.3, roll=1e-9, sd_roll=1e-9)
    teller, n = lateral(trust, body=stiff), 60
    y = 0.02 * rng.standard_normal(n) + 0.3 * DT * np.arange(n)
    for k in range(n):
        told = teller.tell(Measured(k * DT, SPEED * k * DT, y[k], 0, SPEED, math.nan, 0, 0, 0))
    # x = [p, w, b], as the file says; the first sample is where the place begins.
    kept = math.exp(-DT / trust.bias_time)
    F = np.array([[1.0, DT, 0.0], [0.0, 1.0, -DT], [0.0, 0.0, kept]])
    across, change = (SPEED * trust.heading * DT) ** 2, (trust.acceleration * DT) ** 2
    Q = np.diag([across, change, trust.bias**2 * (1.0 - kept**2)])
    begun = np.diag([0.0, 1.0, trust.bias**2])
    begun = F @ begun @ F.T + Q
    begun[0, :] = begun[:, 0] = 0.0
    begun[0, 0] = trust.position**2
    powers = [np.linalg.matrix_power(F, k) for k in range(n)]
    spread = [begun]
    for _ in range(n - 1):
        spread.append(F @ spread[-1] @ F.T + Q)
    joint = np.empty((n, n, 3, 3))
    for i in range(n):
        for j in range(i + 1):
            joint[i, j] = powers[i - j] @ spread[j]
            joint[j, i] = joint[i, j].T
    S = joint[:, :, 0, 0] + trust.position**2 * np.eye(n)
    with_w = joint[n - 1, :, 1, 0]  # of w at the end with each p
    assert told.v_y == pytest.approx(with_w @ np.linalg.solve(S, y - y[0]), rel=1e-3)
    variance = joint[n - 1, n - 1, 1, 1] - with_w @ np.linalg.solve(S, with_w)
    assert told.v_y_sd == pytest.approx(math.sqrt(variance), rel=1e-3)


# In the loop.


@pytest.fixture(scope="module")
def learnt():
    """What the axle identifier learns of a v_y that is told."""
    car = DoubleTrackCar(CAR)
    state, teller, rng = car.start(SPEED), lateral(), np.random.default_rng(5)
    sensors, rows, forces = imu_and_localization(rng), [], []
    for k in range(2000):
        measured = sensors.measure(state, rng)
        rows.append(teller.tell(measured).in_place_of(measured))
        forces.append(state.axle_force)
        angle = (0.3 + k / 1500.0) * 0.05 * math.sin(0.022 * k + math.sin(0.009 * k))
        state = car.step(state, angle, SPEED)
    signals = dict(zip(Measured._fields, np.array(rows).T, strict=True))
    recording = Recording(
        name="told",
        delta_f=signals["delta"],
        delta_r=np.zeros(len(rows)),
        axle_force=np.array(forces),
        **{name: signals[name] for name in ("t", "v_x", "v_y", "r", "a_y")},
    )
    return identify(recording, CAR, AxleIdentifier.for_vehicle(CAR)).freeze()


def learning(learnt, speed, *faults, friction=None):
    identifier = OnlineIdentifier(AxleIdentifier.for_vehicle(CAR), CAR, DT, learnt)
    return drive(
        iso_3888_1(),
        DoubleTrackCar(CAR, friction=friction),
        Tracker(prediction_tire(learnt), period=DT, delay=0.06),
        speed=speed,
        sensors=FaultySensors(imu_and_localization(np.random.default_rng(4)), faults),
        delay=2,
        rng=np.random.default_rng(1),
        learner=Learner(Supervisor(identifier, prediction_tire(learnt))),
        lateral=lateral(start=learnt),
    )


def test_a_friction_that_drops_is_noticed_without_v_y_and_the_car_stays_on_its_path(learnt):
    place = 50.0
    friction = Friction(changes=(FrictionChange(scale=0.5, at_place=place),))
    run = learning(learnt, 27.5, friction=friction)
    assert run.completed
    assert np.abs(run.e_y).max() < 0.3
    dropped_at = run.t[np.argmax(place < run.X)]
    lost = [t for t, note in run.notes if note.startswith("friction lost")]
    assert 0.0 < lost[0] - dropped_at < 0.7
    assert not [note for _, note in run.notes if note.startswith("sensor fault")]


@pytest.mark.sweep("a_y*")
@pytest.mark.parametrize(
    ("channel", "kind", "size"),
    [("r", "biased", 0.06), ("v_x", "scaled", 0.8), ("a_y", "stuck", 0.0), ("delta", "stuck", 0.0)],
)
def test_a_sensor_that_breaks_is_noticed_without_v_y(learnt, channel, kind, size):
    fault = SensorFault(channel=channel, kind=kind, start=2.0, duration=math.inf, size=size)
    run = learning(learnt, 20.0, fault)
    noticed = [t for t, note in run.notes if note.startswith("sensor fault")]
    assert 2.0 <= noticed[0] < 5.0
