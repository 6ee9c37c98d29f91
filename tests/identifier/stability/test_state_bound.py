from dataclasses import replace

import numpy as np
import pytest

from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import DrivingError, Gains, diagonal
from identifier.paper.network import Network
from identifier.run import identify
from identifier.stability.bounds import small_gain, steady_capacity
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL
from identifier.stability.lyapunov import lyapunov
from identifier.stability.operation import proven_bounds
from identifier.stability.printed import (
    _bound_14,
    _canceling_pair,
    _printed_k_b,
    _tight_k_b,
    trivial_bound,
)
from identifier.stability.sampled_bound import (
    Disturbance,
    by_leakage,
    error_gains,
    output_layer,
)
from tests.identifier.stability.limits import integral_euler_limit
from tests.identifier.stability.test_certificate import CITY

SKEWED = np.array([[-4.0, 3.0], [-0.5, -6.0]])
LAWS = {"integral": INTEGRAL, "instantaneous": INSTANTANEOUS, "pi_lead": DrivingError(1.0, 0.3)}


def learning_of(A_d, law, *, lam, eta_W, rho_W, n_h, dt=2e-3):
    """How W learns and leaks, along -A_d⁻ᵀ."""
    gains = Gains(
        A_d=tuple(map(tuple, np.asarray(A_d).tolist())),
        forgetting=lam,
        eta_W=eta_W,
        eta_V=0.0,
        rho_W=rho_W,
        rho_V=0.0,
    )
    return output_layer(gains, law, -np.linalg.inv(A_d).T, n_h=n_h, dt=dt)


def leakage_bounds(A_d, law, f_max, *, n_h, dt=2e-3, noise=0.0, **gains):
    """The certificate's bounds by the leakage."""
    learning = learning_of(A_d, law, n_h=n_h, dt=dt, **gains)
    acting = Disturbance(residual=f_max, noise=noise)
    return by_leakage(error_gains(A_d, dt), learning, A_d, acting, n_h)


def simulated(A_d, law, lam, eta, rho, f, s, dt=2e-3, leak_scale=1.0, W=0.0):
    """Largest |ξ̃| and |W| of the laws under given f (n, 2) and s (n, n_h), Euler, from ξ̃ = z = 0.

    W starts along the first axle and the first units, with the norm that is given.
    """
    n_h = s.shape[1]
    xi, z = np.zeros(2), np.zeros(2)
    W = W / np.sqrt(n_h) * np.outer([1.0, 0.0], s[0])
    inverse, largest = np.linalg.inv(A_d).T, [0.0, 0.0]
    for force, units in zip(f, s, strict=True):
        size = np.linalg.norm(xi)
        largest = [max(largest[0], size), max(largest[1], np.linalg.norm(W))]
        drive = inverse @ law.drive(z, xi)
        xi, z, W = (
            xi + dt * (A_d @ xi + force - W @ units),
            z + dt * (xi - lam * z),
            W + dt * (-eta * np.outer(drive, units) - leak_scale * rho * size * W),
        )
    return largest


def nasty_inputs(rng, n_h, f_max):
    """A residual and hidden units that switch at random between their largest values."""
    n, hold = 5000, int(rng.integers(50, 500))
    turns = rng.uniform(0, 2 * np.pi, n // hold + 1)
    f = f_max * np.column_stack([np.cos(turns), np.sin(turns)])
    s = np.sign(rng.standard_normal((n // hold + 1, n_h)))
    return np.repeat(f, hold, axis=0)[:n], np.repeat(s, hold, axis=0)[:n]


@pytest.mark.sweep("integral")
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_error_and_weights_stay_within_their_bounds_for_the_worst_inputs_that_were_tried(law):
    rng = np.random.default_rng(9)
    closest = [np.inf, np.inf]
    for k in range(8):
        A_d = SKEWED if k % 2 else -rng.uniform(2, 8) * np.eye(2)
        lam, n_h, f_max = rng.uniform(1, 8), 4, 2.0
        D = -np.linalg.inv(A_d).T
        unit = small_gain(A_d, law=law, forgetting=lam, eta_W=1.0, n_h=n_h, dt=2e-3, direction=D)
        eta = 0.6 / unit if unit > 0 else 20.0
        capacity = f_max * rng.uniform(0.5, 3.0)
        rho = steady_capacity(D, law=law, forgetting=lam, eta_W=eta, rho_W=capacity, n_h=n_h)
        bounds = leakage_bounds(A_d, law, f_max, lam=lam, eta_W=eta, rho_W=rho, n_h=n_h)
        f, s = nasty_inputs(rng, n_h, f_max)
        resumed = rng.choice([0.0, 1.0]) * bounds.W
        error, W = simulated(A_d, law, lam, eta, rho, f, s, W=resumed)
        assert error <= bounds.xi_tilde
        assert W <= bounds.W
        closest = [min(closest[0], bounds.xi_tilde / error), min(closest[1], bounds.W / W)]
    assert closest[0] < 8.0  # the bounds are of the right order


def test_weights_that_do_not_leak_pass_the_bound_that_leaking_ones_keep():
    numbers = {"lam": 1.0, "eta_W": 20.0, "rho_W": 5.0, "n_h": 4}
    bounds = leakage_bounds(-4 * np.eye(2), INSTANTANEOUS, 20.0, **numbers)
    f, s = np.tile([20.0, 0.0], (10000, 1)), np.ones((10000, 4))
    gains = (1.0, 20.0, 5.0)
    _, leaking = simulated(-4 * np.eye(2), INSTANTANEOUS, *gains, f, s)
    _, planted = simulated(-4 * np.eye(2), INSTANTANEOUS, *gains, f, s, leak_scale=0.0)
    assert 0.9 * bounds.W < leaking <= bounds.W < planted


@pytest.mark.heavy
def test_the_weights_settle_at_the_capacity_where_the_residual_is_larger():
    for law in LAWS.values():
        f, s = np.tile([30.0, 0.0], (10000, 1)), np.ones((10000, 4))
        numbers = {"forgetting": 3.0, "eta_W": 2.0, "rho_W": 0.5, "n_h": 4}
        capacity = steady_capacity(np.eye(2) / 4.0, law=law, **numbers)
        _, W = simulated(-4 * np.eye(2), law, 3.0, 2.0, 0.5, f, s)
        assert pytest.approx(capacity, rel=0.15) == 2.0 * W  # |f_hat| = √n_h |W|


def test_the_bound_is_refused_where_the_circle_does_not_close():
    A_d, numbers = -3 * np.eye(2), {"lam": 2.0, "rho_W": 1.0, "n_h": 4, "dt": 1e-6}
    assert small_gain(
        A_d, law=INTEGRAL, forgetting=2.0, eta_W=9.0, n_h=4, dt=1e-6, direction=np.eye(2) / 3.0
    ) == pytest.approx(1.0)  # η n_h = a² λ²
    assert leakage_bounds(A_d, INTEGRAL, 1.0, **numbers, eta_W=9.01) is None
    assert leakage_bounds(A_d, INTEGRAL, 1.0, **numbers, eta_W=8.99).W > 0
    assert leakage_bounds(A_d, INSTANTANEOUS, 1.0, **numbers, eta_W=1e3).W > 0


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_the_bound_solves_its_own_circle(noise):
    numbers = {"lam": 2.0, "eta_W": 1.0, "rho_W": 0.7, "n_h": 4, "noise": noise, "dt": 0.02}
    bounds = leakage_bounds(SKEWED, INTEGRAL, 1.5, **numbers)
    error = error_gains(SKEWED, 0.02)
    by_noise = (error.start + 1.0 + error.force * np.linalg.norm(SKEWED, 2)) * noise
    by_weights = by_noise + error.force * (1.5 + 2.0 * bounds.W)
    assert bounds.xi_tilde == pytest.approx(by_weights, rel=1e-6)


def test_the_noise_of_the_sensors_is_in_the_error_that_they_show():
    """No force, no network: an error of n that turns at every sample, which Euler follows."""
    a, dt, n = 6.0, 0.02, 0.3
    e, largest = -n, 0.0  # of the estimate that begins at the first measurement
    for k in range(200):
        seen = e + n * (-1.0) ** k
        largest, e = max(largest, abs(seen)), e - dt * a * seen
    acting, A_d = Disturbance(residual=1e-9, noise=n), -a * np.eye(2)
    still = learning_of(A_d, INTEGRAL, lam=2.0, eta_W=0.0, rho_W=0.0, n_h=4, dt=dt)
    bound = by_leakage(error_gains(A_d, dt), still, A_d, acting, 4).xi_tilde
    assert n < largest <= bound == pytest.approx(3.0 * n)  # 1 from the start, 1 from A_d n, 1 seen


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_weights_keep_their_bound_whatever_the_error_does_within_its_own(share):
    """φ = |W| + (g/λ) m, integrated with |ξ̃| = X all the time or none of it, from resumed weights.

    With φ' and m' as in the text above `small_gain`: what a proof says of them, in small steps.
    """
    lam, rho, n_h = 2.0, 30.0, 4
    numbers = {"lam": lam, "eta_W": 1.0, "rho_W": rho, "n_h": n_h, "dt": 1e-5}
    bounds = leakage_bounds(SKEWED, INTEGRAL, 1.5, **numbers)
    gain = np.linalg.norm(np.linalg.inv(SKEWED), 2) * np.sqrt(n_h)
    nearest = 0.0
    for X in (bounds.X, 1e-3):
        m, dt, phi = 0.0, 0.02 / (rho * bounds.X + lam), share * bounds.W
        for _ in range(20000):
            nearest = max(nearest, phi / bounds.W)
            rate = X * (gain / lam + rho * gain / lam * m - rho * phi)
            phi, m = phi + dt * rate, m + dt * (X - lam * m)
    assert 0.9 < nearest <= 1.0 + 1e-9


@pytest.fixture(name="run")
def a_run(drive, car):
    """Identify the drive of the fixtures and return the history with its sampled residual."""

    def run(**gains):
        settings = {"forgetting": 6.0, "eta_V": 5.0, "rho_W": 5.0, "rho_V": 5.0, **gains}
        design = PaperIdentifier(
            gains=Gains(A_d=diagonal(6.0), **settings), network=Network(hidden=8)
        )
        history = identify(drive(n=1000), car, design)
        p, K_inv = car.bicycle, np.array([[1500.0 * 1.55, 2500.0], [1500.0 * 1.15, -2500.0]]) / 2.7
        record = history.recording
        alpha = (
            record.u
            - np.column_stack([record.v_y + p.l_f * record.r, record.v_y - p.l_r * record.r])
            / record.v_x[:, None]
        )
        linear = alpha * [p.C_f, p.C_r]
        inertia = np.column_stack([record.v_x * record.r, 0 * record.r]) @ K_inv.T
        xi = record.x @ K_inv.T
        residual = (np.diff(xi, axis=0) / 0.01 - linear[:-1] + inertia[:-1]) / 1000.0
        return history, residual

    return run


def test_the_identifier_itself_keeps_the_bounds_of_leakage(run):
    history, residual = run(eta_W=100.0)
    f_max = np.linalg.norm(residual, axis=1).max()
    assert 1.0 < f_max < 20.0
    V_start = float(np.linalg.norm(history.state["V"][0]))
    signals = np.hstack([history.recording.x, history.recording.u])
    x_bar_max = np.linalg.norm(signals / np.array(history.method.network.scale), axis=1).max()
    acting = {"disturbance": Disturbance(residual=f_max), "needed_force": f_max}
    operation = replace(CITY, n_h=8, x_bar_max=x_bar_max, V_start=V_start, **acting)
    inverse = np.eye(2) / 6.0
    proven = proven_bounds(history.method.gains, INTEGRAL, operation, inverse)
    bounds = proven.leakage
    error = np.linalg.norm(history.outputs["xi_tilde"], axis=1).max()
    assert 0.02 * bounds.xi_tilde < error <= bounds.xi_tilde
    assert np.linalg.norm(history.state["W"], axis=(1, 2)).max() <= bounds.W
    assert np.linalg.norm(history.state["V"], axis=(1, 2)).max() <= proven.V


def nudged(a, rho, n_h, dt, share, n, nudge):
    """The largest error after a nudge at a share of the limit of the gain, and η."""
    eta = share * integral_euler_limit(a, a, dt) / n_h
    f, s = np.zeros((n, 2)), np.ones((n, n_h))
    f[:50] = nudge
    return simulated(-a * np.eye(2), INTEGRAL, a, eta, rho, f, s, dt=dt)[0], eta


def test_the_integral_law_passes_bound_14_many_times_over():
    """No residual, ideal weights zero, w_bar = 0: (14) allows next to nothing."""
    a, rho, n_h = 6.0, 0.05, 4
    error, eta = nudged(a, rho, n_h, 2e-3, 1.2, 40000, 1e-2)
    pair = _canceling_pair(-a * np.eye(2), eta_W=eta, rho_W=rho)
    ideal = {"W_M": 1.0, "n_h": n_h, "eta_W": eta, "rho_W": rho}  # generous: W_M is 0
    tight = _bound_14(pair, w_bar=0.0, k_b=_tight_k_b(pair, **ideal))
    assert error > 100.0 * tight


@pytest.mark.heavy
def test_the_integral_law_passes_even_the_printed_route_where_a_is_slow():
    a, rho, n_h = 0.1, 1.0, 1
    error, eta = nudged(a, rho, n_h, 0.05, 4.0, 60000, 1e-3)
    pair = lyapunov(-a * np.eye(2), 2.0 * eta / rho * np.eye(2))  # |P| = (η/ρ)/a: b is smallest
    k_b = _printed_k_b(pair, W_M=0.0, n_h=n_h, eta_W=eta, rho_W=rho)
    printed = _bound_14(pair, w_bar=0.0, k_b=k_b)
    assert error > 1.2 * printed
    assert trivial_bound(-a * np.eye(2), 1e-3) < printed
