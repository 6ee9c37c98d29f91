"""What is declared of the learnt numbers holds of the stored ones, whatever was measured."""

from dataclasses import replace
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.axle import learning as bounds
from identifier.axle.covariance import LEAST_VARIANCE, narrowed, packed, per_variance, unpacked
from identifier.axle.curve import LADDER
from identifier.run import identify
from tests.identifier.axle.conftest import HOSTILE, spoilt

SLOPES = np.sum(1 / np.array(LADDER))
ROW = 1 / np.array(LADDER) / SLOPES
FLAT, STEEP = 2.0 / SLOPES, 80.0 / SLOPES  # the least and the most stiffness, by the same sum


def broken(design, car, state):
    """What is declared and does not hold of some sample; sums of weights are exact."""
    b, found, n = design.bounds, set(), len(design.ladder)
    prior = design.prior.covariance(car, design.ladder)
    for W, own, UD in zip(state["W"], state["own"], state["UD"], strict=True):
        for i, w in enumerate(W):
            grip = sum(map(Fraction, w))
            slope = sum(Fraction(x) / Fraction(a) for x, a in zip(w, design.ladder, strict=True))
            s, k, o = own[i]
            held = Fraction(b.least_grip) <= grip <= Fraction(b.most_grip)
            found |= set() if held else {"grip"}
            stiff = Fraction(b.least_stiffness) <= slope <= Fraction(b.most_stiffness)
            found |= set() if stiff else {"stiffness"}
            found |= {"weight"} if not np.abs(w).max() <= b.weight else set()
            found |= {"compliance"} if not 0.0 <= s <= b.compliance else set()
            found |= {"share"} if not 0.0 <= k <= 1.0 else set()
            found |= {"offset"} if not abs(o) <= (b.steering, b.v_y)[i] else set()
        P = unpacked(UD, n + 3)
        sizes, most = (
            np.column_stack([np.trace(A[:, :n, :n], axis1=1, axis2=2), A[:, [4, 5, 6], [4, 5, 6]]])
            for A in (P, design.regression.widest * prior)
        )
        found |= {"variance"} if not (sizes <= most).all() else set()
        F = np.zeros((2, n + 3, n + 3))
        F[:, *np.triu_indices(n + 3)] = UD
        found |= {"definite"} if not (np.einsum("aii->ai", F) >= 0.0).all() else set()
    return found


@pytest.mark.sweep(
    "flipped_v_y-20.0",
    "dead_steering-20.0",
    "spikes-20.0",
    "stuck-20.0",
    "backwards-20.0",
    "standstill-20.0",
)
@pytest.mark.parametrize("speed", [8.0, 20.0, 35.0])
@pytest.mark.parametrize("fault", HOSTILE)
def test_what_is_declared_holds_after_every_sample(fault, speed, car, drive):
    """And all stays finite, with forces of a few loads."""
    clean, design = drive(speed=speed, amplitude=0.07), AxleIdentifier.for_vehicle(car)
    history = identify(spoilt(clean, fault), car, design)
    assert history.diverged_at is None
    assert broken(design, car, history.state) == set()
    for port, values in history.state.items():
        assert np.isfinite(values).all(), port
    assert (np.abs(history.axle_force) < 6 * np.array(car.axle_loads)).all()
    model = history.freeze(1e9)
    assert model.stiffness.min() >= 0.0
    assert np.isfinite(model.predict(history.recording)).all()


@pytest.mark.sweep("0.3")
@pytest.mark.parametrize("dt", [0.2, 0.3, 0.5])
def test_what_is_declared_holds_of_coarse_samples_too(dt, car, drive):
    """A sample is then longer than the memories of the filters."""
    fine, design = drive(n=6000), AxleIdentifier.for_vehicle(car, dt=dt)
    every = slice(None, None, round(dt / fine.dt))
    names = ("t", "v_x", "v_y", "r", "delta_f", "delta_r")
    coarse = replace(fine, axle_force=None, **{name: getattr(fine, name)[every] for name in names})
    history = identify(coarse, car, design)
    assert history.diverged_at is None
    assert broken(design, car, history.state) == set()


@pytest.mark.heavy
def test_left_free_the_same_drives_leave_the_box(car, drive):
    design = AxleIdentifier.for_vehicle(car)
    wide = replace(design.bounds, least_grip=1e-3, most_grip=30.0, weight=60.0)
    wide = replace(wide, least_stiffness=1e-3, most_stiffness=3e3)
    free = replace(design, bounds=wide, regression=replace(design.regression, widest=1e6))
    found = set()
    for fault in ("dead_yaw_rate", "wandering_gains"):
        recording = spoilt(drive(amplitude=0.07), fault)
        found |= broken(design, car, identify(recording, car, free).state)
    assert {"grip", "stiffness", "weight", "variance"} <= found


def kept(theta, P, **limits):
    """[w, s, k, offset] within bounds, in double."""
    n = len(theta) - 3
    declared = bounds.Bounds(compliance=0.3, v_y=0.2, **limits)
    numbers = declared.of_ladder(LADDER)
    upper = {(i, j): P[i, j] for i in range(n) for j in range(i, n)}
    found = bounds.bounded(
        numbers, [ca.SX(float(t)) for t in theta], upper, offset=0.01, slope=list(ROW)
    )
    return np.array([float(ca.evalf(one)) for one in found])


def test_the_move_is_the_least_in_the_metric_of_the_covariance(rng):
    """No point of the set, among many near it, is nearer in that metric."""
    at_both, at_steepest = 0, 0
    for _ in range(90):
        A = rng.standard_normal((4, 4))
        P = A @ A.T + 0.05 * np.eye(4)
        theta = np.concatenate([rng.standard_normal(4) * 1.5, [0.1, 0.2, 0.001]])
        found = kept(theta, P, weight=50.0)[:4]
        assert 0.1 <= found.sum() <= 3.0
        assert FLAT <= ROW @ found <= STEEP
        metric = np.linalg.inv(P)
        size = (found - theta[:4]) @ metric @ (found - theta[:4])
        near = found + 10.0 ** rng.uniform(-3, 0, (4000, 1)) * rng.standard_normal((4000, 4))
        inside = (near.sum(1) >= 0.101) & (near.sum(1) <= 2.999)
        inside &= (near @ ROW >= FLAT + 1e-3) & (near @ ROW <= STEEP - 1e-3)
        away = near[inside] - theta[:4]
        assert (np.einsum("ki,ij,kj->k", away, metric, away) > size - 1e-2 * (1 + size)).all()
        at_bound = min(found.sum() - 0.1, 3.0 - found.sum()) < 1e-2
        at_both += at_bound and ROW @ found < FLAT + 1e-3
        at_steepest += ROW @ found > STEEP - 1e-3
    assert at_both >= 3 and at_steepest >= 3


def test_what_is_inside_is_not_moved_by_a_bit(rng):
    for _ in range(50):
        theta = np.concatenate([rng.uniform(0.03, 0.35, 4), [0.1, 0.2, 0.001]])
        np.testing.assert_array_equal(kept(theta, np.eye(4)), theta)


@pytest.mark.sweep("1.0", "1000000000000000.0")
@pytest.mark.parametrize("scale", [1.0, 1e3, 1e15])
def test_the_set_is_reached_from_anywhere_by_any_metric(scale, rng):
    """Also by one that is singular, or that rounding has made indefinite."""
    for k in range(60):
        v = rng.standard_normal((4, 1 + k % 4))
        P = v @ v.T - 1e-9 * np.eye(4) * (k % 2)
        theta = scale * rng.standard_normal(7)
        w = kept(theta, P)[:4]
        assert Fraction(0.1) <= sum(map(Fraction, w)) <= Fraction(3.0)
        slope = sum(Fraction(a) / Fraction(b) for a, b in zip(w, LADDER, strict=True))
        assert 2 <= slope <= 80
        assert np.abs(w).max() <= 3.0


def test_bounds_that_no_weights_can_keep_are_refused():
    with pytest.raises(ValueError, match="least_grip must be below most_grip"):
        bounds.Bounds(compliance=0.1, v_y=0.1, least_grip=4.0)
    with pytest.raises(ValueError, match="least_stiffness must be below most_stiffness"):
        bounds.Bounds(compliance=0.1, v_y=0.1, least_stiffness=90.0)
    with pytest.raises(ValueError, match=r"4 weights up to 0\.1 cannot carry"):
        bounds.Bounds(compliance=0.1, v_y=0.1, weight=0.1).of_ladder(LADDER)
    with pytest.raises(ValueError, match=r"stiffness of .* loads/rad, outside of 2 to 80"):
        bounds.Bounds(compliance=0.1, v_y=0.1).of_ladder((0.001, 0.002, 0.004, 0.008))


def test_limits_are_floats_that_are_not_above_the_declared():
    for limit in (0.1, 0.3, 0.324, 1 / 3, 0.01):
        numbers = bounds.Bounds(compliance=limit, v_y=limit).of_ladder(LADDER)
        for number in (numbers.compliance, numbers.v_y):
            assert float(np.float32(number)) == number
            assert limit * (1 - 2e-7) < number <= limit


def test_factors_are_those_of_the_covariance(rng):
    A = rng.standard_normal((2, 7, 9))
    P = A @ A.transpose(0, 2, 1)
    np.testing.assert_allclose(unpacked(packed(P), 7), P, rtol=1e-10, atol=1e-12)
    first = packed(P)[0]
    assert (first[[0, 7, 13, 18, 22, 25, 27]] > 0.0).all()  # D, by rows
    assert first[27] == pytest.approx(P[0, 6, 6])
    assert (packed(np.zeros((2, 7, 7)))[:, [0, 27]] == LEAST_VARIANCE).all()


def test_a_stored_covariance_that_is_too_wide_is_narrowed(car, drive):
    """Weights may come from a file of another design: its boxes hold from the first sample on."""
    design, recording = AxleIdentifier.for_vehicle(car), drive(n=300)
    model = identify(recording, car, design).freeze(1e9)
    wide = replace(
        model,
        W=10.0 * model.W,
        compliance=model.compliance + 0.5,
        sway_share=np.ones(2),
        offset=model.offset + 1.0,
        covariance=300.0 * model.prior_covariance,
    )
    state = identify(recording, car, design, start=wide).state
    assert broken(design, car, state) == set()
    limits = per_variance(model.prior_covariance, 4, 2.0)
    np.testing.assert_array_equal(narrowed(model.covariance, limits), model.covariance)
