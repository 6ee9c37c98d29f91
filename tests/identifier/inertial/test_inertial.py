"""The inertial identifier over drives of the plant: what it tells, learns, ignores and refuses."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.random_cars import good_sensors
from identifier.axle import AxleIdentifier, AxleModel
from identifier.estimate.fit import fit
from identifier.inertial import InertialIdentifier
from identifier.methods import continuing, make_method
from identifier.run import identify, learn
from models.friction import Friction, FrictionChange
from models.recordings import RecordingError
from models.sensors import Sensor
from models.vehicle import GRAVITY, Vehicle, sedan
from tests.identifier.conftest import missed, steered

CAR = sedan()
METHOD = InertialIdentifier.for_vehicle(CAR)
NOISE = replace(good_sensors(CAR), v_y=Sensor())


def drive_of(seed=3, bank=0.0, friction=None, duration=40.0):
    return steered(
        seed, duration - 0.01, amplitude=np.radians(4.5), onset=5.0, bank=bank, friction=friction
    )


def as_shown(run):
    """What a body-fixed accelerometer and noisy sensors show; v_y is left out."""
    rng, exact = np.random.default_rng(1), run.recording()
    felt = exact.a_y + GRAVITY * np.sin(run.roll) + 0.1 + 0.15 * rng.normal(size=len(exact))
    shown = NOISE.apply(exact, rng)
    return replace(shown, a_y=felt, v_y=np.zeros(len(exact)), axle_force=None)


@pytest.fixture(scope="module")
def banked():
    """A drive on a road that banks by up to 4 degrees, as the plant ran it."""
    return drive_of(bank=lambda t: np.radians(4.0) * np.sin(2 * np.pi * t / 25.0))


@pytest.fixture(scope="module")
def history(banked):
    return identify(as_shown(banked), CAR, METHOD)


@pytest.fixture(scope="module")
def estimate():
    """What a flat drive of the car taught, with v_y."""
    return fit([drive_of(seed=5, duration=30.0).recording()], CAR).model


def errors(history, run):
    runs = history.state["running"].reshape(-1, 3)[1:, 0] > 0.5
    error = history.outputs["v_y"].ravel() - run.v_y
    return error[runs], history.outputs["v_y_sd"].ravel()[runs], runs


def alarms(history):
    fast = history.state["running"].reshape(-1, 3)[1:, 1]
    return fast > METHOD.trust.alarm


def degrees(error):
    return float(np.degrees(np.sqrt(np.mean(error**2)) / 20.0))


def test_side_slip_is_told_on_a_banked_road_with_an_honest_deviation(history, banked):
    error, sd, runs = errors(history, banked)
    assert runs.mean() > 0.99
    assert degrees(error) < 0.2 * degrees(banked.v_y) + 0.05
    assert np.mean(np.abs(error) < 2 * sd) > 0.9
    assert degrees(sd) < 4 * degrees(error)  # and not honest by knowing nothing


def test_an_accelerometer_that_is_late_by_what_is_said_is_read_in_time(estimate, banked):
    method, shown = continuing(estimate, CAR, v_y=False), as_shown(banked)
    late = replace(shown, a_y=np.roll(shown.a_y, 6))
    found = [
        degrees(errors(identify(late, CAR, one, start=estimate), banked)[0][100:])
        for one in (method, replace(method, a_y_late=0.06))
    ]
    assert found[1] < 0.8 * found[0]


def test_the_bank_of_the_road_and_the_roll_of_the_body_are_told_apart(history, banked):
    late = slice(1500, None)
    bank = history.state["motion"].reshape(-1, 7)[1:, 6]
    truth = np.radians(4.0) * np.sin(2 * np.pi * banked.t / 25.0)
    assert np.std((bank - truth)[late]) < 0.3 * np.std(truth[late])
    gradient = np.polyfit(banked.a_y, GRAVITY * banked.roll, 1)[0]
    assert history.state["sensors"][-1].ravel()[1] == pytest.approx(gradient, rel=0.4)


def test_what_is_learnt_is_nearly_as_good_as_with_a_sensor_of_v_y(history, banked):
    exact = banked.recording()
    given = learn(replace(as_shown(banked), v_y=exact.v_y), CAR, AxleIdentifier.for_vehicle(CAR))
    assert (missed(history.freeze(), exact) < 1.3 * missed(given, exact)).all()


def test_it_freezes_to_the_kind_of_model_that_an_axle_identifier_learns(history):
    model = history.freeze()
    assert isinstance(model, AxleModel)
    alpha = np.array([0.01, 0.03, 0.06])
    assert (model.band.relative_sd(alpha) < 0.7).all()  # and knows that it learnt


def test_a_recording_without_an_accelerometer_is_refused_before_it_is_learnt_on(banked):
    blind = replace(as_shown(banked), a_y=None)
    for run in (identify, learn):
        with pytest.raises(RecordingError, match="no ay, from which InertialIdentifier learns"):
            run(blind, CAR, METHOD)
    assert "a_y" not in AxleIdentifier.for_vehicle(CAR).needs
    identify(blind.between(0.0, 5.0), CAR, AxleIdentifier.for_vehicle(CAR))


def test_what_is_told_for_observed_is_so_and_nothing_is_where_nothing_is_known(history, banked):
    error, _, runs = errors(history, banked)
    seen = history.outputs["side_slip_observable"].ravel()[runs] > 0.5
    assert np.mean(np.abs(error[seen]) / 20.0 < 2 * METHOD.trust.observable) > 0.97
    slow = as_shown(banked)
    parked = identify(replace(slow, v_x=np.full(len(slow), 0.5)), CAR, METHOD)
    assert not parked.outputs["side_slip_observable"].any()
    assert np.isfinite(parked.outputs["v_y"]).all()


@pytest.mark.parametrize("tires", ["typical", "held"])
def test_half_the_grip_is_noticed_within_half_a_second_of_sliding_and_learnt(tires, estimate):
    method, start = METHOD, None
    if tires == "held":
        method, start = continuing(estimate, CAR, v_y=False), estimate
    change = FrictionChange(scale=0.5, at_time=20.0)
    run = drive_of(friction=Friction(changes=(change,)), duration=45.0)
    history = identify(as_shown(run), CAR, method, start=start)
    after = run.t > 20.0
    slides = run.t[after & (np.abs(run.a_y) > 0.95 * np.abs(run.a_y[after]).max())][0]
    assert run.t[alarms(history)][0] < slides + 0.5
    at = [np.searchsorted(run.t, t) for t in (19.9, 44.9)]
    grip = [history.state["W"][k].sum(axis=1).mean() for k in at]
    assert grip[1] < 0.8 * grip[0]
    error, sd, _ = errors(history, run)
    assert degrees(error[2500:]) < 0.3
    assert np.mean(np.abs(error[2000:]) < 2 * sd[2000:]) > 0.9


def test_a_stored_model_is_gone_on_from(history, banked):
    shown = as_shown(banked)
    again = identify(shown, CAR, METHOD, start=history.freeze())
    np.testing.assert_array_equal(again.state["W"][0], history.state["W"][-1])
    first = slice(500, 1000)
    sd = [one.outputs["v_y_sd"].ravel()[first].mean() for one in (again, history)]
    assert sd[0] < sd[1]


def test_a_model_of_another_structure_is_refused(history):
    other = replace(METHOD, ladder=(0.032, 0.128))
    with pytest.raises(ValueError, match="another structure"):
        other.setup(CAR, history.freeze())


def test_bounds_hold_whatever_is_measured(banked):
    rng, shown = np.random.default_rng(0), as_shown(banked)
    wild = replace(
        shown,
        a_y=shown.a_y + 30 * rng.normal(size=len(shown)),
        v_y=3.0 + rng.normal(size=len(shown)),
    )
    state = identify(wild, CAR, make_method("inertial", CAR)).state
    b = METHOD.bounds
    held, sensors = METHOD.certify(CAR).limits, state["sensors"].reshape(-1, 4).T
    names = "a_y_offset_g", "roll_rad_per_g", "steering_offset_rad", "yaw_rate_offset_rad_s"
    for (least, most), values in (
        ((b.least_grip, b.most_grip), state["W"].sum(axis=2)),
        ((b.least_stiffness, b.most_stiffness), (state["W"] / METHOD.ladder).sum(axis=2)),
        (held["compliance_m"], state["own"]),
        *((held[name], sensors[k]) for k, name in enumerate(names)),
    ):
        assert least <= values.min() and values.max() <= most


def test_a_tiny_body_rolls_no_faster_than_the_filter_can_follow():
    tiny = Vehicle(
        mass=0.05,
        yaw_inertia=1e-5,
        l_f=0.03,
        l_r=0.03,
        cornering_stiffness_front=3.0,
        cornering_stiffness_rear=3.0,
    )
    method = InertialIdentifier.for_vehicle(tiny)
    assert method.roll_frequency / tiny.froude_time > 60.0
    assert method.accelerometer.body(tiny).frequency == 60.0
    roll_stiffness = method.setup(tiny).constants["laws"][2]
    assert roll_stiffness == 60.0**2
