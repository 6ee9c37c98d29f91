"""The estimate finds what was planted, from one log or several, whatever stiffness is told."""

import math
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca
import numpy as np
import pytest

from benchmarks.random_cars import random_car, random_drive
from identifier.doctor.faults import examine
from identifier.estimate import solve
from identifier.estimate.drive import Drive
from identifier.estimate.fit import _after, _blocks, _lasting, fit
from identifier.estimate.information import Information
from identifier.estimate.method import FitMethod
from identifier.estimate.priors import ALIKE, OF_AXLES, OF_CAR, Priors
from identifier.estimate.solve import Problem, descend, estimate, settled
from identifier.motion.parameters import INDEX, NAMES
from identifier.run import learn
from identifier.verdict import judge_identification
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.recordings import Recording
from models.tires import Tire
from models.vehicle import estimate as estimated
from models.vehicle import sedan
from tests.identifier.conftest import missed
from tests.identifier.estimate.conftest import DROP, NOISE, driven
from tireid.driving.learn import sample_recording

GRID = np.linspace(0.005, 0.06, 12)


@pytest.fixture(scope="module")
def planted():
    """A drive whose sensors of v_y and steering are off."""
    drive = driven(3)
    v_y = drive.v_y + 0.15 + np.radians(0.5) * drive.v_x
    return replace(drive, v_y=v_y, delta_f=drive.delta_f - 0.01)


def test_planted_errors_of_sensors_are_found_within_their_doubt(planted):
    found = fit([planted], sedan())
    truth = {"v_y_bias": 0.15, "v_y_angle": np.radians(0.5), "steering_zero": 0.01}
    for name, value in truth.items():
        assert abs(found.posterior[name] - value) < 3.0 * found.posterior.sd(name), name
        assert found.posterior.sd(name) < 0.3 * value, name
    assert missed(found.model, planted).max() < 0.05


def test_the_curve_predicts_a_drive_that_did_not_teach(learnt):
    other = driven(5)
    assert missed(learnt.model, other).max() < 0.08
    half = learnt.model.band.over(other)
    held = np.mean(np.abs(learnt.model.predict(other) - other.axle_force) <= half, axis=0)
    assert held.min() > 0.8


@pytest.mark.parametrize("factor", [0.25, 4.0])
def test_a_told_stiffness_changes_nothing(learnt, factor):
    car = sedan()
    front, rear = (factor * C for C in car.bicycle[4:])
    told = replace(car, cornering_stiffness_front=front, cornering_stiffness_rear=rear)
    np.testing.assert_array_equal(fit([driven(3)], told).posterior.p, learnt.posterior.p)


@pytest.mark.parametrize("scale", [1.0, 0.1])
def test_every_belief_has_a_reason_and_lies_within_its_bounds(scale):
    car = sedan()
    sizes = {"l_f": scale, "l_r": scale, "yaw_inertia": scale**2}
    small = replace(car, **{name: size * getattr(car, name) for name, size in sizes.items()})
    priors = Priors.of(small)
    for belief in (OF_AXLES | OF_CAR).values():
        assert belief.sd > 0.0
        assert belief.low < belief.high and belief.low <= belief.mean <= belief.high
    assert set(ALIKE) <= set(OF_AXLES)
    assert set(NAMES) >= {f"{name}_{axle}" for name in OF_AXLES for axle in "fr"} | set(OF_CAR)
    inside = (priors.low <= priors.mean) & (priors.mean <= priors.high)
    assert inside.all()
    moving = priors.information[np.ix_(priors.moves, priors.moves)]
    assert np.linalg.eigvalsh(moving).min() > 0.0
    k = INDEX["v_y_lever"]
    assert priors.information[k, k] == pytest.approx((0.015 * small.wheelbase) ** -2)


def test_two_logs_tell_more_than_one(learnt):
    both = fit([driven(3), driven(5)], sedan())
    for name in ("ln_stiffness_f", "ln_grip_r", "steering_gain", "v_y_bias"):
        assert both.posterior.sd(name) < learnt.posterior.sd(name), name
    assert missed(both.model, driven(5)).max() < missed(learnt.model, driven(5)).max()


def test_a_long_log_in_blocks_teaches_what_it_does_at_once(learnt):
    done = []
    found = fit([driven(3)], sedan(), block=8.0, progress=done.append)
    assert len(found.parts) == len(done) > 1
    assert done == sorted(done) and 0.2 < done[0] < 0.7 and done[-1] > 0.95
    blocks = found.model
    np.testing.assert_allclose(blocks.force(GRID), learnt.model.force(GRID), rtol=0.05)
    np.testing.assert_allclose(
        blocks.band.relative_sd(GRID), learnt.model.band.relative_sd(GRID), rtol=0.7
    )


def test_hours_of_one_drive_tell_no_more_than_minutes_and_tears_between_are_cut():
    """Errors of a model do not average out; where a car would have leapt another drive begins."""
    drive, rng = driven(3), np.random.default_rng(1)
    times, n = 70, len(drive)
    noise = {"v_x": 0.01, "v_y": 0.01, "r": 0.002, "delta_f": 0.0}
    signals = {
        name: np.tile(getattr(drive, name), times) + sd * rng.standard_normal(n * times)
        for name, sd in noise.items()
    }
    t = drive.dt * np.arange(n * times)
    hours = Recording(name="again", t=t, delta_r=np.zeros(t.size), **signals)
    begins = Drive.of(hours, sedan()).begins
    assert np.abs(np.array(begins) - n * np.arange(times)).max() <= 2
    fast = replace(hours.taken(slice(0, 3 * n)), t=0.5 * t[: 3 * n])
    assert len(Drive.of(fast, sedan()).signals) == 3 * n // 2, "means go on over a tear"
    whole = fit([hours], sedan())
    many, few = whole.model, fit([hours.taken(slice(0, 4 * n))], sedan()).model
    told = sum((part for _, part in whole.parts), Information.nothing())
    _, together = settled(Priors.of(sedan()).after(told), many.p)
    np.testing.assert_allclose(np.diag(together), np.diag(many.covariance), rtol=1e-2)
    on = np.diag(few.covariance) > 0.0
    sd, less = (np.sqrt(np.diag(one.covariance)[on]) for one in (few, many))
    assert (less > 0.6 * sd).all() and (np.abs(many.p - few.p)[on] < 1.5 * sd).all()
    k = INDEX["v_y_bias"]
    assert abs(many.p[k]) < 4.0 * np.sqrt(many.covariance[k, k])


def test_a_descent_that_did_not_end_is_said(monkeypatch, caplog):
    drive = driven(3)
    problem = Problem([Drive.of(drive, sedan())], sedan(), Priors.of(sedan()))
    assert not descend(problem, problem.priors.mean, iterations=1).ended
    assert estimate(problem.drives, sedan()).ended
    short = partial(descend, iterations=1)
    monkeypatch.setattr(solve, "descend", short)
    fit([drive], sedan())
    assert "the descent ended at its limit" in caplog.text


def test_a_drop_of_friction_is_a_segment_and_without_one_there_is_none(learnt):
    assert learnt.model.reach.segments == ()
    drive = driven(5, scale=0.5, amplitude=0.06, swing=0.0)
    wet = fit([drive], sedan()).model
    (segment,) = wet.reach.segments
    begins = segment.begin > 0.0  # else what came before the drop is the segment
    assert (segment.begin if begins else segment.end) == pytest.approx(DROP, abs=1.5)
    ratio = segment.ratio if begins else 1.0 / segment.ratio
    assert 0.4 < ratio < 0.75
    at = np.array([DROP - 5.0, DROP + 5.0])
    assert wet.drives.road_differs(at).tolist() == [not begins, begins]
    (note,) = (text for _, text in wet.drives.notes)
    assert f"{segment.ratio:.2f} ±" in note
    judged = judge_identification(wet, drive)
    assert judged.valid and not wet.drives.road_differs(judged.forces.t - 0.15).any()


PLAY = 0.02  # rad


@dataclass(frozen=True)
class Loose:
    """A tire whose wheel turns freely until a play is used up: none of it makes a force."""

    tire: Tire

    def forces(self, alpha, *of):
        return self.tire.forces(alpha - ca.fmax(-PLAY, ca.fmin(PLAY, alpha)), *of)

    def __getattr__(self, name):
        return getattr(self.tire, name)


@pytest.mark.parametrize("seed", [3, 4])
def test_a_play_of_the_steering_is_found_and_its_curve_is_the_tires(seed):
    rng = np.random.default_rng(seed)
    car = random_car("tenth", rng)
    loose = replace(car, tires=(Loose(car.tires[0]), car.tires[1]))
    log, other = (random_drive(loose, rng).log(rng) for _ in range(2))
    model = fit([log], car.declared).model
    assert model["steering_play"] == pytest.approx(PLAY, rel=0.2)
    without = Priors.of(car.declared).without(["steering_play"])
    firm = replace(model, p=estimate([Drive.of(log, car.declared)], car.declared, without).p)
    assert (missed(model, other) < [0.05, 0.05]).all()
    assert missed(model, other)[0] < 0.8 * missed(firm, other)[0]
    (note,) = (text for code, text in model.drives.notes if code == "steering_play")
    assert "deg of play" in note
    (found,) = (one for one in examine(log, car.declared).findings)
    assert found.code == "play" and found.size == pytest.approx(PLAY, rel=0.2)


def test_a_full_size_car_has_a_play_where_its_curve_asks_for_one(learnt):
    assert learnt.model["steering_play"] == 0.0 == learnt.posterior.sd("steering_play")
    tire = Plant(sedan()).tire
    steering = RandomSteer(
        amplitude=0.09, frequency=0.6, seed=3, onset=1.0, rate_limit=1.0, duration=20.0
    )
    run = Plant(sedan(), Loose(tire), rear_tire=tire).simulate(steering, speed=17.0)
    found = fit([NOISE.apply(run.recording(), np.random.default_rng(3))], sedan()).model
    assert found["steering_play"] == pytest.approx(PLAY, rel=0.25)
    np.testing.assert_allclose(found.stiffness, learnt.model.stiffness, rtol=0.2)


# A steering ratio that somebody typed is right to a few percent, or plainly wrong.


def test_the_stiffness_of_a_gentle_drive_does_not_end_before_the_corner():
    """It is that of the Magic Formula, not of units that are over at a degree."""
    model = fit([driven(6, amplitude=0.015)], sedan()).model
    C = np.exp([model["ln_stiffness_f"], model["ln_stiffness_r"]])
    assert (model.slope_at(np.zeros((1, 2)))[0] < 1.05 * C).all()


def test_what_a_hard_drive_taught_stays_known_when_gentle_logs_are_added(learnt):
    """Also where their sensors have other zeros; unless their road, or the tires, are others."""
    car, slips = sedan(), np.outer([0.5, 1.0], learnt.model.known_slip)
    method = FitMethod.for_vehicle(car)
    tire = learnt.model
    for day, seed in ((0.004, 6), (-0.004, 7)):
        log = driven(seed, amplitude=0.015)
        log = replace(log, delta_f=log.delta_f + day, v_y=log.v_y - 15.0 * day)
        tire = learn(log, car, method, tire)
        assert (tire.known_slip >= 0.999 * learnt.model.known_slip).all()
    first, last = (one.band.of_phi(slips)[0] for one in (learnt.model, tire))
    assert (last < 1.3 * first).all()
    away = tire.curve_at(slips)[0] - learnt.model.curve_at(slips)[0]
    assert np.abs(away).max() < 0.03, "static loads"

    rain = driven(5, scale=0.5).between(DROP + 0.5, math.inf)
    wet, alone = learn(rain, car, method, learnt.model), learn(rain, car, method)
    assert (wet.known_slip < 0.9 * learnt.model.known_slip).all()
    np.testing.assert_allclose(wet.curve_at(slips)[0], alone.curve_at(slips)[0], rtol=0.12)
    refused = learnt.model.band.calibrated_by(None, np.array([0.2, 0.02]))
    np.testing.assert_array_equal(learn(log, car, method, refused).p, fit([log], car).model.p)


@pytest.mark.parametrize("ratio", [0.75, 1.4])
def test_a_wrong_steering_ratio_does_not_reach_the_stiffness(ratio, car, drive):
    log = drive()
    right = fit([log], car).model
    found = fit([replace(log, delta_f=ratio * log.delta_f)], car).model
    np.testing.assert_allclose(found.stiffness, right.stiffness, rtol=0.08)
    assert found["steering_gain"] == pytest.approx(1.0 / ratio - 1.0, abs=0.06)
    assert abs(right["steering_gain"]) < 0.04


def test_a_yaw_inertia_that_nobody_measured_does_not_become_a_steering_ratio():
    """m l_f l_r is 7 % above that of the sedan; given as measured, the ratio takes the error."""
    car, log = sedan(), sample_recording(sedan())
    guess = estimated(car.mass, car.l_f, car.l_r)["yaw_inertia"]
    left_out = replace(car, yaw_inertia=guess)
    assert left_out.inertia_is_estimate and not car.inertia_is_estimate
    model = fit([log], left_out).model
    assert abs(model["steering_gain"]) < 0.06 and not model.drives.notes
    assert model["ln_inertia"] == pytest.approx(math.log(car.yaw_inertia / guess), abs=0.08)
    measured = Priors.of(left_out).without(["ln_inertia"])
    taken = fit([log], left_out, measured).model["steering_gain"]
    assert taken == pytest.approx(math.log(guess / car.yaw_inertia), abs=0.03)
    assert taken > 2.0 * abs(model["steering_gain"])


def test_blocks_are_no_longer_than_asked_and_days_stand_alone():
    logs = [driven(3), driven(5), driven(3)[0.0:5.0]]
    lasts = [
        [len(one.counts) * one.dt for one in group]
        for group in _blocks(logs, sedan(), 26.0, coarse=False)
    ]
    assert [[round(x) for x in group] for group in lasts] == [[20], [20, 5]]
    alone = list(_blocks(logs, sedan(), 8.0, coarse=False, alone=True))
    assert [len(group) for group in alone] == [1] * 7
    (coarse,) = _blocks(logs[:1], sedan(), 26.0, coarse=True)
    assert coarse[0].dt == pytest.approx(0.02)


def test_what_a_block_left_is_believed_and_what_it_does_not_tell_stays(learnt):
    before, found = Priors.of(sedan()), learnt.posterior
    after = _after(before, found)
    moved = np.diag(found.covariance) > 0.0
    np.testing.assert_allclose(
        after.covariance[np.ix_(moved, moved)], found.covariance[np.ix_(moved, moved)], rtol=1e-6,
        atol=1e-12,
    )  # fmt: skip
    assert (after.mean == found.p).all() and after.typed == () and after.moves[moved].all()


def test_the_reach_of_a_drive_is_what_lasts_of_its_slip_and_speed(learnt):
    slip = np.column_stack([np.repeat([0.01, 0.05, 0.2], [40, 24, 3]), np.full(67, 0.03)])
    np.testing.assert_allclose(_lasting(slip, 0.01), [0.05, 0.03])
    reach, drive = learnt.model.reach, driven(3)
    v_x, truth = drive.v_x[drive.v_x > 5.0], drive.alpha(sedan().l_f, sedan().l_r)
    np.testing.assert_allclose(reach.speeds, np.quantile(v_x, [0.005, 0.995]), atol=0.1)
    np.testing.assert_allclose(reach.slip, np.abs(truth).max(axis=0), rtol=0.25)
    assert reach.pairs > 1000 and (reach.unexplained < 1.5).all()
    assert reach.a_x[0] < -1.0 < 1.0 < reach.a_x[1]


def test_a_log_that_teaches_nothing_is_refused_alone():
    drive = driven(3)
    slow = replace(drive, v_x=0.05 * drive.v_x)
    with pytest.raises(ValueError, match="no sample is fast enough"):
        fit([slow], sedan())
    assert len(fit([slow, drive], sedan(), block=20.5).parts) == 1, "what follows teaches"
    with pytest.raises(ValueError, match="days must be one of"):
        FitMethod(min_speed=3.0, days="many")
