"""The compiled step against the equations written out in numpy, and what a run must guarantee."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import Gains
from identifier.paper.network import Network
from identifier.run import DivergedError, identify

GAINS = Gains(
    A_d=((-8.0, 1.0), (0.5, -6.0)), forgetting=5.0, eta_W=100.0, eta_V=5.0, rho_W=0.3, rho_V=0.2
)


def by_hand(recording, design, car):
    """(8), (10)-(13) in explicit Euler, written with numpy alone; forces [N] and weights."""
    p, g, dt, U = car.bicycle, design.gains, design.dt, design.force_unit
    A_d, K = g.matrix, np.array([[1 / p.m, 1 / p.m], [p.l_f / p.I_z, -p.l_r / p.I_z]])
    K_inv, scale = np.linalg.inv(K), np.array(design.network.scale)
    W, V = design.network.initial_weights(np.random.default_rng(design.seed))
    z, xi_hat, forces = np.zeros(2), K_inv @ recording.x[0] / U, []
    for x, u, v_x in zip(recording.x, recording.u, recording.v_x, strict=True):
        alpha = u - np.array([x[0] + p.l_f * x[1], x[0] - p.l_r * x[1]]) / v_x
        linear = np.array([p.C_f, p.C_r]) * alpha
        xi = K_inv @ x / U
        x_read = x if design.input_source == "measured" else U * K @ xi_hat
        x_bar = np.concatenate([x_read, u]) / scale
        sigma = np.tanh(V @ x_bar)
        f_hat, xi_t = W @ sigma, xi - xi_hat
        error = {"integral": z, "instantaneous": xi_t, "pi_lead": z + g.lead * xi_t}[design.law]
        direction = np.linalg.inv(A_d).T @ error
        if design.law == "pi_lead":  # along P of the Lyapunov equation, P = -A_d⁻ᵀ if symmetric
            direction = -solve_continuous_lyapunov(A_d.T, -2.0 * np.eye(2)) @ error
        leak = np.linalg.norm(xi_t)
        W_dot = -g.eta_W * np.outer(direction, sigma) - g.rho_W * leak * W
        V_dot = -g.eta_V * np.outer((1 - sigma**2) * (W.T @ direction), x_bar)
        V_dot -= g.rho_V * leak * V
        coriolis = K_inv @ np.array([-v_x * x[1], 0.0]) / U
        xi_hat_dot = A_d @ xi_hat + linear / U + coriolis - A_d @ xi + f_hat
        forces.append(linear + U * f_hat)
        z, xi_hat = z + dt * (-g.forgetting * z + xi_t), xi_hat + dt * xi_hat_dot
        W, V = W + dt * W_dot, V + dt * V_dot
    return np.array(forces), W, V


def assert_by_hand(recording, design, car):
    """Run both, compare forces and weights, and return the sizes of W and V."""
    history = identify(recording, car, design)
    forces, W, V = by_hand(recording, design, car)
    np.testing.assert_allclose(history.axle_force, forces, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(history.state["W"][-1], W, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(history.state["V"][-1], V, rtol=1e-9, atol=1e-10)
    return np.linalg.norm(W), np.linalg.norm(V)


@pytest.mark.sweep("inf-measured-integral", "0.5-estimated-instantaneous", "inf-estimated-pi_lead")
@pytest.mark.parametrize("law", ["integral", "instantaneous", "pi_lead"])
@pytest.mark.parametrize("source", ["measured", "estimated"])
def test_step_repeats_the_equations_by_hand(law, source, car, drive):
    gains = replace(GAINS, lead=0.2)
    design = PaperIdentifier(gains=gains, law=law, input_source=source, network=Network(hidden=6))
    assert_by_hand(drive(n=400), design, car)


def test_learnt_forces_approach_the_truth(car, drive):
    recording = drive()
    history = identify(recording, car, PaperIdentifier.for_vehicle(car))
    p = car.bicycle
    alpha_f = recording.delta_f - (recording.v_y + p.l_f * recording.r) / recording.v_x
    linear = np.sqrt(np.mean((p.C_f * alpha_f - recording.axle_force[:, 0])[-500:] ** 2))
    learnt = np.sqrt(np.mean((history.axle_force - recording.axle_force)[-500:, 0] ** 2))
    assert learnt < 0.5 * linear


def test_at_rest_learning_rests_the_filter_empties_and_the_observer_follows(car, drive):
    """Learning goes on from a clean start: no error of before the halt is left to learn from."""
    moving = drive(n=300)
    v_x = np.where((np.arange(300) < 150) | (np.arange(300) >= 200), 20.0, 0.0)
    design = PaperIdentifier.for_vehicle(car)
    history = identify(replace(moving, v_x=v_x), car, design)
    z, xi_hat, W = (history.state[name] for name in ("z", "xi_hat", "W"))
    p, (v_y, r) = car.bicycle, moving.x.T
    xi = np.column_stack([p.m * p.l_r * v_y + p.I_z * r, p.m * p.l_f * v_y - p.I_z * r])
    xi /= (p.l_f + p.l_r) * design.force_unit
    rest = slice(150, 200)  # what the carried values are after a sample at rest
    assert np.isfinite(history.axle_force).all()
    for told in (history.axle_force, history.outputs["xi_tilde"]):
        np.testing.assert_array_equal(told[rest], 0.0)
    np.testing.assert_array_equal(W[150], W[200])
    assert (np.abs(W[150] - W[100]).max() > 0.0) and (np.abs(W[300] - W[200]).max() > 0.0)
    assert np.abs(z[150]).min() > 1e-6
    np.testing.assert_array_equal(z[1:][rest], 0.0)
    assert np.abs(xi_hat[150] - xi[149]).max() > 1e-6
    np.testing.assert_allclose(xi_hat[1:][rest], xi[rest], rtol=1e-9)
    assert np.abs(z[202:]).max() > 1e-6


def test_gains_that_diverge_are_reported_not_hidden(car, drive):
    wild = replace(GAINS, eta_W=1e7, eta_V=1e7, rho_W=0.0, rho_V=0.0)
    history = identify(drive(), car, PaperIdentifier(gains=wild))
    assert history.diverged_at is not None
    with pytest.raises(DivergedError, match="the method diverged at"):
        history.freeze(14.0)


def test_a_recording_of_another_rate_is_refused(car, drive):
    with pytest.raises(ValueError, match=r"sampled at 0.02 s, the method at 0.01 s"):
        identify(drive(n=50, dt=0.02), car, PaperIdentifier(gains=GAINS))


def test_default_design_is_similar_for_a_model_car(car, model_car):
    """By Froude a 1:10 model sees the same scaled inputs: lengths over 10, times over sqrt(10)."""
    full, small = PaperIdentifier.for_vehicle(car), PaperIdentifier.for_vehicle(model_car)
    ratio = np.array(full.network.scale) / np.array(small.network.scale)
    np.testing.assert_allclose(ratio, [np.sqrt(10), 1 / np.sqrt(10), 1.0, 1.0])
    assert full.force_unit == 1000.0
    assert small.force_unit == 1.0


@pytest.mark.parametrize("law", ["integral", "instantaneous", "instantaneous_scaled", "pi_lead"])
@pytest.mark.parametrize("signal", ["v_x", "v_y", "r", "delta_f"])
@pytest.mark.parametrize("size", [-1e3, 1e3, 9e3])
def test_a_spike_is_not_learnt_from(car, drive, law, signal, size):
    """One impossible sample changes neither weights nor what is said one second later."""
    recording = drive(n=400)
    spoilt = getattr(recording, signal).copy()
    spoilt[200] += size
    design = PaperIdentifier.for_vehicle(car, law=law)
    clean = identify(recording, car, design)
    history = identify(replace(recording, **{signal: spoilt}), car, design)
    assert np.isfinite(history.axle_force).all()
    assert history.diverged_at is None
    np.testing.assert_array_equal(history.axle_force[200], 0.0)
    np.testing.assert_allclose(history.axle_force[300:], clean.axle_force[300:], atol=150.0)


def test_weights_keep_their_forces_in_a_design_of_another_force_unit(car, drive):
    recording = drive(n=600)
    design = PaperIdentifier.for_vehicle(car)
    model = identify(recording, car, design).freeze(5.0)
    other = replace(design, force_unit=4.0 * design.force_unit)
    start = identify(recording, car, other, start=model).freeze(float(recording.t[0]))
    expected = model.predict(recording)
    assert np.abs(expected).max() > 100.0
    np.testing.assert_allclose(start.predict(recording), expected, rtol=1e-9, atol=1e-6)
