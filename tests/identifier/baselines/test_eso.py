"""The extended state observer: where its poles lie, what it follows, and by how much it lags."""

import numpy as np
import pytest

from identifier.baselines import ExtendedStateObserver
from identifier.baselines.eso import build_step
from identifier.method import CannotFreezeError
from identifier.run import identify


def error_matrix(step, car, bandwidth, dt):
    """How [ξ̂, F̂] of one axle moves on without measurement, by differences of the step."""
    before = {
        "turning": np.zeros(2),
        "running": 1.0,
        "x": np.zeros(2),
        "u": np.zeros(2),
        "v_x": 20.0,
        "bandwidth": bandwidth,
        "vehicle": np.array(car.bicycle),
        "sampling": [dt, 1.0],
    }
    columns = []
    for xi, F in ((1.0, 0.0), (0.0, 1.0)):
        after = step(xi_hat=[xi, 0.0], F_hat=[F, 0.0], **before)
        assert float(after["xi_hat_next"][1]) == 0.0, "axles are not coupled"
        columns.append([float(after["xi_hat_next"][0]), float(after["F_hat_next"][0])])
    return np.array(columns).T


@pytest.mark.parametrize(("bandwidth", "dt"), [(5.0, 0.01), (50.0, 0.01), (50.0, 0.002)])
def test_both_poles_of_each_axle_lie_at_minus_the_bandwidth(bandwidth, dt, car):
    M = error_matrix(build_step(), car, bandwidth, dt)
    pole = np.exp(-bandwidth * dt)
    assert np.trace(M) == pytest.approx(2 * pole, rel=1e-12)
    assert np.linalg.det(M) == pytest.approx(pole**2, rel=1e-12)
    assert np.trace(M) != pytest.approx(2 * np.exp(-1.1 * bandwidth * dt), rel=1e-3)


def test_force_comes_through_two_equal_lags_at_the_bandwidth(car, drive):
    """At 0.5 Hz: (1 - β)²/(1 - β/z)², of the mean force over the last sample."""
    recording = drive(n=1500, amplitude=0.01)
    history = identify(recording, car, ExtendedStateObserver(bandwidth=20.0))
    settled = recording.t >= 5.0
    wave = np.exp(-1j * np.pi * recording.t[settled])  # ten whole turns of 0.5 Hz
    for i in (0, 1):
        out = np.sum(history.axle_force[settled, i] * wave)
        ratio = out / np.sum(recording.axle_force[settled, i] * wave)
        beta, turn = np.exp(-0.2), np.exp(-0.01j * np.pi)
        lag = (1 - beta) / (1 - beta * turn)
        mean = (1 - turn) / (0.01j * np.pi)
        assert abs(ratio - mean * lag**2) < 0.003
        assert abs(ratio - mean * lag) > 0.1, "the test would see one lag for two"
        assert abs(lag - 20.0 / (1j * np.pi + 20.0)) < 0.02


def test_a_faster_observer_follows_closer(car, drive):
    recording = drive(n=800)
    errors = [
        np.abs(identify(recording, car, method).axle_force - recording.axle_force)[100:].max()
        for method in (ExtendedStateObserver(bandwidth=w) for w in (10.0, 30.0, 90.0))
    ]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_it_rests_at_rest_and_begins_anew(car, halted_drive):
    recording, rest = halted_drive
    history = identify(recording, car, ExtendedStateObserver.for_vehicle(car))
    assert (history.axle_force[rest] == 0.0).all()
    assert np.abs(history.axle_force - recording.axle_force)[~rest].max() < car.weight


def test_a_signal_estimator_cannot_be_frozen(car, drive):
    history = identify(drive(n=50), car, ExtendedStateObserver.for_vehicle(car))
    with pytest.raises(CannotFreezeError, match="not a tire"):
        history.freeze(0.2)


def test_a_bandwidth_must_be_positive():
    with pytest.raises(ValueError, match=r"bandwidth must be positive and finite, it is 0\.0"):
        ExtendedStateObserver(bandwidth=0.0)
