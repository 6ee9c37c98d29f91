"""A fit where other rooms take it: hidden units, going on learning, C, ONNX, tracker."""

from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from codegen import find_compiler
from identifier.axle import AxleIdentifier
from identifier.axle.curve import LADDER
from identifier.axle.model import begun
from identifier.estimate.fit import fit
from identifier.estimate.method import FitMethod
from identifier.estimate.model import FittedModel
from identifier.estimate.posterior import Reach
from identifier.estimate.priors import Priors
from identifier.export.onnx import onnx_bytes
from identifier.export.package import build_package
from identifier.inertial import InertialIdentifier
from identifier.methods import continuing
from identifier.motion.parameters import INDEX
from identifier.run import identify
from models.vehicle import sedan
from mpc.path.gates import iso_3888_2
from mpc.realtime import Measurement, Status, Tracker
from mpc.tires import prediction_tire
from mpc.tires.tire import DOUBT_STEP, Car, Point
from tests.shipped import Shipped
from tireid import exporting
from tireid.driving.runs import LEARNING, given_tire, make_learner
from tireid.driving.setup import Setup, SpeedWish

CAR = sedan()
PRESSED = replace(CAR, downforce_area_front=1.0, downforce_area_rear=1.2)
WIDE = (0.128, 0.256)
PRIORS = Priors.of(CAR)
COVARIANCE = np.zeros_like(PRIORS.information)
COVARIANCE[np.ix_(PRIORS.moves, PRIORS.moves)] = np.linalg.inv(
    PRIORS.information[np.ix_(PRIORS.moves, PRIORS.moves)]
)


def believed(p=PRIORS.mean, **numbers):
    """The beliefs about a sedan as a fit, some of its numbers others."""
    p = p.copy()
    for name, value in numbers.items():
        p[INDEX[name]] = value
    return FittedModel(
        vehicle=CAR,
        p=p,
        covariance=0.01 * COVARIANCE,
        reach=Reach(
            np.array([0.17, 0.12]),
            np.array([16.0, 20.0]),
            np.zeros(2),
            np.array([0.6, 0.4]) ** 2,
            1.0,
        ),
    )


@pytest.fixture(scope="module")
def drive():
    return ti.sample_recording(CAR)


@pytest.fixture(scope="module")
def fitted(drive):
    return fit([drive], CAR).model


def test_hidden_units_that_begin_with_a_fit_follow_it_to_a_percent_of_the_load(fitted):
    assert (fitted.known_slip > 0.1).all()
    for model, ladder, follows in (
        (fitted, LADDER, True),
        (believed(residual0_f=0.2), WIDE, False),
    ):
        units = begun(model, ladder)
        slips = np.linspace(-1.0, 1.0, 201)[:, None] * model.known_slip
        off = [model.force(x)[:, i] - units.force(x)[:, i] for i, x in enumerate(slips.T)]
        assert (np.abs(off[0]).max() < 0.01 * CAR.axle_loads[0]) == follows
    assert begun(units) is units


def test_sensors_are_taken_over_and_the_doubt_of_an_angle_is_that_at_the_speed_of_the_drives():
    model = believed(
        v_y_bias=0.02, v_y_angle=0.01, steering_zero=0.003, v_y_lever=0.2, steering_gain=0.1
    )
    units = begun(model)
    np.testing.assert_allclose(units.offset, [0.003, 0.02])
    assert units.sensors == (0.01, 0.2, 0.1)
    b, angle = INDEX["v_y_bias"], INDEX["v_y_angle"]
    P = model.covariance
    variance = P[b, b] + 36.0 * P[b, angle] + 18.0**2 * P[angle, angle]
    assert P[b, angle] != 0.0
    np.testing.assert_allclose(units.covariance[1, -1, -1], variance, rtol=1e-5)


def test_the_axle_identifier_goes_on_from_a_fit_with_its_doubt(fitted):
    design = continuing(fitted, CAR)
    assert isinstance(design, AxleIdentifier)
    first = design.frozen(CAR, design.setup(CAR, fitted).carry)
    units = begun(fitted)
    np.testing.assert_allclose(first.W, units.W)
    np.testing.assert_allclose(first.beside_curve, units.beside_curve)
    slips = np.array([0.02, 0.1])
    assert (first.band.relative_sd(slips) < 0.5 * design.frozen(CAR, design.setup(CAR).carry)
            .band.relative_sd(slips)).all()  # fmt: skip


def test_going_on_from_a_fit_begins_with_its_forces(fitted, drive):
    part = drive.taken(slice(2500, 2700))
    gone_on = identify(part, CAR, AxleIdentifier.for_vehicle(CAR), fitted)
    afresh = identify(part, CAR, AxleIdentifier.for_vehicle(CAR))
    errors = [
        np.sqrt(np.mean((one.axle_force[20:] - part.axle_force[20:]) ** 2))
        for one in (gone_on, afresh)
    ]
    assert errors[0] < 0.6 * errors[1]


def test_the_exported_step_of_a_fit_is_its_exact_one(fitted, drive):
    if find_compiler() is None:
        pytest.skip("needs a C compiler")
    method, part = FitMethod.for_vehicle(CAR), drive.taken(slice(2000, 3000))
    package = build_package(method, CAR, fitted, name="fit")
    assert not package.specialized.learnt
    found = Shipped.of(package).run(part)
    np.testing.assert_allclose(
        found.outputs["axle_force"], fitted.setup(0.01).output(part, "axle_force"), atol=1e-6
    )


def test_a_run_of_a_fit_is_exported_to_go_on_learning(drive, fitted, tmp_path, monkeypatch):
    monkeypatch.setattr(exporting, "measure", lambda *_: [])
    monkeypatch.setattr(exporting, "figures_text", lambda _: "")
    run = ti.identify(drive, CAR, FitMethod.for_vehicle(CAR))
    step = ti.export(run, tmp_path / "ecu").package.specialized
    assert isinstance(step.method, AxleIdentifier)
    np.testing.assert_allclose(step.carry["W"], begun(fitted).W)
    blind = ti.identify(replace(drive, v_y=None), CAR)
    assert isinstance(
        ti.export(blind, tmp_path / "imu").package.specialized.method, InertialIdentifier
    )


def test_a_fit_exports_on_another_car_by_its_loads(fitted):
    heavy = replace(CAR, mass=1.2 * CAR.mass)
    carried = FitMethod.for_vehicle(heavy).setup(heavy, fitted)
    np.testing.assert_allclose(carried.constants["loads"], 1.2 * np.array(CAR.axle_loads))


@pytest.mark.parametrize("start", [None, AxleIdentifier])
def test_sample_by_sample_nothing_but_a_fit_has_a_step(start):
    if start is not None:
        design = start.for_vehicle(CAR)
        start = design.frozen(CAR, design.setup(CAR).carry)
    with pytest.raises(ValueError, match="the method axle learns"):
        FitMethod.for_vehicle(CAR).setup(CAR, start)


def test_a_network_file_tells_curves_and_band_of_a_fit(fitted):
    runtime = pytest.importorskip("onnxruntime", reason="needs the package onnxruntime")
    session = runtime.InferenceSession(onnx_bytes(fitted, with_band=True))
    alpha = np.linspace(-0.1, 0.1, 21)
    out = session.run(None, {"alpha_f": alpha[:, None], "alpha_r": alpha[:, None]})
    loads = np.array(CAR.axle_loads)
    np.testing.assert_allclose(np.hstack(out[:2]), fitted.force(alpha), atol=1e-9 * loads.min())
    band = fitted.band.half(alpha, v_x=float(fitted.reach.speeds.mean()))
    np.testing.assert_allclose(np.hstack(out[2:]), band, rtol=1e-9)


def test_a_tracker_takes_the_errors_of_the_sensors_off():
    numbers = {"v_y_bias": 0.05, "v_y_angle": -0.02, "steering_zero": 0.004, "steering_gain": 0.03}
    model = believed(**numbers, steering_play=0.005)
    tire = prediction_tire(model)
    v_y, r, delta, v_x = 0.6, 0.3, 0.07, 25.0
    at = Point(v_y, r, delta, v_x, Car(*tire.car), tire.weights)
    true = v_y - 0.05 + 0.02 * v_x
    expected = (
        1.03 * delta + 0.004 - np.arctan((true + CAR.l_f * r) / v_x),
        -np.arctan((true - CAR.l_r * r) / v_x),
    )
    front, rear = (float(x) for x in tire.structure.slip(at))
    np.testing.assert_allclose(front, expected[0] - 0.005, atol=1e-4)
    np.testing.assert_allclose(rear, expected[1])
    slips = DOUBT_STEP * np.arange(26)
    np.testing.assert_allclose(tire.doubt.T, model.band.half(slips))


@pytest.mark.parametrize("car", [CAR, PRESSED], ids=["plain", "pressed"])
def test_a_tracker_of_a_fit_lags_and_pushes_as_the_fit_does(car):
    fit = believed(
        steering_gain=0.03,
        v_y_bias=0.05,
        v_y_angle=0.01,
        residual1_r=0.03,
        ln_road=-0.1,
        steering_play=0.015,
    )
    model = fit.mounted_on(car)
    motion, tire = model.casadi_function().dynamics, prediction_tire(model)
    v_y, r, delta, v_x, slip = -0.5, 0.2, 0.03, 20.0, (0.04, 0.02)
    x_dot, force = motion([v_y, r, *slip], delta, v_x)
    at = Point(v_y, r, delta, v_x, Car(*tire.car), tire.weights)
    pushed = [float(F) for F in tire.structure.force(slip, at)]
    np.testing.assert_allclose(pushed, np.array(force).ravel(), rtol=1e-12)
    lag = np.array([float(sigma) for sigma in tire.structure.lag_length(slip, at)])
    kinematic = np.array([float(x) for x in tire.structure.slip(at)])
    rate = v_x / lag * (kinematic - slip)
    np.testing.assert_allclose(rate, np.array(x_dot).ravel()[2:], rtol=1e-12)


def test_one_compiled_tracker_takes_any_fit(fitted):
    tires = [prediction_tire(one) for one in (fitted, believed(), fitted.at_friction(0.5))]
    tracker = Tracker(tires[0])
    built, road = tracker.instance, np.zeros(tracker.problem.horizon + 1)
    for tire in tires:
        tracker.set_tire(tire)
        command = tracker.step(Measurement(0.1, 0.0, 0.0, 0.0, road, road + 20.0))
        afresh = Tracker(tire).step(Measurement(0.1, 0.0, 0.0, 0.0, road, road + 20.0))
        assert command.status == afresh.status == Status.OK
        tracker.reset()
        assert command.steering == afresh.steering
    assert tracker.instance is built
    assert len({tire.structure for tire in tires}) == 1
    weights = tires[0].structure.at_friction(tires[0].weights, 0.5)
    np.testing.assert_allclose(weights, tires[2].weights, rtol=1e-12)


def test_who_goes_on_learning_steers_on_what_is_learnt_in_its_units(fitted):
    path = iso_3888_2()
    wish = SpeedWish(speed=16.0)
    setup = Setup(path=path, vehicle=CAR, mu=1.0, drops=(), wish=wish)
    told = given_tire(LEARNING, setup, fitted)
    learner = make_learner(fitted, CAR)
    handed = prediction_tire(learner.supervisor.identifier.model())
    assert told.structure == handed.structure
    np.testing.assert_allclose(told.weights, handed.weights)
