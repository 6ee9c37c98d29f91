"""Every law's compiled step against numpy, and what a run, a freeze and a design must guarantee."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.paper.design import PaperIdentifier
from identifier.paper.network import Network, natural_network
from identifier.regression import LAWS, RegressionIdentifier
from identifier.regression.laws import WORTH
from identifier.reproducibility import online_error, replay
from identifier.run import identify


def small_design(vehicle, law, dt=0.01):
    """The design for a vehicle, small so that it compiles fast."""
    network = natural_network(vehicle, hidden=6)
    return RegressionIdentifier.for_vehicle(vehicle, law=law, network=network, memory=8, dt=dt)


def forget_by_hand(law, P, s, keep, bound):
    if law == "rls_exponential":
        return P / keep
    if law == "rls_bounded_trace":
        return P * min(1 / keep, max(1.0, bound / np.trace(P)))
    seen = P @ s
    growth = np.outer(seen, seen) / (s @ seen)
    return P + min(1 / keep - 1, max(0.0, bound - np.trace(P)) / np.trace(growth)) * growth


def learn_by_hand(s, y, d):
    """W after each pair (n + 1, 2, n_h), written with numpy alone, one law after the other."""
    n_h, dt, eye = s.shape[1], d.dt, np.eye(s.shape[1])
    W, Omega, Y, P = np.zeros((2, n_h)), 0 * eye, np.zeros((2, n_h)), eye / d.ridge
    S, Z = np.zeros((n_h, d.memory)), np.zeros((2, d.memory))
    keep, share, weight = (
        np.exp(-d.forgetting * dt),
        -np.expm1(-d.learning_rate * dt),
        1 / d.filter_rate,
    )
    out = [W]
    for sk, yk in zip(s, y, strict=True):
        if np.mean(sk**2) < d.quiet**2 or not sk.any():
            out.append(W)
            continue
        if d.law.startswith("rls"):
            gain = dt * P @ sk / (1 + dt * sk @ P @ sk)
            W = W + np.outer(yk - W @ sk, gain)
            P = np.linalg.inv(np.linalg.inv(P) + dt * np.outer(sk, sk))
            P = forget_by_hand(d.law, P, sk, keep, n_h / d.ridge)
        else:
            if d.law.startswith("kreisselmeier"):
                Omega = keep * Omega + dt * np.outer(sk, sk)
                Y = keep * Y + dt * np.outer(yk, sk)
            else:
                S, Z = S * np.sqrt(keep), Z * np.sqrt(keep)
                Omega = weight * (S @ S.T + np.outer(sk, sk))
                Y = weight * (Z @ S.T + np.outer(yk, sk))
                volume = [
                    np.linalg.det(weight * T @ T.T + d.ridge * eye)
                    for T in [
                        S,
                        *(
                            np.where(np.arange(d.memory) == j, sk[:, None], S)
                            for j in range(d.memory)
                        ),
                    ]
                ]
                j = int(np.argmax(volume[1:]))
                if volume[j + 1] > WORTH * volume[0]:
                    S, Z = S.copy(), Z.copy()
                    S[:, j], Z[:, j] = sk, yk
            A = Omega + d.ridge * eye
            newton = d.law.endswith("newton")
            W = W - share * (W - Y @ np.linalg.inv(A) if newton else (W @ A - Y) / np.trace(A))
        W = W * min(1.0, d.W_max / max(np.linalg.norm(W), 1e-300))
        out.append(W)
    return np.array(out)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("dt", [0.01, 0.04])
def test_the_compiled_step_repeats_the_equations_by_hand(law, dt, car, drive, design, pairs):
    chosen, recording = design(law, quiet=0.1, W_max=2.5, dt=dt), drive(n=300, dt=dt)
    history = identify(recording, car, chosen)
    expected = learn_by_hand(*pairs(recording, chosen, car), chosen)
    np.testing.assert_allclose(history.state["W"], expected, rtol=1e-6, atol=1e-7)
    assert np.linalg.norm(expected[-1]) > 0.5
    wrong = learn_by_hand(*pairs(recording, chosen, car), replace(chosen, ridge=2e-3))
    assert np.abs(wrong[-1] - expected[-1]).max() > 1e-5  # a wrong number does not pass


@pytest.mark.parametrize("law", LAWS)
def test_better_than_the_integral_law_online_and_frozen(law, car, drive):
    """With networks of the same size, though the integral law learns the hidden layer too."""
    recording, errors = drive(n=2000), []
    for chosen in (
        RegressionIdentifier.for_vehicle(car, law=law),
        PaperIdentifier.for_vehicle(car),
    ):
        history = identify(recording, car, chosen)
        frozen = replay(history.freeze(recording.t[-1]), history).against_truth
        errors.append(np.array([online_error(history).both, frozen.both]))
    assert (errors[0] < 0.75 * errors[1]).all()


@pytest.mark.parametrize("law", LAWS)
def test_at_rest_and_straight_ahead_nothing_is_learnt(law, car, drive):
    moving, k = drive(n=400), np.arange(400)
    chosen = small_design(car, law)
    stopped = identify(replace(moving, v_x=np.where(k < 200, 20.0, 0.0)), car, chosen)
    straight = {
        name: np.where(k < 100, getattr(moving, name), 0.0) for name in ("v_y", "r", "delta_f")
    }
    quiet = identify(replace(moving, **straight), car, chosen)
    for name in stopped.state:
        if name not in ("target_lag", "regressor_lag", "fresh"):
            np.testing.assert_array_equal(stopped.state[name][200], stopped.state[name][-1])
            np.testing.assert_array_equal(quiet.state[name][300], quiet.state[name][-1])
    assert np.abs(stopped.state["W"][200] - stopped.state["W"][100]).max() > 0.0
    np.testing.assert_array_equal(stopped.axle_force[200:], 0.0)


@pytest.mark.parametrize("law", LAWS)
def test_wild_samples_leave_forces_finite_and_weights_in_their_ball(law, car, drive, rng):
    recording = drive(n=600)
    v_y, r = recording.v_y.copy(), recording.r.copy()
    v_y[rng.integers(0, 600, 10)], r[rng.integers(0, 600, 10)] = 1e3, -1e3
    v_x = np.where(np.arange(600) // 50 == 7, 0.0, recording.v_x)
    chosen = small_design(car, law)
    history = identify(replace(recording, v_y=v_y, r=r, v_x=v_x), car, chosen)
    assert np.isfinite(history.axle_force).all()
    norms = np.linalg.norm(history.state["W"], axis=(1, 2))
    assert norms.max() <= chosen.W_max * (1 + 1e-12)


def test_true_forces_are_not_looked_at(car, drive, design):
    one, other = (identify(drive(n=200, scale=scale), car, design()) for scale in (1.0, -3.0))
    np.testing.assert_array_equal(one.axle_force, other.axle_force)


def test_the_online_force_is_that_of_the_weights_before_the_sample(car, drive, design):
    history = identify(drive(n=300), car, design())
    for k in (100, 250):
        frozen = history.freeze(history.recording.t[k]).axle_force(history.recording)
        np.testing.assert_allclose(frozen[k], history.axle_force[k], rtol=1e-12)
        assert np.abs(frozen[k + 20] - history.axle_force[k + 20]).max() > 1.0


@pytest.mark.parametrize("law", LAWS)
def test_learning_goes_on_from_stored_weights_and_falls_back_to_them(law, car, drive, design):
    """Begun at a good model, and told to trust it, every law stays at its weights."""
    stored = identify(drive(n=800), car, design(seed=4)).freeze(7.99)
    chosen = design(law, ridge=1e6)
    history = identify(drive(n=200), car, chosen, start=stored)
    np.testing.assert_allclose(history.state["W"][-1], stored.weights.W, rtol=1e-3)
    np.testing.assert_array_equal(history.state["V"][-1], stored.weights.V)
    other = replace(stored, force_unit=stored.force_unit / 2)
    begun = identify(drive(n=200), car, chosen, start=other).state["W"][0]
    np.testing.assert_allclose(begun, stored.weights.W / 2)


def test_stored_weights_of_another_structure_are_refused(car, drive, design):
    stored = identify(drive(n=50), car, design()).freeze(0.3)
    wider = design(network=Network(hidden=7))
    with pytest.raises(ValueError, match="another structure"):
        identify(drive(n=50), car, wider, start=stored)


def test_slip_angles_as_input_carry_over_to_another_speed_better_than_the_state(car, drive):
    """v_x is inside them. The middle one of three hidden layers, at 25 m/s learnt at 20 m/s."""
    slow, fast, middle = drive(n=2000), drive(n=800, speed=25.0), []
    for inputs in (("alpha_f", "alpha_r"), Network().inputs):
        network, errors = Network(hidden=8, inputs=inputs), []
        for seed in range(3):
            chosen = RegressionIdentifier.for_vehicle(car, network=network, seed=seed)
            model = identify(slow, car, chosen).freeze(slow.t[-1])
            errors.append(np.sqrt(np.mean((model.axle_force(fast) - fast.axle_force) ** 2)))
        middle.append(np.median(errors))
    assert middle[0] < 0.8 * middle[1]


def test_impossible_numbers_are_refused(design):
    with pytest.raises(ValueError, match="law must be one of"):
        design("magic")
    for name, value in (
        ("ridge", 0.0),
        ("filter_rate", float("nan")),
        ("forgetting", -1.0),
        ("W_max", float("nan")),
        ("memory", 0),
    ):
        with pytest.raises(ValueError, match=name):
            design(**{name: value})


def test_a_model_car_a_tenth_the_size_learns_the_same_share(car, drive):
    """By Froude: lengths over 10, times over sqrt(10), masses over 1000, forces over 1000."""
    root, recording = np.sqrt(10.0), drive(n=600)
    model = replace(
        car,
        mass=car.mass / 1e3,
        yaw_inertia=car.yaw_inertia / 1e5,
        l_f=car.l_f / 10,
        l_r=car.l_r / 10,
        cornering_stiffness_front=car.cornering_stiffness_front / 1e3,
        cornering_stiffness_rear=car.cornering_stiffness_rear / 1e3,
    )
    small = replace(
        recording,
        t=recording.t / root,
        v_x=recording.v_x / root,
        v_y=recording.v_y / root,
        r=recording.r * root,
        axle_force=recording.axle_force / 1e3,
    )
    for law in ("kreisselmeier", "rls", "concurrent"):
        full = identify(recording, car, small_design(car, law))
        tenth = identify(small, model, small_design(model, law, dt=small.dt))
        np.testing.assert_allclose(1e3 * tenth.axle_force, full.axle_force, rtol=1e-4, atol=1.0)
