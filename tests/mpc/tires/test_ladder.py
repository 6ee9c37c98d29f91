"""The frozen axle model in the prediction: its curves, its lag, its offsets."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.axle import AxleIdentifier, AxleModel
from models.recordings import Recording
from mpc.prediction import build_dynamics
from mpc.realtime import Tracker
from mpc.tires import prediction_tire
from mpc.tires.tire import ALL, Car, Point

W = np.array([[0.05, 0.5, 0.5, -0.15], [0.02, 0.6, 0.6, -0.2]])


def axle_model(car, *, sway=(0.0, 0.0), offset=(0.0, 0.0), weights=W):
    design, n = AxleIdentifier.for_vehicle(car), weights.shape[1]
    return AxleModel(
        vehicle=car,
        ladder=design.ladder,
        sway=design.sway,
        plausibility=design.plausibility,
        W=weights,
        compliance=np.array([0.05, 0.06]),
        sway_share=np.array(sway),
        offset=np.array(offset),
        covariance=np.tile(np.eye(n + 3), (2, 1, 1)),
        prior_covariance=np.tile(np.eye(n + 3), (2, 1, 1)),
        excitation=np.zeros((2, 9)),
    )


def recorded(n, v_x, v_y, r, delta):
    v_x, v_y, r, delta_f = (np.broadcast_to(signal, n) for signal in (v_x, v_y, r, delta))
    t, straight = 0.01 * np.arange(n), np.zeros(n)
    return Recording(name="drive", t=t, v_x=v_x, v_y=v_y, r=r, delta_f=delta_f, delta_r=straight)


def slalom(speed=20.0):
    phase = 2.0 * np.pi * 0.7 * 0.01 * np.arange(600)
    wave = np.sin(phase)
    return recorded(600, speed, 0.5 * np.sin(phase + 0.5), 0.3 * wave, 0.05 * wave)


def standing(v_y, r, delta, speed=20.0):
    return recorded(400, speed, v_y, r, delta)


@pytest.mark.parametrize("motion", [(0.4, 0.3, 0.05), (-1.0, -0.2, -0.1), (1.5, 0.5, 0.2)])
def test_steady_forces_are_those_of_the_frozen_model(car, forces, motion):
    model = axle_model(car, offset=(0.01, 0.15))
    predicted, _ = forces(prediction_tire(model), 20.0, *(np.array([value]) for value in motion))
    expected = model.predict(standing(*motion))[-1]
    np.testing.assert_allclose(predicted[0], expected, rtol=1e-9)


def lengths(model, alpha):
    tire = prediction_tire(model)
    w = ca.SX.sym("w", tire.structure.n_weights)
    x = ca.SX.sym("x", 2)
    at = Point(0.0, 0.0, 0.0, 20.0, Car(*tire.car), w)
    pair = tire.structure.lag_length((x[0], x[1]), at)
    return np.array(ca.Function("lag", [x, w], [ca.vertcat(*pair)])(alpha, tire.weights)).ravel()


def test_the_lag_is_that_of_the_frozen_model_and_shortens_where_the_tire_slides(car):
    model = axle_model(car)
    np.testing.assert_allclose(lengths(model, [0.0, 0.0]), model.relaxation_length, rtol=1e-12)
    sliding = lengths(model, [0.2, 0.2])
    assert (sliding < 0.25 * model.relaxation_length).all()
    assert (sliding > 0.0).all()
    falling = axle_model(car, weights=np.array([[0.0, 0.8, 0.8, -0.7]] * 2))
    np.testing.assert_allclose(  # the curve falls there: the slope is held at 2 %
        lengths(falling, [0.3, 0.3]),
        0.02 * falling.relaxation_length + 0.98e-3 * car.wheelbase,
        rtol=1e-9,
    )


def followed(model, drive, fine):
    """Lagged slip after a second, by Euler steps with linear between samples, is the model's."""
    tire = prediction_tire(model)
    rates = build_dynamics(tire.structure)
    behind, slips = np.zeros(2), []
    for k in range(len(drive)):
        slips.append(behind)
        i = min(k + 1, len(drive) - 1)
        for share in np.arange(fine) / fine:
            v_x, v_y, r, delta = (
                (1 - share) * signal[k] + share * signal[i]
                for signal in (drive.v_x, drive.v_y, drive.r, drive.delta_f)
            )
            x = np.concatenate([[0.0, 0.0, v_y, r, delta], behind])
            x_dot = rates(x, 0.0, 0.0, v_x, 1e-9, tire.car, tire.weights, *ALL)
            behind = behind + 0.01 / fine * np.array(x_dot).ravel()[5:]
    found, expected = np.array(slips)[100:], model.lagged_slip(drive)[100:]
    error, size = np.abs(found - expected).max(axis=0), np.abs(expected).max(axis=0)
    assert (error < 0.03 * size).all()
    return error, size, expected


def test_lagged_slip_follows_as_in_the_frozen_model(car):
    drive = slalom()
    _, size, expected = followed(axle_model(car), drive, 5)
    kinematic = drive.alpha(car.l_f, car.l_r)[100:]  # without the lag it would show
    assert (np.abs(kinematic - expected).max(axis=0) > 0.1 * size).all()


@pytest.mark.heavy
def test_a_body_that_sways_slowly_is_a_softer_carcass(car):
    """Against the frozen model itself, whose body sways with its inertia, in steady rhythm."""
    sways, rests = (axle_model(car, sway=(k, k)) for k in (0.35, 0.0))
    t, v_x, turns = 0.01 * np.arange(1500), 25.0, 2.0 * np.pi * 0.4
    delta = 0.01 * np.sin(turns * t)
    tire, rates = prediction_tire(sways), build_dynamics(prediction_tire(sways).structure)
    x, rows, slips = np.zeros(7), [], []
    for angle in delta:  # a car on these tires: Euler at 2 ms
        x[4] = angle
        rows.append(x[2:4].copy())
        slips.append(x[5:].copy())
        for _ in range(5):
            given = (x, 0.0, 0.0, v_x, 1e-9, tire.car, tire.weights)
            x = x + 0.002 * np.array(rates(*given, *ALL)).ravel()
            x[:2] = 0.0
    v_y, r = np.array(rows).T
    drive = recorded(t.size, v_x, v_y, r, delta)
    found, late = np.array(slips)[600:], slice(600, None)
    with_sway, without = (model.lagged_slip(drive)[late] for model in (sways, rests))
    size = np.abs(with_sway).max(axis=0)
    assert (np.abs(found - with_sway).max(axis=0) < 0.04 * size).all()
    assert (np.abs(found - without).max(axis=0) > 0.05 * size).all()


def test_a_model_learnt_anew_is_other_weights_only(car):
    one, other = prediction_tire(axle_model(car)), prediction_tire(axle_model(car, weights=0.5 * W))
    assert one.structure == other.structure
    assert one.weights.size == one.structure.n_weights
    assert one.structure.lagged
    assert one.car.size == 4


@pytest.fixture(name="racer")
def a_racer(car):
    return replace(car, downforce_area_front=1.8, downforce_area_rear=-0.6)


@pytest.mark.parametrize("speed", [12.0, 35.0, 60.0])
def test_of_a_car_with_downforce_forces_are_those_of_the_frozen_model(racer, forces, speed):
    model, motion = axle_model(racer, offset=(0.01, 0.15)), (0.4, 0.3, 0.05)
    tire = prediction_tire(model)
    predicted, _ = forces(tire, speed, *(np.array([value]) for value in motion))
    expected = model.predict(standing(*motion, speed=speed))[-1]
    np.testing.assert_allclose(predicted[0], expected, rtol=1e-9)
    half = tire._replace(weights=tire.structure.at_friction(tire.weights, 0.5))
    less, _ = forces(half, speed, *(np.array([value]) for value in motion))
    slid = standing(0.4, 0.3, 0.05, speed=speed)
    np.testing.assert_allclose(less[0], model.at_friction(0.5).predict(slid)[-1], rtol=1e-9)


@pytest.mark.heavy
def test_of_a_car_with_downforce_slip_lags_as_in_the_frozen_model(racer):
    model, drive = axle_model(racer), slalom(np.linspace(15.0, 60.0, 600))
    error, _, expected = followed(model, drive, 10)
    plain = replace(model, vehicle=replace(racer, downforce_area_front=0.0, downforce_area_rear=0))
    apart = np.abs(plain.lagged_slip(drive)[100:] - expected).max(axis=0)
    assert (apart > 5.0 * error).any()


def test_caution_is_refused_for_a_car_whose_bands_are_of_static_loads(racer):
    tire = prediction_tire(axle_model(racer))
    assert Tracker(tire, period=0.05).caution == 0.0
    with pytest.raises(ValueError, match="caution must be 0 for a car with downforce"):
        Tracker(tire, caution=0.5, period=0.05)
