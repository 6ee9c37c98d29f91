"""Estimators that never read v_y, against textbooks in numpy, and over drives that are known."""

from dataclasses import fields, replace
from functools import partial

import casadi as ca
import numpy as np
import pytest

from identifier.method import CannotFreezeError
from identifier.methods import make_method
from identifier.run import identify
from identifier.tire_model import load_model
from models.bicycle import BicycleParameters, bicycle
from models.recordings import RecordingError
from models.vehicle import Vehicle
from tests.identifier.conftest import felt
from tests.rivals import INSTALLED, REASON

if not INSTALLED:
    pytest.skip(REASON, allow_module_level=True)

from tireid_rivals import NAMES, HorizonEstimator, SlipFilter, Washout
from tireid_rivals.horizon import LONGEST, build_stage
from tireid_rivals.slip_filter import LIMITS, TIRES, Numbers
from tireid_rivals.without_v_y import expected, predicted

linear_kf = partial(SlipFilter.for_vehicle, tire="linear")
joint_ekf = partial(SlipFilter.for_vehicle, tire="dugoff")
LEARNING = ("joint_ekf", "mhe")


def short_horizon(car, *, dt=0.01, samples=8, **numbers):
    return HorizonEstimator(filter=joint_ekf(car, dt=dt), window=samples * dt, **numbers)


MAKE = {
    "linear_kf": linear_kf,
    "joint_ekf": joint_ekf,
    "washout": Washout.for_vehicle,
    "mhe": short_horizon,
}


def told(method, recording, car, **signals):
    """All that a step tells and carries, with some signals replaced."""
    setup = method.setup(car)
    shown = setup.shown(recording)
    return setup.scan(shown.samples, {**setup.carry, **shown.signals, **signals, **setup.constants})


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


@pytest.mark.parametrize("name", [*NAMES, "axle"])
def test_no_bit_depends_on_v_y_of_the_recording(name, car, drive, rng):
    recording = felt(drive(n=200))
    method = MAKE[name](car) if name in MAKE else make_method(name, car)
    as_it_is = told(method, recording, car)
    for wrong in (np.full(200, np.nan), rng.permutation(recording.v_y), 1e3 * recording.v_y):
        x = np.column_stack([wrong, recording.r])
        other = told(method, recording, car, x=x)
        same = all(np.array_equal(value, other[port]) for port, value in as_it_is.items())
        assert same == (name != "axle"), "the axle identifier reads it, and this test would see"


@pytest.mark.parametrize("name", NAMES)
def test_every_signal_that_a_car_without_the_sensor_has_is_read(name, car, drive):
    recording, method = felt(drive(n=200)), MAKE[name](car)
    v_y = told(method, recording, car)["v_y"]
    for port, value in (
        ("x", np.column_stack([recording.v_y, 1.1 * recording.r])),
        ("a_y", 1.1 * recording.a_y),
        ("v_x", 1.1 * recording.v_x),
        ("u", 1.1 * recording.u),
    ):
        if (name, port) != ("washout", "u"):  # of which it reads the rear, that is not steered
            assert np.abs(told(method, recording, car, **{port: value})["v_y"] - v_y).max() > 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_a_log_without_an_accelerometer_is_refused(name, car, drive):
    with pytest.raises(RecordingError, match="there is no ay"):
        identify(drive(n=50), car, MAKE[name](car))


@pytest.mark.parametrize("name", NAMES)
def test_a_sample_without_a_y_is_no_end(name, car, drive):
    recording, method = felt(drive(n=400)), MAKE[name](car)
    gaps = np.where(np.arange(400) % 7 == 3, np.nan, recording.a_y)
    clean, broken = (told(method, recording, car, a_y=a_y) for a_y in (recording.a_y, gaps))
    assert np.isfinite(broken["v_y"]).all() and np.isfinite(broken["axle_force"]).all()
    errors = [rms(one["v_y"].ravel() - recording.v_y) for one in (clean, broken)]
    assert errors[1] < 1.5 * errors[0] + 0.01


def test_the_linear_filter_is_that_of_the_textbook(car, drive):
    recording, method = felt(drive(n=300)), linear_kf(car)
    history = identify(recording, car, method)
    p, dt, v = car.bicycle, 0.01, 20.0
    model = bicycle(p, v)
    A, B = np.array(ca.DM(model.A)), np.array(ca.DM(model.B))
    H = np.array([[0.0, 1.0], A[0] + [0.0, v]])  # a_y = dv_y/dt + v_x r
    D = np.array([[0.0, 0.0], B[0]])
    half = np.linalg.inv(np.eye(2) - dt / 2 * A)  # Tustin's rule
    F, G = half @ (np.eye(2) + dt / 2 * A), dt * half @ B
    Q = np.diag([method.v_y_disturbance, method.r_disturbance]) ** 2 * dt
    R = np.diag([method.r_noise, method.a_y_noise]) ** 2
    y = np.column_stack([recording.r, recording.a_y])
    r, u = recording.r[0], recording.u
    lean = p.m * v * r * p.l_f / (p.l_f + p.l_r) / p.C_r
    x, P = (
        np.array([p.l_r * r - v * lean, r]),
        np.diag([method.start_slip * v, method.r_noise]) ** 2,
    )
    for k in range(1, 300):
        x, P = F @ x + G @ (u[k - 1] + u[k]) / 2, F @ P @ F.T + Q
        S = H @ P @ H.T + R
        gain = P @ H.T @ np.linalg.inv(S)
        x, P = x + gain @ (y[k] - H @ x - D @ u[k]), (np.eye(2) - gain @ H) @ P
        assert history.outputs["v_y"][k, 0] == pytest.approx(x[0], rel=1e-9, abs=1e-12)
        assert history.outputs["v_y_sd"][k, 0] == pytest.approx(np.sqrt(P[0, 0]), rel=1e-9)


def test_the_washout_solves_its_equation(car, drive):
    recording, method = felt(drive(n=600)), Washout(cutoff=2.0)
    found = identify(recording, car, method).outputs["v_y"].ravel()
    p, fine = car.bicycle, 50
    t = np.arange(0.0, recording.t[-1], 0.01 / fine)
    a_y, r = (np.interp(t, recording.t, signal) for signal in (recording.a_y, recording.r))
    steady = r * (p.l_r - 20.0**2 * p.m * p.l_f / (p.l_f + p.l_r) / p.C_r)
    v, coarse = steady[0], []
    for k in range(t.size):
        if k % fine == 0:
            coarse.append(v)
        v += 0.01 / fine * (a_y[k] - 20.0 * r[k] + 2.0 * (steady[k] - v))
    assert rms(found[: len(coarse)] - coarse) < 0.03 * rms(coarse)


def test_a_washout_forgets_a_bias_but_for_its_time_constant(car, drive):
    recording = felt(drive(n=1500))
    wrong = replace(recording, a_y=recording.a_y + 0.5)
    for cutoff in (1.0, 4.0):
        clean, biased = (
            identify(one, car, Washout(cutoff=cutoff)).outputs["v_y"].ravel()[-1]
            for one in (recording, wrong)
        )
        assert biased - clean == pytest.approx(0.5 / cutoff, rel=1e-3)


def least_squares(method, car, y, u, v, start, iterations):
    """Return the end of the trajectory that minimizes the cost over all samples, by dense solves.

    The road is another one than that of the estimator: one system of equations in all unknowns,
    Jacobians by differences.
    """
    numbers = Numbers(*(getattr(method, name) for name in Numbers._fields))
    p, tire, dt = BicycleParameters(*car.bicycle), TIRES["dugoff"], method.dt
    z, w = ca.SX.sym("z", 6), ca.SX.sym("w", 2)
    step = ca.Function("f", [z, w], [predicted(tire, p, numbers.friction, z, v, w, dt)])
    shows = ca.Function("h", [z, w], [expected(tire, p, numbers.friction, z, v, w)])
    mean, P = start
    W_a = np.linalg.inv(np.linalg.cholesky(P))
    walks = [numbers.v_y_disturbance, numbers.r_disturbance, *[numbers.walk] * 4]
    W_q = 1.0 / (np.array(walks) * np.sqrt(dt))
    W_r = 1.0 / np.array([numbers.r_noise, numbers.a_y_noise])
    n = len(y)

    def residuals(flat):
        zs = flat.reshape(n, 6)
        found = [W_a @ (zs[0] - mean)]
        for k in range(1, n):
            ahead = np.array(step(zs[k - 1], (u[k - 1] + u[k]) / 2)).ravel()
            found += [W_q * (zs[k] - ahead), W_r * (y[k] - np.array(shows(zs[k], u[k])).ravel())]
        return np.concatenate(found)

    flat = np.tile(mean, n)
    for _ in range(iterations):
        e = residuals(flat)
        J = np.column_stack([(residuals(flat + 1e-6 * d) - e) / 1e-6 for d in np.eye(flat.size)])
        flat = flat - np.linalg.lstsq(J, e, rcond=None)[0]
    return flat[-6:]


@pytest.mark.heavy
def test_the_horizon_minimizes_its_cost(car, drive):
    recording = felt(drive(n=12, amplitude=1.2))
    method = short_horizon(car, samples=12, iterations=10)
    history = identify(recording, car, method)
    joint = method.filter
    first = history.state["estimate"][1].ravel()
    spread = [joint.start_slip * 20.0, joint.r_noise, *[joint.stiffness_spread] * 2]
    P = np.diag([*spread, *[joint.friction_spread] * 2]) ** 2
    y = np.column_stack([recording.r, recording.a_y])
    best = least_squares(joint, car, y, recording.u, 20.0, (first, P), iterations=10)
    found = history.state["estimate"][-1].ravel()
    np.testing.assert_allclose(found, best, rtol=1e-3, atol=1e-5)
    assert np.abs(best - first).max() > 0.02, "it has learnt something, and begins elsewhere"
    filtered = identify(recording, car, joint).state["estimate"][-1].ravel()
    assert np.abs(filtered - best).max() > 20 * np.abs(found - best).max(), "a filter does not"


def test_a_sample_that_does_not_count_leaves_a_stage_as_it_is(car, rng):
    method, stage = joint_ekf(car), build_stage()
    A = rng.normal(size=(6, 6))
    z, P = rng.normal(size=6), A @ A.T
    values = [np.zeros(6), np.zeros(6), np.zeros(7), [0, 1, 0.1, 0, 20.0, 0.3, 4.0]]
    known = [car.bicycle, [0.01, 1.0], [getattr(method, name) for name in Numbers._fields]]
    for counts in (0, 1):
        values[-1][0] = counts
        after = stage(z, P, *values, *known)
        np.testing.assert_array_equal(np.allclose(np.array(after[0]).ravel(), z), not counts)
        np.testing.assert_array_equal(np.allclose(np.array(after[1]), P), not counts)


@pytest.mark.parametrize("name", NAMES)
def test_side_slip_of_a_known_drive_is_told(name, car, drive):
    recording = felt(drive(n=1500, amplitude=0.012))
    method = MAKE[name](car)
    if name == "washout":  # nothing banks and nothing is biased here
        method = replace(method, cutoff=0.5)
    history = identify(recording, car, method)
    error = history.outputs["v_y"].ravel() - recording.v_y
    assert rms(error) < 0.25 * rms(recording.v_y)


@pytest.mark.parametrize("name", LEARNING)
def test_tires_are_learnt_where_the_vehicle_file_is_wrong(name, car, drive):
    recording = felt(drive(n=1500))
    wrong = replace(car, cornering_stiffness_front=1.8e5, cornering_stiffness_rear=0.9e5)
    history = identify(recording, wrong, MAKE[name](wrong))
    linear = identify(recording, wrong, linear_kf(wrong))
    late = slice(750, None)
    errors = [rms((run.outputs["v_y"].ravel() - recording.v_y)[late]) for run in (history, linear)]
    assert errors[0] < 0.5 * errors[1]
    model = history.freeze()
    stated = identify(recording, wrong, make_method("linear", wrong)).freeze()
    missed = [rms(one.predict(recording) - recording.axle_force) for one in (model, stated)]
    assert missed[0] < 0.4 * missed[1]


@pytest.mark.parametrize("name", LEARNING)
def test_what_is_learnt_is_written_read_and_gone_on_from(name, car, drive, tmp_path):
    recording, method = felt(drive(n=600)), MAKE[name](car)
    model = identify(recording, car, method).freeze()
    model.save(tmp_path / "tires.json")
    start = load_model(tmp_path / "tires.json")
    theta = method.setup(car, start).carry["estimate"].ravel()[2:]
    learnt = identify(recording, car, method).state["estimate"][-1].ravel()[2:]
    np.testing.assert_allclose(theta, learnt, rtol=1e-12)
    with pytest.raises(ValueError, match="not a curve 'dugoff'"):
        method.setup(car, identify(recording, car, make_method("magic_formula_ekf", car)).freeze())


@pytest.mark.parametrize("name", sorted(set(NAMES) - set(LEARNING)))
def test_without_a_tire_to_learn_nothing_is_frozen_or_begun_with(name, car, drive):
    recording, method = felt(drive(n=100)), MAKE[name](car)
    with pytest.raises(CannotFreezeError, match="lateral velocity, not a tire"):
        identify(recording, car, method).freeze()
    with pytest.raises(ValueError, match="cannot begin with a stored model"):
        method.setup(car, identify(recording, car, make_method("linear", car)).freeze())


@pytest.mark.parametrize("name", NAMES)
def test_a_similar_model_car_is_told_the_same(name, car, drive):
    """Lengths by 1/s, times and speeds by sqrt(1/s): v_y comes out by sqrt(1/s)."""
    s, recording = 10.0, felt(drive(n=600))
    small = Vehicle(
        mass=car.mass / s**3, yaw_inertia=car.yaw_inertia / s**5, l_f=car.l_f / s, l_r=car.l_r / s,
        cornering_stiffness_front=car.cornering_stiffness_front / s**3,
        cornering_stiffness_rear=car.cornering_stiffness_rear / s**3,
    )  # fmt: skip
    root = np.sqrt(s)
    shrunk = replace(
        recording, t=recording.t / root, v_x=recording.v_x / root, v_y=recording.v_y / root,
        r=recording.r * root, axle_force=recording.axle_force / s**3,
    )  # fmt: skip
    large = identify(recording, car, MAKE[name](car)).outputs["v_y"]
    like = identify(shrunk, small, MAKE[name](small, dt=shrunk.dt)).outputs["v_y"]
    np.testing.assert_allclose(like * root, large, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", LEARNING)
def test_an_estimate_that_is_none_begins_anew_and_keeps_what_is_learnt(name, car, drive):
    recording, method = felt(drive(n=600)), MAKE[name](car)
    mad = np.where(np.abs(np.arange(600) - 300) < 20, 90.0, recording.a_y)
    soft = {"a_y_noise": 0.05, "outlier": 1e3}
    method = (
        replace(method, filter=replace(method.filter, **soft))
        if name == "mhe"
        else replace(method, **soft)
    )
    history = identify(replace(recording, a_y=mad), car, method)
    assert np.isfinite(history.outputs["v_y"]).all()
    assert (np.abs(history.outputs["v_y"].ravel()) <= 0.7 * recording.v_x + 1e-9).sum() > 560
    theta = history.state["estimate"].reshape(601, -1)[:, 2:]
    assert (np.abs(theta) <= np.array(LIMITS[: theta.shape[1]])).all()
    stopped = history.state["running"].ravel() < 0.5
    assert stopped[280:330].any() and not stopped[350:].any()


@pytest.mark.parametrize("name", NAMES)
def test_at_standstill_nothing_moves_and_slowly_it_turns_steadily(name, car, drive):
    recording = felt(drive(n=100))
    still = identify(replace(recording, v_x=np.zeros(100)), car, MAKE[name](car))
    assert not still.outputs["v_y"].any() and not still.axle_force.any()
    if name != "washout":  # which integrates, however slow the car
        slow = identify(replace(recording, v_x=np.full(100, 2.0)), car, MAKE[name](car))
        assert np.abs(slow.outputs["v_y"]).max() < np.abs(car.l_r * recording.r).max() + 0.01


def test_numbers_that_make_no_filter_are_refused(car):
    method = joint_ekf(car)
    numbers = {one.name for one in fields(SlipFilter)} - {"tire"}
    for name in numbers - {"learning_speed"}:
        with pytest.raises(ValueError, match=f"{name} must be positive and finite, it is -1"):
            replace(method, **{name: -1.0})
    with pytest.raises(ValueError, match="tire must be one of"):
        replace(method, tire="brush")
    with pytest.raises(ValueError, match="a horizon needs tires to learn, not 'linear' ones"):
        HorizonEstimator(filter=linear_kf(car), window=0.5)
    for window in (0.001, 0.01 * (LONGEST + 1)):
        with pytest.raises(ValueError, match="samples must lie between 1 and"):
            HorizonEstimator(filter=method, window=window)
    with pytest.raises(ValueError, match="iterations must lie between 1 and 10"):
        HorizonEstimator(filter=method, window=0.1, iterations=0)
