"""Faults of sensors: what was learnt survives them."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.run import identify
from tests.identifier.axle.conftest import spoilt
from tests.identifier.conftest import learnt, missed


@pytest.mark.parametrize("fault", ["spikes", "dropouts", "stuck", "standstill", "huge"])
def test_what_was_learnt_survives_faults(fault, car, drive):
    """The frozen model of the faulty drive, on a faultless one, is nearly as good as without."""
    clean = drive(amplitude=0.08)
    assert (missed(learnt(spoilt(clean, fault), car), clean) < 0.05).all()


def test_faults_that_are_believed_would_spoil_it(car, drive):
    """With the gate wide open the same spikes do harm: the gate is what protects."""
    clean, design = drive(amplitude=0.08), AxleIdentifier.for_vehicle(car)
    wide = {"jump": 1e6, "yaw_jump": 1e6, "steering_jump": 1e6, "max_steering": 1e6}
    wide |= {"max_yaw_rate": 1e6, "max_sideslip": 1e6}
    credulous = replace(design, plausibility=replace(design.plausibility, **wide))
    history = identify(spoilt(clean, "spikes"), car, credulous)
    assert np.isfinite(history.axle_force).all()
    guarded = missed(learnt(spoilt(clean, "spikes"), car), clean)
    assert missed(history.freeze(), clean).max() > 2 * guarded.max()


def test_learning_rests_at_rest_slowly_straight_and_stuck(car, drive):
    recording, n = drive(), 1500
    still = {"v_y": np.zeros(n), "r": np.zeros(n), "delta_f": np.zeros(n)}
    noise = np.random.default_rng(1).standard_normal((2, n))
    quiet = {**still, "v_y": 0.02 * noise[0], "r": 0.002 * noise[1]}
    for signals in (
        {"v_x": np.zeros(n)},
        {"v_x": np.full(n, 2.0)},
        still,
        quiet,
        {name: np.full(n, getattr(recording, name)[200]) for name in still},
    ):
        history = identify(replace(recording, **signals), car, AxleIdentifier.for_vehicle(car))
        W = history.state["W"]
        assert np.abs(W - W[0]).max() == 0.0
    assert np.abs(learnt(recording, car).W - W[0]).max() > 0.05


def test_forces_read_zero_below_the_least_speed_only(car, drive):
    recording, design = drive(n=600), AxleIdentifier.for_vehicle(car)
    v_x = np.where(np.arange(600) < 300, 20.0, 0.9 * design.min_speed)
    force = identify(replace(recording, v_x=v_x), car, design).axle_force
    np.testing.assert_array_equal(force[326:], 0.0)
    assert np.abs(force[20:300]).min(axis=1).max() > 0.0


@pytest.mark.parametrize("hold", [2, 4, 5])
def test_a_slow_sensor_in_a_fast_log_is_learnt_from(hold, car, drive):
    """Signals held for some samples are not stuck: what is learnt stays near that of the rest."""
    recording = drive()
    held = np.arange(recording.t.size) // hold * hold
    slow = replace(recording, v_y=recording.v_y[held], r=recording.r[held])
    history = identify(slow, car, AxleIdentifier.for_vehicle(car))
    assert history.state["excitation"][-1, :, 1].min() > 2.0  # seconds of learning
    usual = missed(learnt(recording, car), recording).mean()
    assert missed(history.freeze(), recording).mean() < usual + 0.06
