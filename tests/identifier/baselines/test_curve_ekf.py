"""Filters of tire parameters find the tire that made the data."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.baselines import magic_formula_ekf
from identifier.baselines.ports import LAG_PORTS
from identifier.run import identify
from tests.identifier.baselines.conftest import MAGIC, magic
from tests.identifier.conftest import missed


def test_magic_formula_is_found_on_data_that_it_made(car, curve_drive, rng):
    recording = curve_drive(car, magic, n=4000, rng=rng)
    found = identify(recording, car, magic_formula_ekf(car)).freeze(99.0).parameters
    slope = np.prod(found, axis=1) / np.prod(MAGIC, axis=1)
    np.testing.assert_allclose(slope, 1.0, atol=0.06)
    np.testing.assert_allclose(found[:, 2] / MAGIC[:, 2], 1.0, atol=0.06)
    np.testing.assert_allclose(found[:, 1], MAGIC[:, 1], atol=0.15)
    told = np.array(car.bicycle)[4:]
    assert np.abs(np.prod(MAGIC, axis=1) / told - 1).min() > 0.2, "the prior was far off"


def test_frozen_and_online_force_agree_at_the_instant_of_freezing(car, drive):
    history = identify(drive(n=600), car, magic_formula_ekf(car, textbook=True))
    for k in (350, 521):
        frozen = history.freeze(0.01 * k).predict(history.recording)
        np.testing.assert_allclose(history.axle_force[k], frozen[k], rtol=1e-9)
        assert np.abs(frozen - history.axle_force)[: k - 100].max() > 10.0


def test_with_a_lag_they_agree_from_the_slip_on_that_was_carried(car, drive):
    history = identify(drive(n=600), car, magic_formula_ekf(car))
    for k in (350, 521):
        frozen = history.freeze(0.01 * k)
        setup, rest = frozen.setup(0.01), history.recording.between(0.01 * k - 1e-6, 99.0)
        carried = {name: history.state[name][k] for name in LAG_PORTS}
        force = setup._replace(carry=carried).output(rest, "axle_force")
        np.testing.assert_allclose(force[0], history.axle_force[k], rtol=1e-9)
        whole = frozen.predict(history.recording)[k]  # the past had other parameters
        np.testing.assert_allclose(whole, force[0], atol=0.01 * np.abs(whole).max())
        unlagged = replace(frozen, relaxation_length=np.zeros(2)).predict(history.recording)[k]
        assert np.abs(unlagged - whole).max() > 10.0


LAG, OFFSET = np.array([0.9, 0.6]), np.array([0.004, -0.08])  # m; rad and m/s


def test_lag_and_offsets_are_found_on_a_car_that_has_them(car, curve_drive, rng):
    """The car drives on its lagged tires; its steering and v_y are read with offsets."""
    recording = curve_drive(car, magic, n=6000, rng=rng, lag=LAG)
    read = replace(recording, delta_f=recording.delta_f - OFFSET[0], v_y=recording.v_y + OFFSET[1])
    found = identify(read, car, magic_formula_ekf(car)).freeze()
    np.testing.assert_allclose(found.relaxation_length, LAG, rtol=0.15)
    assert (np.abs(found.offset - OFFSET) < [0.001, 0.02]).all()
    plain = identify(read, car, magic_formula_ekf(car, textbook=True)).freeze()
    assert (missed(found, read) < 0.03).all()
    assert (missed(plain, read) > 3.0 * missed(found, read)).all()


def test_it_begins_afresh_and_with_no_stored_curve(car, drive):
    recording, method = drive(n=200), magic_formula_ekf(car)
    model = identify(recording, car, method).freeze(99.0)
    with pytest.raises(ValueError, match="goes on from no stored model"):
        identify(recording, car, method, start=model)
