"""The rivals of benchmarks/rivals, against textbooks in numpy, and over drives that are known."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.method import CannotFreezeError
from identifier.methods import RIVALS, make_method
from identifier.run import identify
from models.bicycle import bicycle
from models.recordings import RecordingError
from tests.identifier.baselines.conftest import MAGIC, magic, simulate
from tests.identifier.conftest import felt, missed
from tests.rivals import INSTALLED, REASON

if not INSTALLED:
    pytest.skip(REASON, allow_module_level=True)

from tireid_rivals import NAMES, magic_formula_ekf, textbook_ekf

LAG, OFFSET = np.array([0.9, 0.6]), np.array([0.004, -0.08])  # m; rad and m/s


def told(method, recording, car, **signals):
    """All that a step tells and carries, with some signals replaced."""
    setup = method.setup(car)
    sampled = setup.sampled(recording)
    return setup.scan(
        sampled.samples, {**setup.carry, **sampled.signals, **signals, **setup.constants}
    )


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


def test_lag_and_offsets_are_found_on_a_car_that_has_them(car, rng):
    """The car drives on its lagged tires; its steering and v_y are read with offsets."""
    recording = simulate(car, magic, n=6000, rng=rng, lag=LAG)
    read = replace(recording, delta_f=recording.delta_f - OFFSET[0], v_y=recording.v_y + OFFSET[1])
    found = identify(read, car, magic_formula_ekf(car)).freeze()
    np.testing.assert_allclose(found.relaxation_length, LAG, rtol=0.15)
    assert (np.abs(found.offset - OFFSET) < [0.001, 0.02]).all()
    np.testing.assert_allclose(found.parameters[:, 2], MAGIC[:, 2], rtol=0.06)
    plain = identify(read, car, textbook_ekf(car)).freeze()
    assert missed(found, read).max() < 0.03
    assert missed(plain, read).max() > 3.0 * missed(found, read).max()


@pytest.mark.parametrize("name", [*NAMES, "axle"])
def test_no_bit_depends_on_v_y_of_the_recording(name, car, drive, rng):
    recording, method = felt(drive(n=200)), make_method(name, car)
    as_it_is = told(method, recording, car)
    for wrong in (np.full(200, np.nan), rng.permutation(recording.v_y), 1e3 * recording.v_y):
        x = np.column_stack([wrong, recording.r])
        other = told(method, recording, car, x=x)
        same = all(np.array_equal(value, other[port]) for port, value in as_it_is.items())
        assert same == (name != "axle"), "the axle identifier reads it, and this test would see"


@pytest.mark.parametrize("name", NAMES)
def test_a_log_without_an_accelerometer_is_refused(name, car, drive):
    with pytest.raises(RecordingError, match="there is no ay"):
        identify(drive(n=50), car, make_method(name, car))


def test_the_linear_filter_is_that_of_the_textbook(car, drive):
    recording, method = felt(drive(n=300)), make_method("linear_kf", car)
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
    x = np.array([p.l_r * r - v * lean, r])
    P = np.diag([method.start_slip * v, method.r_noise]) ** 2
    for k in range(1, 300):
        x, P = F @ x + G @ (u[k - 1] + u[k]) / 2, F @ P @ F.T + Q
        S = H @ P @ H.T + R
        gain = P @ H.T @ np.linalg.inv(S)
        x, P = x + gain @ (y[k] - H @ x - D @ u[k]), (np.eye(2) - gain @ H) @ P
        assert history.outputs["v_y"][k, 0] == pytest.approx(x[0], rel=1e-9, abs=1e-12)
        assert history.outputs["v_y_sd"][k, 0] == pytest.approx(np.sqrt(P[0, 0]), rel=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_side_slip_of_a_known_drive_is_told(name, car, drive):
    recording = felt(drive(n=1500, amplitude=0.012))
    history = identify(recording, car, make_method(name, car))
    error = history.outputs["v_y"].ravel() - recording.v_y
    assert rms(error) < 0.25 * rms(recording.v_y)


def test_tires_are_learnt_where_the_vehicle_file_is_wrong(car, drive):
    recording = felt(drive(n=1500))
    wrong = replace(car, cornering_stiffness_front=1.8e5, cornering_stiffness_rear=0.9e5)
    joint, linear = (identify(recording, wrong, make_method(name, wrong))
                     for name in ("joint_ekf", "linear_kf"))  # fmt: skip
    late = slice(750, None)
    errors = [rms((run.outputs["v_y"].ravel() - recording.v_y)[late]) for run in (joint, linear)]
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.parametrize("name", RIVALS)
def test_all_begin_afresh(name, car, drive):
    stored = identify(felt(drive(n=100)), car, make_method("linear", car)).freeze()
    with pytest.raises(ValueError, match=r"goes on from|cannot begin with a stored model"):
        make_method(name, car).setup(car, stored)


@pytest.mark.parametrize("name", NAMES)
def test_what_estimates_side_slip_freezes_no_tire(name, car, drive):
    with pytest.raises(CannotFreezeError, match="lateral velocity, not a tire"):
        identify(felt(drive(n=100)), car, make_method(name, car)).freeze()
