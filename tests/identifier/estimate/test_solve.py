"""The descent and what it is made of, by other roads: differences, closed forms, all paths."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from identifier.estimate import report, roads, solve
from identifier.estimate.drive import Drive, box, slope_on, thinned
from identifier.estimate.information import SIZE, Information
from identifier.estimate.latent import TRUST
from identifier.estimate.posterior import Reach, Segment
from identifier.estimate.priors import Priors
from identifier.estimate.roads import _cheapest, _ranked
from identifier.estimate.solve import (
    ERROR_SIZE,
    NU,
    Problem,
    around_beliefs,
    autocorrelation_time,
    beliefs_cost,
    bounded_step,
    descend,
    error_size,
    normal,
    settled,
    starts,
)
from identifier.motion.parameters import INDEX, NAMES
from models.recordings import joined
from models.vehicle import GRAVITY, estimate, sedan
from tests.identifier.estimate.conftest import driven
from tests.made import made

CAR = sedan()
PRIORS = Priors.of(CAR)
T = np.array([0.5, 0.8])


@pytest.fixture(scope="module")
def problem():
    return Problem([Drive.of(driven(3), CAR, slice(0, 900))], CAR, PRIORS)


@pytest.fixture(scope="module")
def optimum(problem):
    return descend(problem, PRIORS.mean, T, enough=1e-6)


def away(problem, rng, size=0.3):
    """Parameters beside what is believed, with a front axle as soft at zero as no tire is."""
    p, index = PRIORS.mean.copy(), problem.index
    p[index] += size * PRIORS.sd[index] * rng.standard_normal(index.size)
    p = np.clip(p, PRIORS.low, PRIORS.high)
    p[INDEX["residual0_f"]] -= 0.2
    return p


def test_gradient_and_curvature_are_those_of_the_cost(problem, rng):
    p, S2 = away(problem, rng), np.array([1.3, 0.7])
    at = problem.residuals(p)
    H, g = normal(problem, at, S2, T)
    gradient, curvature = around_beliefs(PRIORS, p)
    assert beliefs_cost(PRIORS, p) > PRIORS.cost(p) + 0.5, "one axle is too soft"
    for _ in range(3):
        step = np.zeros_like(p)
        step[problem.index] = 1e-4 * PRIORS.sd[problem.index] * rng.standard_normal(g.size)
        d = step[problem.index]
        costs = [
            (
                problem.misfit(problem.residuals(p + s * step).e, S2, T),
                beliefs_cost(PRIORS, p + s * step),
            )
            for s in (1.0, -1.0)
        ]
        drives, beliefs = np.subtract(*costs)
        assert drives == pytest.approx(2.0 * g @ d, rel=1e-2, abs=1e-6)
        assert beliefs == pytest.approx(2.0 * gradient @ step, rel=1e-3, abs=1e-8)
    # Gauss-Newton: of each residual w J'J with Student's weight, but for uses of the ellipse.
    w = (problem.weight[:, None] / T) * (NU + 1.0) / (NU * S2 + at.e**2)
    bends = H - np.einsum("mi,mij,mik->jk", w, at.slopes, at.slopes)
    uses = [NAMES[k].startswith(("braking", "driving")) for k in problem.index]
    np.testing.assert_allclose(
        np.diag(bends)[uses],
        np.maximum(g / np.maximum(p[problem.index], 0.002), 0.0)[uses],
        atol=1e-9,
    )
    np.testing.assert_allclose(bends - np.diag(np.where(uses, np.diag(bends), 0.0)), 0.0, atol=1e-6)
    softer = p.copy()
    softer[[INDEX[f"residual{j}_f"] for j in range(4)]] = 0.0
    added = curvature - around_beliefs(PRIORS, softer)[1]
    assert added[INDEX["residual0_f"], INDEX["residual0_f"]] > 0.0


def test_a_descent_ends_where_no_parameter_gains_and_tells_its_curvature(problem, optimum):
    found = optimum
    best = problem.cost(problem.residuals(found.p).e, found.p, T)
    assert best == pytest.approx(found.cost) and (found.memory == T).all()
    assert found.seconds == pytest.approx(problem.weight.sum())
    sd = np.sqrt(np.diag(found.covariance))
    for k in problem.index:
        for sign in (-0.3, 0.3):
            p = found.p.copy()
            p[k] = np.clip(p[k] + sign * sd[k], PRIORS.low[k], PRIORS.high[k])
            assert problem.cost(problem.residuals(p).e, p, T) > best - 0.01
    S2 = found.scale**2
    H, g = normal(problem, problem.residuals(found.p), S2, T)
    inside = np.ix_(problem.index, problem.index)
    P = around_beliefs(PRIORS, found.p)[1][inside]
    np.testing.assert_allclose(found.covariance[inside], np.linalg.inv(H + P), rtol=1e-6)
    np.testing.assert_allclose(found.curvature[inside], H, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(found.slope[problem.index], g, rtol=1e-9)


def test_a_descent_that_gains_as_much_for_ever_ends_at_its_limit(problem, monkeypatch):
    monkeypatch.setattr(solve, "_better", lambda _, now, p, *a, **k: (p, now.e, 1e-3, 1.0))
    assert not descend(problem, PRIORS.mean).ended


def test_scale_is_that_of_students_t_and_what_is_better_is_not_believed(problem, rng):
    m = problem.weight.size
    many = Problem(problem.drives * 20, CAR, PRIORS)
    e = rng.standard_t(NU, size=(20 * m, 2)) * [0.5, 2.0]
    np.testing.assert_allclose(many.scale(e), [0.25, 4.0], rtol=0.1)
    np.testing.assert_array_equal(problem.scale(1e-3 * e[:m]), 0.25**2)
    S2, p = many.scale(e), PRIORS.mean
    loss = 0.5 * (NU + 1.0) * np.log1p(e**2 / (NU * S2)) + 0.5 * np.log(S2)
    by_hand = (loss * many.weight[:, None] / T).sum()
    assert many.cost(e, p, T) == pytest.approx(by_hand + beliefs_cost(PRIORS, p))


def test_what_is_missed_is_a_share_of_the_force_and_halves_have_as_much(problem):
    p = PRIORS.mean
    drive = problem.drives[0]
    kept = np.flatnonzero(np.isin(drive.t, problem.times(0)))
    v_x, r = drive.signals[kept][:, [0, 2]].T
    np.testing.assert_allclose(problem.force, np.abs(v_x * r) / GRAVITY)
    np.testing.assert_allclose(
        error_size(problem.force),
        np.sqrt(ERROR_SIZE[0] ** 2 + (ERROR_SIZE[1] * problem.force) ** 2),
    )
    missed = problem.residuals(p).e * error_size(problem.force)[:, None]
    share = np.sqrt((missed**2).sum(axis=0) / (problem.force**2).sum())
    np.testing.assert_allclose(problem.model_error(p), share)
    first, second = problem.halves()
    assert (first + second == 1.0).all() and (np.diff(first) <= 0.0).all()
    assert first @ problem.force**2 == pytest.approx(second @ problem.force**2, rel=0.05)
    np.testing.assert_array_equal(problem.weighted(first).weight, problem.weight * first)


def test_memory_is_the_integral_of_the_correlation(rng):
    keep, step = 0.8, 0.05
    noise = rng.standard_normal((2, 40_000))
    for k in range(1, noise.shape[1]):
        noise[:, k] += keep * noise[:, k - 1]
    found = autocorrelation_time(list(noise), step, 200)
    assert found == pytest.approx(step * (1.0 + keep) / (1.0 - keep), rel=0.15)
    short = [np.full(19, 50.0), *noise]
    assert autocorrelation_time(short, step, 200) == found, "below 20 samples it does not count"
    assert autocorrelation_time([np.zeros(100)], step, 200) == 2.0
    assert autocorrelation_time([np.ones(300)], step, 10) == pytest.approx(step * 18.0, rel=0.1)


def test_a_step_stays_within_bounds_as_least_squares_does(rng):
    for _ in range(20):
        A, b = rng.standard_normal((8, 5)), 3.0 * rng.standard_normal(8)
        p, low, high = rng.uniform(0.0, 1.0, 5), np.zeros(5), np.ones(5)
        p[:2], high[4] = [0.0, 1.0], np.inf  # two at a bound, one with none above
        step = bounded_step(A.T @ A, A.T @ (A @ p - b), p, low, high)
        best = lsq_linear(A, b, (low, high), tol=1e-12)
        np.testing.assert_allclose(p + step, best.x, atol=1e-6)


def test_what_is_believed_alone_settles_at_its_mean_with_its_covariance():
    begin = PRIORS.mean + 0.5 * PRIORS.sd
    begin[INDEX["residual0_f"]] = -0.15
    p, covariance = settled(PRIORS, np.clip(begin, PRIORS.low, PRIORS.high))
    np.testing.assert_allclose(p, PRIORS.mean, atol=0.02)
    k = INDEX["ln_grip_f"]
    assert covariance[k, k] == pytest.approx(PRIORS.covariance[k, k], rel=0.05)


def test_straights_show_where_to_begin():
    t = 0.01 * np.arange(2000)
    r = np.where(t > 10.0, 0.3 * np.sin(t), 0.0)
    drive = made(t, v_y=0.4 - r, r=r, delta_f=0.02 + 0.1 * r)
    plain, bias, angle = starts(Problem([Drive.of(drive, CAR)], CAR, PRIORS))
    np.testing.assert_array_equal(plain, PRIORS.mean)
    names = ("steering_zero", "v_y_bias", "v_y_angle")
    assert [bias[INDEX[name]] for name in names] == pytest.approx([-0.02, 0.4, 0.0])
    assert [angle[INDEX[name]] for name in names] == pytest.approx([-0.02, 0.0, 0.02])
    right = replace(drive, v_y=-r, delta_f=0.1 * r)
    assert len(starts(Problem([Drive.of(right, CAR)], CAR, PRIORS))) == 1
    turning = replace(drive, r=np.full(t.size, 0.04 * GRAVITY / 20.0))
    assert len(starts(Problem([Drive.of(turning, CAR)], CAR, PRIORS))) == 1


# What is believed, and what drives reached.


def test_beliefs_are_gaussians_with_couples_and_a_tail_where_somebody_typed(rng):
    p, n = PRIORS.mean.copy(), len(NAMES)
    p[PRIORS.moves] += 0.5 * PRIORS.sd[PRIORS.moves] * rng.standard_normal(PRIORS.moves.sum())
    M = rng.standard_normal((SIZE, SIZE))
    data = Information(matrix=M @ M.T / SIZE, vector=rng.standard_normal(SIZE), seconds=1.0)
    for priors in (PRIORS, PRIORS.after(data)):
        gradient, curvature = priors.around(p)
        for k in np.flatnonzero(PRIORS.moves)[::3]:
            step = 1e-5 * PRIORS.sd[k] * np.eye(n)[k]
            slope = (priors.cost(p + step) - priors.cost(p - step)) / (2.0 * step[k])
            assert slope == pytest.approx(gradient[k], rel=1e-3, abs=1e-3)
        inside = np.ix_(PRIORS.moves, PRIORS.moves)
        assert np.linalg.eigvalsh(curvature[inside]).min() > 0.0
    k = INDEX["steering_gain"]
    far = PRIORS.mean + 5.0 * PRIORS.sd * (np.arange(n) == k)
    assert PRIORS.cost(far) == pytest.approx(np.log1p(25.0 / 2.0))
    f, r = INDEX["ln_grip_f"], INDEX["ln_grip_r"]
    unlike = PRIORS.mean + 0.15 * (np.arange(n) == f) - 0.15 * (np.arange(n) == r)
    assert PRIORS.cost(unlike) == pytest.approx((0.15 / 0.25) ** 2 + 0.5 * 2.0**2)
    b, angle = INDEX["v_y_bias"], INDEX["v_y_angle"]
    apart = Priors.of(CAR, apart=True, wide={"v_y_bias": 0.4})
    assert apart.information[b, angle] == 0.0 and apart.sd[b] == pytest.approx(0.4)
    assert PRIORS.information[b, angle] < 0.0
    for one in (PRIORS, apart):
        held = one.moves
        np.testing.assert_allclose(
            one.covariance[np.ix_(held, held)] @ one.information[np.ix_(held, held)],
            np.eye(held.sum()), atol=1e-8,
        )  # fmt: skip
        assert (one.covariance[~held] == 0.0).all() and (one.sd[~held] == 0.0).all()


def test_beliefs_are_held_widened_by_roads_and_replaced_by_a_fit():
    names = ("v_y_bias", "ln_grip_f")
    held = PRIORS.without(names)
    where = [INDEX[name] for name in names]
    assert not held.moves[where].any() and (held.mean[where] == 0.0).all()
    assert (held.information[where] == 0.0).all() and (held.information[:, where] == 0.0).all()
    assert held.moves.sum() == PRIORS.moves.sum() - 2 and PRIORS.moves[where].all()
    roads, n = PRIORS.with_roads(2), len(NAMES)
    assert roads.mean.size == n + 2 and roads.moves[n:].all()
    assert roads.cost(np.append(PRIORS.mean, [0.5, -0.5])) == pytest.approx(1.0)
    np.testing.assert_allclose(np.exp(roads.low[n:]), 0.2)
    np.testing.assert_allclose(np.exp(roads.high[n:]), 2.2)
    covariance = 0.04 * PRIORS.covariance
    known = PRIORS.known(PRIORS.mean + 1.0, covariance)
    np.testing.assert_allclose(known.covariance, covariance, rtol=1e-3, atol=1e-8)
    assert (known.mean == PRIORS.mean + 1.0).all() and known.typed == ()
    k = INDEX["ln_inertia"]
    for size, sd in ((1.0, 0.1), (0.1, 0.3)):
        lengths = {"l_f": size * CAR.l_f, "l_r": size * CAR.l_r}
        guessed = replace(CAR, **lengths, yaw_inertia=estimate(CAR.mass, **lengths)["yaw_inertia"])
        assert Priors.of(guessed).sd[k] == pytest.approx(sd)
    assert PRIORS.sd[k] == 0.0


def test_what_drives_reached_adds_up():
    pair = np.array
    one = Reach(pair([0.1, 0.02]), pair([5.0, 9.0]), pair([-3.0, 1.0]), pair([4.0, 8.0]), 2.0,
                (Segment(0.0, 1.0, 0.5, 0.1),), 0.1, -0.3)  # fmt: skip
    other = Reach(pair([0.05, 0.03]), pair([4.0, 8.0]), pair([-2.0, 2.0]), pair([4.0, -9.0]), 2.0,
                  (Segment(3.0, 4.0, 0.7, 0.1),), 0.2, 0.1)  # fmt: skip
    both = one.with_(other)
    outcome = [both.slip, both.speeds, both.a_x, both.alike]
    assert [x.tolist() for x in outcome] == [[0.1, 0.03], [4.0, 9.0], [-3.0, 2.0], [8.0, -1.0]]
    assert [x.begin for x in both.segments] == [0.0, 3.0]
    assert (both.pairs, both.parted, both.a_y_late) == (4.0, 0.2, -0.3)
    assert both.unexplained.tolist() == [np.sqrt(2.0), 0.0]


@pytest.mark.parametrize(
    ("gain", "sd", "outcome"), [(0.1, 0.02, True), (-0.1, 0.04, False), (0.07, 0.01, False)]
)
def test_a_fit_notes_what_its_drives_had_beside_tires(gain, sd, outcome):
    p, covariance, k = PRIORS.mean.copy(), np.zeros((len(NAMES),) * 2), INDEX["steering_gain"]
    p[k], covariance[k, k] = gain, sd**2
    reach = Reach(segments=(Segment(3.0, 8.0, 0.5, 0.04),), parted=TRUST.parted, a_y_late=0.05)
    listed = dict(report.notes(reach, p, covariance))
    assert set(listed) == {"another_road", "a_y_late"} | ({"steering_gain"} if outcome else set())
    assert "from 3 to 8 s the friction was 0.50 ± 0.04 times" in listed["another_road"]
    assert "50 ms late" in listed["a_y_late"]
    if outcome:
        assert "reads 0.909 ± 0.017 times the right value" in listed["steering_gain"]
    assert "not_observable" in dict(report.notes(reach._replace(parted=0.01), p, covariance))


def test_numbers_of_tires_at_their_bounds_are_told_by_axle():
    assert report.at_bounds(CAR, PRIORS.mean) == ()
    p = PRIORS.mean.copy()
    p[INDEX["ln_stiffness_r"]] = PRIORS.high[INDEX["ln_stiffness_r"]]
    p[INDEX["ln_grip_f"]] = PRIORS.low[INDEX["ln_grip_f"]]
    front, rear = report.at_bounds(CAR, p)
    assert (front.axle, front.title, front.unit) == ("front", "grip", "static loads")
    assert (rear.axle, rear.title) == ("rear", "cornering stiffness") and rear.refuses
    assert (front.value, rear.value) == pytest.approx((0.1, 60.0))


# Roads.


def test_the_cheapest_path_is_the_best_of_all(rng):
    for price in (0.1, 1.0, 5.0):
        loss = rng.exponential(size=(3, 6))
        paths = list(product(range(3), repeat=6))
        costs = [
            loss[list(path), range(6)].sum() + price * np.count_nonzero(np.diff(path))
            for path in paths
        ]
        assert tuple(_cheapest(loss, price)) == paths[int(np.argmin(costs))]


def test_a_segment_is_as_likely_as_the_misfit_of_its_friction(problem, optimum, monkeypatch):
    """Of all drives; a path over steps of half a second becomes labels of samples."""
    losses = []

    def path(loss, price):
        losses.append(loss)
        assert price == roads.PRICE
        return np.where(np.arange(loss.shape[1]) < 6, 3, 9)

    monkeypatch.setattr(roads, "_cheapest", path)
    drives = problem.drives * 2
    (one, other) = roads._segments(drives, CAR, PRIORS, optimum)
    both, (loss,) = Problem(drives, CAR, PRIORS).thinned(), losses
    S2, memory = np.minimum(optimum.scale, 1.5) ** 2, np.minimum(optimum.memory, 4.0)
    for k in (0, 5, 13):
        e = both.misses(optimum.p, float(roads.GRID[k]))
        assert loss[k].sum() == pytest.approx(both.misfit(e, S2, memory), rel=5e-3)
    assert loss.shape == (14, -(-both.weight.size // 10))
    begins = np.flatnonzero(np.diff(one)) + 1  # the shorter road is the first
    assert one[0] == 1 and one[-1] == 0 and (other == 0).all()
    t = drives[0].t
    assert begins.tolist() == [np.searchsorted(t, both.times(0)[60])]


def test_roads_count_from_the_longest_and_near_ones_are_one():
    (one, other) = _ranked([np.array([0, 0, 5, 5, 5]), np.array([5, 12, 12, 0, 0, 0, 0])])
    assert one.tolist() == [0, 0, 1, 1, 1] and other.tolist() == [1, 2, 2, 0, 0, 0, 0]


# Signals.


def test_means_hold_the_edges_and_slopes_are_of_what_is_fast(rng):
    x = rng.standard_normal(50)
    padded = np.pad(x, 3, mode="edge")
    np.testing.assert_allclose(box(x, 6.4), np.convolve(padded, np.full(7, 1 / 7), "valid"))
    np.testing.assert_array_equal(box(x, 1.9), x)
    np.testing.assert_allclose(thinned(x, 4), x[:48].reshape(12, 4).mean(axis=1))
    t = 0.01 * np.arange(2000)
    fast, on, within = np.sin(6.0 * t), np.ones(t.size, dtype=bool), (0.8, 1.2)
    assert slope_on(fast, 1.1 * fast + 3.0, on, 0.01, within) == pytest.approx(1.1, abs=0.01)
    for felt in (0.7 * fast, 1.3 * fast, fast + np.cos(6.0 * t), 0.0 * fast):
        assert slope_on(fast, felt, on, 0.01, within) is None
    assert slope_on(fast, fast, t < 1.9, 0.01, within) is None, "two seconds are needed"


def test_starts_are_tried_in_means_of_each_drive_by_its_own_rate(problem):
    slow = replace(problem.drives[0].thinned(10), every=10)
    both = Problem([*problem.drives, slow], CAR, PRIORS)
    assert [one.dt for one in both.thinned().drives] == pytest.approx([0.04, 0.1])
    labels = [np.arange(len(problem.drives[0].signals)) // 450]
    found = solve.estimate(problem.drives, CAR, PRIORS, labels=labels)
    assert found.roads.shape == (1,) and abs(found.roads[0]) < 4.0 * found.road_sd[0]


def test_a_thinned_drive_holds_means_of_its_segments():
    drive = Drive.of(joined([driven(3), driven(4)]), CAR)
    thin = drive.thinned(4)
    edges = (*drive.begins, len(drive.signals))
    parts = [drive.signals[a:b] for a, b in pairwise(edges)]
    means = np.concatenate([thinned(part, 4) for part in parts])
    np.testing.assert_allclose(thin.signals[:, :-1], means[:, :-1])
    np.testing.assert_array_equal(thin.counts, means[:, -1] == 1.0)
    assert thin.dt == pytest.approx(4 * drive.dt)
    assert thin.begins == (0, len(parts[0]) // 4)


def test_a_bank_is_what_motion_shows_and_no_accelerometer_but_for_roll_and_level():
    t = 0.01 * np.arange(4000)
    r, fall = 0.1 * np.sin(2.0 * t), 0.06 * np.exp(-(((t - 20.0) / 4.0) ** 2))
    motion = 20.0 * r
    drive = made(t, r=r, delta_f=0.1 * r, a_y=1.05 * (motion - GRAVITY * fall) + 0.03)
    outcome = Drive.of(drive, CAR).signals[:, 6] / GRAVITY
    middle = (np.abs(t - 20.0) < 2.0) & (np.abs(np.sin(2.0 * t)) < 2.0)
    np.testing.assert_allclose(outcome[middle], fall[middle], atol=0.012)
    assert (outcome[np.abs(t - 20.0) > 12.0] == 0.0).all(), "within what a sensor is off level"
    deaf = replace(drive, a_y=0.5 * motion)
    assert (Drive.of(deaf, CAR).signals[:, 6] == 0.0).all()
