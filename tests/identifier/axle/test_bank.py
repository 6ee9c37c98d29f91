"""A banked road is told by an accelerometer, and not learnt as tire; a wrong one ruins nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.faults import Bank
from identifier.axle import AxleIdentifier
from identifier.run import OnlineIdentifier, identify
from models.vehicle import GRAVITY
from tests.identifier import conftest

ROLL = 0.05  # rad per g, of the body that carries the sensor


@pytest.fixture
def slalom(car, drive):
    """A level road, and an accelerometer on a body that rolls."""
    level = drive(n=2500, amplitude=0.06)
    rng = np.random.default_rng(5)
    noisy = {
        "v_y": level.v_y + 0.02 * rng.standard_normal(len(level)),
        "r": level.r + 0.002 * rng.standard_normal(len(level)),
    }
    felt = (1.0 + ROLL) * level.axle_force.sum(axis=1) / car.mass
    return replace(level, a_y=felt + 0.3 * rng.standard_normal(len(level)), **noisy)


def missed(car, log):
    """Error of the frozen force of the worse axle [% of its rms value]."""
    return 100.0 * conftest.missed(conftest.learnt(log, car), log).max()


@pytest.mark.parametrize(
    ("degrees", "period"), [(3.0, math.inf), (-3.0, math.inf), (3.0, 30.0)], ids=str
)
def test_a_bank_is_not_learnt_as_tire_where_an_accelerometer_tells_it(degrees, period, car, slalom):
    banked = Bank(vehicle=car, angle=math.radians(degrees), period=period).apply(slalom)
    level, told = missed(car, slalom), missed(car, banked)
    untold = missed(car, replace(banked, a_y=None))
    assert untold > 2.0 * told
    assert told < 2.0 * level + 1.0


def test_a_body_that_rolls_on_a_level_road_is_no_bank(car, slalom):
    assert missed(car, slalom) == pytest.approx(missed(car, replace(slalom, a_y=None)), rel=0.02)


def wrong_channels(felt, rng):
    """What may stand in a column of a_y that is none, by what is wrong with it."""
    return {
        "the other sign": -felt,
        "in g": felt / GRAVITY,
        "dead": 0.0 * felt,
        "stuck": np.full_like(felt, 1.5),
        "late by a third of a second": np.roll(felt, 33),
        "of another drive": np.roll(felt[::-1], 700),
        "rattling": felt + 3.0 * rng.standard_normal(felt.size),
        "broken half way": np.where(np.arange(felt.size) < felt.size // 2, felt, -3.0),
    }


@pytest.mark.parametrize("wrong", wrong_channels(np.zeros(1), np.random.default_rng(0)))
def test_a_channel_that_is_no_acceleration_of_this_car_ruins_nothing(wrong, car, slalom):
    channel = wrong_channels(slalom.a_y, np.random.default_rng(0))[wrong]
    without = missed(car, replace(slalom, a_y=None))
    assert missed(car, replace(slalom, a_y=channel)) < without + 2.0


def test_without_the_comparison_a_wrong_sign_would_ruin_what_is_learnt(car, slalom):
    design = AxleIdentifier.for_vehicle(car)
    believing = replace(design, road=replace(design.road, doubt=1e3, most=1e3, step=1e3))
    flipped = replace(slalom, a_y=-slalom.a_y)
    at = np.array([0.04])
    right, guarded, ruined = (
        identify(log, car, one).freeze().force(at)
        for log, one in ((slalom, design), (flipped, design), (flipped, believing))
    )
    assert np.abs(guarded / right - 1.0).max() < 0.02
    assert np.abs(ruined / right - 1.0).max() > 0.05


def test_what_is_no_number_is_as_none_to_the_last_bit(car, slalom):
    method, told = AxleIdentifier.for_vehicle(car), {}
    for name, absent in (("none", None), ("NaN", np.nan), ("inf", np.inf), ("no car's", 1e3)):
        online = OnlineIdentifier(method, car, slalom.dt)
        samples = zip(slalom.x, slalom.u, slalom.v_x, strict=True)
        told[name] = [online.update(*sample, absent) for sample in samples], online.state()
        assert online.counts.refused == 0
    history = identify(replace(slalom, a_y=None), car, method)
    for forces, state in told.values():
        np.testing.assert_array_equal(forces, history.axle_force)
        for port, value in state.items():
            assert np.isfinite(value).all()
            np.testing.assert_array_equal(value, history.state[port][-1], err_msg=port)
