"""The parts of a plan by another road: an integrator, sums by hand, geometry, numbers by hand."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identifier.axle import AxleIdentifier
from identifier.axle.slip import SHORTEST
from identifier.plan import PlanError, PlausibleTires, Space, hold_of, make_plan
from identifier.plan import motion as motion_module
from identifier.plan import search as search_module
from identifier.plan.chosen import CHOSEN as PLAN_CHOSEN
from identifier.plan.information import asked, covariance_after, deviation, expected_error
from identifier.plan.motion import NO_HOLD, Entry, Hold, simulate, steps_of
from identifier.plan.plan import _longest_pass, _rated, random_of, slalom_of
from identifier.plan.search import Search, _Steerings, body_of, edge_distance, swing_time
from identifier.run import identify
from models.bicycle import BicycleParameters, bicycle
from models.plant import Plant
from models.vehicle import GRAVITY, sedan

CAR, SPEED = sedan(), 15.0
SPACE = Space(
    length=60.0, width=14.0, speed=SPEED, share=0.9, margin=1.0, rate_limit=0.7, max_angle=0.5
)


@pytest.fixture(scope="module")
def tires():
    return PlausibleTires.declared(CAR, 0.8)


@pytest.fixture(scope="module")
def found(tires):
    """A plan of one pass, of a short search; and what it said of its progress."""
    shares = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search_module, "CHOSEN", search_module.CHOSEN._replace(generations=12))
        plan = make_plan(tires, SPACE, 3.0, np.random.default_rng(0), shares.append)
    return plan, shares


@pytest.fixture(scope="module")
def driven(tires):
    """Two steerings on all tires: planned angles and motion."""
    t = steps_of(tires, 2.5)
    planned = np.column_stack([0.09 * np.sin(4.0 * t), 0.03 * np.sin(7.0 * t)])
    entry = Entry(np.array([3.0, 4.0]), np.array([5.0, 6.0]), np.array([0.2, -0.1]))
    return t, simulate(tires, planned, SPEED, entry, NO_HOLD)


def equations(tires, k, planned):
    """d/dt of v_y, r, X, Y, ψ, δ, ρ, dρ/dt, and of both axles x, ∂x/∂s, ∂x/∂k."""
    ladder, W = np.array(tires.method.ladder), tires.W[k]
    s, share = tires.compliance, tires.sway_share
    stiffness, damping, soft, *_ = tires.method.sway.numbers()
    loads, arms = np.array(CAR.axle_loads), np.array([CAR.l_f, -CAR.l_r])
    flattest = PLAN_CHOSEN.least_slope * (W / ladder).sum(axis=1)

    def rates(t, state):
        v_y, r, _, _, psi, delta, rho, rho_dot = state[:8]
        x, p_s, p_k = state[8:].reshape(3, 2)
        T = np.tanh(x[:, None] / ladder)
        phi, slope = (W * T).sum(axis=1), (W * (1.0 - T**2) / ladder).sum(axis=1)
        bend = (-2.0 * W * T * (1.0 - T**2) / ladder**2).sum(axis=1)
        bend = np.where(slope < flattest, 0.0, bend)
        slope = np.maximum(slope, flattest)
        F_f, F_r = loads * phi * [math.cos(delta), 1.0]
        sway = -rho_dot * soft / SPEED
        alpha = [delta, 0.0] - np.arctan((v_y + arms * r) / SPEED) + share * sway
        sigma = s * slope + SHORTEST * CAR.wheelbase
        pull = SPEED / sigma
        late = (alpha - x) / sigma * (slope + s * bend * p_s)
        return [
            (F_f + F_r) / CAR.mass - SPEED * r, (CAR.l_f * F_f - CAR.l_r * F_r) / CAR.yaw_inertia,
            SPEED * math.cos(psi) - v_y * math.sin(psi),
            SPEED * math.sin(psi) + v_y * math.cos(psi), r,
            (planned(t) - delta) / tires.steering_lag[k], rho_dot,
            stiffness * ((loads * phi).sum() / CAR.mass - rho) - damping * rho_dot,
            *(pull * (alpha - x)), *(-pull * (p_s + late)), *(pull * (sway - p_k)),
        ]  # fmt: skip

    return rates


@pytest.mark.parametrize("k", [0, 4])
def test_motion_and_sensitivities_are_those_of_an_integrator(tires, k, monkeypatch):
    monkeypatch.setattr(motion_module, "CHOSEN", motion_module.CHOSEN._replace(step=0.05 / 16))
    t, entry = steps_of(tires, 2.0), Entry(np.array([3.0]), np.array([5.0]), np.array([0.2]))
    ours = simulate(tires, 0.1 * np.sin(4.0 * t)[:, None], SPEED, entry, NO_HOLD)
    start = np.zeros(14)
    start[2:5] = 3.0, 5.0, 0.2
    rates = equations(tires, k, lambda at: 0.1 * np.sin(4.0 * at))
    theirs = solve_ivp(rates, (0.0, t[-1]), start, t_eval=t, rtol=1e-8, atol=1e-10).y
    axles = [one[:, :, 0, k] for one in (ours.slip, ours.of_compliance, ours.of_share)]
    lanes = [one[:, 0, k] for one in (ours.v_y, ours.r, ours.X, ours.Y, ours.psi, ours.delta)]
    for mine, exact in zip([*lanes, *np.hstack(axles).T], [*theirs[:6], *theirs[8:]], strict=True):
        np.testing.assert_allclose(mine, exact, atol=0.02 * np.ptp(exact))


def test_the_covariance_is_the_sum_of_regressors_by_hand(tires, driven):
    _, motion = driven
    P, numbers = covariance_after(tires, motion, SPEED), tires.method.regression
    ladder, dt = np.array(tires.method.ladder), 2.0 * steps_of(tires, 1.0)[1]
    for m, k, a in ((0, 0, 0), (0, 3, 1), (1, 6, 1)):
        slip, force, slope, p_s, p_k = (one[::2, a, m, k] for one in motion[:5])
        offset = slope if a == 0 else slope / SPEED
        rows = np.column_stack([np.tanh(slip[:, None] / ladder), slope * p_s, slope * p_k, offset])
        keep = math.exp(-numbers.bandwidth * dt)
        information, h, last = np.linalg.inv(tires.covariance[a]), 0.0, 0.0
        for g, phi, steep in zip(rows, force, slope, strict=True):
            h, last = keep * h + 0.5 * (1.0 - keep) * (g + last), g
            y = h[: ladder.size] @ tires.W[k, a]
            sigma = numbers.error + numbers.relative_error * abs(y)
            sigma += numbers.lateness * numbers.bandwidth * abs(phi - y)
            sigma += numbers.noise * max(steep, 0.0) / SPEED
            alike = 5.0 * numbers.correlation_time / dt  # samples that count as one
            information = information + np.outer(h, h) / (sigma**2 * alike)
        np.testing.assert_allclose(P[m, k, a] @ information, np.eye(ladder.size + 3), atol=1e-6)


def test_deviations_are_those_of_curves_that_are_drawn(tires):
    rng, doubt, n = np.random.default_rng(3), asked(tires, SPEED), len(tires.method.ladder)
    np.testing.assert_allclose(doubt.slips, tires.slip_at(0.98)[0][:, None] * np.arange(1, 13) / 12)
    ladder, offsets = np.array(tires.method.ladder), (1.0, 1.0 / SPEED)
    ours, errors = deviation(doubt, tires.covariance), []
    for a in (0, 1):
        scale = 1e-3  # small, so that the curve is a line in its offset
        drawn = scale * rng.multivariate_normal(np.zeros(n + 3), tires.covariance[a], 20_000)
        at = doubt.slips[a] + offsets[a] * drawn[:, -1:]
        curves = np.tanh(at[..., None] / ladder) @ tires.W[0, a]
        curves += drawn[:, :n] @ np.tanh(doubt.slips[a][:, None] / ladder).T
        np.testing.assert_allclose(curves.std(axis=0) / scale, ours[a], rtol=0.03)
        errors.append(ours[a] / tires.grip[0, a])
    wanted = math.sqrt(np.mean(np.square(errors)))
    assert expected_error(tires, doubt, tires.covariance) == pytest.approx(wanted)


def test_who_holds_the_course_steers_against_a_deviation_wherever_it_leads(tires):
    hold = hold_of(tires, SPEED)
    assert hold.steering((0.0, 0.0, 0.0), (9.0, 2.0, 0.0)) == pytest.approx(-2.0 * hold.aside)
    assert hold.steering((0.0, 0.0, 0.0), (0.0, 0.0, 0.1)) == pytest.approx(-0.1 * hold.heading)
    c, s = math.cos(2.0), math.sin(2.0)
    turned = hold.steering((1.0, 3.0, 2.0), (1.0 - 2.0 * s, 3.0 + 2.0 * c, 2.1))
    assert turned == pytest.approx(-2.0 * hold.aside - 0.1 * hold.heading)
    stiff = (tires.W[0] / np.array(tires.method.ladder)).sum(axis=1) * CAR.axle_loads
    linear = bicycle(
        BicycleParameters(CAR.mass, CAR.yaw_inertia, CAR.l_f, CAR.l_r, *map(float, stiff)), SPEED
    )
    gain = -np.linalg.solve(np.array(linear.A), np.array(linear.B)[:, 0])[1]  # yaw rate per angle
    poles = np.roots([1.0, gain * hold.heading, gain * hold.aside * SPEED])
    np.testing.assert_allclose(poles, -0.6 * math.sqrt(GRAVITY / CAR.wheelbase), rtol=1e-3)
    loose = replace(tires, W=tires.W * np.array([1.0, 0.1])[:, None])  # it would oversteer
    neutral = 2.0 * 0.6 * math.sqrt(GRAVITY / CAR.wheelbase) * CAR.wheelbase / SPEED
    assert hold_of(loose, SPEED).heading == pytest.approx(0.5 * neutral)


def test_the_edge_is_as_far_as_the_corners_of_the_body_are(tires):
    body = body_of(tires)
    track = max(CAR.require_chassis().track_front, CAR.require_chassis().track_rear)
    assert body == pytest.approx(
        (CAR.l_f + 0.32 * CAR.wheelbase, CAR.l_r + 0.32 * CAR.wheelbase, 0.56 * track)
    )
    bare = replace(tires, vehicle=replace(CAR, chassis=None))
    assert body_of(bare).side == pytest.approx(0.33 * CAR.wheelbase)

    def least(X, Y, psi):
        return edge_distance(SPACE, body, *(np.array([[one]]) for one in (X, Y, psi)))[0]

    assert least(5.0, 7.0, 0.0) == pytest.approx(5.0 - body.behind)
    assert least(5.0, 7.0, math.pi) == pytest.approx(5.0 - body.ahead)
    assert least(55.0, 7.0, 0.0) == pytest.approx(5.0 - body.ahead)
    assert least(30.0, 2.0, 0.0) == pytest.approx(2.0 - body.side)
    assert least(30.0, 11.0, 0.0) == pytest.approx(3.0 - body.side)
    assert least(30.0, 7.0, -math.pi / 2) == pytest.approx(7.0 - body.behind)
    corner = math.hypot(body.behind, body.side), math.atan2(body.side, body.behind)
    at = 7.0 - corner[0] * math.sin(0.7 + corner[1])
    assert least(30.0, 7.0, 0.7) == pytest.approx(at)


def test_a_swing_takes_as_long_as_its_rate_wants(tires):
    slow, angle = replace(SPACE, rate_limit=0.2), float(tires.slip_at(SPACE.share)[0, 0])
    took = swing_time(tires, slow)
    at = np.zeros(1)
    swing = _Steerings(np.array([[0.0, took]]), np.array([[angle, -angle]]), Entry(at, at, at))
    t = np.linspace(0.0, took, 2001)
    delta = swing.delta(t)[:, 0]
    assert delta[0] == angle and delta[-1] == -angle and abs(delta[1000]) < 1e-12
    assert np.abs(np.diff(delta) / np.diff(t)).max() == pytest.approx(0.2, rel=1e-4)
    quick = swing_time(tires, replace(SPACE, rate_limit=9.0))
    assert quick == pytest.approx(0.75 * math.sqrt(CAR.wheelbase / GRAVITY))


@pytest.mark.parametrize("duration", [3.0, 24.0])
def test_steerings_keep_rates_angles_and_margins_whatever_the_numbers(tires, duration):
    search = Search(tires=tires, space=SPACE, duration=duration, guided=False)
    N, body, swings = search.swings, body_of(tires), duration / swing_time(tires, SPACE)
    assert search.repeats == math.ceil(swings / 14)
    assert round(round(swings) / search.repeats) == N
    rng = np.random.default_rng(1)
    numbers = rng.uniform(-1.0, 1.0, (6, N + 2))
    numbers[0] = [*np.resize([1.0, -1.0], N - 1), 1.0, 1.0, 0.0]
    numbers[1] = [*np.full(N - 1, 0.2), -1.0, -1.0, 1.0]
    found = search.steerings(numbers)
    np.testing.assert_allclose(found.times[:, [0, -1]], [[0.0, duration]] * 6, atol=1e-12)
    spans = np.diff(found.times)[:, :N]
    np.testing.assert_allclose(spans[:2, -1] / spans[:2, 0], [9.0, 1.0 / 9.0])
    np.testing.assert_allclose(spans.sum(axis=1), duration / search.repeats)
    t = np.linspace(0.0, duration, 24_001)
    delta = found.delta(t)
    assert np.abs(found.angles).max() <= search.largest_angle and not found.angles[:, 0].any()
    rates = np.abs(np.diff(delta, axis=0)).max(axis=0) / t[1]
    assert rates.max() <= 0.7 * (1.0 + 1e-6) and rates[0] > 0.69
    assert found.angles[1, 2] == pytest.approx(0.2 * search.largest_angle)
    once = t <= duration / search.repeats
    if search.repeats > 1:
        np.testing.assert_allclose(
            delta[: once.sum()], -delta[once.sum() - 1 :][: once.sum()], atol=1e-3
        )
    np.testing.assert_allclose(found.entry.psi, math.radians(60.0) * numbers[:, -1])
    wide = replace(SPACE, width=1e3)
    enters = edge_distance(
        wide, body, found.entry.X[None], np.full((1, 6), 500.0), found.entry.psi[None]
    )
    np.testing.assert_allclose(enters, SPACE.margin)
    straight = found.entry.Y[:2] - [SPACE.width - body.side, body.side]
    np.testing.assert_allclose(straight, [-SPACE.margin, SPACE.margin])


def test_a_guided_pass_comes_back_to_the_middle_by_no_more_than_may_be_steered(tires):
    search = Search(tires=tires, space=SPACE, duration=9.0, guided=True)
    numbers = np.zeros((2, search.swings + 2))
    numbers[:, -2] = 0.9, -0.9  # it enters at a side
    kept = search.motion(search.steerings(numbers))
    free = replace(search, guided=False).motion(search.steerings(numbers))
    np.testing.assert_allclose(free.Y, np.broadcast_to(free.Y[:1], free.Y.shape), atol=1e-9)
    away = np.abs(kept.Y[[0, -1], :, 0] - 0.5 * SPACE.width)
    assert (away[1] < 0.05 * away[0]).all() and (away[0] > 4.0).all()
    blind = replace(search, space=replace(SPACE, held=False)).motion(search.steerings(numbers))
    assert np.ptp(blind.asked[:, 0, :]) > 0.0 == np.ptp(blind.asked, axis=2).max()
    rates = np.abs(np.diff(kept.asked[:, :, 0], axis=0)).max() / steps_of(tires, 1.0)[1]
    assert rates <= SPACE.rate_limit * (1.0 + 1e-9) and np.abs(kept.asked).max() <= 0.5


def test_no_swing_is_larger_than_a_bend_at_the_grip_and_its_slip(tires):
    search = Search(tires=tires, space=SPACE, duration=3.0, guided=False)
    bend = CAR.wheelbase * tires.grip[0].mean() * GRAVITY / SPEED**2
    assert search.largest_angle == pytest.approx(bend + 1.5 * tires.slip_at(PLAN_CHOSEN.rear)[0, 0])
    crawling = replace(search, space=replace(SPACE, speed=3.0))
    assert crawling.largest_angle == SPACE.max_angle


def test_each_limit_is_broken_by_as_much_as_is_said(tires):
    search = Search(tires=tires, space=SPACE, duration=3.0, guided=False)
    quiet = search.motion(search.steerings(np.zeros((1, search.swings + 2))))
    assert search.violation(quiet) <= 0.0
    rear, calm, share = (
        tires.slip_at(one) for one in (PLAN_CHOSEN.rear, PLAN_CHOSEN.calm, SPACE.share)
    )

    def broken(place, value):
        slip = quiet.slip.copy()
        slip[place] = value
        return float(search.violation(quiet._replace(slip=slip))[0])

    assert broken((9, 1, 0, 5), 1.2 * rear[5, 1]) == pytest.approx(0.2)
    assert broken((9, 1, 0, 5), -0.99 * rear[5, 1]) == 0.0
    assert broken((9, 0, 0, 0), -1.3 * share[0, 0]) == pytest.approx(0.3)
    assert broken((9, 0, 0, 5), 5.0 * share[5, 0]) == 0.0, "of the likely tires alone"
    assert broken((-1, 1, 0, 5), 1.1 * calm[5, 1]) == pytest.approx(0.1)
    assert broken((-2, 1, 0, 5), 1.1 * calm[5, 1]) == 0.0
    Y = quiet.Y.copy()
    Y[7, 0, 3] = 14.0 + 2.0 * CAR.wheelbase - 1.0 - body_of(tires).side
    aside = float(search.violation(quiet._replace(Y=Y))[0])
    assert aside == pytest.approx(2.0, abs=0.01)


def test_costs_are_the_errors_of_passes_and_more_than_1_beyond_a_limit(tires):
    search = Search(tires=tires, space=SPACE, duration=3.0, guided=False)
    begin = search.beginnings(np.random.default_rng(0))
    assert begin.shape == (32, search.swings + 2) and np.abs(begin).max() <= 1.0
    assert np.abs(begin[:, -1]).max() <= 0.3 < np.abs(begin[:, -2]).max() <= 0.9
    turning = np.sign(begin[:, 0]) * np.sign(begin[:, 1])
    assert (turning < 0).mean() > 0.5 and abs(np.sign(begin[:, 0]).mean()) < 0.5
    sizes = np.abs(begin[:, : search.swings - 1]).max(axis=1)
    assert sizes.min() < 0.2 and sizes.max() > 0.7
    costs = search.costs(begin)
    over = search.violation(search.motion(search.steerings(begin)))
    assert (over > 0.0).any() and (over <= 0.0).any()
    np.testing.assert_allclose(costs[over > 0.0], 1.0 + over[over > 0.0])
    one = int(np.flatnonzero(over <= 0.0)[0])
    taken = search.as_pass(begin[one : one + 1])
    assert costs[one] == pytest.approx(taken.error) and taken.error < 1.0
    np.testing.assert_allclose(taken.course(taken.t[[0, -1]])[:, 0], taken.motion.X[[0, -1], 0, 0])


@pytest.mark.parametrize(("rate", "asked_for"), [(1.0, 21), (0.9999, 21), (0.99, 31)])
def test_a_search_ends_when_twenty_generations_gain_less_than_a_percent(
    tires, monkeypatch, rate, asked_for
):
    costs = []

    def told(_, numbers):
        costs.append(0.9 * rate ** len(costs))
        return costs[-1] + 0.01 * np.arange(len(numbers))

    monkeypatch.setattr(search_module, "CHOSEN", search_module.CHOSEN._replace(generations=30))
    monkeypatch.setattr(Search, "costs", told)
    Search(tires=tires, space=SPACE, duration=2.0, guided=False).best(np.random.default_rng(0))
    assert len(costs) == asked_for


def test_a_plan_tells_its_progress_and_what_it_found(found, tires):
    plan, shares = found
    assert shares == sorted(shares) and 0.0 < shares[0] < 0.2 and 0.9 < shares[-1] <= 1.2
    (one,) = plan.passes
    motion = one.motion
    felt = np.gradient(motion.v_y[:, 0, 0], one.t) + SPEED * motion.r[:, 0, 0]
    assert plan.lateral_acceleration == pytest.approx(np.abs(felt).max(), rel=0.1)
    _, before, after = plan.deviations()
    loads = np.array(CAR.axle_loads)[:, None]
    np.testing.assert_allclose(before / loads, deviation(asked(tires, SPEED), tires.covariance))
    np.testing.assert_allclose(after / loads, deviation(asked(tires, SPEED), one.covariance))
    assert plan.error_before == pytest.approx(
        float(expected_error(tires, asked(tires, SPEED), tires.covariance))
    )
    ways = edge_distance(SPACE, body_of(tires), motion.X, motion.Y, motion.psi)
    assert plan.clearance == ways.min()
    (rehearsal,) = plan.rehearsed(Plant(CAR))
    log = rehearsal.log
    assert rehearsal.side_slip == pytest.approx(np.abs(np.arctan2(log.v_y, log.v_x)).max())
    assert abs(rehearsal.clearance - plan.clearance) < 1.0
    assert log.t[-1] == pytest.approx(4.0)
    felt = np.gradient(log.v_y, log.t) + log.v_x * log.r
    assert np.corrcoef(felt, log.a_y)[0, 1] > 0.99 and not log.delta_r.any()
    assert np.corrcoef(log.axle_force.sum(axis=1), log.a_y)[0, 1] > 0.99


def test_rivals_have_the_frequency_and_room_that_are_said(tires):
    f = 0.27 * math.sqrt(GRAVITY / CAR.wheelbase)
    t = np.linspace(0.0, 8.0, 8001)
    for maneuver, own in ((slalom_of(CAR, 8.0)(0.05), f), (slalom_of(CAR, 8.0, 0.9)(0.05), 0.9)):
        delta = maneuver.steering(t)[:, 0]
        np.testing.assert_allclose(delta, 0.05 * np.sin(2.0 * math.pi * own * t), atol=2e-3)
        fastest = 0.05 * 2.0 * math.pi * own
        assert fastest < maneuver.rate_limit < 1.1 * fastest
    random = random_of(CAR, 8.0, 2)(0.05)
    assert (random.frequency, random.seed) == (pytest.approx(1.5 * f), 2)
    assert random.rate_limit == pytest.approx(2.1 * math.pi * 1.5 * f * 0.05)
    still = [slalom_of(CAR, 2.0)(size) for size in (1e-6, 2e-6, 0.08)]
    rated, body = _rated(tires, SPACE, still, 2.0), body_of(tires)
    alone = [_rated(tires, SPACE, [one], 2.0).error for one in still]
    assert rated.error == pytest.approx(sorted(alone)[1])
    assert rated.width == pytest.approx(2.0 * body.side, abs=0.01)
    way = SPEED * steps_of(tires, 2.0)[-1]
    assert rated.length == pytest.approx(way + body.ahead + body.behind, abs=0.01)


def test_a_car_turns_where_a_circle_at_four_fifths_of_its_share_has_room(tires):
    body = body_of(tires)
    radius = 8.0**2 / (0.8 * SPACE.share * tires.grip.min() * GRAVITY)
    wide = 2.0 * (math.hypot(radius + body.side, body.ahead) + SPACE.margin)
    for share, endless in ((1.001, True), (0.999, False)):
        space = replace(SPACE, speed=8.0, length=100.0, width=share * wide)
        assert (_longest_pass(tires, space) == math.inf) is endless


def test_an_area_is_large_enough_when_it_is_as_large_as_was_asked(tires):
    small = replace(SPACE, length=20.0)
    with pytest.raises(PlanError) as told:
        make_plan(tires, small, 3.0, np.random.default_rng(0))
    long, slow = (
        float(re.search(words, str(told.value))[1])
        for words in (r"must be ([\d.]+) m long", r"drive at ([\d.]+) m/s")
    )
    needed = 3 * swing_time(tires, SPACE)
    body = body_of(tires)
    own = 2.0 * SPACE.margin + body.ahead + body.behind
    assert long == pytest.approx(own + SPEED * needed, rel=5e-3)
    assert slow == pytest.approx((20.0 - own) / needed, rel=5e-3)


def test_plausible_cars_have_brush_tires_softer_stiffer_and_grippier_by_a_third(tires):
    slips = np.linspace(0.01, 0.3, 60)
    curves = np.tanh(slips[:, None] / np.array(tires.method.ladder)) @ tires.W.transpose(0, 2, 1)
    front, rear = np.array([CAR.bicycle.C_f, CAR.bicycle.C_r]) / CAR.axle_loads
    neutral = math.sqrt(front * rear)
    cases = [(front, rear, 1.0), (0.7 * front, 0.7 * rear, 1.0), (1.3 * front, 1.3 * rear, 1.0)]
    cases += [(neutral, neutral, 0.7), (front, rear, 1.3), (0.7 * front, 1.3 * rear, 1.0)]
    cases += [(0.7 * front, 0.7 * rear, 0.7)]
    for ours, (*stiffness, share) in zip(curves, cases, strict=True):
        for a, c in enumerate(stiffness):
            u = np.minimum(c * np.tan(slips) / (3.0 * 0.8 * share), 1.0)
            brush = 0.8 * share * (3.0 * u - 3.0 * u**2 + u**3)
            np.testing.assert_allclose(ours[:, a], brush, atol=0.05)
    lag = CAR.require_chassis().steering_lag
    np.testing.assert_allclose(tires.steering_lag, lag * np.array([1, 0.7, 1.3, 1.3, 0.7, 1.3, 1]))
    told = PlausibleTires.declared(CAR, 0.8, steering_lag=0.1)
    assert told.steering_lag[0] == 0.1
    bare = PlausibleTires.declared(replace(CAR, chassis=None), 0.8)
    assert bare.steering_lag[0] == 0.04


def test_a_learnt_car_is_planned_with_its_own_curves_and_no_offset():
    log = Plant(CAR).simulate(slalom_of(CAR, 6.0)(0.06), speed=SPEED).recording()
    model = identify(log, CAR, AxleIdentifier.for_vehicle(CAR, dt=log.dt)).freeze()
    known = PlausibleTires.learnt(model, np.random.default_rng(0))
    np.testing.assert_array_equal(known.compliance, model.compliance)
    assert known.covariance is model.covariance and known.method.ladder == model.ladder
    lag = CAR.require_chassis().steering_lag
    np.testing.assert_allclose(known.steering_lag / lag, [1.0, *[0.7, 1.3] * 3])
    assert len(known.W) == 7 and np.ptp(known.W, axis=0).max() > 0.0
    assert not np.isnan(known.slip_at(0.9)).any()
    half = known.slip_at(0.5)
    assert (half < known.slip_at(0.9)).all() and Hold(0.0, 0.0) == NO_HOLD
