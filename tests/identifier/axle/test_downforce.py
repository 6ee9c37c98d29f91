"""A car that pushes on the road with the square of its speed: it learns the static curve."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.run import identify
from identifier.tire_model import load_model
from identifier.verdict import calibrated
from models.maneuvers import RandomSteer
from models.plant import Plant, tire_of
from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from tests.identifier.axle.test_step import assert_by_hand, disturbed
from tests.identifier.conftest import bicycle, missed

RACER = Vehicle(
    mass=900.0,
    yaw_inertia=1100.0,
    l_f=1.5,
    l_r=1.3,
    cornering_stiffness_front=9e4,
    cornering_stiffness_rear=1.1e5,
    downforce_area_front=1.6,
    downforce_area_rear=2.2,
)
LIFTING = replace(RACER, downforce_area_front=-1.6, downforce_area_rear=-0.4)
UNTOLD = replace(RACER, downforce_area_front=0.0, downforce_area_rear=0.0)
LOADS = 900.0 * 9.81 * np.array([1.3, 1.5]) / 2.8
STIFF, PEAK = np.array([9e4, 1.1e5]), 1.5 * LOADS
SLIPS = np.array([-0.06, -0.03, -0.01, 0.01, 0.03, 0.06])


def static(alpha):
    """The forces of both axles under their static loads, of slips (2,) or (k, 1)."""
    return PEAK * np.tanh(STIFF * alpha / PEAK)


def pressed(v_x, car=RACER):
    """Loads over the static ones, by the physics: ½ ρ A v²; no axle flies."""
    areas = np.array([car.downforce_area_front, car.downforce_area_rear])
    return np.maximum(1.0 + 0.5 * 1.2 * areas * np.asarray(v_x)[..., None] ** 2 / LOADS, 0.2)


@cache
def race(n=3000, phase=0.0, car=RACER):
    """A slalom while the car speeds up and brakes; forces are known exactly."""
    t = 0.01 * np.arange(n)

    def v_x(t):
        return 37.5 - 22.5 * np.cos(0.45 * t + phase)

    def delta(t):
        wave = np.sin(2 * np.pi * 0.5 * t + 3.0 * np.sin(0.3 * t))
        return 0.055 * (20.0 / (20.0 + v_x(t))) * wave

    v_y, r, force = bicycle(car, t, v_x, delta, lambda x, v: static(x) * pressed(v, car))
    return Recording(name="race", t=t, v_x=v_x(t), v_y=v_y, r=r, delta_f=delta(t),
                     delta_r=0.0 * t, axle_force=force)  # fmt: skip


def learnt(recording, car):
    return identify(recording, car, AxleIdentifier.for_vehicle(car))


@pytest.fixture(scope="module", name="drive")
def a_drive():
    return race()


@pytest.fixture(scope="module", name="run")
def a_run(drive):
    return learnt(drive, RACER)


@pytest.fixture(scope="module", name="model")
def a_model(run):
    return run.freeze()


def test_the_told_area_leaves_the_static_curve_to_learn(model, drive):
    np.testing.assert_allclose(model.force(SLIPS), static(SLIPS[:, None]), rtol=0.04)
    np.testing.assert_allclose(model.stiffness, STIFF, rtol=0.08)
    assert (missed(model, drive) < 0.03).all()
    assert (missed(model, race(phase=2.0)) < 0.03).all()
    untold = learnt(drive, UNTOLD).freeze()
    assert (missed(untold, drive) > 0.1).all()
    assert (np.abs(untold.force(SLIPS) / static(SLIPS[:, None]) - 1.0).max(axis=0) > 0.15).all()


def test_the_step_repeats_the_equations_by_hand(drive):
    recording = disturbed(drive.between(0.0, 12.0))
    hand = assert_by_hand(AxleIdentifier.for_vehicle(RACER), RACER, recording)
    assert hand.time.min() > 3.0


@pytest.mark.heavy
def test_an_axle_that_lifts_keeps_a_fifth_of_its_load():
    drive = race(n=1200, car=LIFTING)
    assert_by_hand(AxleIdentifier.for_vehicle(LIFTING), LIFTING, drive)
    assert LIFTING.load_ratio(60.0)[0] == 0.2 < LIFTING.load_ratio(20.0)[0] < 1.0
    np.testing.assert_allclose(LIFTING.load_ratio(drive.v_x), pressed(drive.v_x, LIFTING))
    longer = race(car=LIFTING)
    assert (missed(learnt(longer, LIFTING).freeze(), longer) < 0.03).all()


def test_curves_with_a_speed_are_those_of_its_load(model):
    for speed in (15.0, 40.0, 70.0):
        curve = model.force(SLIPS, v_x=speed)
        np.testing.assert_allclose(curve, model.force(SLIPS) * pressed(speed), rtol=1e-9)
        np.testing.assert_allclose(np.mean(model.band.at(SLIPS, v_x=speed), axis=0), curve)
    assert model.force(0.03, "rear") == pytest.approx(model.force(np.array([0.03]))[0, 1])
    assert "30 m/s" in model.summary()
    assert "30 m/s" not in replace(model, vehicle=UNTOLD).summary()


def test_motion_and_lag_are_those_of_the_replay(model, drive):
    """The replay holds slip by its closed form, the equations of motion are integrated here."""
    soft = replace(
        model, compliance=np.array([0.02, 0.03]), sway_share=np.zeros(2), offset=np.zeros(2)
    )
    force, slip = soft.predict(drive), soft.lagged_slip(drive)
    dynamics = ca.Function("rate", *_slip_rate(soft))
    begin, before, after = ca.SX.sym("x", 2), ca.SX.sym("before", 4), ca.SX.sym("after", 4)
    x = begin
    for share in (np.arange(20) + 0.5) / 20:
        at = (1.0 - share) * before + share * after
        x = x + drive.dt / 20 * dynamics(x, *ca.vertsplit(at))[1]
    told = dynamics(x, *ca.vertsplit(after))[0]
    sample = ca.Function("sample", [begin, before, after], [x, told])
    rows = np.stack([drive.v_y, drive.r, drive.delta_f, drive.v_x])
    _, found = sample.mapaccum(len(drive) - 1)(np.zeros(2), rows[:, :-1], rows[:, 1:])
    away = np.abs(np.array(found).T[100:] - force[101:]).max(axis=0)
    assert (away < 0.02 * np.abs(force).max(axis=0)).all()
    plain = replace(soft, vehicle=UNTOLD)
    assert np.abs(plain.lagged_slip(drive) - slip).max() > 1e-3  # more slope, a longer lag


def _slip_rate(model):
    slip, x = ca.SX.sym("slip", 2), ca.SX.sym("x", 2)
    delta, v_x = ca.SX.sym("delta"), ca.SX.sym("v_x")
    ports = [slip, x[0], x[1], delta, v_x]
    v_y, r = ca.SX.sym("v_y"), ca.SX.sym("r")
    told = model.force_expression(slip, ca.vertcat(v_y, r), delta, v_x)
    return [ports[0], v_y, r, delta, v_x], list(told)


def test_bands_hold_at_every_speed(run):
    model, other = calibrated(run), race(phase=2.0)
    half = model.band.over(other)
    inside = np.abs(model.predict(other) - other.axle_force) <= half
    fast = other.v_x > 45.0
    assert (inside[fast].mean(axis=0) > 0.85).all() and (inside[~fast].mean(axis=0) > 0.85).all()
    # The factors of a band are of ranges of speed: those of one range are compared.
    wide = model.band.half(SLIPS, v_x=60.0) / model.band.half(SLIPS, v_x=45.0)
    assert (wide > 1.05).all() and (wide < 1.8).all()
    told = model.band.slope_over(other) / model.slope_at(model.lagged_slip(other))
    np.testing.assert_allclose(told, pressed(other.v_x), rtol=1e-12)


def test_a_file_keeps_the_downforce_and_one_without_has_no_word_of_it(model, tmp_path, drive):
    model.save(tmp_path / "racer.json")
    again = load_model(tmp_path / "racer.json")
    assert again.vehicle.downforce == RACER.downforce
    np.testing.assert_array_equal(again.predict(drive), model.predict(drive))
    assert "downforce" not in str(replace(model, vehicle=UNTOLD).to_dict())


def test_the_certificate_states_no_time_of_a_drop_that_is_not_proven():
    design = AxleIdentifier.for_vehicle(RACER)
    with_downforce, without = (design.certify(car).properties for car in (RACER, UNTOLD))
    assert [one.name for one in without] == [*(one.name for one in with_downforce), "drop_time"]


def grows_with_load(tire):
    """The tire with a stiffness and a friction that hardly know of a load above the nominal one."""
    c, far = tire.coefficients, 8.0
    now, then = (np.sin(2.0 * np.arctan(1.0 / peak)) for peak in (c.PKY2, far))
    racing = replace(c, PKY1=c.PKY1 * now / then, PKY2=far, PDY2=0.0)
    return replace(tire, coefficients=racing)


def test_on_the_plant_forces_grow_as_far_as_tires_grow_with_load():
    """With roll and load transfer; a road tire gains less grip than load, and most at its peak."""
    car = replace(sedan(), downforce_area_front=2.0, downforce_area_rear=2.4)
    steer = RandomSteer(
        amplitude=0.03, frequency=0.5, seed=1, onset=0.5, rate_limit=2.0, duration=30.0
    )
    tire = tire_of(car)
    log = Plant(car, grows_with_load(tire)).simulate(steer, speed=lambda t: 15.0 + 1.5 * t)
    told, untold = (learnt(log.recording(), one).freeze() for one in (car, sedan()))
    assert log.v_x.max() > 55.0
    assert (missed(told, log.recording()) < 0.03).all()
    assert (missed(untold, log.recording()) > 2.0 * missed(told, log.recording())).all()
    road = Plant(car, tire).simulate(steer, speed=lambda t: 15.0 + 1.5 * t).recording()
    half = replace(car, downforce_area_front=1.0, downforce_area_rear=1.2)
    away = [missed(learnt(road, one).freeze(), road) for one in (car, half)]
    assert (away[1] < away[0]).all()
