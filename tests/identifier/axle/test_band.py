"""The band around the learnt curves: it holds on drives never seen, and widens where nobody was."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.band import (
    BandCalibration,
    colored,
    colored_variance,
    declared_spread,
    ranges_of,
)
from identifier.band import normal_quantile
from identifier.evidence import brisk_windows
from identifier.methods import make_method
from identifier.run import identify
from identifier.tire_model import load_model
from identifier.verdict import calibrated, within_band
from identifier.verdict.bands import color_of, quantile
from models.vehicle import sedan
from tests.identifier.conftest import steered

SLIP = np.linspace(-0.3, 0.3, 61)


def learnt(recording, car):
    return identify(recording, car, AxleIdentifier.for_vehicle(car))


@pytest.fixture(scope="module", name="run")
def a_run(swinging):
    car, drives = swinging
    return learnt(drives[0], car)


@pytest.fixture(scope="module")
def swinging():
    """A sedan on the plant, and drives of it at three speeds."""
    speeds = {3: 20.0, 4: 17.0, 5: 23.0}
    return sedan(), [steered(seed, 22.0, speed=v).recording() for seed, v in speeds.items()]


@pytest.fixture(scope="module", name="model")
def a_model(run):
    return calibrated(run)


def coverage(model, recording):
    """Share of samples whose true force lies in the band around the replayed one (2,)."""
    slip, loads = model.lagged_slip(recording), recording.axle_force
    half = np.column_stack([model.band.half(slip[:, i], 0.9)[:, i] for i in range(2)])
    inside = np.abs(model.predict(recording) - loads) <= half
    return inside[recording.t > 1.5].mean(axis=0)


def test_bands_hold_on_drives_that_were_not_seen(model, swinging):
    held = np.mean([coverage(model, one) for one in swinging[1][1:]])
    assert 0.8 <= held <= 0.99
    wrong = replace(model, W=1.4 * model.W)  # the alarm rings: a curve 40 % off leaves its band
    assert np.mean([coverage(wrong, one) for one in swinging[1][1:]]) < 0.6


def test_a_calibrated_band_follows_errors_and_a_told_one_does_not(run, model, swinging):
    car, (first, *_) = swinging
    rng = np.random.default_rng(2)
    slow = np.cumsum(rng.standard_normal(len(first))) * 0.006  # a velocity sensor that wanders
    other = learnt(replace(first, v_y=first.v_y + slow), car)
    rough, told = calibrated(other), other.freeze()
    assert rough.calibration.factors.mean() > 1.5 * model.calibration.factors.mean()
    assert told.calibration is None and run.freeze().calibration is None
    at = np.array([0.03])
    assert (rough.band.half(at) > 1.3 * model.band.half(at)).all()
    assert (rough.band.half(at) > 1.3 * told.band.half(at)).all()


def test_calibration_leaves_the_frozen_model_as_it_is(run, model):
    frozen = run.freeze()
    for name in ("W", "compliance", "offset", "covariance", "prior_covariance", "excitation"):
        np.testing.assert_array_equal(getattr(model, name), getattr(frozen, name))
    assert "band" not in frozen.to_dict()
    more = {"band": model.calibration.to_dict(), "force_missed": model.model_error.tolist()}
    assert model.to_dict() == frozen.to_dict() | more
    np.testing.assert_array_equal(calibrated(run, 15.0).W, run.freeze(15.0).W)


def test_a_band_widens_with_its_level_and_around_its_curve(model):
    halves = [model.band.half(SLIP, level) for level in (0.1, 0.5, 0.9, 0.99)]
    assert all((b > a).all() for a, b in pairwise(halves))
    low, high = model.band.at(SLIP)
    np.testing.assert_allclose(0.5 * (low + high), model.force(SLIP))
    np.testing.assert_allclose(high - low, 2.0 * model.band.half(SLIP))
    one = model.band.at(0.05, "rear", 0.8)
    assert isinstance(one[0], float) and one[0] < model.force(0.05, "rear") < one[1]
    assert one[1] == pytest.approx(model.band.at([0.05], level=0.8)[1][0, 1])


@pytest.mark.parametrize("level", [0.0, 1.0, -0.1, 90.0, np.nan])
def test_an_impossible_level_is_refused(model, level):
    with pytest.raises(ValueError, match="level must be above 0 and below 1"):
        model.band.at(0.1, level=level)


def test_where_nobody_was_the_band_is_the_priors(swinging, model):
    car, drives = swinging
    new = AxleIdentifier.for_vehicle(car).frozen(car, learnt(drives[0], car).state_at(0.0))
    T = np.tanh(0.3 / np.array(new.ladder))
    n, C = T.size, new.prior_covariance
    prior = np.sqrt(np.einsum("j,ajk,k->a", T, C[:, :n, :n], T)) * np.array(car.axle_loads)
    assert (new.band.half(np.array([0.3]))[0] >= 1.64 * prior).all()
    narrowed = replace(
        new,
        calibration=replace(
            BandCalibration.declared(new.band.speed),
            factors=np.full((2, 6), 0.1),
            color=np.full(2, 9.0),
        ),
    )
    np.testing.assert_allclose(narrowed.band.half(SLIP), new.band.half(SLIP), rtol=1e-9)
    known = float(model.known_slip.min())
    relative = model.band.half(np.array([0.8 * known, 2.0 * known])) / model.band.half(
        np.array([0.8 * known])
    )
    assert (relative[1] > 1.5).all()


def test_a_band_is_wider_where_the_car_is_slower_than_it_was_taught(model):
    taught = model.calibration.speed
    assert taught == pytest.approx(20.0, rel=0.05)
    flat = replace(model, calibration=replace(model.calibration, speeds=np.ones((2, 4))))
    at = np.array([0.02])
    slow, usual, fast = (flat.band.half(at, v_x=share * taught) for share in (0.6, 1.0, 1.5))
    assert (slow > 1.05 * usual).all() and (fast < 0.99 * usual).all()
    np.testing.assert_array_equal(usual, flat.band.half(at))
    one, other = model.band.at(0.02, "front", v_x=12.0), model.band.at(0.02, "front")
    assert one[1] - one[0] > other[1] - other[0]
    ranged = replace(flat.calibration, speeds=np.array([[1.0, 1.0, 1.0, 2.0]] * 2))
    for speed, times in ((1.0, 1.0), (3.5, 1.0), (4.0, 1.5), (4.5, 2.0), (9.0, 2.0)):
        told, by_slip = (
            one.factor(np.column_stack([at, at]), np.array([speed]))
            for one in (ranged, flat.calibration)
        )
        np.testing.assert_allclose(told, times * by_slip)
    with pytest.raises(ValueError, match="v_x of a band must be positive, it is 0"):
        model.band.at(0.02, v_x=0.0)


def test_a_drive_at_two_speeds_gives_each_its_own_factor(swinging):
    """Errors of a velocity sensor that is rough while the car is slow are errors there alone."""
    car, _ = swinging
    drive = steered(8, 40.0, speed=lambda t: np.where(t < 20, 13.0, 20.0)).recording()
    rng = np.random.default_rng(2)
    slow = np.cumsum(rng.standard_normal(len(drive))) * 0.006 * (drive.v_x < 15.0)
    rough = calibrated(learnt(replace(drive, v_y=drive.v_y + slow), car)).calibration
    first, second = (rough.speeds[:, k].mean() for k in (1, 2))
    assert first > 1.2 * second


def test_a_band_over_a_drive_holds_with_noise_in_it(model, swinging):
    """That of slip alone does not: a force is wrong by its slip, too."""
    drive, rng = swinging[1][2], np.random.default_rng(9)
    noisy = replace(drive, v_y=drive.v_y + 0.15 * rng.standard_normal(len(drive)))
    away = np.abs(model.predict(noisy) - drive.axle_force)[drive.t > 1.5]
    slip = model.lagged_slip(noisy)
    curve = model.band.along(slip, noisy.v_x)
    over = model.band.over(noisy)
    assert (over >= curve).all()
    held, alone = (np.mean(away <= half[drive.t > 1.5]) for half in (over, curve))
    assert held > 0.85 and alone < 0.75
    still = replace(drive, v_x=np.where(drive.t > 20.0, 0.1, drive.v_x))
    assert (model.band.over(still)[-100:] == 0.0).all()


def test_on_another_road_the_band_opens_by_what_friction_may_do(model):
    open_ = model.band.on_another_road()
    np.testing.assert_array_equal(open_.W, model.W)
    grip = np.array([0.1])
    assert (open_.band.half(grip) > 1.5 * model.band.half(grip)).all()
    near = np.array([5e-4])  # friction does not change the stiffness
    np.testing.assert_allclose(open_.band.half(near), model.band.half(near), rtol=0.1)
    for mu in (0.75, 1.3):
        alpha = np.linspace(0.04, 0.15, 20)
        truth = mu * model.force(alpha / mu)
        assert (np.abs(truth - model.force(alpha)) <= open_.band.half(alpha)).all()
    for sd in (-0.1, np.nan):
        with pytest.raises(ValueError, match="sd_friction must be finite, not negative"):
            model.band.on_another_road(sd)


def test_a_band_survives_a_file_and_old_files_have_none(run, model, tmp_path, refused_in_one_line):
    model.save(tmp_path / "new.json")
    run.freeze().save(tmp_path / "old.json")
    again, old = load_model(tmp_path / "new.json"), load_model(tmp_path / "old.json")
    assert old.calibration is None
    np.testing.assert_array_equal(again.band.half(SLIP), model.band.half(SLIP))
    data = json.loads((tmp_path / "new.json").read_text())
    wrong = {
        "factors": (np.zeros((2, 6)).tolist(), "within 0.1 and 100"),
        "color": ([1.0], "shape"),
        "level": (0.5, "level of the band must be 0.9"),
        "ranges": ([], "ranges of the band must be"),
        "speed_ranges": ([1.0], "speed_ranges of the band must be"),
        "speeds": (np.zeros((2, 4)).tolist(), "within 0.1 and 100"),
        "speed": (-3.0, "speed of the band must be positive"),
        "noise": ([-1.0, 0.0, 0.0], "within 0 and 100"),
    }
    for name, (value, said) in wrong.items():
        refused_in_one_line(data | {"band": data["band"] | {name: value}}, said)
    refused_in_one_line(data | {"band": {}}, "missing")
    refused_in_one_line(data | {"band": 3}, "band")


@pytest.mark.heavy
def test_samples_fill_the_band(model):
    """They have one factor where the band has one for each range of slip: alike to a half."""
    drawn = model.band.samples(1000, np.random.default_rng(1))
    assert all(isinstance(one, AxleModel) for one in drawn)
    slip = np.array([0.03, 0.06, 0.2])
    away = np.array([one.force(slip) for one in drawn]) - model.force(slip)
    share = normal_quantile(0.9) * away.std(axis=0) / model.band.half(slip)
    assert (share > 0.4).all() and (share < 1.6).all() and (np.abs(share - 1.0) < 0.2).any()
    assert not np.allclose(drawn[0].compliance, drawn[1].compliance)
    assert model.band.samples(0, np.random.default_rng(1)) == ()
    with pytest.raises(ValueError, match="n must not be negative"):
        model.band.samples(-1, np.random.default_rng(1))
    with pytest.raises(ValueError, match="no tire is among"):
        replace(model, W=-model.W).band.samples(1, np.random.default_rng(1))


def test_models_without_doubt_have_no_band(swinging):
    car, drives = swinging
    run = identify(drives[0], car, make_method("linear", car, 0))
    tire = calibrated(run)
    assert tire.band is None and within_band(tire, drives[1]) is None


def test_too_short_a_drive_leaves_the_band_as_told(swinging):
    car, drives = swinging
    assert calibrated(learnt(drives[0].between(0.0, 1.5), car)).calibration is None


def test_windows_of_a_drive_lie_in_the_band_as_often_as_it_says(model, swinging):
    share = within_band(model, swinging[1][1])
    assert ((share > 0.75) & (share <= 1.0)).all()
    assert (within_band(replace(model, W=1.5 * model.W), swinging[1][1]) < 0.6).all()
    assert (within_band(model, swinging[1][1], 0.2) < share).all()


# Pieces, reached by another road.


def test_samples_that_tell_less_are_fewer_samples():
    """A linear regression whose errors come in runs of nine knows what a ninth of them tells."""
    rng = np.random.default_rng(4)
    prior, H = np.diag([4.0, 1.0, 0.5]), rng.standard_normal((50, 3))
    all_told = np.linalg.inv(np.linalg.inv(prior) + H.T @ H)
    a_ninth = np.linalg.inv(np.linalg.inv(prior) + H.T @ H / 9.0)
    np.testing.assert_allclose(colored(all_told, prior, 9.0), a_ninth, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(colored(all_told, prior, 1.0), all_told, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(colored(prior, prior, 9.0), prior, rtol=1e-9, atol=1e-15)


def test_the_variance_without_an_inverse_is_never_below_that_with_one():
    rng = np.random.default_rng(7)
    over = []
    for _ in range(300):
        half, H = rng.standard_normal((2, 4, 4))
        prior = half @ half.T + 0.01 * np.eye(4)
        P = np.linalg.inv(np.linalg.inv(prior) + rng.uniform(0.0, 30.0) * H.T @ H)
        color, h = rng.uniform(1.0, 60.0), rng.standard_normal(4)
        left, before = np.array([[h @ P @ h]]), np.array([[h @ prior @ h]])
        bound = float(colored_variance(left, before, np.array([color]))[0, 0])
        exact = float(h @ colored(P, prior, color) @ h)
        assert exact * (1.0 - 1e-9) <= bound <= before[0, 0] * (1.0 + 1e-9)
        over.append(bound / exact)
    assert np.median(over) < 3.0
    alike = colored_variance(left, left, np.array([9.0]))  # along one axis it is exact
    np.testing.assert_allclose(alike, left)
    part = colored_variance(0.2 * before, before, np.array([9.0]))
    np.testing.assert_allclose(part, before / (1.0 + 4.0 / 9.0))


def test_the_variance_is_that_of_the_force_by_its_slope_over_what_was_learnt(model):
    """Central differences of the replayed curve, over weights and over the zero of the slip."""
    x, v_x, step = 0.03, 18.0, 1e-6
    for axle in range(2):
        n, slope = len(model.ladder), []
        for j in range(n):
            W = [model.W.copy(), model.W.copy()]
            W[0][axle, j] += step
            W[1][axle, j] -= step
            up, down = (replace(model, W=w).force(np.array([x]))[0, axle] for w in W)
            slope.append((up - down) / (2.0 * step))
        up, down = (model.force(np.array([x + d]))[0, axle] for d in (step, -step))
        slope += [0.0, 0.0, (up - down) / (2.0 * step) / (1.0, v_x)[axle]]
        h = np.array(slope) / model.vehicle.axle_loads[axle]
        told = replace(model, calibration=None)
        spread = told.band.spread(np.full((1, 2), x), np.array([v_x]), np.ones((1, 2)))
        phi = model.force(np.array([x]))[0, axle] / model.vehicle.axle_loads[axle]
        stretch = np.clip(told.band.speed / v_x, 0.5, 2.0)
        m2 = ((0.04 * phi) ** 2 + 0.01**2) * stretch**2
        total = float((spread.scaled + spread.fixed)[0, axle])
        assert total == pytest.approx(m2 + h @ model.covariance[axle] @ h, rel=1e-5)


def test_the_needed_factor_makes_a_band_that_just_reaches():
    rng = np.random.default_rng(5)
    spread = declared_spread(*rng.uniform(0.1, 1.0, (2, 40)), np.full(40, 20.0))
    error = rng.uniform(0.0, 3.0, 40)
    needed = spread.needed_factor(error, 0.0)
    reached = spread.half_width(np.sqrt(needed), 0.9)
    assert (needed > 0.0).sum() > 10
    np.testing.assert_allclose(reached[needed > 0.0], error[needed > 0.0])
    assert (reached >= error - 1e-12).all()
    assert (spread.needed_factor(error, 0.01) <= needed).all()


def test_the_quantile_leaves_room_for_one_more_window():
    values = np.arange(100.0)
    assert quantile(values, np.ones(100)) == 91.0  # 0.9 of 102, counted from 1
    assert quantile(values[:10], np.ones(10)) == np.inf
    assert quantile(values, np.where(values < 50, 1.0, 0.0)) == 46.0


@pytest.mark.parametrize(("time", "low", "high"), [(0.0, 2.5, 6.0), (2.0, 15.0, 90.0)])
def test_errors_that_stay_alike_count_less(swinging, time, low, high):
    recording = swinging[1][0]
    windows, rng = brisk_windows(recording, 1.0), np.random.default_rng(6)
    white = rng.standard_normal(len(recording))
    keep = np.exp(-recording.dt / time) if time else 0.0
    error = np.zeros(len(recording))
    for k in range(1, len(recording)):
        error[k] = keep * error[k - 1] + white[k]
    assert low <= color_of(windows.mean(error), windows) <= high


def test_ranges_and_quantiles_are_those_of_tables():
    assert normal_quantile(0.9) == pytest.approx(1.644854, abs=1e-6)
    np.testing.assert_array_equal(ranges_of(np.array([0.0, 0.0101, 0.05, 0.5])), [0, 1, 3, 5])
