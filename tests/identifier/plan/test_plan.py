"""Plans: the motion they expect, what they promise to teach, and that no limit is passed."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.plan import Plan, PlanError, PlausibleTires, Space, hold_of, make_plan, rehearse
from identifier.plan import information as information_module
from identifier.plan import motion as motion_module
from identifier.plan import search as search_module
from identifier.plan.information import asked, covariance_after, deviation, expected_error
from identifier.plan.motion import NO_HOLD, Entry, Guide, Motion, simulate, steps_of, time_step
from identifier.plan.plan import _longest_pass, extent, free_motion, hardest, slalom_of
from identifier.plan.search import Search, body_of
from identifier.run import identify
from models.bicycle import BicycleParameters, bicycle
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.recordings import Recording
from models.vehicle import sedan

CAR, SPEED = sedan(), 15.0


@pytest.fixture(scope="module")
def tires():
    return PlausibleTires.declared(CAR, 0.8)


@pytest.fixture
def brief(monkeypatch):
    """A search of few generations: it finds less, and keeps every limit."""
    monkeypatch.setattr(search_module, "CHOSEN", search_module.CHOSEN._replace(generations=15))


def space(**others):
    numbers = {"length": 60.0, "width": 14.0, "speed": SPEED, "share": 0.9, "margin": 1.0}
    return Space(**{**numbers, "rate_limit": 0.7, "max_angle": 0.5, **others})


def steered(tires, steering, duration, hold=NO_HOLD):
    t = steps_of(tires, duration)
    at = np.zeros(1)
    return t, simulate(tires, steering(t)[:, None], SPEED, Entry(at, at, at), hold)


def test_small_angles_move_the_likely_car_as_the_linear_bicycle(tires):
    stiff = (tires.W[0] / np.array(tires.method.ladder)).sum(axis=1) * CAR.axle_loads
    linear = bicycle(
        BicycleParameters(CAR.mass, CAR.yaw_inertia, CAR.l_f, CAR.l_r, *map(float, stiff)), SPEED
    )
    t, motion = steered(tires, lambda t: 2e-3 * np.sin(3.0 * t), 4.0)
    system = control.ss(np.array(linear.A), np.array(linear.B)[:, :1], np.eye(2), np.zeros((2, 1)))
    system *= control.ss(-25.0, 25.0, 1.0, 0.0)  # the steering's lag of 40 ms
    x = control.forced_response(system, t, 2e-3 * np.sin(3.0 * t)).outputs
    # What is left is the lag of the tires, some 20 ms.
    assert np.abs(motion.r[:, 0, 0] - x[1]).max() < 0.08 * np.abs(x[1]).max()
    assert np.abs(np.gradient(motion.psi[:, 0, 0], t) - motion.r[:, 0, 0])[1:-1].max() < 1e-3


def test_a_shorter_step_gives_the_same_motion(tires, monkeypatch):
    def swing(t):
        return 0.06 * np.sin(4.0 * t)

    _, coarse = steered(tires, swing, 3.0)
    monkeypatch.setattr(motion_module, "CHOSEN", motion_module.CHOSEN._replace(step=0.05 / 8))
    _, fine = steered(tires, swing, 3.0)
    for name in ("r", "Y"):
        theirs = getattr(fine, name)[::8, 0]
        ours = getattr(coarse, name)[: len(theirs), 0]
        off = np.abs(ours - theirs).max() / np.abs(theirs).max()
        assert off < 0.1, (name, off)  # half a step of delay; tires are unknown by 30 %


def lagged(alpha, dt, compliance, W, ladder):
    """Slip of one axle behind its slip angle, the lag integrated in small steps."""
    x, xs, many = 0.0, [], 200
    for before, now in zip([0.0, *alpha[:-1]], alpha, strict=True):
        slope = (W / (ladder * np.cosh(x / ladder) ** 2)).sum()
        sigma = compliance * slope + 1e-3 * CAR.wheelbase
        decay = math.exp(-SPEED * dt / many / sigma)
        for k in range(many):  # the input is held at the middle of each small step
            target = before + (k + 0.5) / many * (now - before)
            x = target + (x - target) * decay
        xs.append(x)
    return np.array(xs)


def test_slip_and_its_sensitivity_are_those_of_a_lag_that_is_integrated(tires):
    still = replace(tires, sway_share=np.zeros(2))  # no sway
    t, motion = steered(still, lambda t: 0.05 * np.sin(5.0 * t), 2.0)
    one = [value[:, 0, 0] for value in (motion.delta, motion.v_y, motion.r)]
    alpha = one[0] - np.arctan((one[1] + CAR.l_f * one[2]) / SPEED)
    s, W = still.compliance[0], still.W[0, 0]
    ladder, dt, step = np.array(still.method.ladder), t[1], 1e-3 * still.compliance[0]
    x = lagged(alpha, dt, s, W, ladder)
    np.testing.assert_allclose(motion.slip[:, 0, 0, 0], x, atol=2e-3 * np.abs(x).max())
    above, below = (lagged(alpha, dt, s + sign * step, W, ladder) for sign in (1.0, -1.0))
    wanted = (above - below) / (2.0 * step)
    found = motion.of_compliance[:, 0, 0, 0]
    np.testing.assert_allclose(found, wanted, atol=0.03 * np.abs(wanted).max())


def test_the_identifier_ends_as_sure_as_was_expected_of_it(tires, monkeypatch):
    monkeypatch.setattr(information_module, "CHOSEN", information_module.CHOSEN._replace(color=1.0))
    steer = RandomSteer(
        amplitude=0.06, frequency=0.8, seed=3, onset=0.0, rate_limit=1.0, duration=6.0
    )
    t, motion = steered(tires, lambda t: steer.steering(t)[:, 0], 6.0)
    P = covariance_after(tires, motion, SPEED)[0, 0]
    one = motion.r[:, 0, 0]
    log = Recording(
        name="as planned",
        t=t,
        v_x=np.full(t.size, SPEED),
        v_y=motion.v_y[:, 0, 0],
        r=one,
        delta_f=motion.delta[:, 0, 0],
        delta_r=np.zeros(t.size),
    )
    known = identify(log, CAR, AxleIdentifier.for_vehicle(CAR, dt=log.dt)).freeze()
    doubt = asked(tires, SPEED)
    ours, theirs = deviation(doubt, P), deviation(doubt, known.covariance)
    before = deviation(doubt, tires.covariance)
    assert np.median(ours / before) < 0.5
    ratio = ours / theirs
    assert ratio.min() > 0.5 and ratio.max() < 1.5 and 0.75 < np.median(ratio) < 1.25


def test_each_swing_more_leaves_less_open(tires):
    errors = []
    for duration in (1.0, 2.0, 4.0):
        _, motion = steered(tires, lambda t: 0.07 * np.sin(3.0 * t), duration)
        P = covariance_after(tires, motion, SPEED)
        errors.append(float(expected_error(tires, asked(tires, SPEED), P)[0, 0]))
    assert errors[0] > errors[1] > errors[2] > 0.0


def test_every_tire_that_was_planned_for_stays_in_the_area_and_none_slides(tires, brief):
    found = make_plan(tires, space(), 3.0, np.random.default_rng(0))
    (one,) = found.passes
    body, motion = body_of(tires), one.motion
    for along in (body.ahead, -body.behind):
        for side in (body.side, -body.side):
            X = motion.X + along * np.cos(motion.psi) - side * np.sin(motion.psi)
            Y = motion.Y + along * np.sin(motion.psi) + side * np.cos(motion.psi)
            assert X.min() >= 1.0 - 1e-5 and X.max() <= 59.0 + 1e-5
            assert Y.min() >= 1.0 - 1e-5 and Y.max() <= 13.0 + 1e-5
    used = np.abs(motion.force[:, :, 0, 0]).max(axis=0) / tires.grip[0]
    assert (used <= 0.91).all() and used.max() > 0.6
    assert np.abs(motion.slip[:, 1, 0]).max(axis=0).tolist() <= tires.slip_at(0.97)[:, 1].tolist()
    rates = np.diff(one.steering.steering(np.linspace(0.0, 3.0, 3001))[:, 0]) / 1e-3
    assert np.abs(rates).max() <= 0.7 * 1.001
    assert found.clearance >= 1.0 - 1e-5 and found.error < 0.5 * found.error_before


def test_a_way_out_of_the_area_and_a_slide_are_noticed(tires):
    search = Search(tires=tires, space=space(), duration=3.0, guided=False)
    swings = np.zeros((2, search.swings + 2))
    swings[1, : search.swings - 1] = 1.0  # all to the left, as far as it goes
    violation = search.violation(search.motion(search.steerings(swings)))
    assert violation[0] <= 0.0 < violation[1]
    assert search.costs(swings)[0] < 1.0 < search.costs(swings)[1]


def test_a_car_that_holds_the_course_needs_less_room(tires):
    def side(hold):
        _, motion = steered(tires, lambda t: 0.06 * np.sin(2.0 * t) + 0.01, 5.0, hold)
        return np.ptp(motion.Y[-1, 0])

    assert side(hold_of(tires, SPEED)) < 0.3 * side(NO_HOLD)


def test_guidance_brings_a_course_back_that_angles_alone_lose(tires):
    t, at = steps_of(tires, 15.0), np.zeros(1)
    planned, entry = 0.04 * np.sin(3.0 * t)[:, None] + 0.005, Entry(at, at, at)
    hold = hold_of(tires, SPEED)
    guide = Guide(hold, 0.0, rate=0.2, angle=0.04)
    free = simulate(tires, planned, SPEED, entry, hold)
    kept = simulate(tires, planned, SPEED, entry, hold, guide)
    assert np.abs(free.Y[:, 0, 0]).max() > 30.0 > 10.0 * np.abs(kept.Y[:, 0, 0]).max()
    asked = kept.asked[:, 0, 0]
    assert asked[0] == 0.0 and np.abs(asked).max() <= 0.04
    assert np.abs(np.diff(asked) / np.diff(t)).max() <= 0.2 * (1.0 + 1e-9)
    again = simulate(tires, asked[:, None], SPEED, entry, hold)  # as it is handed over
    np.testing.assert_allclose(again.Y, kept.Y, atol=1e-9)


def test_a_car_of_slow_steering_goes_where_motion_with_its_lag_says():
    slow = replace(CAR, chassis=replace(CAR.require_chassis(), steering_lag=0.12))
    steering, missed = slalom_of(CAR, 3.0)(0.03), []
    for told in (None, 0.01):  # the vehicle file's; and who believes in quick steering
        known = PlausibleTires.declared(slow, 0.9, steering_lag=told)
        t = steps_of(known, 3.0)
        motion = free_motion(known, steering.steering(t)[:, :1], SPEED)
        wanted = np.column_stack([one[:, 0, 0] for one in (motion.X, motion.Y, motion.psi)])
        log, way = rehearse(
            Plant(slow), steering, lambda at: np.zeros((at.size, 3)), SPEED, NO_HOLD
        )
        late = log.t >= 1.0 - 1e-9
        missed.append(np.abs(np.interp(log.t[late] - 1.0, t, wanted[:, 1]) - way[late][:, 1]).max())
    assert missed[0] < 0.5 * missed[1], missed


def test_a_plan_is_worth_more_than_a_slalom_of_its_length(tires, brief):
    found = make_plan(tires, space(), 3.0, np.random.default_rng(0))
    slalom, random = found.rivals
    assert (slalom.name, random.name) == ("slalom", "random")
    assert found.error < slalom.error
    assert slalom.catches_up >= 1.5 * found.time
    slips, before, after = found.deviations()
    assert slips.shape == (2, 12) and (after < before).all()


@pytest.mark.heavy
def test_an_area_that_a_car_crosses_is_driven_several_times_and_each_teaches(tires, brief):
    found = make_plan(tires, space(length=40.0, width=40.0), 4.0, np.random.default_rng(0))
    assert isinstance(found, Plan) and len(found.passes) == 2
    assert found.passes[0].error > found.passes[1].error == found.error
    assert found.time == pytest.approx(4.0)


def test_where_a_car_can_turn_a_pass_has_no_end(tires):
    assert _longest_pass(tires, space(length=80.0, width=80.0, speed=6.0)) == math.inf
    assert _longest_pass(tires, space()) == pytest.approx(
        (60.0 - 2.0 - 1.64 * CAR.wheelbase) / 15.0
    )


@pytest.mark.parametrize(
    ("others", "time", "words"),
    [
        ({"length": 20.0, "width": 14.0}, 3.0, "must be .* m long, or drive at"),
        ({"width": 3.0}, 3.0, "is 3 m wide and the car with its margins"),
        ({"speed": 1.0}, 3.0, "no sample counts below"),
        ({"length": 8.0, "speed": 5.0}, 3.0, "must be .* m long$"),
        ({}, 0.1, "the time must be 0.5 to 60 s"),
        ({"length": 300.0}, 0.6, "needed to steer three times at 15 m/s, the time is 0.6"),
        ({}, 60.0, "passes of .* more than 12"),
    ],
)
def test_what_cannot_be_is_said_with_what_would_be(tires, others, time, words):
    with pytest.raises(PlanError, match=words):
        make_plan(tires, space(**others), time, np.random.default_rng(0))


def test_a_narrow_lane_that_no_pass_keeps_is_refused(tires, brief):
    with pytest.raises(PlanError, match=r"no pass of 3 s at 15 m/s stays in 60 x 3.75"):
        make_plan(tires, space(width=3.75), 3.0, np.random.default_rng(0))


@pytest.mark.parametrize("name", ["length", "speed", "rate_limit", "share", "margin", "max_angle"])
def test_numbers_of_a_space_are_judged_at_birth(name):
    for value in (-1.0, math.nan, math.inf):
        with pytest.raises(PlanError, match=name):
            space(**{name: value})


def test_no_told_car_oversteers_at_small_slip():
    soft = replace(CAR, cornering_stiffness_rear=0.5 * CAR.cornering_stiffness_rear)
    W = PlausibleTires.declared(soft, 0.8).W
    slope = (W / np.array(AxleIdentifier.for_vehicle(soft).ladder)).sum(axis=2)
    assert (slope[:, 1] >= 0.999 * slope[:, 0]).all()


def test_what_a_model_knows_is_not_planned_again(brief):
    log = Plant(CAR).simulate(slalom_of(CAR, 10.0)(0.06), speed=SPEED).recording()
    model = identify(log, CAR, AxleIdentifier.for_vehicle(CAR, dt=log.dt)).freeze()
    known = PlausibleTires.learnt(model, np.random.default_rng(0))
    np.testing.assert_array_equal(known.W[0], model.W)
    told = PlausibleTires.declared(CAR, 0.8)
    before = [
        float(expected_error(one, asked(one, SPEED), one.covariance)[()]) for one in (known, told)
    ]
    assert before[0] < 0.5 * before[1]
    found = make_plan(known, space(), 2.0, np.random.default_rng(0))
    assert found.error < found.error_before


def test_the_hardest_slalom_just_keeps_its_share(tires):
    maneuver = hardest(tires, space(), slalom_of(CAR, 6.0))
    t = steps_of(tires, 6.0)

    def used(factor):
        motion = free_motion(tires, factor * maneuver.steering(t)[:, :1], SPEED)
        return (np.abs(motion.slip[..., 0, 0]).max(axis=0) / tires.slip_at(0.9)[0]).max()

    assert used(1.0) <= 1.0 < used(1.2)


def test_the_least_rectangle_turns_with_the_way():
    along, turn = np.linspace(0.0, 50.0, 400), math.radians(33.0)
    across = np.sin(along)
    X = np.cos(turn) * along - np.sin(turn) * across
    Y = np.sin(turn) * along + np.cos(turn) * across
    assert extent(X, Y) == pytest.approx((50.0, 2.0), rel=0.03)


@pytest.mark.heavy
def test_a_rehearsal_on_the_plant_stays_near_the_course_that_was_planned(tires, brief):
    found = make_plan(tires, space(), 3.0, np.random.default_rng(0))
    (one,) = found.passes
    log, way = rehearse(Plant(CAR), one.steering, one.course, SPEED, hold_of(tires, SPEED))
    late = log.t >= 1.0 - 1e-9
    wanted = one.course(log.t[late] - 1.0)
    assert np.abs(way[late][:, 1] - wanted[:, 1]).max() < 1.0
    assert log.axle_force is not None and np.abs(log.delta_f[~late]).max() < 0.01


def test_the_step_scales_with_the_size_of_the_car(tires):
    small = replace(CAR, l_f=0.01 * CAR.l_f, l_r=0.01 * CAR.l_r, yaw_inertia=1e-4 * CAR.yaw_inertia)
    ratio = time_step(PlausibleTires.declared(small, 0.8)) / time_step(tires)
    assert ratio == pytest.approx(0.1)
    assert Motion._fields[-1] == "delta"


@pytest.mark.heavy
def test_a_car_with_downforce_is_planned_under_the_loads_of_its_speed(tires, brief):
    racer, speed = replace(CAR, downforce_area_front=1.5, downforce_area_rear=2.5), 25.0
    static = PlausibleTires.declared(racer, 0.8)
    np.testing.assert_array_equal(static.at_speed(0.0).W, static.W)
    known = static.at_speed(speed)
    load = 1.0 + 0.5 * 1.2 * np.array([1.5, 2.5]) * speed**2 / CAR.axle_loads
    np.testing.assert_allclose(known.grip, static.grip * load, rtol=1e-12)
    before, under = (
        deviation(asked(one, speed), one.covariance) for one in (static, known)
    )  # of forces
    np.testing.assert_allclose(under, before * load[:, None], rtol=1e-9)
    wide = space(length=120.0, width=30.0, speed=speed)
    found = make_plan(static, wide, 2.0, np.random.default_rng(0))
    np.testing.assert_array_equal(found.tires.W, known.W)
    assert found.error < 0.9 * found.error_before
    assert found.clearance > 0.0
    for name in ("W", "covariance", "prior"):
        np.testing.assert_array_equal(getattr(tires.at_speed(40.0), name), getattr(tires, name))
