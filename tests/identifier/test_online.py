"""Sample by sample a method does what it does over the recording, to the last bit."""

import time
from dataclasses import replace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.method import CannotFreezeError
from identifier.methods import DEFAULT, METHODS, make_method
from identifier.run import DivergedError, OnlineIdentifier, identify
from tests.identifier.conftest import felt
from tests.rivals import rival


def driven(identifier, recording):
    a_y = [None] * len(recording) if recording.a_y is None else recording.a_y
    samples = zip(recording.x, recording.u, recording.v_x, a_y, strict=True)
    return np.array([identifier.update(*sample) for sample in samples])


ONLINE = [*(name for name in METHODS if name != DEFAULT), rival("joint_ekf")]


@pytest.mark.parametrize("name", ONLINE)
def test_every_method_learns_the_same_bits_as_over_the_recording(name, car, drive):
    recording, method = felt(drive(n=300)), make_method(name, car)
    history = identify(recording, car, method)
    online = OnlineIdentifier(method, car, recording.dt)
    np.testing.assert_array_equal(driven(online, recording), history.axle_force)
    for port, value in online.state().items():
        np.testing.assert_array_equal(value, history.state[port][-1])
    for port, value in history.outputs.items():
        np.testing.assert_array_equal(online.outputs[port], value[-1].ravel(order="F"))
    try:
        frozen = history.freeze(recording.t[-1])
    except CannotFreezeError:
        with pytest.raises(CannotFreezeError):
            online.model()
    else:
        assert online.model().to_dict() == frozen.to_dict()


@pytest.mark.parametrize("name", ["axle", "integral"])
def test_a_run_goes_on_from_stored_weights(name, car, drive):
    recording, method = drive(n=300), make_method(name, car)
    start = identify(recording, car, method).freeze(2.0)
    history = identify(recording, car, method, start)
    online = OnlineIdentifier(method, car, recording.dt, start)
    assert online.model().to_dict() == start.to_dict()  # before the first sample
    np.testing.assert_array_equal(driven(online, recording), history.axle_force)


def test_preparing_leaves_no_trace(car, drive):
    recording, method = drive(n=100), make_method("integral", car)
    fresh, prepared = (OnlineIdentifier(method, car, 0.01) for _ in range(2))
    prepared.prepare()
    np.testing.assert_array_equal(driven(prepared, recording), driven(fresh, recording))
    assert prepared.counts == fresh.counts


def test_a_law_that_diverges_is_noticed_and_freezes_to_nothing(car, drive):
    design = make_method("integral", car)
    gains = replace(design.gains, eta_W=1e9, rho_W=0.0)
    online = OnlineIdentifier(replace(design, gains=gains), car, 0.01)
    assert not online.diverged
    driven(online, drive(n=300))
    assert online.diverged
    with pytest.raises(DivergedError, match="300 samples"):
        online.model()


def test_another_interval_and_samples_of_another_shape_are_refused(car):
    method = AxleIdentifier.for_vehicle(car)
    with pytest.raises(ValueError, match=r"every 0\.02 s, the method wants 0\.01 s"):
        OnlineIdentifier(method, car, 0.02)
    with pytest.raises(ValueError, match="unpack"):
        OnlineIdentifier(method, car, 0.01).update(np.zeros(3), np.zeros(2), 20.0)


def test_an_update_takes_far_less_than_a_sample(car, drive):
    recording = drive(n=500)
    online = OnlineIdentifier(AxleIdentifier.for_vehicle(car), car, recording.dt)
    online.prepare()
    times = []
    for sample in zip(recording.x, recording.u, recording.v_x, strict=True):
        start = time.perf_counter()
        online.update(*sample)
        times.append(time.perf_counter() - start)
    assert np.median(times) < 3e-4  # 6 microseconds where nothing else runs
