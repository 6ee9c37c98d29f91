"""The estimate without v_y, by other roads: finite differences, dense algebra, planted truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

import tireid as ti
from identifier.estimate.drive import hardest
from identifier.estimate.fit import fit
from identifier.estimate.latent import (
    TRUST,
    Off,
    _Latent,
    accelerometer_off,
    latent_priors,
    learn_latent,
)
from identifier.estimate.model import FittedModel
from identifier.estimate.nodes import Nodes, _rolled, low_passed
from identifier.estimate.priors import Priors
from identifier.inertial import InertialIdentifier
from identifier.motion.model import DAMPING
from identifier.motion.nodes import LATENT_NAMES
from identifier.verdict import judge_prediction
from identifier.verdict.verdict import WITHOUT_V_Y
from models.recordings import Recording, RecordingError
from models.recordings.record import joined
from tests.identifier.conftest import steered

CAR = ti.sedan()


def driven(seed):
    return steered(seed, 19.99, amplitude=np.radians(4.0)).recording()


def blind(exact, seed=1):
    rng, n = np.random.default_rng(seed), len(exact)
    return replace(
        exact,
        v_y=None,
        r=exact.r + 0.002 * rng.normal(size=n),
        a_y=exact.a_y + 0.05 + 0.1 * rng.normal(size=n),
        axle_force=None,
    )


@pytest.fixture(scope="module")
def exact():
    return driven(3)


@pytest.fixture(scope="module")
def problem(exact):
    nodes = Nodes.of(blind(exact).between(0.0, 3.0), CAR)
    return _Latent(nodes, CAR, latent_priors(CAR, Priors.of(CAR)))


@pytest.fixture(scope="module")
def place(problem):
    """States and parameters beside the optimum, and weights there."""
    rng = np.random.default_rng(2)
    z, p, _ = problem.begin()
    z = z + np.array([0.05, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.005]) * rng.normal(size=z.shape)
    p[problem.index] += 0.1 * rng.normal(size=problem.index.size) * 0.05
    return z, p, problem.weights(problem.seen(z, p), problem.R)


def test_the_gradient_is_that_of_the_cost(problem, place):
    z, p, weights = place
    at, _ = problem.around(z, p, weights, problem.index)
    rng = np.random.default_rng(5)
    for _ in range(4):
        dz, dp = 1e-6 * rng.normal(size=z.shape), np.zeros_like(p)
        dp[problem.index] = 1e-7 * rng.normal(size=problem.index.size)
        ahead = problem.cost(problem.seen(z + dz, p + dp), p + dp, weights)
        behind = problem.cost(problem.seen(z - dz, p - dp), p - dp, weights)
        outcome = 2.0 * (np.sum(at.g * dz) + at.g_p @ dp[problem.index])
        assert ahead - behind == pytest.approx(outcome, rel=1e-3, abs=1e-6)


def test_the_step_is_that_of_the_dense_matrix(problem, place):
    z, p, weights = place
    at, _ = problem.around(z, p, weights, problem.index)
    n, m = z.size, problem.index.size
    H = np.zeros((n + m, n + m))
    for k in range(len(z)):
        here = slice(8 * k, 8 * k + 8)
        H[here, here] = at.A[k]
        if k + 1 < len(z):
            H[8 * k + 8 : 8 * k + 16, here] = at.O[k]
            H[here, 8 * k + 8 : 8 * k + 16] = at.O[k].T
    H[:n, n:] = at.B.reshape(n, m)
    H[n:, :n] = H[:n, n:].T
    H[n:, n:] = at.C
    scale = np.sqrt(np.diag(H))
    g = np.concatenate([at.g.ravel(), at.g_p])
    step = -np.linalg.solve(H / np.outer(scale, scale), g / scale) / scale
    dz, dp, _ = next(problem._steps(at, p, 0.0))
    bounded = (p + np.bincount(problem.index, step[n:], p.size) < problem.priors.low).any()
    if not bounded:
        np.testing.assert_allclose(dp, step[n:], rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(dz.ravel(), step[:n], rtol=1e-3, atol=1e-6)
    exactly = _Latent(problem.nodes, CAR, problem.priors, trust=replace(TRUST, lasting=1.0))
    own, P, slopes = exactly.spread(z, p, problem.R)
    inverse = np.linalg.inv(H / np.outer(scale, scale)) / np.outer(scale, scale)
    whole = own[:, 0, 0] + np.einsum("ni,ij,nj->n", slopes, P, slopes)
    np.testing.assert_allclose(whole, np.diag(inverse)[: z.size : 8], rtol=1e-3)


def test_steps_that_are_tried_again_are_smaller_and_within_bounds(problem, place):
    z, p, weights = place
    low, high = problem.priors.low, problem.priors.high
    p = np.clip(p, low, high)
    at, _ = problem.around(z, p, weights, problem.index)
    aimed, sizes = p.copy(), []
    for _, dp, _ in problem._steps(at, p, 0.0):
        aimed[problem.index] = p[problem.index] + dp
        assert (aimed > low - 1e-9).all() and (aimed < high + 1e-9).all()
        sizes.append(np.linalg.norm(dp * np.sqrt(np.diag(at.C))))
    assert (np.diff(sizes) < 0.0).all() and sizes[-1] < 0.01 * sizes[0]


def test_soft_and_stiff_tires_end_alike(exact):
    nodes = Nodes.of(blind(exact), CAR)
    whole = _Latent(nodes, CAR, latent_priors(CAR, Priors.of(CAR)))
    soft, stiff = (whole.descend(*whole.begin(k), whole.R)[2] for k in (-0.4, 0.4))
    assert soft == pytest.approx(stiff, abs=0.5)


def test_parameters_that_are_held_leave_their_doubt(problem, place):
    """Held parameters with the covariance of the free ones tell the same doubt of v_y."""
    z, p, _ = place
    own, P, slopes = problem.spread(z, p, problem.R)
    free = np.einsum("ni,ij,nj->n", slopes, P, slopes)
    moves = np.zeros_like(problem.priors.moves)
    again = [LATENT_NAMES.index(name) for name in ("r_bias", "a_y_bias")]
    moves[again] = True
    held = _Latent(problem.nodes, CAR, replace(problem.priors, moves=moves), columns=problem.index)
    own_held, P_held, slopes_held = held.spread(z, p, problem.R)
    np.testing.assert_allclose(own_held, own, rtol=1e-6)
    known = np.flatnonzero(~moves[problem.index])
    outcome = np.einsum(
        "ni,ij,nj->n", slopes_held[:, known], P[np.ix_(known, known)], slopes_held[:, known]
    ) + np.einsum("ni,ij,nj->n", slopes_held[:, held.free], P_held, slopes_held[:, held.free])
    np.testing.assert_allclose(outcome, free, rtol=1e-3)


@pytest.mark.parametrize("size", [1.0, 0.1])
def test_without_v_y_the_accelerometer_is_believed_by_the_size_of_the_car(size):
    lengths = {"l_f": size * CAR.l_f, "l_r": size * CAR.l_r}
    car = replace(CAR, **lengths, yaw_inertia=size**2 * CAR.yaw_inertia)
    scale, beliefs = np.sqrt(car.wheelbase / 2.7), Priors.of(car)
    nowhere = np.zeros(0)
    for late, left in ((0.0, 0.0007), (0.05, 0.01 * scale)):
        found = latent_priors(car, beliefs, Off(late, 0.0, 0.0, nowhere, nowhere, nowhere))
        sd = dict(zip(LATENT_NAMES, np.diag(found.covariance) ** 0.5, strict=True))
        outcome = [sd[name] for name in ("r_bias", "a_y_bias", "roll", "a_y_delay", "a_y_lever")]
        expected = [0.002 / scale, 0.015, 0.04, left, 0.01 * car.wheelbase]
        assert outcome == pytest.approx(expected)
        assert found.mean[LATENT_NAMES.index("roll")] == pytest.approx(0.06)
    held = {LATENT_NAMES[k] for k in np.flatnonzero(beliefs.moves) if not found.moves[k]}
    assert held == {"ln_sway", "v_y_bias", "v_y_angle", "v_y_lever"}
    assert sd["ln_inertia"] == pytest.approx(0.007)


def test_it_begins_without_slip_at_the_rear_and_with_what_steering_leaves_at_the_front(problem):
    z, p, _ = problem.begin(stiffer=0.4)
    v_x, delta, rear = *problem.nodes.given[:, :2].T, z[:, 0] - CAR.l_r * z[:, 1]
    front = delta - np.arctan((z[:, 0] + CAR.l_f * z[:, 1]) / v_x)
    np.testing.assert_allclose(rear, 0.0, atol=1e-12)
    np.testing.assert_allclose(z[:, 2], front, atol=1e-12)
    moved = p - problem.priors.mean
    assert {LATENT_NAMES[k] for k in np.flatnonzero(moved)} == {"ln_stiffness_f", "ln_stiffness_r"}
    assert moved.max() == pytest.approx(0.4)


def test_noise_is_the_density_of_what_is_left_with_the_doubt_of_the_states(problem, place):
    z, _, _ = place
    nothing, rng = np.zeros((len(z), 8, 8)), np.random.default_rng(3)
    slopes, R = np.ones((len(z), 2, 8)), problem.R
    white = rng.standard_normal((len(z), 2)) * [0.02, 1.0]

    def learnt(e, covariance=nothing):
        return problem.noise(e, covariance, slopes, R)

    found = learnt(white)
    np.testing.assert_allclose(found, [0.02**2, 1.0], rtol=0.6)
    doubtful = nothing.copy()
    doubtful[:, 0, 0] = 2.0
    assert learnt(white, doubtful)[1] > found[1] + 1.5
    slow = np.repeat(white[::6], 6, axis=0)[: len(white)]
    assert learnt(slow)[1] > 2.0 * found[1], "what lasts is more than its variance"
    np.testing.assert_allclose(learnt(1e-6 * white), 1e-10)


def test_optima_are_compared_by_hubers_loss(problem, place):
    z, p, _ = place
    seen, clip = problem.seen(z, p), TRUST.clip
    off = np.abs(seen["missed"]) / np.sqrt(problem.variance(problem.R))
    assert (off > clip).any() and (off < clip).any()
    huber = np.where(off > clip, clip * off - 0.5 * clip**2, 0.5 * off**2)
    weights = problem.weights(seen, problem.R)
    rest = problem.cost(seen, p, {**weights, "of_shows": np.zeros_like(off)})
    on = problem.nodes.counts
    assert problem.value(seen, p, problem.R) == pytest.approx(rest + huber[on].sum())


def test_a_low_pass_is_of_second_order_twice_and_a_body_sways_behind_a_y():
    t = 0.01 * np.arange(4000)
    for hertz, gain in ((1.0, 0.998), (5.0, 0.5), (10.0, 0.055)):  # of Butterworth's, squared
        wave = np.sin(2.0 * np.pi * hertz * t)
        passed = low_passed(wave, 5.0, 0.01)
        assert np.std(passed[500:-500]) / np.std(wave) == pytest.approx(gain, abs=0.02)
    omega = 9.0
    rho, rate = _rolled(np.where(t > 1.0, 2.0, 0.0), omega, 0.01)
    assert rho[99] == rate[99] == 0.0
    assert rho[-1] == pytest.approx(2.0) and rho.max() == pytest.approx(2.7, abs=0.15)
    np.testing.assert_allclose(rate[1:], np.diff(rho) / 0.01)
    peak = t[np.argmax(rho)] - 1.0
    assert peak == pytest.approx(np.pi / (omega * np.sqrt(1.0 - DAMPING**2)), abs=0.02)


@pytest.fixture(scope="module")
def learnt(exact):
    return fit([blind(exact)], CAR).model


def test_tires_that_are_known_tell_the_side_slip_of_another_drive(learnt):
    other = driven(9)
    outcome = learnt.estimated_v_y(blind(other, seed=4))
    away = np.degrees((outcome.v_y - other.v_y) / other.v_x)
    assert np.sqrt(np.mean(away**2)) < 0.12
    assert np.mean(np.abs(outcome.v_y - other.v_y) < 2.0 * outcome.sd) > 0.9
    assert outcome.observable.mean() > 0.9


@pytest.mark.parametrize("less", range(1, 5))
def test_the_estimated_side_slip_goes_on_to_the_last_sample(learnt, exact, less):
    """Whatever is left of the log behind the last node."""
    log = exact.between(10.0, 22.0 - less * exact.dt)
    found = learnt.estimated_v_y(blind(log)).v_y
    for end in (slice(0, 8), slice(-8, None)):
        assert np.abs(np.diff(found[end])).max() < 0.1, found[end]


@pytest.mark.parametrize(("hertz", "late"), [(None, 0.0), (5.0, 0.045), (2.0, 0.112)])
def test_an_accelerometer_behind_a_causal_filter_is_late(exact, hertz, late):
    log = blind(exact)
    if hertz is not None:
        log = replace(log, a_y=lfilter(*butter(2, 2.0 * hertz * log.dt), log.a_y))
    found = accelerometer_off(log, CAR, latent_priors(CAR, Priors.of(CAR))).late
    assert found == pytest.approx(late, abs=0.02)


@pytest.mark.parametrize("ahead", [-1.6, 1.3])
def test_the_place_of_an_accelerometer_is_no_delay(exact, ahead):
    log = blind(exact)
    log = replace(log, a_y=log.a_y + ahead * np.gradient(exact.r, exact.dt))
    model = fit([log], CAR).model
    assert model.reach.a_y_place == pytest.approx(ahead, abs=0.25)
    assert model.reach.a_y_late == 0.0
    said = dict(model.drives.notes)["a_y_place"]
    assert ("behind" if ahead < 0.0 else "ahead of") in said
    assert ("ms early" in said and "cannot tell" in said) == (model.reach.a_y_instead < 0.0)
    true = exact.axle_force
    missed = np.sqrt(np.mean((model.predict(exact) - true) ** 2, axis=0) / np.mean(true**2, axis=0))
    assert missed.max() < 0.08
    shown = replace(log, v_y=model.estimated_v_y(log).v_y, estimated=("v_y",))
    assert judge_prediction(model, shown).valid


def test_an_a_y_that_was_computed_from_the_motion_is_on_time(exact):
    log = blind(exact)
    log = replace(log, a_y=np.gradient(exact.v_y, exact.dt) + exact.v_x * exact.r)
    assert abs(accelerometer_off(log, CAR, latent_priors(CAR, Priors.of(CAR))).late) < 0.003


def test_an_a_y_that_is_too_early_stays_and_may_be_measured_ahead(exact):
    """As where the yaw rate is behind a filter: at one speed nobody can tell."""
    log = blind(exact)
    early = replace(log, a_y=np.interp(log.t + 0.06, log.t, log.a_y))
    model = fit([early], CAR).model
    assert model.reach.a_y_late or model.reach.a_y_instead == pytest.approx(-0.06, abs=0.02)
    (said,) = (text for code, text in model.drives.notes if code.startswith("a_y"))
    assert "early" in said
    assert InertialIdentifier.holding(model, CAR).a_y_late == 0.0


def test_a_delay_that_is_hardly_known_is_not_believed(exact, monkeypatch):
    """As after a single step of the steering."""
    log = blind(exact)
    log = replace(log, a_y=lfilter(*butter(2, 10.0 * log.dt), log.a_y))
    outcome = _Latent.spread

    def doubtful(*given):
        covariance, P, slopes = outcome(*given)
        return covariance, 400.0 * P, slopes

    monkeypatch.setattr(_Latent, "spread", doubtful)
    assert accelerometer_off(log, CAR, latent_priors(CAR, Priors.of(CAR))).late == 0.0


def test_a_model_keeps_what_it_says_of_its_log(learnt, tmp_path):
    doubtful = replace(learnt, reach=learnt.reach._replace(parted=2.0 * TRUST.parted, a_y_late=0.1))
    doubtful.save(tmp_path / "weights.json")
    again = FittedModel.load(tmp_path / "weights.json")
    assert isinstance(again, FittedModel)
    assert again.drives.notes == doubtful.drives.notes
    assert {"not_observable", "a_y_late"} <= {code for code, _ in again.drives.notes}
    assert not {"not_observable", "a_y_late"} & {code for code, _ in learnt.drives.notes}


def test_nothing_goes_from_one_segment_to_the_next(exact):
    log = blind(exact)
    both = joined([log.between(0.0, 8.0), log.between(12.0, 19.9)])
    nodes = Nodes.of(both, CAR)
    assert nodes.begins.sum() == 2
    assert not nodes.goes[np.flatnonzero(nodes.begins)[1] - 1]
    outcome = fit([both], CAR).model.estimated_v_y(both)
    parts = [exact.between(0.0, 8.0).v_y, exact.between(12.0, 19.9).v_y]
    away = outcome.v_y - np.concatenate(parts)
    assert np.degrees(np.sqrt(np.mean(away**2)) / 20.0) < 0.15


def test_a_log_with_neither_sensor_is_refused(exact):
    with pytest.raises(RecordingError, match="there is no ay"):
        fit([replace(blind(exact), a_y=None)], CAR)


@pytest.mark.parametrize(("worse", "parted"), [(0.0, True), (100.0, False)])
def test_starts_part_only_where_both_explain_the_drive(problem, monkeypatch, worse, parted):
    """An end that explains the drive far worse says nothing of what is observable."""
    z, p, _ = problem.begin()
    best = problem.smoothed(*problem.begin(), rounds=0)
    moved = z.copy()
    moved[:, 0] += 0.5
    monkeypatch.setattr(_Latent, "smoothed", lambda self, *given: best)
    monkeypatch.setattr(_Latent, "descend", lambda *given, **more: (moved, p, best.cost + worse))
    found = learn_latent(problem.nodes, CAR, Priors.of(CAR))
    assert (found.parted > TRUST.parted) == parted
    outcome = found.posterior
    assert outcome.seconds == pytest.approx(problem.nodes.counts.sum() * problem.nodes.dt)
    assert outcome.scale.tolist() == [1.0, 1.0] and outcome.cost == best.cost


@pytest.mark.parametrize(("wider", "refused"), [(1.0, False), (400.0, True)])
def test_a_side_slip_that_is_hardly_known_judges_no_model(learnt, wider, refused):
    doubtful = replace(learnt, covariance=wider * learnt.covariance)
    log = blind(driven(9), seed=4)
    shown = replace(log, v_y=doubtful.estimated_v_y(log).v_y, estimated=("v_y",))
    verdict = judge_prediction(doubtful, shown)
    assert ("side_slip_unknown" in [one.code for one in verdict.findings]) == refused
    assert refused or verdict.blind == WITHOUT_V_Y


def test_of_a_long_log_the_hardest_part_teaches():
    n = 40_000
    t = 0.1 * np.arange(n)
    r = np.where((t > 1000.0) & (t < 1300.0), 0.3, 0.01) * np.sin(0.5 * t)
    log = Recording(
        name="long", t=t, v_x=np.full(n, 20.0), v_y=None, r=r, delta_f=0.1 * r, delta_r=0.0 * t,
        a_y=20.0 * r,
    )  # fmt: skip
    part = hardest(log, 300.0)
    assert part.stop - part.start == 3000 and abs(t[part.start] - 1000.0) < 10.0
    assert hardest(log.between(0.0, 100.0), 300.0) == slice(0, len(log.between(0.0, 100.0)))
