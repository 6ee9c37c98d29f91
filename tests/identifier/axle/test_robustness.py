"""Faults of sensors: everything stays finite and bounded, and what was learnt survives."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.run import identify


def spikes(signals, rng):
    for k in rng.integers(100, 1400, 15):
        name = rng.choice(["v_y", "r", "delta_f"])
        signals[name][k] += rng.choice([-1, 1]) * {"v_y": 5.0, "r": 1.5, "delta_f": 0.5}[name]


def dropouts(signals, rng):
    for k in rng.integers(100, 1400, 8):
        for name in ("v_x", "v_y", "r", "delta_f"):
            signals[name][k : k + rng.integers(5, 80)] = 0.0


def stuck(signals, rng):
    for k in rng.integers(100, 1400, 8):
        for name in ("v_y", "r", "delta_f"):
            signals[name][k : k + 60] = signals[name][k]


def standstill(signals, rng):
    signals["v_x"][500:900] = 0.0
    signals["v_y"][500:900] = 0.02 * rng.standard_normal(400)


def backwards(signals, rng):
    signals["v_x"][500:900] *= -1.0


def huge(signals, rng):
    signals["v_y"][700:] = 1e4
    signals["r"][800:] = -1e4


def chattering(signals, rng):
    signals["v_y"] += rng.standard_normal(1500)
    signals["r"] += rng.standard_normal(1500)


FAULTS = [spikes, dropouts, stuck, standstill, backwards, huge, chattering]


def faulty(recording, fault, rng):
    names = ("v_x", "v_y", "r", "delta_f")
    signals = {name: getattr(recording, name).copy() for name in names}
    fault(signals, rng)
    return replace(recording, **signals)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_everything_stays_finite_and_bounded(fault, car, drive, rng):
    recording = faulty(drive(amplitude=0.08), fault, rng)
    design = AxleIdentifier.for_vehicle(car)
    history = identify(recording, car, design)
    assert history.diverged_at is None
    for name, values in history.state.items():
        assert np.isfinite(values).all(), name
    assert (np.abs(history.axle_force) < 6 * np.array(car.axle_loads)).all()
    assert np.abs(history.state["W"]).max() <= design.bounds.weight
    model = history.freeze(1e9)
    for P in model.covariance:
        assert np.linalg.eigvalsh(P).min() > 0.0
    assert np.isfinite(model.predict(recording)).all()


@pytest.mark.parametrize(
    "fault", [spikes, dropouts, stuck, standstill, huge], ids=lambda fault: fault.__name__
)
def test_what_was_learnt_survives_faults(fault, car, drive, rng):
    """The frozen model of the faulty drive, on a faultless one, is nearly as good as without."""
    clean = drive(amplitude=0.08)
    model = identify(faulty(clean, fault, rng), car, AxleIdentifier.for_vehicle(car)).freeze(1e9)
    miss = model.predict(clean) - clean.axle_force
    assert np.sqrt(np.mean(miss**2)) < 0.05 * np.sqrt(np.mean(clean.axle_force**2))


def test_faults_that_are_believed_would_spoil_it(car, drive, rng):
    """With the gate wide open the same spikes do harm: the gate is what protects."""
    clean, design = drive(amplitude=0.08), AxleIdentifier.for_vehicle(car)
    wide = {"jump": 1e6, "yaw_jump": 1e6, "steering_jump": 1e6, "max_steering": 1e6}
    wide |= {"max_yaw_rate": 1e6, "max_sideslip": 1e6}
    credulous = replace(design, plausibility=replace(design.plausibility, **wide))
    recording = faulty(clean, spikes, rng)
    misses = []
    for method in (design, credulous):
        history = identify(recording, car, method)
        assert np.isfinite(history.axle_force).all()
        force = history.freeze(1e9).predict(clean)
        misses.append(np.sqrt(np.mean((force - clean.axle_force) ** 2)))
    assert misses[1] > 2 * misses[0]


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
    assert (
        np.abs(identify(recording, car, AxleIdentifier.for_vehicle(car)).state["W"] - W[0]).max()
        > 0.05
    )


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
    design = AxleIdentifier.for_vehicle(car)
    errors = []
    for one in (recording, slow):
        history = identify(one, car, design)
        assert history.state["excitation"][-1, :, 1].min() > 2.0  # seconds of learning
        force = history.freeze(15.0).predict(recording)
        errors.append(np.sqrt(np.mean((force - recording.axle_force) ** 2)))
    assert errors[1] < errors[0] + 0.06 * np.sqrt(np.mean(recording.axle_force**2))
