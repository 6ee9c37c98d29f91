"""The dead zone of the leakage: its bounds against hostile errors, by recursions of our own."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.methods import certify
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import DrivingError
from identifier.stability.loop import INTEGRAL
from identifier.stability.sampled_bound import Learning
from models.vehicle import sedan

CAR = sedan()
DT, LAM, RHO, DRIVE = 0.01, 8.0, 3.0, 40.0


def learning(law, *, staged, free, rho=RHO):
    return Learning(
        law=law, forgetting=LAM, leakage=rho, drive=DRIVE, dt=DT, staged=staged, free=free
    )


def largest_weights(law, errors, directions, *, staged, free, rho=RHO, start=0.0):
    """Largest |W| of N runs, at samples and at stages, (N,) each; written with numpy alone.

    errors (n, N, 2): ξ̃ of each sample, held over it. W is (N, 2): what drives it is the driving
    error, turned by ±1 (n, N) and multiplied by DRIVE.
    """
    z = np.zeros_like(errors[0])
    W = np.zeros_like(errors[0])
    W[:, 0] = start

    def slope(state, error, sign):
        z, W = state
        size = np.maximum(np.linalg.norm(W, axis=1), 1e-300)
        leaking = W * np.maximum(0.0, 1.0 - free / size)[:, None]
        driven = DRIVE * sign[:, None] * (law.z * z + law.xi_tilde * error)
        held = rho * np.linalg.norm(error, axis=1)[:, None] * leaking
        return error - LAM * z, driven - held

    at_samples = at_stages = np.linalg.norm(W, axis=1)
    for error, sign in zip(errors, directions, strict=True):
        if staged:
            slopes = [slope((z, W), error, sign)]
            for share in (0.5, 0.5, 1.0):
                ahead = tuple(v + share * DT * d for v, d in zip((z, W), slopes[-1], strict=True))
                at_stages = np.maximum(at_stages, np.linalg.norm(ahead[1], axis=1))
                slopes.append(slope(ahead, error, sign))
            z, W = (
                v + DT / 6.0 * (a + 2.0 * b + 2.0 * c + d)
                for v, a, b, c, d in zip((z, W), *slopes, strict=True)
            )
        else:
            z, W = (v + DT * d for v, d in zip((z, W), slope((z, W), error, sign), strict=True))
        at_samples = np.maximum(at_samples, np.linalg.norm(W, axis=1))
    return at_samples, np.maximum(at_samples, at_stages)


@pytest.mark.parametrize("staged", [False, True])
def test_an_error_that_is_held_and_then_small_fills_the_bound(staged):
    """And passes that of the leakage alone, which is what a certificate without the radius says."""
    X, free = 2.0, 30.0
    held, quiet = np.full(4000, X), np.full(1000, 1e-6)
    errors = np.zeros((5000, 1, 2))
    errors[:, 0, 0] = np.concatenate([held, quiet])
    options = {"staged": staged, "free": free}
    found = largest_weights(INTEGRAL, errors, np.ones((5000, 1)), **options)[0][0]
    bound = learning(INTEGRAL, **options).kept(X)
    assert 0.95 * bound < found <= bound
    assert found > 1.3 * learning(INTEGRAL, staged=staged, free=0.0).kept(X)


@pytest.mark.parametrize("staged", [False, True])
@pytest.mark.parametrize("law", [INTEGRAL, DrivingError(0.0, 1.0), DrivingError(1.0, 0.2)])
def test_no_error_drives_the_weights_beyond_their_bound(staged, law, rng):
    """Errors of every size up to X, that turn and flip, with up to 0.9 of W leaking in a sample."""
    for free in (0.5, 5.0, 50.0):
        for rho in (1.0, 10.0, 45.0):
            X, n, runs = 2.0, 1500, 64
            hold = rng.integers(1, 200, runs)  # samples for which a direction is kept
            turns = rng.uniform(0.0, 2.0 * np.pi, (n, runs))
            sizes = X * rng.uniform(0.0, 1.0, (n, runs)) ** rng.choice([0.0, 1.0, 8.0], runs)
            at = (np.arange(n)[:, None] // hold) * hold
            turns, sizes = (np.take_along_axis(v, at, 0) for v in (turns, sizes))
            errors = sizes[..., None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
            signs = np.where(rng.random((n, runs)) < 0.02, -1.0, 1.0)
            options = {"staged": staged, "free": free, "rho": rho}
            known = learning(law, **options)
            bound = known.kept(X)
            start = bound * rng.uniform(0.0, 1.0)
            samples, stages = largest_weights(law, errors, signs, start=start, **options)
            assert samples.max() <= bound * (1.0 + 1e-12)
            assert stages.max() <= (bound + max(known.beyond(X))) * (1.0 + 1e-12)


def test_more_than_one_whole_sample_of_leakage_is_not_covered():
    assert learning(INTEGRAL, staged=False, free=3.0, rho=60.0).kept(2.0) == np.inf
    assert learning(INTEGRAL, staged=False, free=3.0, rho=0.0).kept(2.0) == np.inf


def test_the_force_that_a_dead_zone_lets_w_hold_is_the_one_at_which_learning_rests():
    """All units saturated, a residual above the capacity: the force settles at the capacity."""
    design, n_h = PaperIdentifier.for_vehicle(CAR), 10
    resting = replace(design, gains=replace(design.gains, W_free=3.0))
    capacity = certify(resting, CAR)["capacity"].value
    assert capacity == pytest.approx(
        certify(design, CAR)["capacity"].value + np.sqrt(n_h) * 3.0, rel=1e-12
    )
    g, a, s = resting.gains, -resting.gains.A_d[0][0], np.ones(n_h)
    xi, z, W, dt = 0.0, 0.0, np.zeros(n_h), 1e-3
    for _ in range(60000):
        f_hat, size = W @ s, np.linalg.norm(W)
        leaking = W * max(0.0, 1.0 - 3.0 / max(size, 1e-300))
        W_dot = g.eta_W / a * z * s - g.rho_W * abs(xi) * leaking
        xi, z = xi + dt * (-a * xi + 1.5 * capacity - f_hat), z + dt * (xi - g.forgetting * z)
        W = W + dt * W_dot
    assert W @ s == pytest.approx(capacity, rel=1e-3)


def test_too_small_a_capacity_advises_the_leakage_that_is_just_enough():
    design = PaperIdentifier.for_vehicle(CAR)
    strong = replace(design, gains=replace(design.gains, rho_W=10.0, W_free=1.0))
    advice = certify(strong, CAR)["capacity"].advice
    rho = float(advice.removeprefix("rho_W below "))
    enough = replace(strong, gains=replace(strong.gains, rho_W=0.99 * rho))
    assert certify(enough, CAR)["capacity"].status == "pass"
    short = replace(strong, gains=replace(strong.gains, rho_W=1.01 * rho))
    assert certify(short, CAR)["capacity"].status == "warn"


@pytest.mark.parametrize("integrator", ["euler", "rk4"])
def test_the_dead_zone_of_each_layer_widens_its_own_bound(integrator):
    design = replace(PaperIdentifier.for_vehicle(CAR), integrator=integrator)
    wide = replace(design, gains=replace(design.gains, V_free=20.0))
    before, after = (certify(one, CAR) for one in (design, wide))
    assert after["V_bound"].value == pytest.approx(before["V_bound"].value + 20.0, rel=0.03)
    assert after["weight_bound"].value == before["weight_bound"].value
    wide = replace(design, gains=replace(design.gains, W_free=5.0))
    assert certify(wide, CAR)["weight_bound"].value > before["weight_bound"].value + 5.0


def test_bound_14_is_not_stated_of_a_leakage_that_rests():
    def names(design):
        return {entry.name for entry in certify(design, CAR).properties}

    design = PaperIdentifier.for_vehicle(CAR)
    for layer in ("W_free", "V_free"):
        resting = replace(design, gains=replace(design.gains, **{layer: 1.0}))
        assert {"printed_bound", "tight_bound", "ultimate_bound"} <= names(design) - names(resting)
