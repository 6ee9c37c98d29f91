"""Recursive least squares against the batch solution of the same filtered regression."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from identifier.baselines import CurveModel, StiffnessRls
from identifier.run import identify

METHOD = StiffnessRls(cutoff=4.0, memory=3.0, prior_slip=0.002)


def batch(recording, car, method):
    """Σ w h y / Σ w h², exponentially weighted, the prior included; filters by scipy."""
    L, dt, kappa = car.wheelbase, method.dt, method.cutoff
    other = np.array([car.l_r, car.l_f])
    v_y, r, v_x = recording.v_y[:, None], recording.r[:, None], recording.v_x[:, None]
    xi = (car.mass * other * v_y + car.yaw_inertia * np.array([1, -1]) * r) / L
    alpha = recording.u - (v_y + np.array([car.l_f, -car.l_r]) * r) / v_x
    keep = np.exp(-kappa * dt)

    def low_pass(signal):
        b, a = [(1 - keep) / 2, (1 - keep) / 2], [1.0, -keep]
        settled = (1 - b[0]) * signal[:1]  # the first output is the first input
        return lfilter(b, a, signal, axis=0, zi=settled)[0]

    h = low_pass(alpha)
    y = kappa * xi - low_pass(kappa * xi - car.mass * v_x * r * other / L)
    learning = np.arange(len(recording)) * dt * kappa > 2
    h, y = h[learning], y[learning]
    weight = np.exp(-np.arange(len(h))[::-1, None] * dt / method.memory)
    prior = method.prior_slip**2 * method.memory * np.exp(-len(h) * dt / method.memory)
    told = np.array([car.cornering_stiffness_front, car.cornering_stiffness_rear])
    top = prior * told + np.sum(weight * h * y * dt, axis=0)
    return top / (prior + np.sum(weight * h**2 * dt, axis=0))


@pytest.mark.parametrize("dt", [0.01, 0.025])
def test_recursion_gives_the_weighted_batch_solution(dt, car, curve_drive):
    recording = curve_drive(
        car, lambda i, a: (8e4, 1.5e5)[i] * np.tanh(20 * a) / 20, n=round(8.0 / dt), dt=dt
    )
    method = replace(METHOD, dt=dt)
    history = identify(recording, car, method)
    online = history.state["stiffness"][-1]
    floor = METHOD.prior_slip**2 * METHOD.memory
    learning = history.state["information"][round(0.52 / dt) + 1 :]  # after half a second
    assert (learning > floor).all(), "else it is not plain weighting"
    np.testing.assert_allclose(online, batch(recording, car, method), rtol=1e-9)
    other = replace(method, memory=1.0)
    assert np.abs(online / batch(recording, car, other) - 1).max() > 0.01


def test_the_stiffness_of_a_linear_car_is_found_and_frozen(car, curve_drive, rng):
    true = np.array([8.5e4, 1.45e5])
    recording = curve_drive(car, lambda i, a: true[i] * a, amplitude=0.03, rng=rng)
    model = identify(recording, car, METHOD).freeze(99.0)
    assert isinstance(model, CurveModel)
    np.testing.assert_allclose(model.parameters[:, 0], true, rtol=0.03)
    again = identify(recording, car, METHOD, start=model)
    np.testing.assert_array_equal(again.state["stiffness"][0], model.parameters[:, 0])


LAG, OFFSET = 0.8, np.array([0.004, -0.08])  # m; rad and m/s


def read_with_offsets(recording):
    return replace(recording, delta_f=recording.delta_f - OFFSET[0], v_y=recording.v_y + OFFSET[1])


def test_stiffness_and_offsets_of_a_lagged_car_are_found(car, curve_drive, rng):
    true = np.array([8.5e4, 1.45e5])
    recording = curve_drive(
        car, lambda i, a: true[i] * a, n=6000, amplitude=0.03, rng=rng, lag=np.array([LAG, LAG])
    )
    read = read_with_offsets(recording)
    fair = replace(METHOD, relaxation_length=LAG, most_steering=0.01, most_v_y=0.2)
    model = identify(read, car, fair).freeze()
    np.testing.assert_allclose(model.parameters[:, 0], true, rtol=0.05)
    assert (np.abs(model.offset - OFFSET) < [0.001, 0.02]).all()
    np.testing.assert_array_equal(model.relaxation_length, [LAG, LAG])
    plain = identify(read, car, METHOD).freeze()
    assert np.abs(plain.parameters[:, 0] / true - 1.0).max() > 0.1, "the textbook is misled"
    again = identify(read, car, fair, start=model)
    np.testing.assert_array_equal(again.state["offset"][0], model.offset)


def test_offsets_rest_in_a_bend(car, drive):
    """A curve that saturates has an offset from a straight line that no sensor has."""
    recording = drive(n=800)
    method = StiffnessRls.for_vehicle(car)
    offset = identify(recording, car, method).state["offset"]
    keep = np.exp(-method.cutoff * method.dt)
    force = lfilter([1 - keep], [1, -keep], recording.axle_force / car.axle_loads, axis=0)
    moved = np.diff(offset, axis=0) != 0.0
    warm = recording.t > 1.0
    assert moved[(np.abs(force) < 0.05) & warm[:, None]].all()
    assert (np.abs(force) > 0.2).any(axis=0).all()
    assert not moved[np.abs(force) > 0.2].any()


def test_a_model_freezes_to_the_force_it_told(car, drive):
    recording = drive(n=600)
    history = identify(recording, car, StiffnessRls.for_vehicle(car))
    frozen = history.freeze(5.0).axle_force(recording)[500]
    np.testing.assert_allclose(frozen, history.axle_force[500], rtol=1e-3)


def test_straight_driving_forgets_nothing(car, curve_drive):
    recording = curve_drive(car, lambda i, a: 8e4 * a, n=800, amplitude=0.0)
    history = identify(recording, car, METHOD)
    np.testing.assert_array_equal(history.state["stiffness"][-1], np.array(car.bicycle)[4:])
    assert history.state["information"].min() >= METHOD.prior_slip**2 * METHOD.memory


def test_learning_rests_at_low_speed_and_force_at_rest(car, halted_drive):
    recording, rest = halted_drive
    history = identify(recording, car, METHOD)
    assert (history.axle_force[rest] == 0.0).all()
    stiffness = history.state["stiffness"]
    assert (np.diff(stiffness, axis=0)[rest] == 0.0).all()
    assert np.ptp(stiffness[:, 0]) > 0.0


def test_a_model_of_another_kind_is_refused(car, drive):
    parameters = np.array([[9e4, 0.8], [9e4, 0.8]])
    start = CurveModel(vehicle=car, curve="dugoff", parameters=parameters, min_speed=1.0)
    with pytest.raises(ValueError, match="not a linear tire"):
        identify(drive(n=20), car, METHOD, start=start)
