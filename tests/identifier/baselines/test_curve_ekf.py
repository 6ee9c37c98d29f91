"""Filters of tire parameters find the tire that made the data."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.baselines import CurveModel, dugoff_ekf, magic_formula_ekf
from identifier.run import identify

MAGIC = np.array([[12.0, 1.5, 6000.0], [14.0, 1.3, 5200.0]])  # B, C, D
DUGOFF = np.array([[8e4, 0.7], [1.0e5, 0.7]])  # C, mu


def magic(axle, alpha):
    B, C, D = MAGIC[axle]
    return D * np.sin(C * np.arctan(B * alpha))


def dugoff_on(car):
    def force(axle, alpha):
        C, mu = DUGOFF[axle]
        demand, limit = C * np.tan(alpha), mu * car.axle_loads[axle]
        if abs(demand) <= limit / 2:
            return demand
        return np.sign(demand) * limit * (1 - limit / (4 * abs(demand)))

    return force


def test_magic_formula_is_found_on_data_that_it_made(car, curve_drive, rng):
    recording = curve_drive(car, magic, n=4000, rng=rng)
    found = identify(recording, car, magic_formula_ekf(car)).freeze(99.0).parameters
    slope = np.prod(found, axis=1) / np.prod(MAGIC, axis=1)
    np.testing.assert_allclose(slope, 1.0, atol=0.06)
    np.testing.assert_allclose(found[:, 2] / MAGIC[:, 2], 1.0, atol=0.06)
    np.testing.assert_allclose(found[:, 1], MAGIC[:, 1], atol=0.15)
    told = np.array(car.bicycle)[4:]
    assert np.abs(np.prod(MAGIC, axis=1) / told - 1).min() > 0.2, "the prior was far off"


def test_dugoff_is_found_on_data_that_it_made(car, curve_drive, rng):
    recording = curve_drive(car, dugoff_on(car), n=4000, rng=rng)
    found = identify(recording, car, dugoff_ekf(car)).freeze(99.0).parameters
    np.testing.assert_allclose(found / DUGOFF, 1.0, atol=0.05)
    assert found[0, 1] == found[1, 1], "one road"


@pytest.mark.parametrize("make", [magic_formula_ekf, dugoff_ekf])
def test_frozen_and_online_force_agree_at_the_instant_of_freezing(make, car, drive):
    history = identify(drive(n=600), car, make(car))
    for k in (350, 521):
        frozen = history.freeze(0.01 * k).axle_force(history.recording)
        np.testing.assert_allclose(history.axle_force[k], frozen[k], rtol=1e-9)
        assert np.abs(frozen - history.axle_force)[: k - 100].max() > 10.0


@pytest.mark.parametrize("make", [magic_formula_ekf, dugoff_ekf])
def test_stored_parameters_begin_the_next_run(make, car, drive):
    recording, method = drive(n=600), make(car)
    model = identify(recording, car, method).freeze(99.0)
    again = identify(recording, car, method, start=model).freeze(0.0)
    np.testing.assert_allclose(again.parameters, model.parameters, rtol=1e-9)
    other = CurveModel(vehicle=car, curve="linear", parameters=np.ones((2, 1)), min_speed=1.0)
    with pytest.raises(ValueError, match="stored model is not a curve"):
        identify(recording, car, method, start=other)


@pytest.mark.parametrize("shape", [0.5, 2.5])
def test_a_stored_shape_that_no_filter_reaches_is_no_start(shape, car, drive):
    recording, method = drive(n=200), magic_formula_ekf(car)
    model = identify(recording, car, method).freeze(99.0)
    parameters = model.parameters.copy()
    parameters[0, 1] = shape
    with pytest.raises(ValueError, match="a curve to begin with must have positive stiffness"):
        identify(recording, car, method, start=replace(model, parameters=parameters))
