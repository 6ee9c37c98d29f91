"""Another friction is told where tires slide, with its size, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.random_cars import good_sensors
from identifier.axle import AxleIdentifier
from identifier.prediction import predict
from identifier.run import identify
from identifier.verdict import calibrated, judge_prediction, road_friction
from identifier.verdict.friction import _mixed, filtered
from models.friction import Friction, FrictionChange
from models.vehicle import sedan
from tests.identifier.conftest import steered

SENSORS = good_sensors(sedan())
DROP = 10.0  # s


def driven(seed, friction=None, amplitude=0.06, **road):
    run = steered(seed, 24.0, amplitude=amplitude, frequency=0.6, friction=friction, **road)
    return run.recording(SENSORS, np.random.default_rng(seed))


def taught(log):
    blind = replace(log, axle_force=None)
    return calibrated(identify(blind, sedan(), AxleIdentifier.for_vehicle(sedan(), dt=log.dt)))


@pytest.fixture(scope="module")
def tires():
    """Learnt on the friction that the tires were measured on, with a band."""
    return taught(driven(3))


@pytest.fixture(scope="module")
def same():
    return driven(5)


@pytest.fixture(scope="module")
def wetter():
    """Half the friction from a time on."""
    return driven(5, Friction(changes=(FrictionChange(scale=0.5, at_time=DROP),)), 0.05)


def test_half_the_friction_is_told_within_a_second_with_its_size(tires, wetter):
    (road,) = predict(tires, wetter).friction().roads
    wrong = np.abs(tires.predict(wetter) - wetter.axle_force) / tires.vehicle.axle_loads
    slides = wetter.t[np.argmax((wrong.max(axis=1) > 0.15) & (wetter.t >= DROP))]
    assert DROP < road.first < slides + 1.0
    assert road.last == pytest.approx(wetter.t[-1], abs=0.3)
    assert abs(road.ratio - 0.5) < 2.0 * road.sd < 0.2


def test_the_road_that_taught_is_told_as_such(tires, same):
    found = road_friction(tires, same)
    assert found.roads == () and found.unchanged
    assert found.unexplained.max() < 0.5


def test_what_came_later_changes_nothing_that_was_told(tires, wetter):
    whole = road_friction(tires, wetter)
    part = road_friction(tires, wetter.between(0.0, DROP + 4.0))
    n = part.t.size - 2
    np.testing.assert_allclose(whole.ratio[:n], part.ratio[:n], rtol=0.1)
    np.testing.assert_array_equal(whole.another[:n] > 0.5, part.another[:n] > 0.5)


@pytest.mark.parametrize("off", [-0.01, 0.01])
def test_another_zero_of_the_steering_is_no_other_road(tires, same, off):
    assert road_friction(tires, replace(same, delta_f=same.delta_f + off)).roads == ()


def test_a_banked_road_is_taken_off_and_the_verdict_tells_the_same(tires):
    wet = Friction(changes=(FrictionChange(scale=0.5, at_time=DROP),))
    prediction = predict(tires, driven(5, wet, 0.05, bank=lambda t: np.full(t.size, 0.03)))
    (road,) = prediction.friction().roads
    assert DROP < road.first < DROP + 5.0 and abs(road.ratio - 0.5) < 2.0 * road.sd
    assert road.text in [one.text for one in prediction.verdict.findings]


def test_more_friction_is_told_where_the_grip_was_learnt_alone(same):
    wet = taught(driven(5, Friction(scale=0.5), 0.05))
    (road,) = road_friction(wet, same).roads
    assert 1.4 < road.ratio < 2.2  # beyond what was learnt the curve is a guess
    assert road_friction(taught(driven(3, amplitude=0.012)), same).roads == ()


def test_the_verdict_of_a_prediction_names_the_road(tires, wetter, same):
    verdict = judge_prediction(tires, wetter)
    assert "another_road" in [one.code for one in verdict.findings if not one.refuses]
    assert any("of the friction of the identification drive" in line for line in verdict.lines)
    slippery = judge_prediction(tires, driven(5, Friction(scale=0.5), 0.05))
    assert {one.code for one in slippery.findings if one.refuses} == {"force_missed"}
    assert "another_road" in [one.code for one in slippery.findings]
    assert "another_road" not in [one.code for one in judge_prediction(tires, same).findings]


# The filter alone, on windows of a tire that is known.

GRID = np.linspace(-0.9, 0.6, 16)
GRID[np.argmin(np.abs(GRID))] = 0.0
WINDOWS = 0.3 * np.arange(1, 61)
SLIP = 0.1 * np.sin(1.3 * WINDOWS)


def curve(slip, ln):
    return np.exp(ln) * np.tanh(10.0 * slip / np.exp(ln))


def from_windows(ln, zero=0.0, variance=0.02**2):
    """What windows tell of a road of some friction, the slip of both axles off by a zero."""
    rng = np.random.default_rng(1)
    true = curve(SLIP, ln) + 0.02 * rng.standard_normal(SLIP.size)
    away = np.array([true - curve(SLIP - zero, each) for each in GRID])
    slope = np.array([10.0 / np.cosh(10.0 * (SLIP - zero) / np.exp(each)) ** 2 for each in GRID])
    both = [np.repeat(one[..., None], 2, axis=2) for one in (away, slope)]
    return filtered(WINDOWS, GRID, *both, np.full((SLIP.size, 2), variance))


@pytest.mark.parametrize("ln", [-0.5, 0.0, 0.4])
def test_the_filter_finds_the_friction_with_its_doubt(ln):
    found = from_windows(ln)
    assert np.log(found.ratio[-1]) == pytest.approx(ln, abs=0.06)
    assert found.another[-1] == pytest.approx(float(ln != 0.0), abs=0.01)
    assert 0.1 / np.sqrt(12.0) <= found.sd[-1] < 0.06
    assert found.unexplained[-1] < 0.01
    assert found.unchanged == (ln == 0.0)
    assert (found.t == WINDOWS).all() and len(found.roads) == (ln != 0.0)


def test_it_says_why_another_road_is_not_reported():
    found = from_windows(-0.6)
    assert found.text == found.roads[0].text
    likely = found._replace(another=np.minimum(found.another, 0.97))
    assert "no other road reported (at " in likely.text and "is 0.97, 0.99 is needed" in likely.text
    wide = found._replace(sd=found.sd + 1.0)
    assert "within two standard deviations of 1" in wide.text
    assert from_windows(0.0).text == "no other road reported"


def test_a_zero_of_the_slip_is_found_for_each_friction():
    found = from_windows(0.0, zero=0.012)
    assert found.another[-1] < 0.05 and found.roads == ()


def test_what_tells_nothing_leaves_what_was_believed():
    found = from_windows(0.0, variance=1e4)
    likely = np.exp(-0.5 * (GRID / 0.7) ** 2)
    p = 0.5 * 0.98 * likely / likely.sum()
    p[GRID == 0.0] += 0.5
    of_friction = p / 0.99
    mean = of_friction @ GRID
    spread = np.sqrt(of_friction @ GRID**2 - mean**2)
    cell = np.diff(GRID).max() / np.sqrt(12.0)
    assert found.unexplained[0] == pytest.approx(0.01, rel=0.01)
    assert found.another[0] == pytest.approx(p @ (np.abs(GRID) > 0.25), rel=0.01)
    assert np.log(found.ratio[0]) == pytest.approx(mean, rel=0.02)
    assert found.sd[0] == pytest.approx(np.hypot(spread, cell), rel=0.01)
    assert found.another[-1] > found.another[0], "another road may have begun"


def test_a_road_that_begins_takes_over_the_zeros_of_all():
    """Mean and variance of the mixture of a road that goes on and one that begins."""
    rng = np.random.default_rng(2)
    p = np.append(rng.random(4), 0.3)
    zero, doubt = rng.standard_normal((4, 2)), rng.random((4, 2))
    stays = rng.random((4, 1))
    new, wide = _mixed(p, zero, doubt, stays)
    share = p[:-1] / p[:-1].sum()
    for k in range(4):
        weight = (1.0 - stays[k]) * share
        weight[k] += stays[k, 0]
        mean = weight @ zero
        np.testing.assert_allclose(new[k], mean)
        np.testing.assert_allclose(wide[k], weight @ (doubt + (zero - mean) ** 2))
